"""The colour of a packet's hits: where the ray meets the triangle's plane in float64, and the texture there.

Embree says which triangle; everything after is recomputed in float64 from the ray, so that a look-up is wrong by no
more than float64 at any distance, and equal in both engines. First every lane gets its texture coordinates and level
of detail, then its colour. A packet that hits one triangle, or one object, throughout, which is most of them, goes
through loops the compiler vectorises; the others go lane by lane through the same expressions. What a texture is worth
at a place is `texturing`'s.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called, inlined
from aliasbench.renderers.raytrace.bodies import lane_to_body
from aliasbench.renderers.raytrace.ewa import footprint_axes
from aliasbench.renderers.raytrace.lane_bits import ALL_LANES, equal_lanes, lowest_bit
from aliasbench.renderers.raytrace.lanes import (
    BLUE,
    DISTANCE,
    DX,
    DY,
    DZ,
    GREEN,
    LANES,
    LOD,
    LX,
    LY,
    LZ,
    MX,
    MY,
    MZ,
    OX,
    OY,
    OZ,
    PERSPECTIVE,
    R_RIGHT,
    R_UP,
    RED,
    RIGHT,
    S_RIGHT,
    S_UP,
    SCALE,
    UP,
    U,
    V,
)
from aliasbench.renderers.raytrace.texturing import (
    COLOR,
    EWA,
    KIND,
    LEVEL,
    MIPMAP,
    PLAIN,
    UV_MATRIX,
    shade_lane,
    shade_packet,
)
from aliasbench.renderers.sampling.rare import compiled_if_rare
from aliasbench.scenes.model import FloatArray

MISS = -1

# Values of a triangle: plane n . P = k, then u = U_MAP . P + U_SHIFT and v likewise, P in the mesh's own frame, and its
# corners' largest coordinate there.
NORMAL, OFFSET, U_MAP, U_SHIFT, V_MAP, V_SHIFT, REACH, TRIANGLE_SIZE = 0, 3, 4, 7, 8, 11, 12, 13


class Tables(NamedTuple):
    """What hits are looked up in.

    Attributes
    ----------
    objects : (n, OBJECT_SIZE) float64
    owners : (m,) int32
        Object of every triangle: those of the still mesh first, then those of the moving bodies in order.
    triangles : (m, TRIANGLE_SIZE) float64
        Empty (0 rows) where no object has a texture and no light is scattered.
    bodies : (b, BODY_SIZE) float64
    firsts : (b + 1,) int64
        First triangle of every moving body, and the end.
    levels : (k, 3) int64
        First texel, width and height of every mip level.
    texels : (t, 4) float32
        Linear RGBA of all levels, one after the other.
    lights : (l, LIGHT_SIZE) float64
        See `paths`.
    background : (3,) float64
    footprint : float
        Width of a sample's footprint in pixels.
    """

    objects: FloatArray
    owners: NDArray[np.int32]
    triangles: FloatArray
    bodies: FloatArray
    firsts: NDArray[np.int64]
    levels: NDArray[np.int64]
    texels: NDArray[np.float32]
    lights: FloatArray
    background: FloatArray
    footprint: float


class EwaTables(Tables):
    """Tables of objects whose textures are averaged over ellipses, which other kernels do without (`sampling.rare`)."""

    __slots__ = ()
    RARE = True


@inlined
def shade_flat(tables: Tables, hits: NDArray[np.int32], scratch: FloatArray) -> None:
    """Write the colours of hits on objects without textures."""
    first = hits[0]
    same = True
    for i in range(1, LANES):
        same &= hits[i] == first
    if same:
        _paint_plain(tables, first, scratch)
        return
    # Without branches: at an edge, which lanes miss is anybody's guess.
    red, green, blue = tables.background[0], tables.background[1], tables.background[2]
    for i in range(LANES):
        seen = hits[i] >= 0
        owner = tables.owners[hits[i] if seen else 0]
        r, g, b = tables.objects[owner, COLOR], tables.objects[owner, COLOR + 1], tables.objects[owner, COLOR + 2]
        scratch[RED + i] = r if seen else red
        scratch[GREEN + i] = g if seen else green
        scratch[BLUE + i] = b if seen else blue


@inlined
def shade_textured(tables: Tables, camera: FloatArray, hits: NDArray[np.int32], scratch: FloatArray) -> None:
    """Write the colours of hits on any objects."""
    first = hits[0]
    same = True
    for i in range(1, LANES):
        same &= hits[i] == first
    if same and (first == MISS or tables.objects[tables.owners[first], KIND] == PLAIN):
        _paint_plain(tables, first, scratch)
        return
    if same and first < tables.firsts[0]:
        place_packet(tables, camera, first, scratch)
        owner = np.int64(tables.owners[first])
    else:
        owner = np.int64(_place_triangles(tables, hits, scratch))
        if owner == MISS:
            owner = _place_lanes(tables, camera, hits, scratch)
    if owner != MISS and tables.objects[owner, KIND] != PLAIN:
        shade_packet(tables, owner, scratch)
        return
    for i in range(LANES):
        hit = hits[i]
        if hit == MISS or tables.objects[tables.owners[hit], KIND] == PLAIN:
            _paint_lane(tables, hit, scratch, i)
        else:
            shade_lane(tables, tables.owners[hit], scratch, i)


@called
def _place_lanes(tables: Tables, camera: FloatArray, hits: NDArray[np.int32], scratch: FloatArray) -> int:
    """Write texture coordinates, and levels of detail where needed, of any hits; return their object, or MISS."""
    owner = np.int64(tables.owners[hits[0]] if hits[0] != MISS else MISS)
    for i in range(LANES):
        hit = hits[i]
        if hit == MISS:
            owner = np.int64(MISS)
        else:
            if tables.owners[hit] != owner:
                owner = np.int64(MISS)
            if tables.objects[tables.owners[hit], KIND] != PLAIN:
                place_lane(tables, camera, hit, scratch, i)
    return int(owner)


@inlined
def _place_triangles(tables: Tables, hits: NDArray[np.int32], scratch: FloatArray) -> int:
    """Write texture coordinates of hits on triangles of one object that stands still, triangle by triangle.

    Return the object, or MISS where not all are on one, it has no texture, or levels of detail are needed as well.
    """
    if hits[0] == MISS:
        return MISS
    owner = tables.owners[hits[0]]
    if not PLAIN < tables.objects[owner, KIND] < MIPMAP:
        return MISS
    todo = ALL_LANES
    lane = 0
    while True:
        hit = hits[lane]
        if not 0 <= hit < tables.firsts[0] or tables.owners[hit] != owner:
            return MISS
        row = tables.triangles[hit]
        nx, ny, nz, offset = row[0], row[1], row[2], row[OFFSET]
        ax, ay, az, a0 = row[U_MAP], row[U_MAP + 1], row[U_MAP + 2], row[U_SHIFT]
        bx, by, bz, b0 = row[V_MAP], row[V_MAP + 1], row[V_MAP + 2], row[V_SHIFT]
        for i in range(LANES):
            ox, oy, oz = scratch[OX + i], scratch[OY + i], scratch[OZ + i]
            dx, dy, dz = scratch[DX + i], scratch[DY + i], scratch[DZ + i]
            t = (offset - (nx * ox + ny * oy + nz * oz)) / (nx * dx + ny * dy + nz * dz)
            x, y, z = ox + t * dx, oy + t * dy, oz + t * dz
            if hits[i] == hit:
                scratch[U + i] = ax * x + ay * y + az * z + a0
                scratch[V + i] = bx * x + by * y + bz * z + b0
        todo &= ~equal_lanes(hits, hit)
        if todo == 0:
            return owner
        lane = lowest_bit(todo)


@inlined
def _paint_plain(tables: Tables, hit: int, scratch: FloatArray) -> None:
    if hit == MISS:
        r, g, b = tables.background[0], tables.background[1], tables.background[2]
    else:
        owner = tables.owners[hit]
        r, g, b = tables.objects[owner, COLOR], tables.objects[owner, COLOR + 1], tables.objects[owner, COLOR + 2]
    for i in range(LANES):
        scratch[RED + i], scratch[GREEN + i], scratch[BLUE + i] = r, g, b


@inlined
def _paint_lane(tables: Tables, hit: int, scratch: FloatArray, i: int) -> None:
    if hit == MISS:
        for k in range(3):
            scratch[RED + k * LANES + i] = tables.background[k]
    else:
        owner = tables.owners[hit]
        for k in range(3):
            scratch[RED + k * LANES + i] = tables.objects[owner, COLOR + k]


@inlined
def _place(
    row: FloatArray, scratch: FloatArray, i: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float
) -> float:
    """Write where the ray meets the triangle's plane, in texture coordinates; return the ray parameter there."""
    t = (row[OFFSET] - (row[0] * ox + row[1] * oy + row[2] * oz)) / (row[0] * dx + row[1] * dy + row[2] * dz)
    x, y, z = ox + t * dx, oy + t * dy, oz + t * dz
    scratch[U + i] = row[U_MAP] * x + row[U_MAP + 1] * y + row[U_MAP + 2] * z + row[U_SHIFT]
    scratch[V + i] = row[V_MAP] * x + row[V_MAP + 1] * y + row[V_MAP + 2] * z + row[V_SHIFT]
    return t


@inlined
def _stretch(
    row: FloatArray, values: FloatArray, width: float, height: float, weight: float,
    qx: float, qy: float, qz: float, dx: float, dy: float, dz: float,
) -> float:  # fmt: skip
    """Return the squared distance in texels of level 0 that the look-up moves with the image point (see `_measure`)."""
    along = (row[0] * qx + row[1] * qy + row[2] * qz) / (row[0] * dx + row[1] * dy + row[2] * dz)
    x, y, z = weight * (qx - along * dx), weight * (qy - along * dy), weight * (qz - along * dz)
    du = row[U_MAP] * x + row[U_MAP + 1] * y + row[U_MAP + 2] * z
    dv = row[V_MAP] * x + row[V_MAP + 1] * y + row[V_MAP + 2] * z
    s = (values[UV_MATRIX] * du + values[UV_MATRIX + 1] * dv) * width
    r = (values[UV_MATRIX + 3] * du + values[UV_MATRIX + 4] * dv) * height
    return s * s + r * r


# With the rows known before it is optimised, which `inlined` would not do: 4 % of a picture's time.
@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def place_along(row: FloatArray, scratch: FloatArray, rays: int) -> None:
    """Write where 16 rays, in six rows of `scratch` from `rays` on, meet one triangle's plane, as `_place` does."""
    # Read before the loop: the compiler cannot know that writing coordinates leaves the triangle as it is.
    nx, ny, nz, offset = row[0], row[1], row[2], row[OFFSET]
    ax, ay, az, a0 = row[U_MAP], row[U_MAP + 1], row[U_MAP + 2], row[U_SHIFT]
    bx, by, bz, b0 = row[V_MAP], row[V_MAP + 1], row[V_MAP + 2], row[V_SHIFT]
    for i in range(LANES):
        ox, oy, oz = scratch[rays + i], scratch[rays + LANES + i], scratch[rays + 2 * LANES + i]
        dx, dy = scratch[rays + 3 * LANES + i], scratch[rays + 4 * LANES + i]
        dz = scratch[rays + 5 * LANES + i]
        t = (offset - (nx * ox + ny * oy + nz * oz)) / (nx * dx + ny * dy + nz * dz)
        x, y, z = ox + t * dx, oy + t * dy, oz + t * dz
        scratch[U + i] = ax * x + ay * y + az * z + a0
        scratch[V + i] = bx * x + by * y + bz * z + b0
        scratch[DISTANCE + i] = t


@compiled_if_rare(None)
@inlined
def _write_axes(
    tables: Tables, row: FloatArray, values: FloatArray, scratch: FloatArray, i: int, weight: float,  # noqa: ARG001
    rx: float, ry: float, rz: float, ux: float, uy: float, uz: float, dx: float, dy: float, dz: float,
) -> None:  # fmt: skip
    """Write how texture coordinates move along a lane's footprint."""
    scratch[S_RIGHT + i], scratch[R_RIGHT + i], scratch[S_UP + i], scratch[R_UP + i] = footprint_axes(
        row, values, weight, rx, ry, rz, ux, uy, uz, dx, dy, dz
    )


@inlined
def place_packet(tables: Tables, camera: FloatArray, hit: int, scratch: FloatArray) -> None:
    """Write texture coordinates, and levels of detail where needed, of 16 hits on one triangle that stands still.

    The level is log2 of the footprint's longer side in texels of level 0 (OpenGL 4.6, 8.14.1). The ray meets the plane
    at P = O + t D. When the image point moves by a pixel, O (parallel rays) or D (perspective) moves by w q, w = 1 or t
    pixels, and P by w (q - D (n . q) / (n . D)).
    """
    row = tables.triangles[hit]
    values = tables.objects[tables.owners[hit]]
    place_along(row, scratch, OX)
    if values[KIND] < MIPMAP:
        return
    step = tables.footprint / camera[SCALE]
    perspective = camera[PERSPECTIVE]
    rx, ry, rz = camera[RIGHT], camera[RIGHT + 1], camera[RIGHT + 2]
    ux, uy, uz = camera[UP], camera[UP + 1], camera[UP + 2]
    if values[KIND] == EWA:
        for i in range(LANES):
            weight = step * (1.0 + perspective * (scratch[DISTANCE + i] - 1.0))
            dx, dy, dz = scratch[DX + i], scratch[DY + i], scratch[DZ + i]
            _write_axes(tables, row, values, scratch, i, weight, rx, ry, rz, ux, uy, uz, dx, dy, dz)
        return
    level = int(values[LEVEL])
    width, height = float(tables.levels[level, 1]), float(tables.levels[level, 2])
    for i in range(LANES):
        dx, dy, dz = scratch[DX + i], scratch[DY + i], scratch[DZ + i]
        weight = step * (1.0 + perspective * (scratch[DISTANCE + i] - 1.0))
        across = _stretch(row, values, width, height, weight, rx, ry, rz, dx, dy, dz)
        down = _stretch(row, values, width, height, weight, ux, uy, uz, dx, dy, dz)
        scratch[LOD + i] = max(across, down)
    for i in range(LANES):
        scratch[LOD + i] = 0.5 * np.log2(max(scratch[LOD + i], 1e-300))


@inlined
def place_lane(tables: Tables, camera: FloatArray, hit: int, scratch: FloatArray, i: int) -> None:
    """Write texture coordinates, and the level of detail where needed, of one hit on anything (see `place_packet`)."""
    row = tables.triangles[hit]
    values = tables.objects[tables.owners[hit]]
    ox, oy, oz = scratch[OX + i], scratch[OY + i], scratch[OZ + i]
    dx, dy, dz = scratch[DX + i], scratch[DY + i], scratch[DZ + i]
    in_body = hit >= tables.firsts[0]
    body = 0
    if in_body:
        while hit >= tables.firsts[body + 1]:
            body += 1
        lane_to_body(tables.bodies[body], scratch, i)
        ox, oy, oz = scratch[LX + i], scratch[LY + i], scratch[LZ + i]
        dx, dy, dz = scratch[MX + i], scratch[MY + i], scratch[MZ + i]
    t = _place(row, scratch, i, ox, oy, oz, dx, dy, dz)
    if values[KIND] < MIPMAP:
        return
    weight = tables.footprint / camera[SCALE] * (1.0 + camera[PERSPECTIVE] * (t - 1.0))
    rx, ry, rz = camera[RIGHT], camera[RIGHT + 1], camera[RIGHT + 2]
    ux, uy, uz = camera[UP], camera[UP + 1], camera[UP + 2]
    if in_body:
        rx, ry, rz = _direction_to_body(tables.bodies[body], scratch, i, rx, ry, rz)
        ux, uy, uz = _direction_to_body(tables.bodies[body], scratch, i, ux, uy, uz)
    if values[KIND] == EWA:
        _write_axes(tables, row, values, scratch, i, weight, rx, ry, rz, ux, uy, uz, dx, dy, dz)
        return
    level = int(values[LEVEL])
    width, height = float(tables.levels[level, 1]), float(tables.levels[level, 2])
    across = _stretch(row, values, width, height, weight, rx, ry, rz, dx, dy, dz)
    down = _stretch(row, values, width, height, weight, ux, uy, uz, dx, dy, dz)
    scratch[LOD + i] = 0.5 * np.log2(max(across, down, 1e-300))


@called
def _direction_to_body(
    values: FloatArray, scratch: FloatArray, i: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return a direction at the time of lane i in the body's frame (directions are mapped linearly)."""
    dx, dy, dz = scratch[DX + i], scratch[DY + i], scratch[DZ + i]
    scratch[DX + i], scratch[DY + i], scratch[DZ + i] = x, y, z
    lane_to_body(values, scratch, i)
    scratch[DX + i], scratch[DY + i], scratch[DZ + i] = dx, dy, dz
    return scratch[MX + i], scratch[MY + i], scratch[MZ + i]


@called
def meet_plane(tables: Tables, hit: int, scratch: FloatArray, i: int) -> tuple[float, float, float, float]:
    """Return the ray parameter at which lane i meets a triangle's plane, and the plane's normal, of any length.

    A body's normal n belongs to n . M x for the affine map M into its frame, whose gradient is transposed M times n.
    """
    row = tables.triangles[hit]
    nx, ny, nz = row[NORMAL], row[NORMAL + 1], row[NORMAL + 2]
    if hit < tables.firsts[0]:
        along = nx * scratch[DX + i] + ny * scratch[DY + i] + nz * scratch[DZ + i]
        t = (row[OFFSET] - (nx * scratch[OX + i] + ny * scratch[OY + i] + nz * scratch[OZ + i])) / along
        return t, nx, ny, nz
    body = 0
    while hit >= tables.firsts[body + 1]:
        body += 1
    values = tables.bodies[body]
    lane_to_body(values, scratch, i)
    along = nx * scratch[MX + i] + ny * scratch[MY + i] + nz * scratch[MZ + i]
    t = (row[OFFSET] - (nx * scratch[LX + i] + ny * scratch[LY + i] + nz * scratch[LZ + i])) / along
    ax, ay, az = _direction_to_body(values, scratch, i, 1.0, 0.0, 0.0)
    bx, by, bz = _direction_to_body(values, scratch, i, 0.0, 1.0, 0.0)
    cx, cy, cz = _direction_to_body(values, scratch, i, 0.0, 0.0, 1.0)
    return t, nx * ax + ny * ay + nz * az, nx * bx + ny * by + nz * bz, nx * cx + ny * cy + nz * cz
