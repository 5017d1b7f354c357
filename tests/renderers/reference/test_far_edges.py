"""The bound of a reference holds for polygons that reach far out of the picture, against rational arithmetic."""

from fractions import Fraction

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, Scene
from aliasbench.scenes.shapes import polygon

W, H = 24, 16


def exact_coverage(a, b):
    """Return (H, W): how much of each pixel lies to the left of the line from a to b, in world units of a pixel."""
    (ax, ay), (bx, by) = ((Fraction(float(v)) for v in p) for p in (a, b))
    nx, ny = ay - by, bx - ax
    out = np.zeros((H, W))
    for i in range(H):
        for j in range(W):
            x, y = Fraction(j - W // 2), Fraction(H // 2 - i)
            corners = [(x, y - 1), (x + 1, y - 1), (x + 1, y), (x, y)]
            side = [nx * (p - ax) + ny * (q - ay) for p, q in corners]
            if min(side) >= 0 or max(side) <= 0:
                out[i, j] = float(min(side) >= 0)
                continue
            kept = []
            for k in range(4):
                p, q, d, e = corners[k - 1], corners[k], side[k - 1], side[k]
                if (d >= 0) != (e >= 0):
                    kept.append(tuple(u + d / (d - e) * (v - u) for u, v in zip(p, q, strict=True)))
                if e >= 0:
                    kept.append(q)
            twice = sum(kept[k - 1][0] * kept[k][1] - kept[k - 1][1] * kept[k][0] for k in range(len(kept)))
            out[i, j] = float(abs(twice) / 2)
    return out


@pytest.mark.parametrize("far", [10.0, 1e3, 1e5, 1e7])
def test_the_bound_holds_however_far_an_edge_reaches(far):
    along, across = np.array([0.8, 0.6]), np.array([-0.6, 0.8])
    reach = far * W
    ends = [0.3 * across - reach * along, 0.3 * across + 0.77 * reach * along]
    outline = [*ends, 0.5 * reach * along + reach * across, -0.9 * reach * along + 0.6 * reach * across]
    scene = Scene("far", Camera("orthographic", height=float(H)), (polygon(np.c_[outline, np.zeros(4)]),))
    frame = render(scene, "reference:", size=(W, H))
    error = np.abs(frame.pixels[..., 0] - exact_coverage(*ends)).max()
    assert error <= frame.uncertainty
    # and is no wider than some thousand roundings of the coordinates
    assert frame.uncertainty <= max(1e-12, 1e3 * 2.0**-53 * reach)
    if far == 10.0:
        assert frame.uncertainty == 1e-12


@pytest.mark.parametrize("steep", [2.0**-6, 0.5, 8.0])
@pytest.mark.parametrize("reach", [2.0**5, 2.0**20, 2.0**27])
def test_the_bound_holds_where_parallel_rays_begin(reach, steep):
    # depth steep (y - 3/8 x - 1/4), so that all coordinates are exact: what lies above the line is before the camera
    corners = [(-reach, -reach), (reach, -reach), (0.5 * reach, reach), (-reach, 0.75 * reach)]
    outline = [(x, y, 4.0 - steep * (y - 0.375 * x - 0.25)) for x, y in corners]
    scene = Scene("near", Camera("orthographic", (0.0, 0.0, 4.0), height=float(H)), (polygon(outline),))
    frame = render(scene, "reference:", size=(W, H))
    error = np.abs(frame.pixels[..., 0] - exact_coverage((0.0, 0.25), (8.0, 3.25))).max()
    assert error <= frame.uncertainty
    assert frame.uncertainty <= 1e-12 + 1e-12 * reach * max(1.0, 1.0 / steep)


def test_what_reaches_beyond_a_scene_file_s_limits_is_refused():
    scene = Scene("vast", Camera("orthographic", height=2.0), (polygon([(-1e13, 0, 0), (1e13, 0, 0), (0, 1e13, 0)]),))
    with pytest.raises(InputError, match=r"object number 0 reaches 1e\+13 units .* up to 1e\+12 is drawn"):
        render(scene, "reference:", size=(W, H))
