"""Laws of elliptically weighted averages: what they keep, which covariance their weights have, how near they come.

The exact average of a footprint is counted from points spread evenly over the parallelogram on the finest level.
"""

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import jv

from aliasbench.renderers.raytrace import ewa, shading, texturing
from aliasbench.renderers.raytrace.ewa import MOST_ANISOTROPY, ewa_color, footprint_axes
from aliasbench.renderers.raytrace.tables import Mesh, triangle_values
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.model import ImageTexture, read_only
from aliasbench.scenes.textures import mip_chain

SIDE = 128
SINGLE = 2.0**-23  # spacing of float32 at 1


class Chain:
    """A texture's levels as kernels have them, behind some texels of something else."""

    def __init__(self, texels: Any) -> None:
        self.images = mip_chain(ImageTexture(read_only(np.asarray(texels, np.float32)))).levels
        sizes = [level.shape[0] * level.shape[1] for level in self.images]
        first = 3 + np.cumsum([0, *sizes[:-1]])
        rows = [(at, level.shape[1], level.shape[0]) for at, level in zip(first, self.images, strict=True)]
        self.levels = np.array([(0, 1, 1), (1, 1, 1), *rows], np.int64)
        alien = np.full((3, 4), 1e9, np.float32)
        self.texels = np.concatenate([alien, *(level.reshape(-1, 4) for level in self.images), alien])

    def look_up(self, s: float, r: float, axes: Any, count: int | None = None) -> np.ndarray:
        """Return the average at (s, r) over a footprint with `axes` ((s_x, r_x), (s_y, r_y)) in texels."""
        height, width = self.images[0].shape[:2]
        (s_x, r_x), (s_y, r_y) = axes
        return np.array(
            ewa_color(
                self.levels, self.texels, 2, count or len(self.images),
                s, r, s_x / width, r_x / height, s_y / width, r_y / height,
            )
        )  # fmt: skip


def turned(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def random_footprints(rng: Any, count: int, anisotropy: float, low: float, high: float) -> np.ndarray:
    """Return (count, 2, 2) axes of parallelograms: squares of any direction, stretched along any other."""
    axes = np.empty((count, 2, 2))
    for k in range(count):
        shorter = np.exp(rng.uniform(np.log(low), np.log(high)))
        stretch = np.diag([shorter * anisotropy, shorter])
        axes[k] = turned(rng.uniform(0, 7)) @ stretch @ turned(rng.uniform(0, 7))
    return axes


def exact_average(image: Any, s: float, r: float, axes: Any, points: int = 96) -> np.ndarray:
    """Return the mean (4,) of constant texels over the parallelogram about (s, r)."""
    height, width = image.shape[:2]
    part = (np.arange(points) + 0.5) / points - 0.5
    a, b = np.meshgrid(part, part)
    x = np.floor(s * width + a * axes[0][0] + b * axes[1][0]).astype(int) % width
    y = np.floor(r * height + a * axes[0][1] + b * axes[1][1]).astype(int) % height
    return np.asarray(image[y, x].mean(axis=(0, 1), dtype=np.float64))


def bilinear(image: Any, s: float, r: float) -> np.ndarray:
    height, width = image.shape[:2]
    x, y = s * width - 0.5, r * height - 0.5
    i, j = int(np.floor(y)), int(np.floor(x))
    b, a = y - i, x - j
    rows = [(1 - a) * image[k % height, j % width] + a * image[k % height, (j + 1) % width] for k in (i, i + 1)]
    return np.asarray((1 - b) * rows[0] + b * rows[1], np.float64)


def trilinear(images: Any, s: float, r: float, axes: Any) -> np.ndarray:
    """Return what `texture=trilinear` makes of the footprint: the longer of its two axes decides."""
    lod = min(max(np.log2(max(np.hypot(*axes[0]), np.hypot(*axes[1]))), 0.0), len(images) - 1.0)
    level = int(lod)
    value = bilinear(images[level], s, r)
    if lod > level:
        value += (lod - level) * (bilinear(images[level + 1], s, r) - value)
    return value


def white_noise() -> Any:
    return np.random.default_rng(5).random((SIDE, SIDE, 4), np.float32)


def smooth_noise() -> Any:
    """Return noise whose amplitude falls as 1 / frequency, as a photograph's does."""
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(SIDE), np.fft.fftfreq(SIDE)))
    frequency[0, 0] = np.inf
    noise = np.random.default_rng(6).standard_normal((SIDE, SIDE, 4))
    shaped = np.fft.ifft2(np.fft.fft2(noise, axes=(0, 1)) / frequency[..., None], axes=(0, 1)).real
    return (0.5 + 0.2 * shaped / shaped.std()).astype(np.float32)


def random_squares() -> Any:
    cells = np.random.default_rng(7).random((SIDE // 8, SIDE // 8, 4)) < 0.5
    return np.kron(cells, np.ones((8, 8, 1))).astype(np.float32)


TEXTURES = {"white": white_noise(), "smooth": smooth_noise(), "squares": random_squares()}
CHAINS = {name: Chain(texels) for name, texels in TEXTURES.items()}


# Footprints: anisotropy, range of the shorter side in texels, and the most that the error may be of trilinear's on
# white noise, smooth noise and random squares: about 1.3 times what is measured.
NEARNESS = {
    "magnified": (1.0, 0.25, 1.0, (1.1, 1.1, 1.1)),
    "isotropic 1": (1.0, 1.0, 2.0, (0.32, 0.25, 0.9)),
    "isotropic 2": (1.0, 2.0, 8.0, (0.55, 0.3, 0.9)),
    "anisotropic 2": (2.0, 1.0, 4.0, (0.35, 0.22, 0.3)),
    "anisotropic 4": (4.0, 1.0, 4.0, (0.33, 0.18, 0.18)),
    "anisotropic 8": (8.0, 1.0, 4.0, (0.35, 0.18, 0.18)),
    "anisotropic 16": (16.0, 1.0, 2.0, (0.3, 0.18, 0.18)),
}


@pytest.mark.parametrize("case", NEARNESS)
def test_error_against_exact_averages_is_a_fraction_of_trilinear_s(case: str) -> None:
    anisotropy, low, high, most = NEARNESS[case]
    rng = np.random.default_rng(11)
    axes = random_footprints(rng, 250, anisotropy, low, high)
    places = rng.random((250, 2))
    for (name, chain), limit in zip(CHAINS.items(), most, strict=True):
        exact, own, other = (
            np.array([average(*place, axis) for place, axis in zip(places, axes, strict=True)])
            for average in (
                lambda s, r, a, chain=chain: exact_average(chain.images[0], s, r, a),
                chain.look_up,
                lambda s, r, a, chain=chain: trilinear(chain.images, s, r, a),
            )
        )
        error, trilinear_error = (float(np.sqrt(np.mean((v - exact) ** 2))) for v in (own, other))
        print(f"{case}, {name}: {error:.4f}, trilinear {trilinear_error:.4f}: {error / trilinear_error:.2f}")
        assert trilinear_error > 0.002
        assert error < limit * trilinear_error


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (5, 3), (7, 13), (16, 16), (3, 64)])
def test_constant_textures_stay_constant(size: tuple[int, int]) -> None:
    color = np.array([0.1, 0.7, 3.0, 0.4], np.float32)
    chain = Chain(np.broadcast_to(color, (*size, 4)))
    rng = np.random.default_rng(1)
    for axes in random_footprints(rng, 200, 6.0, 1e-3, 1e3):
        # Texels are rounded once for each level; a mean of equals in float64 adds nothing that shows.
        np.testing.assert_allclose(chain.look_up(*rng.random(2), axes), color, rtol=len(chain.images) * SINGLE)


def lattice_ripples(axes: Any) -> tuple[float, np.ndarray, np.ndarray]:
    """Return how far sums of weights over level 0 can be from integrals: of w (over 1), w d (2,) and w d d^T (2, 2).

    Poisson's sum formula over the texels: the ellipse's transform F = 48 J3(k) / k^3 at k = |H^T f|, with
    S = H H^T = 8 V, is summed over f = 2 pi m for all whole m but 0. The moments are its derivatives, of
    F' / k = -48 J4(k) / k^4 and (F' / k)' / k = 48 J5(k) / k^5.
    """
    square = ewa._SPREAD * (axes.T @ axes + np.eye(2))
    m = np.delete(np.mgrid[-20:21, -20:21].reshape(2, -1), 41 * 20 + 20, axis=1)
    f = 2 * np.pi * m
    along = square @ f
    k = np.sqrt((f * along).sum(axis=0))
    second = np.abs(48 * jv(5, k) / k**5 * along[:, None] * along[None]) + np.abs(
        48 * jv(4, k) / k**4 * square[..., None]
    )
    first = np.abs(48 * jv(4, k) / k**4 * along)
    return float(np.abs(48 * jv(3, k) / k**3).sum()), first.sum(axis=1), second.sum(axis=2)


def level_zero_footprints(count: int) -> np.ndarray:
    """Return axes that level 0 serves as they are: shorter side 1 to 3, sides' product below 16, anisotropy up to 5."""
    rng = np.random.default_rng(2)
    return np.concatenate([random_footprints(rng, count, a, 1.0, min(3.0, 3.9 / np.sqrt(a))) for a in (1.0, 2.0, 5.0)])


def test_ramps_keep_their_value() -> None:
    y, x = np.mgrid[0:SIDE, 0:SIDE]
    chain = Chain(np.stack([x + 0.5, y + 0.5, x - 2 * y, 0 * x], axis=2))
    rng = np.random.default_rng(3)
    for axes in level_zero_footprints(60):
        s, r = rng.uniform(0.25, 0.75, 2)
        weight, mean, _ = lattice_ripples(axes)
        bound = mean / (1 - weight)
        off = np.abs(chain.look_up(s, r, axes)[:2] - SIDE * np.array([s, r]))
        assert (off <= bound + 1e-9).all()
        assert (bound < 0.1 * np.linalg.norm(axes)).all()


def test_weights_have_the_covariance_of_the_footprint_and_a_texel() -> None:
    # Averaged over places within a texel, sums over texels are integrals, up to what comes of dividing by the sum of
    # weights: products of two ripples. The 8 x 8 places leave ripples of 8 cycles: 8 * 48 J3(k) / k^3 < 5e-4 of V.
    y, x = np.mgrid[0:SIDE, 0:SIDE] - (SIDE - 1) / 2
    chain = Chain(np.stack([x * x, x * y, y * y, x], axis=2)), Chain(np.stack([y, y, y, y], axis=2))
    tightest = 1.0
    for axes in level_zero_footprints(8):
        weight, _, ripple = lattice_ripples(axes)
        total = np.zeros((2, 2))
        for i, j in np.ndindex(8, 8):
            # The middle of the texture is a texels' corner, and the place up to half a texel from it.
            s, r = (np.array([i, j]) + 0.5) / 8 - 0.5
            (xx, xy, yy, x1), (y1, *_) = (c.look_up(0.5 + s / SIDE, 0.5 + r / SIDE, axes) for c in chain)
            mixed = xy - s * y1 - r * x1 + s * r
            total += np.array([[xx - 2 * s * x1 + s * s, mixed], [mixed, yy - 2 * r * y1 + r * r]]) / 64
        expected = (axes.T @ axes + np.eye(2)) / 12
        tolerance = weight / (1 - weight) * (ripple + weight * expected) + 5e-4 * np.trace(expected)
        assert (np.abs(total - expected) <= tolerance).all()
        tightest = min(tightest, float(tolerance.max() / np.trace(expected)))
    assert tightest < 0.002


def test_whole_periods_and_texels_shift_nothing() -> None:
    chain = CHAINS["white"]
    moved = Chain(np.roll(TEXTURES["white"], (3, -5), axis=(0, 1)))
    rng = np.random.default_rng(4)
    for axes in random_footprints(rng, 100, 4.0, 0.3, 1.2):
        s, r = rng.random(2)
        value = chain.look_up(s, r, axes)
        # The place is rounded to 2^-40 of a texel; values change by no more than a few times that.
        np.testing.assert_allclose(chain.look_up(s + 7, r - 11, axes), value, atol=1e-10)
        np.testing.assert_allclose(moved.look_up(s - 5 / SIDE, r + 3 / SIDE, axes), value, atol=1e-10)


def test_only_the_ellipse_matters() -> None:
    # A turn within the picture leaves x x^T + y y^T as it is; where that is a circle, every turn of the axes is one.
    chain, rng = CHAINS["white"], np.random.default_rng(8)
    for anisotropy in (1.0, 3.0, 12.0, 40.0):
        for axes in random_footprints(rng, 40, anisotropy, 0.4, 5.0):
            s, r = rng.random(2)
            value = chain.look_up(s, r, axes)
            for other in (turned(rng.uniform(0, 7)) @ axes, axes[::-1], -axes, axes * [[1], [-1]]):
                np.testing.assert_allclose(chain.look_up(s, r, other), value, atol=1e-9)


def test_footprints_count_as_no_narrower_than_a_texel_and_a_sixteenth_of_their_length() -> None:
    assert Technique("raster").anisotropy == MOST_ANISOTROPY
    chain, rng = CHAINS["white"], np.random.default_rng(9)
    for long in (0.0, 0.7, 4.0, 20.0, 33.0, 90.0):
        turn, place = turned(rng.uniform(0, 7)), rng.random(2)
        least = max(1.0, long / 16)
        limited = chain.look_up(*place, np.diag([max(long, 1.0), least]) @ turn)
        for short in (0.0, 0.01 * least, 0.9 * least):
            np.testing.assert_allclose(chain.look_up(*place, np.diag([long, short]) @ turn), limited, atol=1e-9)
        wider = chain.look_up(*place, np.diag([max(long, 1.0), 1.1 * least]) @ turn)
        assert np.abs(wider - limited).max() > 1e-4


def test_far_away_averages_tend_to_the_mean() -> None:
    chain, rng = CHAINS["white"], np.random.default_rng(10)
    mean = TEXTURES["white"].mean(axis=(0, 1), dtype=np.float64)
    errors = [
        np.sqrt(np.mean([(chain.look_up(*rng.random(2), turned(k) * side) - mean) ** 2 for k in range(40)]))
        for side in (1, 4, 16, 64)
    ]
    # White noise of deviation 12^-1/2 over side^2 texels: a quarter at each step.
    assert all(later < 0.4 * earlier for earlier, later in itertools.pairwise(errors))
    for side in (1e3, 1e6, 1e12, 1e200, np.inf, np.nan):
        np.testing.assert_array_equal(chain.look_up(0.3, 0.6, np.diag([side, side])), chain.images[-1][0, 0])


def test_magnified_look_ups_are_smooth_and_between_their_neighbours() -> None:
    chain, image, rng = CHAINS["white"], TEXTURES["white"], np.random.default_rng(12)
    reach = np.sqrt(2 * ewa._SPREAD)
    differences = []
    for _ in range(300):
        s, r = rng.random(2)
        axes = random_footprints(rng, 1, 1.0, 1e-6, 0.9)[0] * rng.integers(0, 2)
        value = chain.look_up(s, r, axes)
        y, x = np.mgrid[-3:4, -3:4] + np.floor(np.array([r, s]) * SIDE).astype(int)[:, None, None]
        near = np.hypot(x + 0.5 - s * SIDE, y + 0.5 - r * SIDE) < reach
        texels = image[y % SIDE, x % SIDE][near]
        assert (value >= texels.min(axis=0) - 1e-12).all()
        assert (value <= texels.max(axis=0) + 1e-12).all()
        differences.append(value - bilinear(image, s, r))
        # |d(1 - Q)^2 / dx| <= 1.54 / reach, over up to 6 texels of which one has at least (1 - 1/2 / (4/3))^2 = .39:
        # no two places 1e-6 of a texel apart differ by more than 2 * 6 * 1.54 / 1.15 / .39 * 1e-6.
        stepped = chain.look_up(s + 1e-6 / SIDE, r, axes)
        assert np.abs(stepped - value).max() < 5e-5
    # Noise has a deviation of 12^-1/2; the two kernels, of one covariance, differ by a tenth of it.
    assert 0.001 < np.sqrt(np.mean(np.square(differences))) < 0.15 / np.sqrt(12)


def test_half_way_between_two_columns_is_their_mean() -> None:
    image = np.zeros((8, 8, 4), np.float32)
    image[:, ::2] = 1.0
    chain = Chain(image)
    for column in range(8):
        np.testing.assert_allclose(chain.look_up(column / 8, 0.3, np.zeros((2, 2))), 0.5, atol=1e-12)


def test_alpha_is_averaged_as_colours_are() -> None:
    texels = np.repeat(TEXTURES["white"][..., :1], 4, axis=2)
    chain, rng = Chain(texels), np.random.default_rng(13)
    for axes in random_footprints(rng, 50, 5.0, 0.1, 20.0):
        value = chain.look_up(*rng.random(2), axes)
        assert len(set(value.tolist())) == 1


def test_weights_along_a_single_row_have_the_variance_of_the_footprint_and_a_texel() -> None:
    # As above, in one dimension, where ripples are below a thousandth of the variance.
    x = np.arange(64) - 31.5
    chain = Chain(np.stack([x * x, x, x, x], axis=1)[None])
    for width in (5.0, 8.0, 12.0):
        shifts = (np.arange(16) + 0.5) / 16 - 0.5
        moments = [chain.look_up(0.5 + s / 64, 0.3, [[width, 0.0], [0.0, 0.0]])[:2] for s in shifts]
        variance = np.mean([xx - 2 * s * x1 + s * s for s, (xx, x1) in zip(shifts, np.array(moments), strict=True)])
        assert variance == pytest.approx((width**2 + 1) / 12, rel=2e-3)


def test_a_texture_one_texel_high_is_averaged_along_its_width() -> None:
    # Whatever the footprint's height: nothing changes along it. The other way round the same.
    row = np.random.default_rng(14).random((1, 64, 4), np.float32)
    flat, upright = Chain(row), Chain(row.transpose(1, 0, 2))
    for width in (0.0, 1.3, 5.0, 17.0, 60.0):
        value = flat.look_up(0.37, 0.1, [[width, 0.0], [0.0, 0.0]])
        other = [[width, 0.0], [0.0, 5.0 * width]]
        np.testing.assert_allclose(flat.look_up(0.37, 0.8, other), value, atol=1e-12)
        np.testing.assert_allclose(upright.look_up(0.8, 0.37, np.array(other)[:, ::-1]), value, atol=1e-12)
    # (1 - x^2)^2 over 17 sqrt(7/12) to either side, as wide as a box of 17, is 1 - 2 .922 + .935 = .091 of the box's
    # square away from it: on white noise of deviation 12^-1/2, .021 over 17 texels.
    near = [[17.0, 0.0], [0.0, 0.0]]
    errors = [flat.look_up(s, 0.1, near) - exact_average(flat.images[0], s, 0.1, near, 400) for s in np.arange(64) / 60]
    assert 0.01 < np.sqrt(np.mean(np.square(errors))) < 0.03


EXTREME = st.floats(allow_nan=True, allow_infinity=True) | st.floats(-3.0, 3.0) | st.sampled_from([0.0, 1e6, -1e9])


@given(
    st.integers(1, 13), st.integers(1, 13), st.integers(1, 4), EXTREME, EXTREME,
    st.tuples(EXTREME, EXTREME, EXTREME, EXTREME),
)  # fmt: skip
def test_any_footprint_gives_a_mean_of_texels(
    width: int, height: int, count: int, s: float, r: float, axes: tuple[float, float, float, float]
) -> None:
    texels = np.random.default_rng(width * 16 + height).random((height, width, 4), np.float32)
    chain = Chain(texels)
    value = chain.look_up(s, r, np.array(axes).reshape(2, 2), min(count, len(chain.images)))
    # In the range of all texels, so neither NaN nor what lies before and behind them.
    assert (value >= texels.min(axis=(0, 1)) - 1e-6).all()
    assert (value <= texels.max(axis=(0, 1)) + 1e-6).all()


def test_rows_are_laid_out_as_shading_and_texturing_say() -> None:
    assert (ewa._U_MAP, ewa._V_MAP, ewa._UV_MATRIX) == (shading.U_MAP, shading.V_MAP, texturing.UV_MATRIX)
    assert shading.NORMAL == 0


@pytest.mark.parametrize("perspective", [False, True])
def test_footprint_axes_are_the_derivatives_of_the_projected_coordinates(perspective: bool) -> None:
    rng = np.random.default_rng(15)
    checked = 0
    for _ in range(60):
        vertices, uv = rng.uniform(-1, 1, (3, 3)) - np.array([0, 0, 4]), rng.uniform(-2, 2, (3, 2))
        mesh = Mesh(vertices, np.array([[0, 1, 2]], np.int32), uv, np.zeros(1, np.int32), np.zeros(1, np.bool_))
        row = triangle_values(mesh)[0]
        values = np.zeros(texturing.OBJECT_SIZE)
        matrix = rng.uniform(-2, 2, (2, 3))
        values[texturing.UV_MATRIX : texturing.UV_MATRIX + 6] = matrix.ravel()
        right, up, forward = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        eye, step, (a, b) = rng.uniform(-0.5, 0.5, 3), 0.01, rng.uniform(-0.3, 0.3, 2)
        normal, offset = row[:3], row[3]

        def ray(a: float, b: float, eye: Any = eye, axes: Any = (right, up, forward)) -> Any:
            point = a * axes[0] + b * axes[1]
            return (eye, axes[2] + point) if perspective else (eye + point, axes[2])

        def project(a: float, b: float, normal: Any = normal, offset: Any = offset, ray: Any = ray) -> Any:
            origin, direction = ray(a, b)
            t = (offset - normal @ origin) / (normal @ direction)
            p = origin + t * direction
            uv = np.array([row[4:7] @ p + row[7], row[8:11] @ p + row[11], 1.0])  # noqa: B023 - called in its turn
            return matrix @ uv, t  # noqa: B023

        direction = ray(a, b)[1]
        if abs(normal @ direction) < 0.2 * np.linalg.norm(normal):
            continue
        weight = step * (project(a, b)[1] if perspective else 1.0)
        s_x, r_x, s_y, r_y = footprint_axes(row, values, weight, *right, *up, *direction)
        h = 1e-5
        along = [
            (project(a + h * i, b + h * j)[0] - project(a - h * i, b - h * j)[0]) / (2 * h) * step
            for i, j in ((1, 0), (0, 1))
        ]
        # Central differences err by h^2 / 6 of the third derivative, and by 2^-52 / h of the values.
        size = max(1.0, np.abs(along).max() / step) * step
        np.testing.assert_allclose([[s_x, r_x], [s_y, r_y]], along, atol=1e-6 * size)
        width, height = 40.0, 24.0
        stretch = shading._stretch(row, values, width, height, weight, *right, *direction)
        assert stretch == pytest.approx((s_x * width) ** 2 + (r_x * height) ** 2, rel=1e-12)
        checked += 1
    assert checked > 20
