"""Pictures of scenes with lights at one instant: what is exact stays exact, what is lit carries a bound.

Lights are quads like any other (radiance in front, black behind): they are seen, hide and shadow, and come after all
objects where they lie in one plane with them. All that is not lit is drawn by the exact references for flat or textured
scenes, with lit objects black; `lit_cells` adds the light. Irradiance is closed at a point (`irradiance`), so only the
pixel is integrated. The bound rests on two Gauss rules on parts where nothing can hide between their nodes.

For averages over a lens or time `sample_lit` gives unbiased estimates from a few points a pixel of the same pictures.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_jacobi, roots_legendre

from aliasbench.renderers.reference.coverage import cover_rows
from aliasbench.renderers.reference.faces import Faces, build_faces
from aliasbench.renderers.reference.filtered import add_filtered, is_pixel_box, wide_view
from aliasbench.renderers.reference.flat import Integral, depth_extent, over_bands, palette, scene_extent
from aliasbench.renderers.reference.lit_cells import Rules, lit_rows
from aliasbench.renderers.reference.lit_points import point_rows
from aliasbench.renderers.reference.occluders import Links, link_lights
from aliasbench.renderers.reference.paths import Paths, scene_paths
from aliasbench.renderers.reference.pieces import Pieces, pieces_at
from aliasbench.renderers.reference.runs import BILINEAR
from aliasbench.renderers.reference.shading import COATED, LIT, SHOWN, Stage
from aliasbench.renderers.reference.texture_tables import TextureTable, texture_table
from aliasbench.renderers.reference.textured import draw_textured, instant_of
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.scenes.model import FloatArray, Light, Scene, Surface, read_only
from aliasbench.scenes.projection import View

TARGET = 2e-6  # a pixel of few cells errs by less
CELLS = 4e6  # of a picture, some 20 to 50 microseconds each
_FEWEST_CELLS = 30.0  # to a pixel
_CLOSE = 1e-9  # as `slabs.TIE`
_TINY = 1e-12  # of how far from the origin things are: as near to a plane as its points are known to lie in it
_ROUNDING = 1e-11


@dataclass(frozen=True, slots=True, eq=False)
class Lighting:
    """A scene with lights at one instant and in one view, ready to be integrated or sampled.

    Attributes
    ----------
    scene, faces, paths
        With the lights as objects, in the colour of the side that is seen, and lit objects black.
    view : View
        As wide as filters reach.
    pieces : Pieces
        In that view; owners are faces.
    stage : Stage
    links : Links
    base : (h, w, 3) float64 or None
        All that is exact of the picture (`Stage.modes` tells what is not in it).
    bound : float
        Of the base.
    """

    scene: Scene
    faces: Faces
    paths: Paths
    view: View
    pieces: Pieces
    stage: Stage
    links: Links
    base: FloatArray
    bound: float


def draw_lit(
    scene: Scene, faces: Faces, paths: Paths, view: View, frame: int, fraction: float, spec: FilterSpec, *,
    linear: bool = False, target: float = TARGET,
) -> Integral:  # fmt: skip
    """Return the filtered picture at one instant of a scene with lights, with a bound for every pixel.

    Parameters
    ----------
    scene, faces, paths
        Without the lights among the faces; unlit and diffuse materials.
    view : View
        The camera at that instant; its axes may be sheared, for a point of a lens.
    frame, fraction
        The instant, see `scenes.motion`.
    spec : FilterSpec
    linear : bool
        Whether images are blends of their texels.
    target : float
        What a pixel should err by; the bound says what it does, more where the work it takes is more than
        `CELLS` allows.

    Returns
    -------
    Integral
        The bound is the sum over the parts of a pixel of the difference of two rules, and all that a part can show
        where work has run out.
    """
    return integrate(light_scene(scene, faces, paths, view, frame, fraction, spec, linear=linear), spec, target)


def sample_lit(
    scene: Scene, faces: Faces, paths: Paths, view: View, frame: int, fraction: float, spec: FilterSpec, points: int,
    seed: int, *, linear: bool = False,
) -> FloatArray:  # fmt: skip
    """Return an unbiased estimate (h, w, 3) of the same picture, from stratified points: `points` to a pixel's area."""
    lighting = light_scene(scene, faces, paths, view, frame, fraction, spec, linear=linear)
    return sample(lighting, spec, points, seed, frame)


def integrate(lighting: Lighting, spec: FilterSpec, target: float = TARGET) -> Integral:
    """Return the picture that `light_scene` prepared, with a bound for every pixel."""
    view, pieces, stage = lighting.view, lighting.pieces, lighting.stage
    margin = spec.margin if not is_pixel_box(spec) else 0
    height, width = lighting.base.shape[:2]
    pixels, bound = lighting.base.copy(), np.full((height, width), lighting.bound)
    if not (stage.modes != SHOWN).any():
        return Integral(pixels, bound)
    rules = cubature(spec, target, height * width)
    extent, tiny = depth_extent(lighting.scene), _TINY * scene_extent(lighting.scene)

    def draw(rows: NDArray[np.int64]) -> tuple[int, FloatArray, FloatArray]:
        top, bottom = max(0, int(rows[0]) - 2 * margin), min(height, int(rows[1]))
        patch, doubt = np.zeros((max(0, bottom - top), width, 3)), np.zeros((max(0, bottom - top), width))
        lit_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, extent, tiny, stage, lighting.links, rules,
            rows, top, patch, doubt,
        )  # fmt: skip
        return top, patch, doubt

    for top, patch, doubt in over_bands(draw, view.height):
        pixels[top : top + len(patch)] += patch
        bound[top : top + len(patch)] += doubt
    largest = float(np.abs(stage.radiance).max(initial=0.0)) * float(np.abs(stage.colors).max()) * spec.gain
    return Integral(pixels, bound + _ROUNDING * largest)


def sample(lighting: Lighting, spec: FilterSpec, points: int, seed: int, frame: int) -> FloatArray:
    """Return an unbiased estimate (h, w, 3) of the picture that `light_scene` prepared."""
    view, pieces, stage = lighting.view, lighting.pieces, lighting.stage
    out = lighting.base.copy()
    if not (stage.modes != SHOWN).any():
        return out
    margin = spec.margin if not is_pixel_box(spec) else 0
    rules = cubature(spec, TARGET, 1)
    extent, tiny = depth_extent(lighting.scene), _TINY * scene_extent(lighting.scene)
    height = len(out)

    def draw(rows: NDArray[np.int64]) -> tuple[int, FloatArray]:
        top, bottom = max(0, int(rows[0]) - 2 * margin), min(height, int(rows[1]))
        patch = np.zeros((max(0, bottom - top), out.shape[1], 3))
        point_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, extent, tiny, stage, lighting.links, rules,
            points, seed, frame, rows, top, patch,
        )  # fmt: skip
        return top, patch

    for top, patch in over_bands(draw, view.height):
        out[top : top + len(patch)] += patch
    return out


def light_scene(
    scene: Scene, faces: Faces, paths: Paths, view: View, frame: int, fraction: float, spec: FilterSpec, *, linear: bool
) -> Lighting:  # fmt: skip
    """Return a scene with lights at one instant, ready for `integrate` and `sample`; see `draw_lit`."""
    view = wide_view(view, spec) if not is_pixel_box(spec) else view
    lights = _in_front(scene.lights)
    quads = np.array([light.quad for light in lights], dtype=np.float64).reshape(-1, 4, 3) - view.origin
    light_planes = np.array([_plane(q) for q in quads]).reshape(-1, 4)
    eye, sight = _sight(view)
    seen = [bool((p[:3] @ eye - p[3] if view.perspective else -p[:3] @ sight) > 0.0) for p in light_planes]
    lit_scene, lit_faces, lit_paths = _with_lights(scene, faces, paths, lights, seen)
    table = texture_table(lit_scene, linear=linear)
    world = lit_paths.positions(lit_faces.vertices, lit_faces.ranges, frame, fraction) - view.origin
    numbered = replace(lit_faces, owners=np.arange(len(lit_faces.owners), dtype=np.int64))
    pieces = pieces_at(numbered, lit_paths, view, frame, fraction)
    objects = lit_faces.owners[pieces.owners]
    base, bound, coated = _draw_base(lit_scene, lit_faces, lit_paths, view, frame, fraction, spec, linear=linear)
    lit = np.array([*(o.material.kind == "diffuse" for o in scene.objects), *(False for _ in lights)], bool)[objects]
    modes = np.where(lit, LIT, np.where((table.kinds[objects] >= 0) & coated, COATED, SHOWN)).astype(np.int64)
    stage = _stage(scene, view, table, pieces, objects, modes, light_planes, lights, lit_faces, world, eye, sight)
    links = link_lights(
        world, lit_faces.corners, lit_faces.starts, quads, light_planes, _receivers(pieces, view),
        _piece_planes(stage.normals, lit_faces, world, pieces.owners), pieces.starts, modes == LIT,
        _CLOSE * depth_extent(scene),
    )  # fmt: skip
    return Lighting(lit_scene, lit_faces, lit_paths, view, pieces, stage, links, base, bound)


def cubature(spec: FilterSpec, target: float, pixels: int) -> Rules:
    """Return the rules for a filter: conical products of Gauss rules (Stroud 1971), exact to degrees 7 and 5.

    A filter makes the integrand a product of polynomials, say, and of reach: then to 11 and 9.
    """
    area = is_pixel_box(spec)
    knots = spec.kind.separable and not area
    breaks: FloatArray = np.unique(np.round(np.mod(np.array(spec.knots) + 0.5, 1.0), 12)) if knots else np.zeros(0)
    good, poor = (4, 3) if area else (6, 5)
    peak = 1.0 if area else (spec.peak**2 if spec.kind.separable else 3.0 / (np.pi * spec.radius**2))
    return Rules(
        _conical(good), _conical(poor), np.zeros(0) if area else spec.params.copy(), float(peak),
        0 if area else spec.margin, breaks[(breaks > 0.0) & (breaks < 1.0)], target,
        int(max(_FEWEST_CELLS, CELLS / pixels)),
    )  # fmt: skip


def _conical(n: int) -> FloatArray:
    """Return places and weights (n n, 3) on the triangle (0, 0), (1, 0), (0, 1), exact to degree 2 n - 1."""
    s, ws = roots_jacobi(n, 1.0, 0.0)
    t, wt = roots_legendre(n)
    x, y = (s + 1) / 2, (t + 1) / 2
    places = [(a, (1 - a) * b, u * v / 4) for a, u in zip(x, ws, strict=True) for b, v in zip(y, wt, strict=True)]
    return np.array(places, dtype=np.float64)


def _in_front(lights: tuple[Light, ...]) -> tuple[Light, ...]:
    """Return the lights that have an area."""
    return tuple(light for light in lights if np.isfinite(_plane(np.array(light.quad))).all())


def _plane(quad: FloatArray) -> FloatArray:
    """Return the unit normal of a quad's winding, and the offset of its plane; not finite for one without area."""
    normal = np.cross(quad[2] - quad[0], quad[3] - quad[1])
    length = float(np.linalg.norm(normal))
    if not length > 0.0:
        return np.full(4, np.nan)
    normal = normal / length
    return np.append(normal, normal @ quad.mean(axis=0))


def _sight(view: View) -> tuple[FloatArray, FloatArray]:
    """Return the eye of a perspective view, relative to its origin, and the direction of an orthographic one's rays."""
    axes = np.stack([view.right, view.up, view.forward])
    return np.zeros(3), np.linalg.solve(axes, np.array([0.0, 0.0, 1.0]))


def _with_lights(
    scene: Scene, faces: Faces, paths: Paths, lights: tuple[Light, ...], seen: list[bool]
) -> tuple[Scene, Faces, Paths]:
    """Return a scene with its lights as objects and lit objects black, and its faces and paths."""
    shapes = tuple(
        Surface(
            read_only(np.array(light.quad, dtype=np.float64)),
            read_only(np.array([[0, 1, 2], [0, 2, 3]], np.int32)),
            color=light.radiance if front else (0.0, 0.0, 0.0),
        )
        for light, front in zip(lights, seen, strict=True)
    )
    objects = tuple(
        replace(o, color=(0.0, 0.0, 0.0)) if o.material.kind == "diffuse" else o for o in scene.objects
    )  # fmt: skip
    more = build_faces(replace(scene, objects=shapes))
    n, k = len(faces.vertices), len(faces.corners)
    joined = Faces(
        np.concatenate([faces.vertices, more.vertices]),
        np.concatenate([faces.uv, more.uv]),
        np.concatenate([faces.corners, more.corners + n]),
        np.concatenate([faces.starts, more.starts[1:] + k]),
        np.concatenate([faces.outlined, more.outlined]),
        np.concatenate([faces.spread, more.spread + n]),
        np.concatenate([faces.owners, more.owners + len(scene.objects)]),
        (*faces.ranges, *(slice(r.start + n, r.stop + n) for r in more.ranges)),
    )
    whole = replace(scene, objects=(*objects, *shapes), lights=())
    return whole, joined, replace(scene_paths(whole), interpolated=paths.interpolated)


def _draw_base(
    scene: Scene, faces: Faces, paths: Paths, view: View, frame: int, fraction: float, spec: FilterSpec, *,
    linear: bool,
) -> tuple[FloatArray, float, bool]:  # fmt: skip
    """Return what is exact of a picture, its bound, and whether textures are not in it."""
    box = is_pixel_box(spec)
    coated = any(o.texture is not None and any(o.color) for o in scene.objects)
    if coated and box:
        # what is black here needs no texture
        bare = tuple(o if any(o.color) else replace(o, texture=None) for o in scene.objects)
        seen = replace(scene, objects=bare)
        coats = texture_table(seen, linear=linear)
        exact = draw_textured(instant_of(seen, faces, paths, view, frame, fraction, coats))
        if exact is not None:
            return exact.pixels, float(exact.bound.max()), False
    plain = replace(
        scene,
        objects=tuple(replace(o, color=(0.0, 0.0, 0.0), texture=None) if o.texture else o for o in scene.objects),
    )
    pieces = pieces_at(faces, paths, view, frame, fraction)
    out = np.zeros((view.height - 2 * spec.margin, view.width - 2 * spec.margin, 3))
    if not box:
        return out, add_filtered(plain, view, pieces, np.ones(1), spec, out), coated
    colors, extent = palette(plain), depth_extent(plain)

    def draw(rows: NDArray[np.int64]) -> int:
        return cover_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, pieces.instants, colors, view.perspective,
            extent, np.ones(1), rows, out,
        )  # fmt: skip

    over_bands(draw, view.height)
    rounding = max(1e-12, 8 * 2.0**-52 * max(view.width, view.height)) * float(np.abs(colors).max())
    return out, rounding, coated


def _stage(
    scene: Scene, view: View, table: TextureTable, pieces: Pieces, objects: NDArray[np.int64],
    modes: NDArray[np.int64], light_planes: FloatArray, lights: tuple[Light, ...], faces: Faces, world: FloatArray,
    eye: FloatArray, sight: FloatArray,
) -> Stage:  # fmt: skip
    spread = world[faces.spread[pieces.owners]]
    normals = np.cross(spread[:, 1] - spread[:, 0], spread[:, 2] - spread[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(length > 0.0, length, 1.0)
    towards = (eye - spread[:, 0] if view.perspective else np.broadcast_to(-sight, normals.shape)) * normals
    normals = np.where(towards.sum(axis=1, keepdims=True) < 0.0, -normals, normals)
    colors = palette(scene)
    colors = np.concatenate([colors[:-1], np.zeros((len(lights), 3)), colors[-1:]])
    brightest = np.ones(len(table.kinds))
    for index, kind in enumerate(table.kinds):
        if 0 <= kind <= BILINEAR:
            first, (h, w) = int(table.offsets[index]), (int(n) for n in table.sizes[index])
            brightest[index] = float(np.abs(table.texels[first : first + h * w]).max())
        elif kind > BILINEAR:
            brightest[index] = float(np.abs(table.params[index, :6]).max())
    unproject = np.asarray(np.linalg.inv(np.stack([view.right, view.up, view.forward])), dtype=np.float64)
    return Stage(
        view.perspective, np.array([view.width / 2, view.height / 2]), view.scale, unproject, modes,
        np.ascontiguousarray(objects), np.ascontiguousarray(normals), light_planes,
        np.array([light.radiance for light in lights], dtype=np.float64).reshape(-1, 3), colors, table.kinds,
        table.maps, table.params, table.sizes, table.offsets, table.texels, brightest,
    )  # fmt: skip


def _receivers(pieces: Pieces, view: View) -> FloatArray:
    """Return the corners of pieces in the world, relative to the camera, (k, 3)."""
    counts = np.diff(pieces.starts)
    planes = np.repeat(pieces.planes[:, 0], counts, axis=0)
    near = planes[:, 0] * pieces.points[:, 0] + planes[:, 1] * pieces.points[:, 1] + planes[:, 2]
    a = (pieces.points[:, 0] - view.width / 2) / view.scale
    b = (view.height / 2 - pieces.points[:, 1]) / view.scale
    local = np.stack([a / near, b / near, 1.0 / near] if view.perspective else [a, b, -near], axis=1)
    out: FloatArray = local @ np.linalg.inv(np.stack([view.right, view.up, view.forward])).T
    return out


def _piece_planes(
    normals: FloatArray, faces: Faces, world: FloatArray, face_of: NDArray[np.int64]
) -> FloatArray:  # fmt: skip
    """Return for each piece its normal towards the camera and the offset of its plane, (m, 4)."""
    at = world[faces.spread[face_of, 0]]
    return np.concatenate([normals, (normals * at).sum(axis=1, keepdims=True)], axis=1)
