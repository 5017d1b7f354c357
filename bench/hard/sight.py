"""What a ray through a point of the picture meets, in float64: the truth for scenes with depth and with textures.

As in `ownership`, a renderer may differ only where a sample is close to a border, be it of a polygon or of a texel.
Polygons must lie before the camera as a whole, and their textures be affine in them.
"""

from functools import lru_cache

import numpy as np

from aliasbench.bench.hard.ownership import Ownership, distance_to_outline, inside, outline_px, pixel_points
from aliasbench.scenes.model import Checker, FloatArray, ImageTexture, Scene, Texture
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at

_FAR_PX = 16.0
_STEP_PX = 1e-4  # for slopes: squares of it are lost in float64 beside what a difference of 1e-4 px changes


def what_is_seen(
    scene: Scene, size: tuple[int, int], points: FloatArray, *, frame: int = 0, fraction: float = 0.0
) -> Ownership:
    """Return what samples at `points` (n, 2) in pixels see: the nearest polygon, of coplanar ones the later.

    `distance` is in pixels from the nearest outline of any polygon, or the nearest border of a texel of what is seen.
    """
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    color = np.tile(np.asarray(scene.background, dtype=np.float64), (len(points), 1))
    distance = np.full(len(points), np.inf)
    to_texel = np.full(len(points), np.inf)
    nearest = np.full(len(points), np.inf)
    rays = view.ray(points[:, 0], points[:, 1])
    for number, surface in enumerate(scene.objects):
        outline = outline_px(scene, number, size, frame, fraction)
        _lower(distance, points, outline)
        matrix = object_matrix(surface.motion, scene.animation, frame, fraction)
        corners = surface.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        depth = _depth(rays, corners)
        seen = inside(points, outline) & (depth <= nearest * (1.0 + 1e-12))
        nearest[seen] = depth[seen]
        to_texel[seen] = np.inf
        color[seen] = surface.color
        if surface.texture is not None and surface.uv is not None and seen.any():
            texture = scene.textures[surface.texture]

            def places(points: FloatArray, texture: Texture = texture, uv: FloatArray = surface.uv,
                       corners: FloatArray = corners) -> FloatArray:  # fmt: skip
                return _texel_place(texture, corners, uv, view.ray(points[:, 0], points[:, 1]))

            place = places(points[seen])
            color[seen] *= texel_value(texture, place)
            steps = [np.array(step) for step in ((_STEP_PX, 0.0), (0.0, _STEP_PX))]
            slope = np.hypot(*(places(points[seen] + step) - place for step in steps)) / _STEP_PX
            off = np.abs(place - np.round(place))
            apart = np.divide(off, slope, out=np.full_like(off, np.inf), where=slope > 0.0)
            to_texel[seen] = apart.min(axis=1)
    return Ownership(color, np.minimum(distance, to_texel))


@lru_cache(maxsize=64)  # one after the other, all subjects of a case are held to the same truth
def centres_of(scene: Scene, size: tuple[int, int], frame: int = 0, fraction: float = 0.0) -> Ownership:
    """Return what the centres of all pixels see, row by row; see `what_is_seen`."""
    return what_is_seen(scene, size, pixel_points(size), frame=frame, fraction=fraction)


def _lower(distance: FloatArray, points: FloatArray, outline: FloatArray) -> None:
    """Lower distances to those from an outline; far from it, where nothing may be wrong, to those from its box."""
    beyond = np.maximum(np.maximum(outline.min(axis=0) - points, points - outline.max(axis=0)), 0.0)
    from_box = np.hypot(beyond[:, 0], beyond[:, 1])
    near = (from_box < _FAR_PX) & (from_box < distance)
    distance[~near] = np.minimum(distance[~near], from_box[~near])
    distance[near] = np.minimum(distance[near], distance_to_outline(points[near], outline))


def _depth(rays: tuple[FloatArray, FloatArray], corners: FloatArray) -> FloatArray:
    """Return (n,): how deep rays meet the plane of a polygon; infinite where they do not."""
    local = corners - corners[0]
    normal = np.cross(local, np.roll(local, -1, axis=0)).sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = -((rays[0] - corners[0]) @ normal) / (rays[1] @ normal)
    out: FloatArray = np.where(depth > 0.0, depth, np.inf)
    return out


def texel_place_at(
    scene: Scene, size: tuple[int, int], points: FloatArray, *, frame: int = 0, fraction: float = 0.0
) -> FloatArray:
    """Return (n, 2): where in the texture, in texels, rays through `points` meet a scene's first object's plane."""
    view, surface = view_at(scene.camera, scene.animation, frame, fraction, size), scene.objects[0]
    matrix = object_matrix(surface.motion, scene.animation, frame, fraction)
    corners = surface.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    if surface.texture is None or surface.uv is None:
        raise TypeError("an object without texture has no texels")
    rays = view.ray(points[:, 0], points[:, 1])
    return _texel_place(scene.textures[surface.texture], corners, surface.uv, rays)


def _texel_place(
    texture: Texture, corners: FloatArray, uv: FloatArray, rays: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Return (n, 2): places in texels where rays meet a polygon's plane, whole numbers being borders."""
    hits = rays[0] - corners[0] + _depth(rays, corners)[:, None] * rays[1]
    basis = np.stack([corners[1] - corners[0], corners[-1] - corners[0]], axis=1)
    shares = hits @ np.linalg.pinv(basis).T
    if isinstance(texture, Checker):
        count = np.asarray(texture.squares)
    elif isinstance(texture, ImageTexture):
        count = np.array(texture.texels.shape[1::-1], dtype=np.float64)
    else:
        raise TypeError("only checkers and images have texels")
    out: FloatArray = (uv[0] + shares @ np.stack([uv[1] - uv[0], uv[-1] - uv[0]])) * count
    return out


def texel_value(texture: Texture, place: FloatArray) -> FloatArray:
    """Return (n, 3): the colour of the texels that places (n, 2) lie in."""
    whole = np.floor(place)
    if isinstance(texture, Checker):
        odd = np.mod(whole.sum(axis=1), 2.0)[:, None]
        low, high = np.asarray(texture.black), np.asarray(texture.white)
        out: FloatArray = low + odd * (high - low)
        return out
    if not isinstance(texture, ImageTexture):
        raise TypeError("only checkers and images have texels")
    height, width = texture.texels.shape[:2]
    columns, rows = (np.mod(whole[:, k], n).astype(np.int64) for k, n in enumerate((width, height)))
    return np.asarray(texture.texels[rows, columns, :3], dtype=np.float64)
