"""Periodic patterns at exactly half the sampling rate and at all of it, in space and in time."""

import math

import numpy as np

from aliasbench.bench.hard.case import METRICS, REFERENCE, HardCase, Verdict, samples_key, with_keys
from aliasbench.bench.hard.footprints import ROUNDINGS
from aliasbench.bench.hard.ladder import RAY_ROUNDINGS
from aliasbench.bench.hard.painting import TIE_PX
from aliasbench.bench.hard.passing import float32_px, largest_error
from aliasbench.bench.hard.placing import MOVING_FRAME, moved
from aliasbench.metrics.catalog import measure
from aliasbench.metrics.spectral_line import recover_frequency
from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.frame import Frame
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.model import Camera, Checker, FloatArray, Grating, Scene, Texture
from aliasbench.scenes.shapes import mesh, quad

FREQUENCIES = (0.5, 1.0)  # cycles per pixel
WIDTH = 24
REACH = 20.0  # px from the middle to where bands end
# Of a cycle. At some of them borders are at samples, or a thousandth or less of a pixel beside them.
PHASES = (0.0, 0.03, 0.1, 0.125, 0.2, 0.25, 0.2505, 0.25 + 1e-6, 0.3, 0.37, 0.5, 0.51, 0.6249, 0.75, 0.8, 0.9995)
SIZE = (WIDTH, len(PHASES))
OUTPUT_ROUNDING = 2.0**-23  # float32 pixels up to 1, summed
RASTER_EDGE_PX = 1 / 512
CENTERS = np.arange(WIDTH) + 0.5 - WIDTH / 2


def _bands(frequency: float, textures: dict[str, Texture], scale: float) -> Scene:
    """Return a band a pixel high for each phase, u = scale (x + phase / frequency) in pixels from the middle."""
    objects = []
    for row, phase in enumerate(PHASES):
        top = SIZE[1] / 2 - row
        places = [(-REACH, top - 1.0), (REACH, top - 1.0), (REACH, top), (-REACH, top)]
        uv = [(scale * (x + phase / frequency), 0.5 * (y - top + 1.0) + 0.25) for x, y in places]
        objects.append(quad([(x, y, 0.0) for x, y in places], uv=uv, texture="wave"))
    return Scene("hard", Camera("orthographic", height=float(SIZE[1])), tuple(objects), textures=textures)


def _cycles(frequency: float) -> FloatArray:
    """Return (phases, width): how many cycles in pixel centres are."""
    out: FloatArray = frequency * CENTERS + np.array(PHASES)[:, None]
    return out


def _dirichlet(frequency: float, count: int) -> float:
    """Return what the mean of `count` regular samples a pixel leaves of a wave."""
    return math.sin(math.pi * frequency) / (count * math.sin(math.pi * frequency / count))


def _shown(scene: Scene, technique: str) -> list[Frame]:
    """Return a scene's picture, and that when it has turned twice and is where it was."""
    turning = render(moved(scene), with_keys(technique, "time=center"), size=SIZE, frame=MOVING_FRAME)
    return [render(scene, technique, size=SIZE), turning]


def _grating(subject: str) -> Verdict:
    """Sine gratings by texture."""
    worst, stated = 0.0, 0.0
    for frequency in FREQUENCIES:
        scene = _bands(frequency, {"wave": Grating(frequency)}, 1.0)
        wave = np.cos(2 * np.pi * _cycles(frequency))[..., None] / 2
        if subject == REFERENCE:
            for frame in _shown(scene, subject):
                stated = max(stated, frame.uncertainty or 0.0)
                worst = max(worst, largest_error(frame.pixels, 0.5 + float(np.sinc(frequency)) * wave))
            continue
        for count in (1, 4):
            text = samples_key(subject, count**2, "sampler=grid" if count > 1 else "")
            for frame in _shown(scene, text):
                worst = max(worst, largest_error(frame.pixels, 0.5 + _dirichlet(frequency, count) * wave))
    if subject == REFERENCE:
        allowed = max(stated, 1e-9)
        return Verdict(worst, "contrast", allowed, allowed, f"the bound of {stated:.1e} that the reference states")
    if not subject.startswith("raster"):
        why = "two roundings of a float32 pixel: rays and textures are float64"
        return Verdict(worst, "contrast", OUTPUT_ROUNDING, OUTPUT_ROUNDING, why)
    allowed = math.pi * max(FREQUENCIES) * float32_px(REACH + 2.0, ROUNDINGS) + OUTPUT_ROUNDING
    return Verdict(worst, "contrast", OUTPUT_ROUNDING, allowed, f"{COORDINATES_WHY}, at a slope of pi a cycle")


COORDINATES_WHY = f"texture coordinates up to {REACH + 2:g} px of 24 bits, rounded {ROUNDINGS:g} times on their way"


def _white_before(cycles: FloatArray) -> FloatArray:
    """Return how much of [0, cycles] is in the first half of a cycle."""
    out: FloatArray = np.floor(cycles) / 2 + np.minimum(cycles - np.floor(cycles), 0.5)
    return out


def _square_wave(subject: str, scene: Scene, frequency: float) -> tuple[float, float]:
    """Return a picture's worst figure, and the bound that it states.

    The first half of every cycle is white. Of a reference the error; else how far, in px, the farthest wrong sample is
    from a border.
    """
    cycles = _cycles(frequency)
    frames = _shown(scene, subject if subject == REFERENCE else samples_key(subject, 1))
    if subject == REFERENCE:
        covered = _white_before(cycles + frequency / 2) - _white_before(cycles - frequency / 2)
        errors = [largest_error(frame.pixels, covered[..., None] / frequency) for frame in frames]
        return max(errors), max(frame.uncertainty or 0.0 for frame in frames)
    is_white = cycles - np.floor(cycles) < 0.5
    far = np.abs(2 * cycles - np.rint(2 * cycles)) / (2 * frequency)
    wrong = [~(np.abs(frame.pixels - is_white[..., None]).max(axis=-1) <= 1e-6) for frame in frames]
    return max(float(far[each].max(initial=0.0)) for each in wrong), 0.0


def _borders(
    subject: str, found: list[tuple[float, float]], raster: tuple[float, str], ray: tuple[float, str]
) -> Verdict:
    worst, stated = (max(values) for values in zip(*found, strict=True))
    if subject == REFERENCE:
        allowed = max(stated, 1e-9)
        return Verdict(worst, "contrast", allowed, allowed, f"the bound of {stated:.1e} that the reference states")
    bound, why = raster if subject.startswith("raster") else ray
    return Verdict(worst, "px", TIE_PX, bound, why)


def _checker(subject: str) -> Verdict:
    """Checkers of one and two squares a pixel."""
    found = []
    for frequency in FREQUENCIES:
        # even squares are white here: (floor(2 nu u) + floor(v)) even is black
        checker = Checker((2.0 * frequency, 0.5), black=(1.0, 1.0, 1.0), white=(0.0, 0.0, 0.0))
        found.append(_square_wave(subject, _bands(frequency, {"wave": checker}, 1.0), frequency))
    # a sample on a border is either square's, and a turn takes it off by what float64 rounds of that
    rays = (TIE_PX, "rays and textures are float64: only samples on a border may fall to either side")
    return _borders(subject, found, (float32_px(REACH + 2.0, ROUNDINGS), COORDINATES_WHY), rays)


def _bars(subject: str) -> Verdict:
    """The same as geometry."""
    found = []
    for frequency in FREQUENCIES:
        corners = []
        for row, phase in enumerate(PHASES):
            top = SIZE[1] / 2 - row
            first, last = (math.floor(frequency * side * (WIDTH / 2 + 1)) for side in (-1, 1))
            for k in range(first - 1, last + 2):
                left, right = (k - phase) / frequency, (k + 0.5 - phase) / frequency
                corners += [(x, y, 0.0) for x, y in ((left, top - 1), (right, top - 1), (right, top), (left, top))]
        firsts = np.arange(0, len(corners), 4)[:, None]
        bars = mesh(corners, np.concatenate([firsts + np.array(fan) for fan in ((0, 1, 2), (0, 2, 3))]))
        scene = Scene("hard", Camera("orthographic", height=float(SIZE[1])), (bars,))
        found.append(_square_wave(subject, scene, frequency))
    rays = (float32_px(REACH), f"float32 rays: {RAY_ROUNDINGS:g} roundings of 2^-24 of up to {REACH:g} px")
    return _borders(subject, found, (RASTER_EDGE_PX, "vertices are snapped to 1/256 px, half of that either way"), rays)


def _metrics(subject: str) -> Verdict:  # noqa: ARG001 - the metrics are the only subject
    """Point samples beside pixel means, by closed forms."""
    worst, note = 0.0, ""
    scene = Scene("hard", Camera("orthographic", height=2.0))
    for frequency in FREQUENCIES:
        wave = np.cos(2 * np.pi * _cycles(frequency)) / 2
        share = 1.0 - float(np.sinc(frequency))
        rows = []
        for row in wave:
            test, reference = (
                np.broadcast_to((0.5 + part * row)[None, None, :, None], (1, 16, WIDTH, 3))
                for part in (1.0, 1.0 - share)
            )
            moire, rmse = (measure(name, test, reference, scene=scene).value for name in ("moire", "rmse"))
            expected = share * float(np.sqrt(np.mean(row**2)))
            errors = [math.inf if v is None else abs(v - e) for v, e in ((moire, 0.0), (rmse, expected))]
            rows.append(test[0, 0, :, 0])
            worst = max(worst, *errors)
        found = recover_frequency(np.array(rows), least_amplitude=1e-9).cycles_per_px
        worst = max(worst, abs(found - (0.5 if frequency == 0.5 else 0.0)))
        note += f"{frequency:g} cycles/px comes back at {found:g}; "
    return Verdict(worst, "contrast", 1e-12, 1e-12, "sums of a few thousand terms in float64", note=note.rstrip("; "))


TURNS = ((2, 7.5), (6, 7.5), (2, -7.5), (6, -22.5), (15, 1.0), (3, 5.0), (5, 9.0), (3, -5.0))
"""Blades and rev/s, of which blades x rate is half of 30, but for whole multiples of 30."""


def _ambiguous_rate(subject: str) -> Verdict:
    """Propellers that go half a blade's distance a frame."""
    size, worst, seen = (96, 96), 0.0, []
    text = subject if subject == REFERENCE else samples_key(subject, 1)
    for blades, rate in TURNS:
        # A point-sampled picture shows the blades' phase but roughly, unless frames turn the pixels onto each other.
        if (rate * 4) % 30 and subject != REFERENCE:
            continue
        scene = SCENES["propeller"].build(blades=blades, rev_per_s=rate, shutter=0.0, inner=0.5, outer=0.9)
        with prepare(scene, text, size=size) as ready:
            frames = np.stack([ready.render(frame=n).pixels for n in range(3)])
        score = measure("apparent_rate", frames, frames, scene=scene)
        undirected = score.value is not None and score.extras["sign"] is None
        error = abs(score.value + 15.0 / blades) if undirected and score.value is not None else math.inf
        seen.append(f"{blades} x {rate:g}: {score.value}")
        worst = max(worst, error)
    why = "a phase within 1e-6 turns of one half has no direction, and the rate then is -f / 2m by definition"
    return Verdict(worst, "rev/s", 1e-12, 1e-12, why, note="; ".join(seen))


def _ambiguous_strobing(subject: str) -> Verdict:
    """The same with an open shutter: what is left to strobe."""
    side, blades, instants = 128, 2, 256
    scene = SCENES["propeller"].build(blades=blades, rev_per_s=15.0 / blades, shutter=1.0)
    text = subject if subject == REFERENCE else samples_key(subject, instants, "sampler=center")
    frames = render(scene, text, size=(side, side)).pixels[None]
    score = measure("strobing", frames, frames, scene=scene)
    # Of odd multiples k of the blades' order sinc(k / 2) is left: the share is (32 / pi^4) sum k^-4 = 1 / 3.
    expected = 1.0 / math.sqrt(3.0)
    error = math.inf if score.value is None else abs(score.value - expected)
    # A pixel takes (k blades / radius)^2 / 12 of an order's power, at most that at the inner radius; and orders past
    # k = 20 are taken to be left as those from 10 on are, (2 / 10 pi)^2 of 4 / (20 pi^2) of the power at most.
    inner = scene.facts.rotors[0].inner * side / 2
    share = 4 / math.pi**2 * (blades / inner) ** 2 / 12 + (0.2 / math.pi) ** 2 * 0.2 / math.pi**2
    allowed = share / (2 * expected)
    why = "what pixels take of the orders' power at the inner radius, and orders too fine to be measured"
    if subject != REFERENCE:
        # a mean of equally spaced instants is within half a step of that over all; the blades' own RMS is 1 / 2
        allowed += 1.0 / instants
        why += f"; and means of {instants} instants are off by half of one, beside an RMS of 1/2"
    return Verdict(error, "1", allowed, allowed, why, note=f"{score.value} found, {expected:.6f} in closed form")


CASES = (
    HardCase(
        "nyquist-grating",
        "motion",
        "Sine gratings of exactly 0.5 and 1 cycles/px, as textures, at 16 phases, still and after two turns.",
        "One and 4 x 4 regular samples equal their closed forms (amplitude 1, D_4), the reference sinc(nu).",
        _grating,
    ),
    HardCase(
        "nyquist-checker",
        "motion",
        "Checkers of exactly one and two squares a pixel, borders at or beside samples, still and after two turns.",
        "Wrong samples are no farther from a border than the bound; the reference equals the covered shares.",
        _checker,
    ),
    HardCase(
        "nyquist-bars",
        "motion",
        "The same as geometry: bars of 1 px and of 0.5 px.",
        "Wrong samples are no farther from a border than the bound; the reference equals the covered shares.",
        _bars,
    ),
    HardCase(
        "nyquist-metrics",
        "motion",
        "Point samples of gratings of exactly 0.5 and 1 cycles/px beside pixel means, at 16 phases, by formula alone.",
        "Moire is 0, the RMS error goes with |cos(phase)|, the frequency found is 0.5 and 0.",
        _metrics,
        (METRICS,),
    ),
    HardCase(
        "ambiguous-rate",
        "motion",
        "Propellers of which every frame shows the blades half a blade's distance on: forwards or backwards?",
        "The apparent rate is f / 2m without a sign.",
        _ambiguous_rate,
    ),
    HardCase(
        "ambiguous-strobing",
        "motion",
        "The same propeller, with the shutter open all the time.",
        "STROBE_abs is 1 / sqrt(3), of samples at 256 instants to 1/256.",
        _ambiguous_strobing,
    ),
)
