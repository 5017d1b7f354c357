"""Glossy reflection on planes: what each glossy polygon mirrors is drawn first, as one facet's normal turns it.

A pass draws one normal h of the facets for all pixels, from their own distribution D cos_h (independent of the viewer),
draws the scene where a plane of such facets shows it (`virtual_images`), with the pass's own camera, and lets each
fragment of the polygon fetch its pixel there, times colour and G2 (i . h) / (cos_i cos_h). That is the BRDF's estimator
at every pixel; at a roughness near 0 it is the mirror itself. There is one reflection: glossy surfaces seen in a glossy
one are black. Each glossy polygon takes one drawing of the scene and a picture of its own. With hardware samples gloss
is evaluated once a pixel.

Against the ray tracer on `glossy-floor` at 120 x 90, means of 6 times 1024 samples: at roughnesses of .02, .05, .1 and
.3 the pictures differ by 5.9, 7.0, 7.2 and 7.9e-4 in the root mean square, of which noise explains 5.8, 6.7, 7.5 and
7.9e-4. What is left is below 2e-4, and edges account for as much.
"""

from contextlib import ExitStack
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.geometry import LAYER_STEP, Body
from aliasbench.renderers.lights import OFF_SURFACE
from aliasbench.renderers.raster.cutting import cut_side
from aliasbench.renderers.raster.graphics import GraphicsContext, GraphicsError, read_shader
from aliasbench.renderers.raster.minification import Shading, piece_coordinates
from aliasbench.renderers.raster.projection import DepthRule, Window, view_matrix
from aliasbench.renderers.raster.shaders import scene_shader
from aliasbench.renderers.raster.surfaces import Surfaces, Uniforms
from aliasbench.renderers.raster.targets import Surface as Drawing
from aliasbench.renderers.raster.virtual_images import Mirror, refine
from aliasbench.renderers.raytrace.scattering import frame_of
from aliasbench.renderers.sampling.discs import disc_point
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.model import FloatArray, Scene, Vec2
from aliasbench.scenes.projection import View

_VERTEX = np.dtype([("position", "3f4"), ("texcoord", "2f4"), ("color", "3f4"), ("nearer", "f4"), ("triangle", "i4")])
_SMOOTHEST = 1e-6  # as in the ray tracer
_LEAST_SLOPE = 1e-6  # of a facet against its plane; one more upright shows nothing
_STRAIGHT_PX = 0.05  # how far off an edge's middle may appear
_SPREAD = 2.0  # roughnesses: tan of the facets that edges are made straight for; four fifths are less inclined


def check_gloss(scene: Scene) -> None:
    """Raise UnsupportedScene for glossy objects that are no polygons."""
    for index, surface in enumerate(scene.objects):
        if surface.material.kind == "glossy" and not surface.is_polygon:
            raise UnsupportedScene(
                f"raster: material glossy on a mesh (object {surface.name or f'number {index}'}) is not drawn; "
                "on polygons it is, each being a plane"
            )


def facet(roughness: float, numbers: Vec2, normal: FloatArray) -> FloatArray:
    """Return the normal of a facet, drawn with density D(h) cos_h about a unit normal.

    A uniform disc lifted to the hemisphere and stretched by the roughness: tan^2 = alpha^2 r^2 / (1 - r^2), as for the
    GGX's D. Facing a surface the ray tracer draws the same facets of the same numbers.
    """
    alpha = max(roughness, _SMOOTHEST)
    x, y = disc_point(*numbers)
    tangent, bitangent = (np.array(v) for v in frame_of(*normal))
    upright = np.sqrt(max(1.0 - x * x - y * y, 0.0))
    half = alpha * (x * tangent + y * bitangent) + upright * normal
    out: FloatArray = half / np.linalg.norm(half)
    return out


class _Batch:
    """The triangles with one texture that a mirror shows, on the device."""

    def __init__(self, array: moderngl.VertexArray, buffer: moderngl.Buffer, shading: Shading) -> None:
        self.array, self.buffer, self.shading = array, buffer, shading

    def release(self) -> None:
        self.array.release()
        self.buffer.release()


class Glossy:
    """One glossy polygon: the picture of what it mirrors, and how it shows it."""

    def __init__(
        self,
        context: GraphicsContext,
        scene: Scene,
        number: int,
        size: tuple[int, int],
        rule: DepthRule,
        made: ExitStack,
    ) -> None:
        self._context, self._scene, self.number = context, scene, number
        self._drawing = Drawing(context, size, 1, rule, made)
        self._batches: list[_Batch] = []
        self._key: tuple[object, ...] = ()
        self._mirror: Mirror | None = None
        self._half = np.zeros(3)

    def update(
        self,
        surfaces: Surfaces,
        batches: dict[str | None, tuple[moderngl.Program, Shading]],
        bodies_nearer: FloatArray,
        uniforms: Uniforms,
        numbers: Vec2,
        view: View,
        window: Window,
        jitter: Vec2,
        frame: int,
    ) -> None:
        """Draw what it mirrors in a pass."""
        self._mirror = mirror = _make_mirror(surfaces, self.number, view)
        self._drawing.begin(self._scene.background)
        if mirror is None:
            return
        roughness = self._scene.objects[self.number].material.roughness
        self._half = facet(roughness, numbers, mirror.normal)
        if float(self._half @ mirror.normal) < _LEAST_SLOPE:
            self._mirror = None
            return
        key = (surfaces.version, frame, tuple(np.sign(mirror.normal).tolist()), view.width, view.height)
        if key != self._key:
            self._key = key
            self._upload(surfaces, batches, bodies_nearer, mirror, roughness, view)
        reach = 4.0 * (1.0 + float(np.abs(mirror.eye).max())) * surfaces.unit
        move = np.eye(4)
        move[:3, :3] *= surfaces.unit
        move[:3, 3] = surfaces.anchor - view.origin
        clip = view_matrix(view, reach, jitter, window) @ move
        values: Uniforms = {
            **uniforms,
            **self._uniforms(mirror),
            "clip_from_pass": tuple(clip.T.ravel().tolist()),
            "parallel_shift": tuple(mirror.parallel_shift(self._half).tolist()),
            "eye_height": 0.0 if mirror.direction is not None else mirror.eye_height,
            "image": 1,
        }
        for batch in self._batches:
            program = batch.array.program
            for name, value in {**batch.shading.uniforms, **values}.items():
                if name in program:
                    program[name] = value
            if batch.shading.image is not None:
                batch.shading.image.use(1)
            batch.array.render(moderngl.TRIANGLES)

    def _uniforms(self, mirror: Mirror) -> Uniforms:
        plane = (*mirror.normal.tolist(), mirror.offset)
        return {"mirror_plane": plane, "mirror_half": tuple(self._half.tolist())}

    def use(self, slot: int) -> Uniforms:
        """Bind its picture; return the uniforms of the polygon's own shader."""
        self._drawing.color.use(slot)
        alpha = max(self._scene.objects[self.number].material.roughness, _SMOOTHEST)
        if self._mirror is None:
            # nothing is in front of such a plane
            return {"mirror": slot, "roughness": alpha, "mirror_plane": (0.0,) * 4, "mirror_half": (0.0,) * 3}
        return {"mirror": slot, "roughness": alpha, **self._uniforms(self._mirror)}

    def _upload(
        self,
        surfaces: Surfaces,
        batches: dict[str | None, tuple[moderngl.Program, Shading]],
        bodies_nearer: FloatArray,
        mirror: Mirror,
        roughness: float,
        view: View,
    ) -> None:
        self._free()
        triangles = _before(surfaces, mirror, self.number)
        tilts = _SPREAD * max(roughness, _SMOOTHEST) * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
        tangent, bitangent = (np.array(v) for v in frame_of(*mirror.normal))
        halves = mirror.normal + tilts[:, :1] * tangent + tilts[:, 1:] * bitangent
        halves /= np.linalg.norm(halves, axis=1, keepdims=True)
        tolerance = _STRAIGHT_PX / view.scale / (1.0 if view.perspective else surfaces.unit)
        triangles = refine(mirror, triangles, halves, tolerance)
        numbers = triangles[:, 0, 5].astype(np.int64)
        # as they would be drawn: the later of equally near ones wins
        order = np.argsort(numbers, kind="stable")
        triangles, numbers = triangles[order], numbers[order]
        owners = surfaces.owners[numbers]
        colors = np.array([o.color for o in self._scene.objects])
        for name, (program, shading) in batches.items():
            mine = np.array([o.texture == name for o in self._scene.objects])[owners]
            if not mine.any():
                continue
            vertices = np.zeros((int(mine.sum()), 3), _VERTEX)
            vertices["position"] = triangles[mine][..., :3]
            nearest = np.zeros(len(vertices), np.int64)
            vertices["texcoord"] = piece_coordinates(shading, triangles[mine][..., 3:5], nearest)
            vertices["color"] = colors[owners[mine]][:, None]
            vertices["nearer"] = bodies_nearer[numbers[mine]][:, None]
            vertices["triangle"] = numbers[mine][:, None]
            buffer = self._context.gl.buffer(vertices.tobytes())
            self._batches.append(_Batch(_make_array(self._context, program, buffer), buffer, shading))

    def _free(self) -> None:
        for batch in self._batches:
            batch.release()
        self._batches = []

    def release(self) -> None:
        """Free everything."""
        self._free()
        self._drawing.release()


class Gloss:
    """All glossy polygons of a scene; made and used inside the context's `use`."""

    def __init__(
        self,
        context: GraphicsContext,
        scene: Scene,
        bodies: tuple[Body, ...],
        surfaces: Surfaces,
        order: NDArray[np.int64],
        shadings: dict[str | None, Shading],
        size: tuple[int, int],
        rule: DepthRule,
        defined: tuple[str, ...],
        text: str,
    ) -> None:
        self._surfaces = surfaces
        perspective = scene.camera.projection == "perspective"
        layers = np.concatenate([np.full(len(b.triangles), b.layer) for b in bodies])[order]
        closer = 1.0 - LAYER_STEP * layers
        self._nearer = 1.0 / closer if perspective else closer
        marked = (*defined, "MIRRORED")
        before = read_shader("gloss.glsl") + text
        used = dict.fromkeys(o.texture for o in scene.objects)
        # what is mirrored is a picture of one sample a pixel: its holes are cut
        shadings = {name: replace(shading, is_coverage=False) for name, shading in shadings.items()}
        self._programs = {
            name: (
                context.program(
                    scene_shader("mirror.vert.glsl", shadings[name], marked),
                    scene_shader("scene.frag.glsl", shadings[name], marked, before),
                ),
                shadings[name],
            )
            for name in used
        }
        numbers = [k for k, o in enumerate(scene.objects) if o.material.kind == "glossy"]
        with ExitStack() as made:
            try:
                self.polygons = {k: Glossy(context, scene, k, size, rule, made) for k in numbers}
                context.check("making pictures of what is mirrored")
            except (moderngl.Error, GraphicsError) as error:
                context.gl.clear_errors()
                raise InputError(
                    f"{len(numbers)} glossy polygons: this device ({context.renderer}) cannot hold a picture of "
                    f"{size[0]}x{size[1]} pixels for each ({error}); choose a smaller size"
                ) from None
            made.pop_all()

    def update(self, uniforms: Uniforms, numbers: Vec2, view: View, window: Window, jitter: Vec2, frame: int) -> None:
        """Draw what all of them mirror in a pass."""
        for polygon in self.polygons.values():
            polygon.update(self._surfaces, self._programs, self._nearer, uniforms, numbers, view, window, jitter, frame)

    def release(self) -> None:
        """Free everything."""
        for polygon in self.polygons.values():
            polygon.release()


def _make_mirror(surfaces: Surfaces, number: int, view: View) -> Mirror | None:
    """Return a polygon's plane from the viewer's side; None where the viewer lies in it."""
    corners = surfaces.corners[surfaces.owners == number]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    largest = int(np.argmax(np.linalg.norm(normals, axis=1)))
    length = float(np.linalg.norm(normals[largest]))
    if length == 0.0:
        return None
    normal = normals[largest] / length
    offset = float(normal @ corners[largest, 0])
    eye = (view.origin - surfaces.anchor) / surfaces.unit
    direction = None if view.perspective else view.ray(np.zeros(1), np.zeros(1))[1][0]
    if direction is not None:
        direction = direction / np.linalg.norm(direction)
    side = float(normal @ eye) - offset if direction is None else -float(normal @ direction)
    if side == 0.0:
        return None
    sign = 1.0 if side > 0.0 else -1.0
    return Mirror(sign * normal, sign * offset, eye, direction)


def _before(surfaces: Surfaces, mirror: Mirror, number: int) -> FloatArray:
    """Return what lies before a polygon's plane, cut: (m, 3, 6) places, uv and numbers of triangles."""
    heights = surfaces.corners @ mirror.normal - mirror.offset
    reach = np.abs(surfaces.corners).max(axis=(1, 2))
    numbers = np.flatnonzero((heights.max(axis=1) > OFF_SURFACE * reach) & (surfaces.owners != number))
    corners = np.concatenate(
        [
            surfaces.corners[numbers],
            np.ones((len(numbers), 3, 1)),
            surfaces.uv[numbers],
            np.broadcast_to(numbers[:, None, None], (len(numbers), 3, 1)),
        ],
        axis=2,
    )
    cut, _ = cut_side(corners, surfaces.owners[numbers], (*mirror.normal, -mirror.offset))
    out: FloatArray = cut[..., [0, 1, 2, 4, 5, 6]]
    return out


def _make_array(context: GraphicsContext, program: moderngl.Program, buffer: moderngl.Buffer) -> moderngl.VertexArray:
    # names the shader does not use are left out of a linked program
    formats = {"position": ("3f4", "12x"), "texcoord": ("2f4", "8x"), "color": ("3f4", "12x")}
    formats |= {"nearer": ("1f4", "4x"), "triangle": ("1i4", "4x")}
    layout = " ".join(f[0] if n in program else f[1] for n, f in formats.items())
    return context.gl.vertex_array(program, [(buffer, layout, *(n for n in formats if n in program))])
