"""Lines between texels exactly where samples are: the half-open rule says whose each is, [k / w, (k + 1) / w)."""

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.hard.case import RASTERS, REFERENCE, HardCase, Verdict, with_keys
from aliasbench.bench.hard.edge_pictures import (
    EXACT,
    FINEST,
    HALF_ULP,
    REFERENCE_ROUNDING,
    Stage,
    label,
    stages,
    worst_of,
)
from aliasbench.bench.hard.ownership import pixel_points
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Checker, FloatArray, ImageTexture, Scene, Texture, read_only
from aliasbench.scenes.shapes import quad

SIZE = (32, 16)
# The textured rectangle in px, twice as large as the picture, and how many texels it has, of 4 x 2 px: powers of two,
# so that texture coordinates are exact wherever pixels are.
LEFT, TOP, ACROSS, DOWN = -15.5, -7.5, 64.0, 32.0
TEXELS = (16, 16)
# By how much texels' columns are moved from row to row of pixels, and rows from column to column.
SHEARS = (0.0, 2.0**-8, 2.0**-12, 2.0**-16, 2.0**-20, 2.0**-24)
Table = NDArray[np.float64]


def _image() -> tuple[Texture, Table]:
    """Return an image of which no two neighbours are alike, in steps that half floats hold, and its texels."""
    k = np.arange(TEXELS[0] * TEXELS[1]).reshape(TEXELS[1], TEXELS[0])
    texels = np.stack([k % 16 / 16 + 1 / 32, k // 16 / 16 + 1 / 32, (k * 7 % 16) / 16, np.ones(k.shape)], axis=-1)
    return ImageTexture(read_only(texels.astype(np.float32))), texels[..., :3]


def _checker() -> tuple[Texture, Table]:
    """Return a checker and the colours of its squares."""
    odd = np.add.outer(np.arange(TEXELS[1]), np.arange(TEXELS[0])) % 2
    return Checker((float(TEXELS[0]), float(TEXELS[1]))), np.repeat(odd[..., None], 3, axis=-1).astype(np.float64)


def _scene(stage: Stage, texture: Texture, shear: float) -> Scene:
    corners = np.array([(LEFT, TOP + DOWN), (LEFT + ACROSS, TOP + DOWN), (LEFT + ACROSS, TOP), (LEFT, TOP)])
    sheared = corners + shear * (corners - (LEFT, TOP))[:, ::-1]
    surface = quad(stage.place(sheared), texture="lines", motion=stage.motion)
    plain = stage.scene(surface)
    return Scene(plain.name, plain.camera, plain.objects, {"lines": texture}, animation=plain.animation)


def texel_misplacements(pixels: NDArray[np.floating], points: FloatArray, table: Table, shear: float) -> FloatArray:
    """Return (n,): how far samples must be moved, in px, to see the texel whose colour they have; inf if none near.

    A sample on a line that shows the wrong side's colour counts as `FINEST`.
    """
    colors = np.asarray(pixels, dtype=np.float64).reshape(-1, 3)
    a, b = (points - (LEFT, TOP)).T
    x, y = (a - shear * b) / (1.0 - shear**2), (b - shear * a) / (1.0 - shear**2)
    pitch = np.array([ACROSS / TEXELS[0], DOWN / TEXELS[1]])
    place = np.stack([x, DOWN - y], axis=1) / pitch
    own = np.floor(place).astype(int)
    out = np.full(len(points), np.inf)
    for step in np.stack(np.meshgrid((-1, 0, 1), (-1, 0, 1)), axis=-1).reshape(-1, 2):
        column, row = ((own + step) % TEXELS).T
        is_same = np.abs(table[row, column] - colors).max(axis=1) <= 1e-6
        # to the texel's near border, along either axis
        to = np.where(step > 0, own + 1 - place, np.where(step < 0, place - own, 0.0)) * pitch
        away = np.maximum(np.linalg.norm(to, axis=1), FINEST) if step.any() else np.zeros(len(points))
        out[is_same] = np.minimum(out[is_same], away[is_same])
    return out


def _areas(table: Table) -> FloatArray:
    """Return (h, w, 3): means over pixels of texels that are not sheared."""

    def shares(count: int, start: float, length: float, pixels: int) -> FloatArray:
        border = start + length / count * np.arange(count + 1)
        pixel = np.arange(pixels)[:, None]
        out: FloatArray = np.clip(np.minimum(border[1:], pixel + 1.0) - np.maximum(border[:-1], pixel), 0.0, None)
        return out

    across, down = shares(TEXELS[0], LEFT, ACROSS, SIZE[0]), shares(TEXELS[1], TOP, DOWN, SIZE[1])
    out: FloatArray = np.einsum("hr,wc,rck->hwk", down, across, table[::-1])
    return out


def _texels(subject: str, texture: Texture, table: Table) -> Verdict:
    found = []
    for stage in stages(SIZE):
        if subject == REFERENCE:
            text = with_keys(subject, "time=center" if stage.moving else "")
            shown = render(_scene(stage, texture, 0.0), text, size=SIZE, frame=stage.frame)
            error = float(np.abs(shown.pixels - _areas(table)).max())
            why = "means over texels are known in closed form; the reference certifies its own error"
            bound = max(REFERENCE_ROUNDING, shown.uncertainty or 0.0)
            found.append(Verdict(error, "contrast", REFERENCE_ROUNDING, bound, why, note=label(stage)))
            continue
        bound, why = _texel_bound(subject)
        worst, wrong = 0.0, 0
        for shear in SHEARS:
            # lines that go through samples in float64 alone belong to either side
            is_tie = shear == 0.0 and not (stage.name == "orthographic" and not stage.moving)
            pixels = render(_scene(stage, texture, shear), subject, size=SIZE, frame=stage.frame).pixels
            away = texel_misplacements(pixels, pixel_points(SIZE), table, shear)
            away = np.where(away <= (FINEST if is_tie else 0.0), 0.0, away)
            worst, wrong = max(worst, float(away.max())), wrong + int((away > 0.0).sum())
        note = f"{label(stage)}; {wrong} of {len(SHEARS) * SIZE[0] * SIZE[1]} samples wrong"
        found.append(Verdict(worst, "px", EXACT, bound, why, note=note))
    return worst_of(found)


def _texel_bound(subject: str) -> tuple[float, str]:
    """Return by how many pixels a subject may misplace texels' borders, and why."""
    if subject in RASTERS:
        # of coordinates up to 1 over `ACROSS` px: coefficients of the interpolation over w and their setup from three
        # vertices (8), its two products and sums (4), the quotient and the product with the count of texels (4)
        return 16.0 * HALF_ULP * ACROSS * 1.5, (
            "float32 texture coordinates: 16 roundings of 2^-24 of a coordinate that goes over the rectangle's diagonal"
        )
    return EXACT, "texture coordinates are computed in float64 from the ray and the triangle's plane"


CASES = (
    HardCase(
        "checker-lines",
        "edges",
        "The lines of a checker go through pixel centres, or are sheared past them by 2^-8 to 2^-24 px a pixel.",
        "Samples have the colour of the square that floor(u s) gives, those on a line too where coordinates are exact: "
        "how far from its square is the worst? The reference: by how much are means over pixels wrong?",
        lambda subject: _texels(subject, *_checker()),
    ),
    HardCase(
        "texel-lines",
        "edges",
        "The lines between an image's texels go through pixel centres, or are sheared past them by 2^-8 to 2^-24 px a "
        "pixel.",
        "Samples have the colour of the texel that floor(u w) gives, those on a line too where coordinates are exact: "
        "how far from its texel is the worst? The reference: by how much are means over pixels wrong?",
        lambda subject: _texels(subject, *_image()),
    ),
)
