"""Blockwise moire: against the definition, against noise, and where chirps have their ghosts."""

import math

import numpy as np
import pytest
from scipy import fft, special

from aliasbench.metrics import blocks
from aliasbench.metrics.catalog import measure
from aliasbench.metrics.spectrum import visible_band

HANN = np.sin(np.pi * (np.arange(32) + 0.5) / 32) ** 2


def define_peaks(picture):
    """The definition, block by block, with whole transforms."""
    fy, fx = np.meshgrid(fft.fftfreq(32), fft.fftfreq(32), indexing="ij")
    band = (np.hypot(fy, fx) > 0) & (np.hypot(fy, fx) <= 0.25)
    rows = []
    for top in range(0, picture.shape[0] - 31, 16):
        row = []
        for left in range(0, picture.shape[1] - 31, 16):
            block = picture[top : top + 32, left : left + 32]
            spectrum = np.fft.fft2((block - block.mean()) * np.outer(HANN, HANN))
            row.append(2 * np.max(np.abs(spectrum[band])) / np.outer(HANN, HANN).sum())
        rows.append(row)
    return np.array(rows)


@pytest.mark.parametrize("size", [(32, 32), (47, 48), (90, 65), (33, 160)])
def test_peaks_are_those_of_the_definition(size):
    rng = np.random.default_rng(size[0])
    for picture in (rng.normal(size=size), rng.normal(size=size) * 1e-3 + 50.0):
        # Rounding of sums of 1024 products of the picture's size.
        assert blocks.peaks_of(picture) == pytest.approx(define_peaks(picture), abs=1e-13 * np.abs(picture).max())


@pytest.mark.parametrize("amplitude", [0.02, 1.0, 30.0])
@pytest.mark.parametrize("k", [(3, 0), (0, 5), (4, 4), (6, -5), (8, 0), (0, 8)])
def test_a_sinusoid_of_whole_cycles_has_its_amplitude_in_every_block(k, amplitude):
    y, x = np.mgrid[:80, :70]
    picture = amplitude * np.cos(2 * np.pi * (k[0] * x + k[1] * y) / 32 + 0.7)
    assert blocks.peaks_of(picture) == pytest.approx(np.full((4, 3), amplitude), rel=1e-12)


def test_constants_have_no_peak_and_extremes_do_not_overflow():
    assert np.max(blocks.peaks_of(np.full((40, 40), 1e4))) < 1e-11
    assert np.max(blocks.peaks_of(np.zeros((40, 40)))) == 0.0
    spike = np.zeros((32, 32))
    spike[15, 15] = 1.0
    one = blocks.peaks_of(spike)[0, 0]
    for scale in (1e200, 1e-200):
        assert blocks.peaks_of(spike * scale)[0, 0] == pytest.approx(one * scale, rel=1e-12)


def test_noise_of_a_bin_is_as_derived():
    band = visible_band(32, 32)
    assert len(band.nu) == blocks.BINS
    powers = blocks.block_powers(np.random.default_rng(1).normal(size=(2000, 32, 32)))[:, band.rows, band.columns]
    assert np.sum(np.outer(HANN, HANN) ** 2) / np.outer(HANN, HANN).sum() ** 2 == pytest.approx(
        (3 / 64) ** 2, rel=1e-12
    )
    low = np.abs(band.nu * 32).max(axis=1) <= 1
    # An exponential power's mean over 2000 blocks varies by 1 / sqrt(2000); the largest of 98 by four times that.
    assert powers[:, ~low].mean(axis=0) == pytest.approx(
        np.full((~low).sum(), (3 / 64) ** 2), rel=4.5 / math.sqrt(2000)
    )
    # Where the block's mean, taken off, has a share.
    assert low.sum() == 4
    assert np.all(powers[:, low].mean(axis=0) < (3 / 64) ** 2)


@pytest.mark.parametrize("sigma", [1e-3, 0.2, 5.0])
def test_peaks_of_white_noise_are_as_told(sigma):
    rng = np.random.default_rng(round(1000 * sigma))
    trials = 250
    peaks = np.stack([blocks.peaks_of(sigma * rng.normal(size=(80, 80))) for _ in range(trials)])
    # H_68, the mean largest of 68 exponential powers, whose root has a mean of 2.17 and a standard deviation of .30.
    harmonic = special.digamma(69) + np.euler_gamma
    assert blocks.mean_noise_peak() < blocks.NOISE_GAIN * math.sqrt(harmonic)
    assert blocks.mean_noise_peak() == pytest.approx(blocks.NOISE_GAIN * 2.17, rel=5e-3)
    # Five deviations of a mean over as many pictures (that their 16 blocks are more is left out), and that of 68.
    assert peaks.mean() == pytest.approx(sigma * blocks.mean_noise_peak(), rel=5 * 0.30 / 2.17 / math.sqrt(4 * trials))
    # 98 % and 99.9 % of one picture's largest: at most 1 - q are above, and not many fewer.
    above = int(np.sum(peaks.max(axis=(1, 2)) > sigma * blocks.high_noise_peak(16)))
    assert above <= 0.01 * trials + 4 * math.sqrt(0.01 * trials)
    looser = sigma * blocks.high_noise_peak(1)
    # One block's 99 % level is left by one in 100 blocks at most, and by more than one in 250.
    share = float(np.mean(peaks > looser))
    assert 0.004 < share < 0.01 + 5 * math.sqrt(0.01 / peaks.size * 4)


@pytest.mark.parametrize("seeds", [1, 4])
def test_of_noise_alone_the_p_value_is_a_bound(seeds):
    rng = np.random.default_rng(seeds)
    trials = 400
    found = []
    for _ in range(trials):
        noise = rng.normal(size=(seeds, 64, 64))
        peaks = np.stack([blocks.peaks_of(n) for n in noise])
        _, i, j = (int(k) for k in np.unravel_index(int(np.argmax(peaks)), peaks.shape))
        rms, freedom = blocks.noise_in_block(noise[:, 16 * i : 16 * i + 32, 16 * j : 16 * j + 32])
        found.append(blocks.peak_p_value(float(peaks.max()), rms, freedom, peaks.size))
    for level in (0.02, 0.05, 0.2):
        share = float(np.mean(np.array(found) < level))
        # Never more often than the level (four deviations of a count), and no less than a quarter as often.
        assert level / 4 - 2 * math.sqrt(level / trials) < share < level + 4 * math.sqrt(level / trials)


@pytest.mark.parametrize(("sigma", "seeds"), [(0.01, 1), (0.3, 1), (0.3, 4), (2.0, 8)])
def test_noise_is_found_under_a_line(sigma, seeds):
    rng = np.random.default_rng(seeds)
    line = 3.0 * np.cos(2 * np.pi * (5 * np.arange(32) / 32 + 0.1))
    estimates = []
    for _ in range(60):
        rms, freedom = blocks.noise_in_block(line + sigma * rng.normal(size=(seeds, 32, 32)))
        estimates.append(rms**2)
    # Each estimate of the square has relative deviation sqrt(2 / freedom); the median is some 1 % high.
    assert np.mean(estimates) == pytest.approx(sigma**2, rel=5 * math.sqrt(2 / freedom / 60) + 0.02)


def planted(rng, *, seed=1, frame=2, top=40, left=70, amplitude=0.5, sigma=0.1, seeds=2, frames=4):
    """Noise in which one picture has a patch of 48 x 48 pixels with a line of (1/8, -1/16) cycles a pixel."""
    picture = sigma * rng.normal(size=(seeds, frames, 100, 140))
    y, x = np.mgrid[:48, :48]
    picture[seed, frame, top : top + 48, left : left + 48] += amplitude * np.cos(2 * np.pi * (x / 8 - y / 16))
    return picture


@pytest.mark.parametrize(
    ("seed", "frame", "top", "left"), [(1, 2, 40, 70), (0, 0, 1, 1), (1, 3, 50, 91), (0, 3, 33, 5)]
)
def test_a_ghost_in_one_frame_of_one_seed_is_found(make_scene, rgb, seed, frame, top, left):
    picture = planted(np.random.default_rng(frame), seed=seed, frame=frame, top=top, left=left)
    score = measure("moire_peak", rgb(picture), rgb(picture[0] * 0), scene=make_scene((140, 100)), frame_start=7)
    found = score.extras
    assert (found["block_seed"], found["block_frame"]) == (seed, frame + 7)
    # The block with most of it begins within 8 pixels of one that lies inside the patch.
    x, y = found["block_center_px"]
    assert left + 8 <= x <= left + 40
    assert top + 8 <= y <= top + 40
    assert found["block_cycles_per_px"] in ([1 / 8, -1 / 16], [-1 / 8, 1 / 16])
    assert found["block_peak_max"] == pytest.approx(0.5, abs=5 * 0.1 * blocks.NOISE_GAIN + 0.05)
    assert found["block_p_value"] < 1e-6
    assert found["block_peak_max"] > found["block_noise_peak_99"]
    # With two seeds the ghost of one is in their difference: it is counted as noise there.
    assert found["blocks"] == 8 * 5 * 7


def test_noise_alone_is_not_significant(make_scene, rgb):
    picture = 0.3 * np.random.default_rng(11).normal(size=(3, 130, 130))
    found = measure("moire_peak", rgb(picture), rgb(picture * 0), scene=make_scene((130, 130))).extras
    assert found["block_p_value"] > 1e-3
    # From 140 degrees of freedom.
    assert found["block_noise"] == pytest.approx(0.3, rel=4 / math.sqrt(2 * 140))
    assert found["block_peak_mean"] == pytest.approx(0.3 * blocks.mean_noise_peak(), rel=0.05)
    assert found["block_peak_max"] < 1.2 * found["block_noise_peak_99"]


def test_long_sequences_are_looked_at_in_part_and_where_most_is():
    power = np.zeros((1, 60))
    power[0, 20] = 1.0
    chosen = blocks.chosen_pictures(power, 961)
    frames = [frame for _, frame in chosen]
    assert frames == sorted(frames)
    assert {0, 20, 59} <= set(frames)
    assert len(frames) == blocks.MOST_BLOCKS // 961 + 1
    assert np.max(np.diff(frames)) <= 60 / (len(frames) - 2) + 1
    assert blocks.chosen_pictures(np.zeros((2, 40)), 100) == [(s, f) for s in range(2) for f in range(40)]
    assert blocks.chosen_pictures(np.array([[0.0, 1.0], [3.0, 2.0]]), 10**6) == [(0, 0), (1, 0)]


def test_a_picture_smaller_than_a_block_has_none(make_scene, rgb):
    picture = rgb(np.random.default_rng(0).normal(size=(1, 40, 31)))
    found = measure("moire_peak", picture, picture * 0, scene=make_scene((31, 40)), filter_radius_px=0.0).extras
    assert (found["block_peak_max"], found["block_peak_mean"]) == (None, None)


def zone_plate(side, k, n, center):
    """cos(k r^2) at n x n regular samples of each pixel, r from `center`."""
    offset = (np.arange(n) + 0.5) / n
    wave = []
    for middle in center:
        at = (np.arange(side)[:, None] + offset - middle).ravel()
        wave.append(np.exp(1j * k * at**2).reshape(side, n).mean(axis=1))
    return np.real(wave[1][:, None] * wave[0])


def exact_zone_plate(side, k, center, filter_name):
    """Re X Y, box by Fresnel's integrals, Gaussian of sigma .5 in closed form."""
    wave = []
    for middle in center:
        x = np.arange(side) + 0.5 - middle
        if filter_name == "box":
            scale = math.sqrt(2 * k / math.pi)
            (s1, c1), (s0, c0) = special.fresnel(scale * (x + 0.5)), special.fresnel(scale * (x - 0.5))
            wave.append((c1 - c0 + 1j * (s1 - s0)) / scale)
        else:
            beta = 1 - 2j * k * 0.25
            wave.append(np.exp(1j * k * x**2 / beta) / np.sqrt(beta))
    return np.real(wave[1][:, None] * wave[0])


@pytest.mark.parametrize("filter_name", ["box", "gaussian"])
@pytest.mark.parametrize(("n", "period_px"), [(1, 128), (1, 110), (2, 64), (3, 40)])
def test_ghosts_of_a_zone_plate_are_at_the_local_frequency_n(make_scene, rgb, filter_name, n, period_px):
    side, k = 256, math.pi / period_px  # the local frequency is r / period_px
    center = (100.5, 120.5)
    test, truth = zone_plate(side, k, n, center), exact_zone_plate(side, k, center, filter_name)
    # A full zone plate with the same k, about the place where the frequency is n along x.
    ghost_x = round(center[0] + n * period_px - 0.5)
    row = round(center[1] - 0.5)
    if ghost_x < side:
        assert abs(test[row, ghost_x]) > 0.99
        assert abs(truth[row, ghost_x]) < 0.01
    found = measure("moire_peak", rgb(test[None]), rgb(truth[None]), scene=make_scene((side, side))).extras
    x, y = found["block_center_px"]
    # Ghosts are at multiples of n along either axis. Within it the false frequency is in the band up to a quarter of
    # the period away, and a block reaches 16 pixels further.
    away = [(a - c) - n * period_px * round((a - c) / (n * period_px)) for a, c in ((x, center[0]), (y, center[1]))]
    assert math.hypot(*away) <= period_px / 4 + 16
    assert math.hypot(x - center[0], y - center[1]) > n * period_px / 2
    assert found["block_p_value"] < 1e-12
    # Along each axis a block about a place of the bin's own frequency has C = |sum w e^(i k u^2)| / sum w, some
    # sqrt(period_px) / 16. The next bin's place is at most 1/64 cycles a pixel and 2 pixels away, where w is .96. A
    # cosine has two such lines; the other one, and the reference, take a tenth at most, or in the middle double it.
    u = np.arange(32) - 15.5
    line = abs(np.sum(HANN * np.exp(1j * k * u**2))) / HANN.sum()
    assert line == pytest.approx(math.sqrt(period_px) / 16, rel=0.05)
    assert 0.96**2 * 0.9 * line**2 < found["block_peak_max"] < 2.0 * line**2


def test_figures_of_the_first_ghost():
    # k = pi / 128, the origin on a pixel's centre: 128 pixels away the local frequency is 1.
    test = zone_plate(300, math.pi / 128, 1, (20.5, 20.5))
    truth = exact_zone_plate(300, math.pi / 128, (20.5, 20.5), "box")
    assert test[20, 20 + 128] == pytest.approx(1.0, abs=2e-5)
    assert abs(truth[20, 20 + 128]) < 0.004
    # exactly a zone plate again, whichever ghost
    assert test[20, 148:212] == pytest.approx(test[20, 20:84], abs=1e-9)
    assert test[148:212, 148] == pytest.approx(test[20:84, 20], abs=1e-9)


@pytest.mark.parametrize(("period_px", "side"), [(128, 160), (300, 200)])
def test_exact_zone_plates_have_no_ghosts(make_scene, rgb, period_px, side):
    k, center = math.pi / period_px, (30.2, 41.7)
    truth = exact_zone_plate(side, k, center, "box")
    n = 24
    fine = zone_plate(side, k, n, center)
    found = measure("moire_peak", rgb(fine[None]), rgb(truth[None]), scene=make_scene((side, side))).extras
    # Regular samples are D_n(nu) sinc(nu)^-1 of the integral along each axis: short of it by (pi nu / n)^2 / 6, and by
    # as much again for a chirp's own change; a block's peak is at most twice the largest error.
    highest = (side - 30.2) / period_px
    bound = 2 * 2 * 2 * (math.pi * highest / n) ** 2 / 6
    assert found["block_peak_max"] < bound
    assert bound < 0.03
    exact = measure("moire_peak", rgb(truth[None]), rgb(truth[None]), scene=make_scene((side, side)))
    assert (exact.value, exact.extras["block_peak_max"], exact.extras["block_peak_mean"]) == (0.0, 0.0, 0.0)


def receding_checker(size, n, distance, pitch):
    """Black and white squares on a floor, n x n regular samples; the horizon is the upper border.

    A floor point seen y pixels under the horizon is distance / y away; the local frequency of rows is distance / y^2.
    """
    width, height = size
    offset = (np.arange(n) + 0.5) / n
    y = (np.arange(height)[:, None] + offset).ravel()[:, None]
    x = (np.arange(width)[:, None] + offset).ravel() - width / 2 - 0.3
    squares = np.floor(distance / y) + np.floor(x / y * pitch)
    return np.mod(squares, 2).reshape(height, n, width, n).mean(axis=(1, 3))


@pytest.mark.parametrize(("distance", "pitch"), [(3600.0, 20.0), (6400.0, 30.0)])
def test_receding_checkers_have_their_ghosts_where_rows_meet_the_pattern(make_scene, rgb, distance, pitch):
    size = (128, 176)
    truth = receding_checker(size, 12, distance, pitch)
    found = measure(
        "moire_peak", rgb(receding_checker(size, 1, distance, pitch)[None]), rgb(truth[None]), scene=make_scene(size)
    )
    more = measure(
        "moire_peak", rgb(receding_checker(size, 4, distance, pitch)[None]), rgb(truth[None]), scene=make_scene(size)
    )
    _, y = found.extras["block_center_px"]
    # Two squares to a cycle: the fundamental is distance / (2 y^2) cycles a pixel, above 3/4 where it comes back within
    # the band; its odd harmonics do the same further down, as far as 1 = 5 distance / (2 y^2). A block reaches 16 on.
    assert y < math.sqrt(5 * distance / 2 / 0.75) + 16
    assert found.extras["block_p_value"] < 1e-3
    # 4 x 4 regular samples have the ghosts of the rows where squares are 4 times as fine: rarer, and weaker.
    assert more.extras["block_peak_max"] < 0.5 * found.extras["block_peak_max"]
    assert more.extras["block_peak_mean"] < 0.5 * found.extras["block_peak_mean"]
