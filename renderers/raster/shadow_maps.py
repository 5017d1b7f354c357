"""Shadows of scenes with many triangles: depth maps drawn from each of a pass's points on the lights.

A map covers what may hide the light and no more, so its texels are as small as they can be: one picture where all of
that lies within 60 degrees of an axis, else five sides of a cube about the light's normal. It stores depth along its
axis as 32-bit floats. The border of a shadow is a texel off at most; where two surfaces meet a shadow begins about a
texel late, since depths are compared with a bias: what the depth of the lit plane itself changes by within a texel,
known from its normal, and half a texel for its neighbours.
"""

from contextlib import ExitStack
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.raster.graphics import DEPTH32F, GraphicsContext
from aliasbench.renderers.raster.minification import Shading
from aliasbench.renderers.raster.shaders import scene_shader
from aliasbench.scenes.model import FloatArray

RESOLUTION = 2048  # texels across a map
_MOST_TEXELS = 1 << 26  # of all maps of a pass; more of them are smaller
_NARROW = 0.5  # cosine of what one picture takes
_MARGIN = 1e-3  # of a map's width
_NEAR = 2.0**-40  # in units of the pass
_EMPTY = 1e30

FACES = 5  # of a point at most
FACE_TEXELS = 4  # in the table of light points


class Face(NamedTuple):
    """One map: orthonormal axes (3, 3), the last of them where it looks, and its sides at depth 1."""

    axes: FloatArray
    left: float
    bottom: float
    right: float
    top: float


def fit_faces(ways: FloatArray, normal: FloatArray) -> list[Face]:
    """Return maps that show all of triangles at (m, 3, 3) from a light point that shines along `normal`.

    What is behind the light is not lit and need not be shown.
    """
    if not len(ways):
        return []
    points = ways.reshape(-1, 3)
    lengths = np.linalg.norm(points, axis=1, keepdims=True)
    directions = np.divide(points, lengths, out=np.zeros_like(points), where=lengths > 0.0)
    axis = directions.sum(axis=0)
    size = float(np.linalg.norm(axis))
    if size > 0.0 and float((directions @ (axis / size)).min()) > _NARROW:
        axes = _axes(axis / size)
        x, y, z = points @ axes.T[:, 0], points @ axes.T[:, 1], points @ axes.T[:, 2]
        left, right, bottom, top = (x / z).min(), (x / z).max(), (y / z).min(), (y / z).max()
        dx, dy = (_MARGIN * max(right - left, top - bottom, 1e-9) for _ in range(2))
        return [Face(axes, left - dx, bottom - dy, right + dx, top + dy)]
    x_axis, y_axis, z_axis = _axes(normal)
    sides = [(x_axis, y_axis, z_axis)]
    for side, other in ((x_axis, y_axis), (-x_axis, y_axis), (y_axis, x_axis), (-y_axis, x_axis)):
        sides.append((other, z_axis, side))
    # of the sides only the half before the light is lit
    return [Face(np.array(s), -1.0, -1.0 if k == 0 else 0.0, 1.0, 1.0) for k, s in enumerate(sides)]


def _axes(forward: FloatArray) -> FloatArray:
    """Return orthonormal axes of which the last is `forward`."""
    helper = np.eye(3)[int(np.argmin(np.abs(forward)))]
    right = np.cross(helper, forward)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(forward, right), forward])


class ShadowMaps:
    """The maps of all light points of a pass, side by side in one texture; used inside the context's `use`."""

    def __init__(
        self,
        context: GraphicsContext,
        uv: FloatArray,
        holes: list[tuple[Shading, NDArray[np.bool_]]],
        points: int,
    ) -> None:
        self._context, self._points, self._holes = context, points, holes
        self._uv = uv.astype(np.float32)
        gl = context.gl
        self._vertices = gl.buffer(reserve=max(uv.size // 2 * 20, 20))
        self._index = gl.buffer(reserve=max(uv.size // 2 * 4, 4), dynamic=True)
        self._solid = self._make_array(None)
        self._cut = [(self._make_array(shading), shading, mine) for shading, mine in holes]
        self._color: moderngl.Texture | None = None
        self._made = ExitStack()
        self._cells = 0
        self._version = 0

    def _make_array(self, shading: Shading | None) -> moderngl.VertexArray:
        plain = Shading("PLAIN", "POINT", np.zeros((2, 3)), True)
        defined = () if shading is None else ("HOLES",)
        vertex, fragment = (scene_shader(f"shadow_map.{n}.glsl", shading or plain, defined) for n in ("vert", "frag"))
        program = self._context.program(vertex, fragment)
        layout, names = ("3f4 2f4", ("position", "texcoord")) if shading else ("3f4 8x", ("position",))
        return self._context.gl.vertex_array(program, [(self._vertices, layout, *names)], self._index)

    def place(self, corners: FloatArray, version: int) -> None:
        """Take the triangles' places (m, 3, 3) in a pass."""
        if version != self._version:
            self._version = version
            both = np.concatenate([corners.astype(np.float32), self._uv], axis=2)
            self._vertices.write(both.tobytes())

    def draw(
        self, corners: FloatArray, may_hide: NDArray[np.bool_], places: FloatArray, normals: FloatArray
    ) -> list[FloatArray]:
        """Draw the maps of all points; return for each (faces, 4, 4): axes and sides, and where it lies.

        Rows are x axis and left, y axis and bottom, z axis and 1 / width; then column, row, 1 / height and texels
        across.
        """
        faces = [
            fit_faces(corners[mask] - place, normal)
            for mask, place, normal in zip(may_hide, places, normals, strict=True)
        ]
        columns, resolution = self._make_room(max(sum(map(len, faces)), 1))
        out, cell = [], 0
        for mine, mask, place in zip(faces, may_hide, places, strict=True):
            table = np.zeros((len(mine), 4, 4))
            for number, face in enumerate(mine):
                column, row = (resolution * c for c in (cell % columns, cell // columns))
                self._framebuffer.viewport = (column, row, resolution, resolution)
                width, height = face.right - face.left, face.top - face.bottom
                table[number, :3, :3] = face.axes
                table[number, :3, 3] = face.left, face.bottom, 1.0 / width
                table[number, 3] = column, row, 1.0 / height, resolution
                self._draw_face(face, place, mask)
                cell += 1
            out.append(table)
        return out

    def _draw_face(self, face: Face, place: FloatArray, mask: NDArray[np.bool_]) -> None:
        values = {
            "point": tuple(place.tolist()),
            **{f"axis_{n}": tuple(a.tolist()) for n, a in zip("xyz", face.axes, strict=True)},
            "bounds": (face.left, face.bottom, 1.0 / (face.right - face.left), 1.0 / (face.top - face.bottom)),
            "near": _NEAR,
        }
        solid = mask.copy()
        for _, _, mine in self._cut:
            solid &= ~mine
        for array, shading, chosen in [(self._solid, None, solid), *((a, s, m & mask) for a, s, m in self._cut)]:
            numbers = np.flatnonzero(chosen).astype(np.int32)
            if not len(numbers):
                continue
            self._index.orphan()
            self._index.write((3 * numbers[:, None] + np.arange(3, dtype=np.int32)).tobytes())
            for name, value in values.items():
                array.program[name] = value
            if shading is not None and shading.image is not None:
                shading.image.use(1)
                array.program["image"], array.program["alpha_cutoff"] = 1, shading.uniforms["alpha_cutoff"]
            array.render(moderngl.TRIANGLES, vertices=3 * len(numbers))

    def _make_room(self, cells: int) -> tuple[int, int]:
        """Make the texture hold so many maps, empty, and the one drawn to; return maps a row and texels across each."""
        # sizes follow from the number of points, not from what was drawn before
        count = self._points * (1 if cells <= self._points else FACES)
        resolution = RESOLUTION
        while count * resolution**2 > _MOST_TEXELS and resolution > 256:
            resolution //= 2
        columns = min(count, self._context.max_texture_size // resolution)
        if count != self._cells:
            self._made.close()
            self._cells = count
            size = (columns * resolution, -(-count // columns) * resolution)
            gl = self._context.gl
            self._color = gl.texture(size, 1, dtype="f4")
            self._color.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._made.callback(self._color.release)
            depth = gl.depth_renderbuffer(size)
            self._made.callback(depth.release)
            self._context.store(depth, size, 1, DEPTH32F)
            self._framebuffer = gl.framebuffer([self._color], depth)
            self._made.callback(self._framebuffer.release)
        self._framebuffer.use()
        gl = self._context.gl
        gl.enable_only(moderngl.DEPTH_TEST)
        gl.depth_func = ">="
        self._framebuffer.viewport = (0, 0, *self._framebuffer.size)
        self._framebuffer.clear(_EMPTY, depth=0.0)
        return columns, resolution

    def use(self, slot: int) -> None:
        """Bind the maps."""
        if self._color is not None:
            self._color.use(slot)

    def release(self) -> None:
        """Free everything."""
        self._made.close()
        self._solid.release()
        for array, _, _ in self._cut:
            array.release()
        self._vertices.release()
        self._index.release()
