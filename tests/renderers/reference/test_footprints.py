"""Green's theorem in texture space: the same as texels clipped one by one, and means within their bounds."""

from types import SimpleNamespace

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference import textured
from aliasbench.renderers.reference.footprints import DEGREE, add_footprint, add_mean, row_bounds
from aliasbench.renderers.reference.fragments import convex_area
from aliasbench.renderers.reference.row_moments import row_primitives
from aliasbench.renderers.reference.surfaces import CLIP, CLIP_BLEND
from aliasbench.renderers.reference.tiles import clip_texels, gauss_table
from aliasbench.scenes.model import Camera, Checker, Grating


def rows_of(texels, blend):
    """Return what kernels need of one image: padded texels, primitives, means and bounds."""
    h, w = texels.shape[:2]
    padded = np.concatenate([texels, texels[:, :1]], axis=1).reshape(-1, 3)
    surfaces = SimpleNamespace(
        ways=np.array([CLIP_BLEND if blend else CLIP]), blocks=np.array([[h, w, 0]]), shifts=np.zeros(1), texels=padded
    )
    primitives, means = row_primitives(surfaces, DEGREE, (CLIP, CLIP_BLEND))
    return padded, primitives, means, row_bounds(surfaces, primitives)[0]


def fragment(rng, fine, slant):
    """Return a convex polygon, and rows of u q, v q and q over it with about `fine` texels across."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(3, 7))))
    poly = np.stack([0.5 + 0.5 * np.cos(angles), 0.5 + 0.5 * np.sin(angles)], axis=1)
    own = np.append(rng.normal(size=(2, 2)) * fine, rng.normal(size=(2, 1)) * 1e3, axis=1)
    q = np.append(rng.normal(size=2) * slant, 1.0)
    q[2] += max(0.0, 0.3 - (poly @ q[:2]).min())
    return poly, np.vstack([own, q])


@pytest.mark.parametrize("blend", [False, True])
@pytest.mark.parametrize(("fine", "slant"), [(200.0, 0.0), (100.0, 0.05), (120.0, 1.0), (300.0, 0.02)])
def test_texture_space_and_clipping_agree(fine, slant, blend):
    rng = np.random.default_rng(3)
    rules, done = gauss_table(), 0
    for _ in range(14):
        h, w = (int(s) for s in rng.integers(1, 6, 2))
        texels = rng.random((h, w, 3))
        padded, primitives, means, bounds = rows_of(texels, blend)
        poly, own = fragment(rng, fine, slant)
        if abs(np.linalg.det(own)) < 0.2 * fine**2 or convex_area(poly, len(poly)) < 0.05:
            continue
        one, other = np.zeros(3), np.zeros(3)
        block = np.array([h, w, 0])
        off = add_footprint(poly, len(poly), own, blend, block, padded, primitives, means, bounds[3], rules, one)
        clip_texels(poly, len(poly), own, blend, h, w, 0, padded, rules, other)
        mean = np.zeros(3)
        most = add_mean(poly, len(poly), own, bounds, mean)
        assert np.abs(mean - other).max() <= most + 1e-12
        if off >= 0.0:
            done += 1
            assert np.abs(one - other).max() <= off + 1e-10
    assert done > 2


@pytest.mark.parametrize("texture", [Checker((900.0, 700.0)), Grating(700.0, 33.0, 0.1, "square")])
@pytest.mark.parametrize("position", [(0.3, 0.9, 2.0), (0.0, 0.9, 2.0)])
def test_means_of_crowded_pixels_are_within_their_bounds(make_polygon, make_scene, monkeypatch, position, texture):
    camera = Camera("perspective", position=position, target=(0, 0, 0), fov_y_deg=40.0)
    floor = [(-1.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 0.0, -1.0), (-1.0, 0.0, -1.0)]
    scene = make_scene([make_polygon(floor, texture="c")], camera=camera, textures={"c": texture})
    size = (9, 7)
    exact = render(scene, "reference:", size=size)
    monkeypatch.setattr(textured, "MOST_CROSSINGS", 1e5)
    means = render(scene, "reference:time=center", size=size)
    assert (exact.uncertainty_kind, means.uncertainty_kind) == ("bound", "bound")
    assert exact.uncertainty is not None
    assert means.uncertainty is not None
    assert exact.uncertainty < 2e-7
    assert exact.uncertainty < means.uncertainty < 0.1
    assert 0.0 < np.abs(means.pixels - exact.pixels).max() <= means.uncertainty + exact.uncertainty
