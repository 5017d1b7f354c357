"""The exact picture in a given view whose axes are not at right angles, against rays through a place of a lens."""

import numpy as np
import pytest

from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.filtered import draw_instant_view
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.renderers.sampling.filters import make_filter
from aliasbench.scenes.model import Camera
from aliasbench.scenes.projection import lens_view, view_at


def rays_through_a_lens(view, place, focus, x, y):
    """Return origins and directions (n, 3) of the rays through a place of the lens that meet the focal plane at (x, y).

    `view` is that through the middle of the lens; x and y are in pixels.
    """
    lens = view.origin + place[0] * view.right + place[1] * view.up
    right, up = (x - view.width / 2) / view.scale, (view.height / 2 - y) / view.scale
    if view.perspective:
        sharp = view.origin + focus * (right[:, None] * view.right + up[:, None] * view.up + view.forward)
        origin = np.broadcast_to(lens, sharp.shape)
    else:
        chief = view.origin + right[:, None] * view.right + up[:, None] * view.up
        sharp, origin = chief + focus * view.forward, chief + (lens - view.origin)
    return origin, sharp - origin


def nearest_colors(scene, origin, direction):
    """Return what rays see of triangles, (n, 3)."""
    out, best = np.tile(np.array(scene.background), (len(origin), 1)), np.full(len(origin), np.inf)
    for surface in scene.objects:
        for corners in surface.vertices[surface.triangles]:
            a, b = corners[1] - corners[0], corners[2] - corners[0]
            normal = np.cross(a, b)
            t = ((corners[0] - origin) @ normal) / (direction @ normal)
            place = origin + t[:, None] * direction - corners[0]
            u = np.cross(place, b) @ normal / (normal @ normal)
            v = np.cross(a, place) @ normal / (normal @ normal)
            hit = (t > 0.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t < best)
            best[hit], out[hit] = t[hit], surface.color
    return out


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize(("name", "radius"), [("box", 0.5), ("tent", 1.0)])
def test_view_through_a_place_of_a_lens_is_what_its_rays_see(make_polygon, make_scene, projection, name, radius):
    wide = {"fov_y_deg": 40.0} if projection == "perspective" else {"height": 2.2}
    camera = Camera(projection, position=(0.7, -0.4, 3.0), target=(0.1, 0.0, 0.2), up=(0.2, 1.0, 0.1), **wide)
    # in front of the focal plane and behind it, and one through the other
    objects = [
        make_polygon([(-0.9, -0.7, -0.9), (0.8, -0.8, 0.7), (0.1, 0.9, 0.1)], (1.0, 0.1, 0.0)),
        make_polygon([(-0.6, 0.5, 0.9), (-0.5, -0.8, -0.6), (0.9, 0.1, 0.2)], (0.0, 0.9, 0.3)),
        make_polygon([(-3.0, -3.0, -1.5), (3.0, -2.5, -1.0), (0.2, 3.0, -2.0)], (0.2, 0.0, 1.0)),
    ]
    scene, size, samples = make_scene(objects, camera=camera, background=(0.3, 0.4, 0.1)), (6, 5), 120
    spec, place, focus = make_filter(name, radius), (0.35, -0.2), 2.6
    middle = view_at(camera, scene.animation, 0, 0.0, size)
    view = lens_view(middle, *place, focus)
    assert abs(view.right @ view.forward) > 0.05
    integral = draw_instant_view(scene, build_faces(scene), scene_paths(scene), view, 0, 0.0, spec)
    margin = spec.margin
    x, y = ((np.arange((n + 2 * margin) * samples) + 0.5) / samples - margin for n in size)
    across, down = (part.ravel() for part in np.meshgrid(x, y))
    seen = nearest_colors(scene, *rays_through_a_lens(middle, place, focus, across, down)).reshape(len(y), len(x), 3)
    along, upright = (
        spec.profile(axis - np.arange(n)[:, None] - 0.5) / samples for axis, n in zip((x, y), size, strict=True)
    )
    expected = np.einsum("iy,yxc,jx->ijc", upright, seen, along)
    # a border crosses a pixel's rows of samples, each of which it may misjudge by half a sample
    assert np.abs(integral.pixels - expected).max() < 4.0 / samples
    assert np.sqrt(np.mean((integral.pixels - expected) ** 2)) < 0.5 / samples
    assert integral.bound.max() < 1e-11
