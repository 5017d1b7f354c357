"""One-dimensional signals, sampled by a row of pixels: what point sampling keeps of a wave, and what it makes up.

`signals` is a wave along x, the same all the way up and down, so that every row of the picture is the sampled signal; a
picture one pixel high is that row alone (`signals:rows=1` at 256 x 1). `frequency` is in cycles per pixel, so that the
sampling rate is 1 / frequency samples per cycle: at .05 the samples follow the wave, at the default of .95 a regular
signal comes back 19 times too slow (look for bars 20 pixels apart where the truth is nearly grey), and
`profile=irregular` at 2 is a high-frequency signal of which the samples are anyone's guess. A scene knows no pixels:
`rows` says how high the picture is for which the frequency holds; in another one it scales with the height.

`nyquist-sweep` has one row of pixels for each of `rates` sampling rates, in equal ratios from `lowest` at the top to
`highest` at the bottom, at each of `phases` equally spaced phases: at the defaults 16 x 16 rows, with 1, 2, 4 and 8
samples per cycle among the rates, made for pictures 256 high. Within a band the phase advances from row to row, which
shows a wave as a slant; look at how the slant is mirrored below 2 samples per cycle (the alias runs the other way), and
at how contrast comes and goes from row to row near 2. At 4 and above nothing depends on the phase any more.

Both declare their frequencies, the sweep one for each rate; the irregular signal has none. Waves are written about the
middle of the picture, where `phase` is theirs. Nothing moves.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from aliasbench.scenes.entries import Choice, Parameter, SceneEntry
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Facts, Grating, GratingFact, ImageTexture, Scene, Surface, Texture, Vec3, read_only
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.staging import flat_camera

ROWS = 256  # height of the picture for which the default's frequency is in cycles per pixel
HEIGHT = 2.0  # of the camera, world units
# A row of 8192 pixels is 16384 units long when it is all of the picture. One quad as long would cost the middle its
# precision in float32, so they get longer outwards; the joints are where no pixel centre is.
JOINTS = (0.0, 4.3, 17.3, 69.3, 277.3, 1109.3, 4437.3, 17749.3)
REACH = 4.0  # up and down, past what wide filters see beyond the border of a picture
SWEEP_REACH = 16.0  # to the left and right: pictures up to 16 times as wide as high
IRREGULAR_BARS = 1024  # before they repeat
IRREGULAR_SEED = 168


def build_signals(*, name: str, frequency: float, phase: float, profile: str, contrast: float, rows: int) -> Scene:
    """Return a wave of `frequency` cycles per pixel, in a picture `rows` pixels high, about a mean of 1/2."""
    cycles = frequency * rows / HEIGHT
    low, high = (0.5 - contrast / 2,) * 3, (0.5 + contrast / 2,) * 3
    texture: Texture
    if profile == "irregular":
        # a bar is half a cycle long, and the texture's period is one unit of uv
        per_unit, offset = 2.0 * cycles / IRREGULAR_BARS, 2.0 * phase / IRREGULAR_BARS
        texture = irregular_bars(low, high)
    else:
        per_unit, offset = 1.0, 0.0
        texture = Grating(cycles, 0.0, phase, "square" if profile == "square" else "sine", low, high)
    objects: list[Surface] = []
    for inner, outer in pairwise(JOINTS):
        for left, right in ((-outer, -inner), (inner, outer)):
            corners = [(left, -REACH, 0.0), (right, -REACH, 0.0), (right, REACH, 0.0), (left, REACH, 0.0)]
            uv = [(per_unit * x + offset, y) for x, y, _ in corners]
            objects.append(quad(corners, uv=uv, texture="wave", name=f"wave from {left:g} to {right:g}"))
    return Scene(
        name=name,
        camera=flat_camera(),
        objects=tuple(objects),
        textures={"wave": texture},
        contrast=contrast,
        facts=Facts(gratings=() if profile == "irregular" else (GratingFact((cycles, 0.0)),)),
    )


def irregular_bars(low: Vec3, high: Vec3) -> ImageTexture:
    """Return a row of bars of unrelated greys between two colours: what has no period worth the name."""
    share = np.random.default_rng(IRREGULAR_SEED).random((1, IRREGULAR_BARS, 1))
    rgb = np.asarray(low) + share * (np.asarray(high) - np.asarray(low))
    return ImageTexture(read_only(np.concatenate([rgb, np.ones_like(share)], axis=2).astype(np.float32)))


def sweep_rates(lowest: float, highest: float, rates: int) -> tuple[float, ...]:
    """Return the sampling rates of a sweep, samples per cycle, in equal ratios."""
    # Rounded, because 8 ** (1 / 3) is not always 2, and at exactly 2 everything depends on the phase.
    return tuple(round(float(lowest * (highest / lowest) ** (k / (rates - 1))), 12) for k in range(rates))


def build_nyquist_sweep(
    *, name: str, lowest: float, highest: float, rates: int, phases: int, profile: str, contrast: float
) -> Scene:
    """Return `rates` x `phases` waves, one above the other, each a pixel high in a picture of as many rows."""
    if not lowest < highest:
        raise InputError(
            f"scene 'nyquist-sweep': parameter lowest = {lowest:g}: must be less than highest, {highest:g}"
        )
    count = rates * phases
    low, high = (0.5 - contrast / 2,) * 3, (0.5 + contrast / 2,) * 3
    # the outermost bands go on outside the picture, where filters see them
    heights = [REACH, *(HEIGHT * (0.5 - row / count) for row in range(1, count)), -REACH]
    keys: list[str] = []
    textures: dict[str, Texture] = {}
    facts: list[GratingFact] = []
    for rate in sweep_rates(lowest, highest, rates):
        cycles = count / HEIGHT / rate
        facts.append(GratingFact((cycles, 0.0)))
        for step in range(phases):
            key = f"rate {rate:.12g} phase {step} of {phases}"
            textures[key] = Grating(cycles, 0.0, step / phases, "square" if profile == "square" else "sine", low, high)
            keys.append(key)
    return Scene(
        name=name,
        camera=flat_camera(),
        objects=_bands(heights, keys),
        textures=textures,
        contrast=contrast,
        facts=Facts(gratings=tuple(facts)),
    )


def _bands(heights: list[float], keys: list[str]) -> tuple[Surface, ...]:
    """Return bands between heights, one below the other, with these textures; their uv are world units."""
    outline = np.array([(-SWEEP_REACH, 0.0), (SWEEP_REACH, 0.0), (SWEEP_REACH, 1.0), (-SWEEP_REACH, 1.0)])
    first = quad(np.c_[outline, np.zeros(4)], uv=outline)
    # A stretched band needs no new check, and checking thousands of them takes longer than all else.
    corners = np.tile(first.vertices, (len(heights) - 1, 1, 1))
    corners[:, :2, 1], corners[:, 2:, 1] = np.array(heights)[1:, None], np.array(heights)[:-1, None]
    vertices, uv = read_only(corners), read_only(corners[..., :2])
    return tuple(
        replace(first, vertices=places, uv=own, texture=key, name=key)
        for places, own, key in zip(vertices, uv, keys, strict=True)
    )


ENTRIES = (
    SceneEntry(
        "signals",
        "a wave along each row: low, high and regular frequencies as pixels sample them",
        "signals",
        build_signals,
        {
            "frequency": Parameter(0.95, 0.001, 16.0, "float", "cycles per pixel, 1 / (samples per cycle)"),
            "phase": Parameter(0.0, -1.0, 1.0, "float", "of the wave in the middle of the picture, cycles"),
            "profile": Choice("sine", ("sine", "square", "irregular"), "shape of the wave; irregular: random bars"),
            "contrast": Parameter(1.0, 0.01, 1.0, "float", "white minus black, about a mean of 0.5"),
            "rows": Parameter(ROWS, 1, 8192, "int", "height in pixels of the picture for which the frequency holds"),
        },
    ),
    SceneEntry(
        "nyquist-sweep",
        "waves sampled 1 to 8 times a cycle, at all phases: aliases below 2, beats until 4",
        "signals",
        build_nyquist_sweep,
        {
            "lowest": Parameter(1.0, 0.25, 16.0, "float", "samples per cycle at the top"),
            "highest": Parameter(8.0, 0.5, 64.0, "float", "samples per cycle at the bottom"),
            "rates": Parameter(16, 2, 64, "int", "sampling rates, in equal ratios"),
            "phases": Parameter(16, 3, 64, "int", "phases of each, equally spaced over a cycle"),
            "profile": Choice("sine", ("sine", "square"), "shape of the waves"),
            "contrast": Parameter(1.0, 0.01, 1.0, "float", "white minus black, about a mean of 0.5"),
        },
    ),
)
