"""Flat colours over an open shutter, under any filter, with a bound for every pixel.

The shutter is cut into slices in which nothing moves more than about a pixel. A cell of the picture that nothing can
change within a slice (`activity`, certain) counts as it is; any other is integrated over the slice by halving
(`panels`), every instant of which is exact. The work is that of edges meeting pixels, whatever the motion. How much of
it may be done is fixed beforehand, by count; where that is too little the bound says so.

What turns as one flat pattern has a closed form under the box (`rotor`), and a closed mean at every point under any
product filter (`whirl`).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.reference.activity import Slices, describe_pieces, measure_across
from aliasbench.renderers.reference.bands import Effort, integrate_row, scan_row
from aliasbench.renderers.reference.cellvalues import shades_of
from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.filtered import draw_filtered, is_pixel_box, rounding_bound, wide_view
from aliasbench.renderers.reference.flat import (
    ROUNDING,
    Integral,
    depth_extent,
    over_bands,
    palette,
)  # fmt: skip
from aliasbench.renderers.reference.masses import QUADRATURE
from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.pieces import Pieces, join_pieces, pieces_at
from aliasbench.renderers.reference.placement import Movers, movers_of
from aliasbench.renderers.reference.rotor import draw_rotor
from aliasbench.renderers.reference.turning import find_rotor, still_faces
from aliasbench.renderers.reference.whirl import WIDEST, draw_whirl
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.projection import View, view_at

TARGET = 1e-5  # the bound aimed at over an open shutter
_SHARE = 0.7  # of it, for the panels of one cell: the rest is rounding and what is counted beforehand
_FIRST, _MOST_SLICES, _DEEPEST = 16, 1024, 24
_WAY_PX = 1.0  # that outlines may move within a slice
_WAYS = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 64.0, 1e3])  # that a pixel's slices are joined for, in pixels
_PLAIN = 0.5  # share of the instants that may be spent before it is known where they are needed
_SECTION = 256  # rows whose patches are held at a time
# Prices in nanoseconds, measured; they set how many instants are looked at, so they are constants and not clocks.
_LOOK_COST, _MASS_COST, _BUDGET = 2000.0, 150.0, 24e9


def draw_shutter(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, spec: FilterSpec,
    target: float = TARGET,
) -> Integral:  # fmt: skip
    """Return the picture averaged over the open shutter, with a bound for every pixel.

    Raises
    ------
    InputError
        For a filter that reaches too far, see `filtered.wide_view`.
    """
    if scene.is_static or scene.animation.shutter <= 0.0:
        return draw_filtered(scene, faces, paths, size, frame, 0.0, spec)
    turning = _draw_turning(scene, faces, paths, size, frame, spec, target)
    return draw_panels(scene, faces, paths, size, frame, spec, target) if turning is None else turning


def _draw_turning(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, spec: FilterSpec, target: float
) -> Integral | None:
    """Return the picture of a turning pattern, closed under the box, else from its closed mean; None if it is none."""
    box = is_pixel_box(spec)
    if not box and (not spec.kind.separable or spec.margin > WIDEST):
        return None
    colors = palette(scene)
    rotor = find_rotor(scene, faces, paths, size, frame, colors)
    if rotor is None:
        return None
    base = draw_filtered(scene, still_faces(faces, paths), paths, size, frame, 0.0, spec)
    if not box:
        whirl = draw_whirl(rotor, size, spec, target * _SHARE)
        return Integral(base.pixels + whirl.pixels[:, :, rotor.channels], base.bound + whirl.bound)
    parts = over_bands(lambda rows: draw_rotor(rotor, size, (int(rows[0]), int(rows[1]))), size[1])
    turned = np.concatenate([p for p, _ in parts])[:, :, rotor.channels]
    return Integral(base.pixels + turned, base.bound + np.concatenate([b for _, b in parts]))


def draw_panels(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, spec: FilterSpec,
    target: float = TARGET, budget: float = _BUDGET,
) -> Integral:  # fmt: skip
    """Return the picture averaged over the open shutter by halving of slices, whatever moves."""
    width, height = size
    colors, box = palette(scene), is_pixel_box(spec)
    view = view_at(scene.camera, scene.animation, frame, 0.0, size)
    wide = view if box else wide_view(view, spec)
    shades, blur = shades_of(colors, None if box else spec)
    movers = movers_of(faces, paths, wide, frame)
    slices = _slices(scene, faces, paths, size, wide, frame, colors, movers)
    span = float((colors.max(axis=0) - colors.min(axis=0)).max())
    joined = np.sum(over_bands(lambda rows: _count(slices, rows, wide.width), wide.height), axis=0)
    block = min(2 * shades.margin + 1, width) * min(2 * shades.margin + 1, height)
    looks = budget / (_LOOK_COST + (0.0 if box else _MASS_COST * block))
    # every contact takes four looks or five; what is left is for where they do not do
    stage = min(int((5.0 * joined[:-2] > _PLAIN * looks).sum()), len(_WAYS) - 1)
    contacts, cells = float(joined[stage]), float(joined[-2])
    spare = max(0.0, looks - 5.0 * contacts)
    most = int(np.clip(4e6 / (15 * block), 64, 4096))
    reach = float(shades.peaks.sum() / shades.peaks.max())
    aim, shutter = target * _SHARE / reach, scene.animation.shutter
    # what `panels` adds for corners asks for this many instants, if nothing else is off
    dense = 1.5 * float(np.sqrt(span * shades.peaks.max() / (24.0 * 0.6 * aim * shutter)))
    dense = min(dense, 0.6 * spare / max(float(joined[-1]), 1e-300))
    spare = max(0.0, spare - dense * float(joined[-1]))
    effort = Effort(
        span, shutter, aim, 0.3 * spare / max(cells, 1.0), 5.0 + 0.4 * spare / max(contacts, 1.0), dense,
        0.3 * spare / wide.height, most,
    )  # fmt: skip
    pixels, bound = np.zeros((height, width, 3)), np.zeros((height, width))
    margin = shades.margin

    def draw(rows: NDArray[np.int64]) -> tuple[int, FloatArray, FloatArray]:
        top, bottom = max(0, int(rows[0]) - 2 * margin), min(height, int(rows[1]))
        patch, slack = np.zeros((max(0, bottom - top), width, 3)), np.zeros((max(0, bottom - top), width))
        for row in range(rows[0], rows[1]):
            records = scan_row(slices, row, wide.width, _WAYS, np.zeros(len(_WAYS) + 2), stage)
            integrate_row(
                records, movers, slices.extent, shades, blur, effort, row, width, height, top, patch, slack
            )  # fmt: skip
        return top, patch, slack

    for section in range(0, wide.height, _SECTION):

        def draw_section(rows: NDArray[np.int64], section: int = section) -> tuple[int, FloatArray, FloatArray]:
            return draw(rows + section)

        for top, patch, slack in over_bands(draw_section, min(_SECTION, wide.height - section)):
            pixels[top : top + len(patch)] += patch
            bound[top : top + len(patch)] += slack
    largest = float(np.abs(colors).max())
    rounding = max(ROUNDING, 8 * 2.0**-52 * max(wide.width, wide.height)) * largest
    if not box:
        rounding = largest * (
            rounding_bound(spec, wide) + QUADRATURE * 64 * (2 * margin + 1) ** 2 * min(1.0, spec.peak)
        )
    return Integral(pixels, np.minimum(bound, span * max(1.0, spec.gain)) + rounding)


def _count(slices: Slices, rows: NDArray[np.int64], width: int) -> FloatArray:
    """Return the number of contacts of a band's pixels, joined for each of `_WAYS`, and the rest of `scan_row`."""
    counts = np.zeros(len(_WAYS) + 2)
    for row in range(rows[0], rows[1]):
        scan_row(slices, row, width, _WAYS, counts, -1)
    return counts


@dataclass(frozen=True, slots=True, eq=False)
class _Slice:
    begin: float
    length: float
    pieces: Pieces


def _slices(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], wide: View, frame: int, colors: FloatArray,
    movers: Movers,
) -> Slices:  # fmt: skip
    """Return slices of the shutter, short where things move fast or come close to the camera."""
    shutter = scene.animation.shutter
    contrasts = np.array([np.abs(colors - c).max() for c in colors[:-1]])
    moving = sum(not m.is_static for m in paths.motions)
    most = int(np.clip(min(4e6 / max(len(faces.corners), 1), 4e4 / max(moving, 1)), 4 * _FIRST, _MOST_SLICES))

    def look(begin: float, length: float) -> _Slice:
        middle = begin + length / 2
        view = view_at(scene.camera, scene.animation, frame, middle, size)
        view = replace(view, width=wide.width, height=wide.height)
        return _Slice(begin, length, pieces_at(faces, paths, view, frame, middle, length))

    done: list[_Slice] = []
    todo = [look(k * shutter / _FIRST, shutter / _FIRST) for k in range(_FIRST)]
    for depth in range(_DEEPEST):
        split = [s for s in todo if _is_long(s, faces, contrasts, certain=False)]
        if len(done) + len(todo) + len(split) > most or depth > 8:
            # few slices more than are worth their cost, for what cannot be followed otherwise
            split = [s for s in split if _is_long(s, faces, contrasts, certain=True)]
            if len(done) + len(todo) + len(split) > 2 * most:
                split = []
        halved = set(map(id, split))
        done += [s for s in todo if id(s) not in halved]
        todo = [look(s.begin + k * s.length / 2, s.length / 2) for s in split for k in (0, 1)]
        if not todo:
            break
    return _join(scene, paths, wide, frame, sorted(done + todo, key=lambda s: s.begin), contrasts, movers)


def _is_long(one: _Slice, faces: Faces, contrasts: FloatArray, *, certain: bool) -> bool:
    """Return whether a slice should be halved; `certain`: whether it must be, for outlines to be followed."""
    p = one.pieces
    most = 8.0 if certain else _WAY_PX
    if (p.loose_speeds[contrasts[faces.owners[p.loose]] > 0.0] * one.length >= most).any():
        return True
    moves = p.outlined & np.repeat(contrasts[p.owners] > 0.0, np.diff(p.starts))
    return bool((p.reach[moves] * one.length >= most).any())


def _join(
    scene: Scene, paths: Paths, view: View, frame: int, parts: list[_Slice], contrasts: FloatArray, movers: Movers
) -> Slices:
    pieces = join_pieces([s.pieces for s in parts])
    distinct = {m: k for k, m in enumerate(dict.fromkeys(m for m in paths.motions if not m.is_static))}
    kinds = np.array([-1 if m.is_static else distinct[m] for m in paths.motions], np.int64)
    turns = np.concatenate(
        [np.zeros(0), *(_turns(paths, frame, s)[s.pieces.owners] for s in parts if len(s.pieces.owners))]
    )
    size = len(pieces.owners)
    camera = np.array([view.scale, view.width / 2, view.height / 2])
    slices = Slices(
        np.array([s.begin for s in parts]), np.array([s.length for s in parts]), pieces.points, pieces.reach,
        pieces.outlined, pieces.starts, pieces.planes, pieces.owners, pieces.faces, pieces.instants, pieces.loose,
        pieces.loose_speeds, np.cumsum([0] + [len(s.pieces.loose) for s in parts]).astype(np.int64),
        np.empty(len(pieces.points)), np.empty(size), np.empty(size), np.empty(size), np.empty(size), turns, kinds,
        contrasts, camera, view.perspective, depth_extent(scene),
    )  # fmt: skip
    describe_pieces(slices)
    measure_across(slices, movers)
    return slices


def _turns(paths: Paths, frame: int, one: _Slice) -> FloatArray:
    """Return bounds on the angular speeds of all objects against the camera, radians per frame interval.

    A plane's normal follows the inverse transposed of its matrix M, and turns at most at |M'| over the least singular
    value that M has in the slice.
    """
    turns = np.full(len(paths.motions), paths.camera_turn(frame))
    for index, motion in enumerate(paths.motions):
        if motion.is_static:
            continue
        if paths.interpolated or motion.matrices is not None:
            change = float(
                np.linalg.norm((paths.matrix(motion, frame, 1.0) - paths.matrix(motion, frame, 0.0))[:3, :3])
            )
            middle = paths.matrix(motion, frame, one.begin + one.length / 2)[:3, :3]
            least = float(np.linalg.svd(middle, compute_uv=False)[-1]) - change * one.length / 2
            turns[index] += (change / least if least > 0.0 else np.inf) if change > 0.0 else 0.0
        elif motion.spin is not None:
            turns[index] += 2 * np.pi * abs(motion.spin.rev_per_s) / paths.animation.fps
    return turns
