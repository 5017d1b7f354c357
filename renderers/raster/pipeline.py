"""What lies on the device for one prepared scene: vertices, matrices, textures and programs.

All bodies share one vertex buffer and every vertex knows its body, whose matrix it finds in a small float texture: a
pass over hundreds of bodies that all move differently is still one upload and one draw for each texture in use.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.geometry import Body
from aliasbench.renderers.raster.alpha_coverage import ALPHA_TO_COVERAGE, coverage_excess
from aliasbench.renderers.raster.answers import make_light
from aliasbench.renderers.raster.graphics import GraphicsContext
from aliasbench.renderers.raster.guard import BoolArray, Pieces
from aliasbench.renderers.raster.minification import (
    Shading,
    make_shading,
    piece_coordinates,
    shader_coordinates,
)
from aliasbench.renderers.raster.projection import pack_matrices
from aliasbench.renderers.raster.shaders import scene_shader
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray, Scene

_MOST_REPEATS = 2.0**21  # from the middle of a surface: float32 is a quarter apart there
BODIES_PER_ROW = 1024  # as in scene.vert.glsl
_VERTEX = np.dtype([("position", "3f4"), ("texcoord", "2f4"), ("color", "3f4"), ("body", "i4"), ("triangle", "i4")])


@dataclass(frozen=True, slots=True, eq=False)
class _Batch:
    """The triangles with one texture, (m, 3) vertex numbers in `triangles`, and the object of each in `owners`.

    A glossy object, then named by `gloss`, is one of its own.
    """

    array: moderngl.VertexArray
    index: moderngl.Buffer
    shading: Shading
    triangles: NDArray[np.int32]
    owners: NDArray[np.int32]
    gloss: int | None


class SceneBuffers:
    """A scene's bodies on the device, drawn with `draw`; made and used inside the context's `use`."""

    shaders: ClassVar[tuple[str, str]] = ("scene.vert.glsl", "scene.frag.glsl")
    answers_light: ClassVar[bool] = True

    def __init__(
        self,
        context: GraphicsContext,
        scene: Scene,
        bodies: Sequence[Body],
        technique: Technique,
        size: tuple[int, int],
    ) -> None:
        gl = context.gl
        self._context = context
        texture_names = [s.texture for s in scene.objects]
        shadings = {
            name: make_shading(gl, scene, name, technique, context.max_texture_size)
            for name in dict.fromkeys(texture_names)
        }
        self.light = make_light(context, scene, bodies, technique, shadings, size) if self.answers_light else None
        vertices, triangles, surfaces = _gather(
            scene, bodies, [shadings[n] for n in texture_names], apart=self.light is not None
        )
        self._vertices = gl.buffer(vertices.tobytes()) if len(vertices) else None
        self._batches: list[_Batch] = []
        self._colors = np.array([s.color for s in scene.objects]).reshape(-1, 3)
        self._left_out = np.zeros(len(scene.objects), dtype=bool)
        self._is_coarse = _coarse_objects(vertices, triangles, surfaces, [shadings[n] for n in texture_names])
        glossy = [k if s.material.kind == "glossy" else None for k, s in enumerate(scene.objects)]
        kinds = list(zip(texture_names, glossy, strict=True))
        for name, gloss in dict.fromkeys(kinds):
            chosen = np.array([kind == (name, gloss) for kind in kinds], dtype=bool)[surfaces]
            if chosen.any():
                self._batches.append(self._make_batch(triangles[chosen], surfaces[chosen], shadings[name], gloss))
        self._shadings = tuple(shadings.values())
        if any(s.is_coverage for s in self._shadings):
            excess = coverage_excess(context, technique.msaa)
            for shading in self._shadings:
                shading.uniforms["coverage_excess"] = excess
        # bodies, and their pieces; a texture has at least one
        count = max(2 * len(bodies), 1)
        rows = -(-count // BODIES_PER_ROW)
        if rows > context.max_texture_size:
            raise InputError(f"{len(bodies)} bodies: this device takes {context.max_texture_size * BODIES_PER_ROW}")
        self._row_length = min(count, BODIES_PER_ROW)
        self._matrices = gl.texture((4 * self._row_length, rows), 4, dtype="f4")
        self._matrices.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def _make_batch(
        self, triangles: NDArray[np.int32], owners: NDArray[np.int32], shading: Shading, gloss: int | None
    ) -> _Batch:
        defined, before = ((), "") if self.light is None else self.light.shader(gloss)
        vertex, fragment = self.shaders
        program = self._context.program(
            scene_shader(vertex, shading, defined), scene_shader(fragment, shading, defined, before)
        )
        index = self._context.gl.buffer(np.ascontiguousarray(triangles).tobytes())
        array = self._make_array(program, self._vertices, index)
        return _Batch(array, index, shading, triangles, owners, gloss)

    def _make_array(
        self, program: moderngl.Program, vertices: moderngl.Buffer | None, index: moderngl.Buffer | None
    ) -> moderngl.VertexArray:
        # names the shader does not use are left out of a linked program
        used = [n if n in program else None for n in _VERTEX.names or ()]
        sizes = {"position": "3f4", "texcoord": "2f4", "color": "3f4", "body": "1i4", "triangle": "1i4"}
        padding = {"3f4": "12x", "2f4": "8x", "1i4": "4x"}
        layout = " ".join(sizes[n] if u else padding[sizes[n]] for n, u in zip(sizes, used, strict=True))
        return self._context.gl.vertex_array(program, [(vertices, layout, *(u for u in used if u))], index)

    def draw(
        self,
        matrices: FloatArray,
        tilts: FloatArray,
        pieces: Pieces | None = None,
        far: BoolArray | None = None,
    ) -> None:
        """Draw into the bound target every body with its matrix (n, 4, 4), the far objects as pieces instead.

        `tilts` (n,) are added to depth values.
        """
        if not self._batches:
            return
        coarse = self._is_coarse if far is None else self._is_coarse & ~far
        if coarse.any():
            raise InputError(
                f"object {int(np.argmax(coarse))}: its texture repeats so often that the rasterizer's 32-bit "
                f"coordinates cannot tell one from the next (over {_MOST_REPEATS:.0e} times); divide the surface"
            )
        self._leave_out(far)
        count = len(matrices)
        if pieces is not None:
            matrices = np.concatenate([matrices, np.broadcast_to(pieces.matrix, matrices.shape)])
            tilts = np.tile(tilts, 2)
        if tilts.any():
            matrices = matrices.copy()
            matrices[:, 2] += tilts[:, None] * matrices[:, 3]
        self._matrices.write(pack_matrices(matrices, self._row_length, self._matrices.height).tobytes())
        self._matrices.use(0)
        placing = {} if self.light is None else self.light.use()
        for batch in self._batches:
            program = batch.array.program
            values = {**batch.shading.uniforms, "matrices": 0, "image": 1, **placing}
            if self.light is not None and batch.gloss is not None:
                values |= self.light.use_mirror(batch.gloss)
            for name, value in values.items():
                if name in program:
                    program[name] = value
            if batch.shading.image is not None:
                batch.shading.image.use(1)
            if batch.shading.is_coverage:
                self._context.gl.enable_direct(ALPHA_TO_COVERAGE)
            kept = len(batch.triangles) if far is None else int(np.count_nonzero(~far[batch.owners]))
            if kept:
                batch.array.render(moderngl.TRIANGLES, vertices=3 * kept)
            if pieces is not None:
                self._draw_pieces(batch, pieces, first=count)
            if batch.shading.is_coverage:
                self._context.gl.disable_direct(ALPHA_TO_COVERAGE)

    def _leave_out(self, far: BoolArray | None) -> None:
        """Make the index buffers those of all objects but the far ones."""
        wanted = np.zeros_like(self._left_out) if far is None else far
        if np.array_equal(wanted, self._left_out):
            return
        for batch in self._batches:
            batch.index.write(np.ascontiguousarray(batch.triangles[~wanted[batch.owners]]).tobytes())
        self._left_out = wanted.copy()

    def _draw_pieces(self, batch: _Batch, pieces: Pieces, first: int) -> None:
        """Draw those of a batch's objects; `first` is the number of the first body's matrix for pieces."""
        chosen = np.isin(pieces.surfaces, batch.owners)
        if not chosen.any():
            return
        vertices = np.zeros((int(chosen.sum()), 3), _VERTEX)
        vertices["position"], vertices["body"] = pieces.corners[chosen], first + pieces.bodies[chosen][:, None]
        vertices["color"] = self._colors[pieces.surfaces[chosen]][:, None]
        if self.light is not None:
            vertices["triangle"] = self.light.ranks[pieces.triangles[chosen]][:, None]
        vertices["texcoord"] = piece_coordinates(batch.shading, pieces.uv[chosen], pieces.nearest[chosen])
        buffer = self._context.gl.buffer(vertices.tobytes())
        array = self._make_array(batch.array.program, buffer, None)
        array.render(moderngl.TRIANGLES)
        array.release()
        buffer.release()

    def release(self) -> None:
        """Free everything on the device (programs are the context's and stay)."""
        for batch in self._batches:
            batch.array.release()
            batch.index.release()
        for shading in self._shadings:
            if shading.image is not None:
                shading.image.release()
        self._matrices.release()
        if self.light is not None:
            self.light.release()
        if self._vertices is not None:
            self._vertices.release()


def _gather(
    scene: Scene, bodies: Sequence[Body], shadings: Sequence[Shading], *, apart: bool
) -> tuple[NDArray[np.void], NDArray[np.int32], NDArray[np.int32]]:
    """Return the vertices of all bodies, (m, 3) triangles in the objects' order, and each triangle's object.

    With `apart` every triangle has vertices of its own, which know its number.
    """
    starts = np.cumsum([0, *(len(b.vertices) for b in bodies)])
    vertices = np.zeros(starts[-1], _VERTEX)
    for number, body in enumerate(bodies):
        part = vertices[starts[number] : starts[number + 1]]
        part["position"], part["body"] = body.vertices, number
        for surface in np.unique(body.surfaces):
            mine = np.unique(body.triangles[body.surfaces == surface])
            part["color"][mine] = scene.objects[surface].color
            part["texcoord"][mine] = shader_coordinates(shadings[surface], body.uv[mine])
    triangles = [b.triangles + start for b, start in zip(bodies, starts, strict=False)]
    surfaces = [b.surfaces for b in bodies]
    if not bodies:
        return vertices, np.zeros((0, 3), np.int32), np.zeros(0, np.int32)
    owner = np.concatenate(surfaces)
    order = np.argsort(owner, kind="stable")
    joined, owner = np.concatenate(triangles).astype(np.int32)[order], owner[order].astype(np.int32)
    if apart:
        vertices = vertices[joined.ravel()]
        joined = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
        vertices["triangle"] = np.arange(len(joined), dtype=np.int32).repeat(3)
    return vertices, joined, owner


def _coarse_objects(
    vertices: NDArray[np.void],
    triangles: NDArray[np.int32],
    surfaces: NDArray[np.int32],
    shadings: Sequence[Shading],
) -> BoolArray:
    """Return which objects have an analytic texture with coordinates that float32 does not resolve."""
    out = np.zeros(len(shadings), dtype=bool)
    if len(triangles):
        largest = np.abs(vertices["texcoord"]).max(axis=1)[triangles].max(axis=1)
        beyond = np.unique(surfaces[largest > _MOST_REPEATS])
        out[beyond] = [shadings[k].periodic and shadings[k].kind not in ("PLAIN", "IMAGE") for k in beyond]
    return out
