"""Polygons, checked and cut into triangles: the one way in for every flat surface, built in or from a user's file.

A polygon that is not planar, not simple or has no area would be drawn by each renderer in its own way and be exact in
none, so it is refused here with the point at fault. The triangles use the outline's own vertices and keep its winding:
edges that two polygons share stay shared, and coverage of the parts sums to coverage of the whole. Convex outlines (the
usual case) are cut as a fan without loading a geometry library; the others by GEOS' constrained Delaunay triangulation,
whose predicates are robust.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray, Material, Motion, Surface, Vec3, read_only

QUAD_UV = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
PLANE_TOLERANCE = 1e-6  # distance from the plane, relative to the polygon's size
AREA_TOLERANCE = 1e-12  # area, relative to the square of the polygon's size: below, no plane can be told from rounding
MIN_SIZE, MAX_SIZE = 1e-60, 1e60  # products of three lengths stay in float64's range
_ULPS = 16.0  # of the coordinates: what writing a plane's points down in float64 costs


def polygon(
    points: ArrayLike,
    *,
    color: Vec3 = (1.0, 1.0, 1.0),
    uv: ArrayLike | None = None,
    texture: str | None = None,
    material: Material | None = None,
    motion: Motion | None = None,
    name: str = "",
) -> Surface:
    """Return a planar simple polygon as a surface.

    Parameters
    ----------
    points : (n, 3) float
        The outline in order, n >= 3; either winding, collinear points allowed.
    color : Vec3
        Linear RGB.
    uv : (n, 2) float, optional
        Texture coordinates of the points, v up; needed with `texture`.
    texture : str, optional
        A key of `Scene.textures`.
    material, motion : optional
        Unlit and at rest by default.
    name : str
        For people; error messages carry it.

    Raises
    ------
    InputError
        If the outline has fewer than three points, repeats a point, has no area, leaves its plane, crosses or touches
        itself, or if anything is not finite or of the wrong shape.
    """
    label = f"polygon {name!r}" if name else "polygon"
    outline = _as_array(points, 3, label)
    fault = outline_fault(outline)
    if fault is not None:
        raise InputError(f"{label}: {fault}")
    coordinates = None
    if uv is not None:
        coordinates = _as_array(uv, 2, f"{label}: uv")
        if len(coordinates) != len(outline):
            raise InputError(
                f"{label}: uv has {len(coordinates)} pairs for {len(outline)} points; one for each is needed"
            )
        coordinates = read_only(coordinates)
    elif texture is not None:
        raise InputError(f"{label}: texture {texture!r} needs uv, one pair for each point")
    return Surface(
        vertices=read_only(outline),
        triangles=triangulate(outline),
        is_polygon=True,
        color=color,
        uv=coordinates,
        texture=texture,
        material=Material() if material is None else material,
        motion=Motion() if motion is None else motion,
        name=name,
    )


def quad(
    corners: ArrayLike,
    *,
    color: Vec3 = (1.0, 1.0, 1.0),
    uv: ArrayLike = QUAD_UV,
    texture: str | None = None,
    material: Material | None = None,
    motion: Motion | None = None,
    name: str = "",
) -> Surface:
    """Return a polygon of four corners (4, 3); `uv` is (0, 0) (1, 0) (1, 1) (0, 1) unless given. See `polygon`."""
    four = _as_array(corners, 3, f"quad {name!r}" if name else "quad")
    if len(four) != 4:
        raise InputError(f"{f'quad {name!r}' if name else 'quad'}: has {len(four)} corners; exactly 4 are needed")
    return polygon(four, color=color, uv=uv, texture=texture, material=material, motion=motion, name=name)


def mesh(
    vertices: ArrayLike,
    triangles: ArrayLike,
    *,
    color: Vec3 = (1.0, 1.0, 1.0),
    motion: Motion | None = None,
    name: str = "",
) -> Surface:
    """Return untextured triangles in space, (m, 3) indices into vertices (n, 3), as one surface."""
    points = _as_array(vertices, 3, f"mesh {name!r}")
    indices = np.asarray(triangles, dtype=np.int32)
    if indices.ndim != 2 or indices.shape[1] != 3 or indices.size == 0:
        raise InputError(f"mesh {name!r}: triangles have shape {indices.shape}; (m, 3) with m >= 1 is needed")
    if indices.min() < 0 or indices.max() >= len(points):
        raise InputError(f"mesh {name!r}: vertex indices must lie in 0..{len(points) - 1}")
    return Surface(
        vertices=read_only(points),
        triangles=read_only(indices),
        is_polygon=False,
        color=color,
        motion=Motion() if motion is None else motion,
        name=name,
    )


def outline_fault(outline: FloatArray) -> str | None:
    """Return what is wrong with an outline (n, 3) of finite points, or None if it is a planar simple polygon."""
    count = len(outline)
    if count < 3:
        return f"has {count} points; at least 3 are needed"
    size = float(np.ptp(outline / 2, axis=0).max()) * 2
    if size == 0.0:
        return "all its points are the same; a polygon with an area is needed"
    if not MIN_SIZE <= size <= MAX_SIZE:
        return f"its size is {size:.3g}; {MIN_SIZE:g} to {MAX_SIZE:g} is allowed"
    following = np.arange(1, count + 1) % count
    same = np.flatnonzero((outline == outline[following]).all(axis=1))
    if len(same):
        return f"points {same[0]} and {following[same[0]]} are the same; each must differ from the next"
    # About the centroid and in units of the size, so that rounding of a far away polygon does not pose as area.
    local = (outline - outline[0]) / size
    local = local - local.mean(axis=0)
    rounding = max(AREA_TOLERANCE, _ULPS * float(np.finfo(np.float64).eps) * float(np.abs(outline).max()) / size)
    normal = _area_vector(local)
    area = float(np.linalg.norm(normal))
    if area <= rounding:
        spread = np.linalg.svd(local, compute_uv=False)
        if spread[1] <= rounding * spread[0]:
            return "has no area: its points lie on one line"
        return "has no area: its outline crosses itself or runs back on itself; a simple polygon is needed"
    if count > 3:
        off = np.abs(local @ (normal / area))
        worst = int(np.argmax(off))
        if off[worst] > PLANE_TOLERANCE + rounding / area:
            return (
                f"point {worst} lies {off[worst]:.3g} of the polygon's size off its plane; "
                f"at most {PLANE_TOLERANCE:g} is allowed (a planar polygon)"
            )
    if not is_simple(outline):
        return "its outline crosses or touches itself; a simple polygon is needed"
    return None


def is_simple(outline: FloatArray) -> bool:
    """Return whether a planar outline (n, 3) neither crosses nor touches itself."""
    if len(outline) == 3:
        return True
    flat = project_to_plane(outline)
    if _is_strictly_convex(flat):
        return True
    import shapely

    return bool(shapely.LinearRing(flat).is_simple)


def triangulate(outline: FloatArray) -> NDArray[np.int32]:
    """Return (n - 2, 3) int32 vertex indices that cut a planar simple outline (n, 3), each wound as the outline is."""
    count = len(outline)
    flat = project_to_plane(outline)
    if count == 3 or _is_strictly_convex(flat):
        rest = np.arange(1, count - 1)
        return read_only(np.stack([np.zeros_like(rest), rest, rest + 1], axis=1).astype(np.int32))
    import shapely

    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(flat)))
    index_of = {tuple(point): k for k, point in enumerate(flat.tolist())}
    rings = shapely.get_coordinates(shapely.get_exterior_ring(pieces)).reshape(-1, 4, 2)[:, :3]
    triangles = np.array([[index_of[tuple(p)] for p in ring] for ring in rings.tolist()], dtype=np.int32)
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    turned = _cross(b - a, c - a) * _signed_area(flat) < 0.0
    triangles[turned] = triangles[turned][:, ::-1]
    return read_only(triangles)


def project_to_plane(outline: FloatArray) -> FloatArray:
    """Return (n, 2): the two coordinates in which a planar outline is seen largest, untouched.

    Dropping a coordinate moves no point, so that crossings found in the plane are those of the outline.
    """
    local = outline - outline[0]
    dropped = int(np.argmax(np.abs(_area_vector(local))))
    return outline[:, [(dropped + 1) % 3, (dropped + 2) % 3]]


def _as_array(values: ArrayLike, width: int, label: str) -> FloatArray:
    try:
        out = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{label}: not a list of {width} numbers each") from error
    if out.ndim != 2 or out.shape[1] != width:
        raise InputError(f"{label}: has shape {out.shape}; (n, {width}) is needed")
    if not np.isfinite(out).all():
        bad = int(np.flatnonzero(~np.isfinite(out).all(axis=1))[0])
        raise InputError(f"{label}: entry {bad} is {out[bad].tolist()}; finite numbers are needed")
    return out


def _area_vector(local: FloatArray) -> FloatArray:
    """Return the outline's normal with its area as length (Newell's method)."""
    # Written out: numpy's cross costs more than everything else that is done to a small polygon.
    a, b = local.T, local[np.arange(1, len(local) + 1) % len(local)].T
    return (
        np.array(
            [(a[1] * b[2] - a[2] * b[1]).sum(), (a[2] * b[0] - a[0] * b[2]).sum(), (a[0] * b[1] - a[1] * b[0]).sum()]
        )
        / 2
    )


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    out: FloatArray = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def _signed_area(flat: FloatArray) -> float:
    local = flat - flat[0]
    return float(_cross(local, np.roll(local, -1, axis=0)).sum()) / 2


def _is_strictly_convex(flat: FloatArray) -> bool:
    """Return whether an outline (n, 2) turns one way at every vertex, and once round in all.

    A turn must be clearly over rounding: a nearly flat vertex is left to the robust way.
    """
    edges = np.roll(flat, -1, axis=0) - flat
    following = np.roll(edges, -1, axis=0)
    cross = _cross(edges, following)
    scale = np.linalg.norm(edges, axis=1) * np.linalg.norm(following, axis=1)
    clear = 1e-12 * scale
    if not ((cross > clear).all() or (cross < -clear).all()):
        return False
    turns = np.arctan2(cross, (edges * following).sum(axis=1)).sum() / (2 * np.pi)
    return bool(abs(abs(turns) - 1.0) < 0.5)
