"""Laws of every warp at several radii and sigmas: it inverts the filter's distribution, and keeps strata strata."""

import functools
import itertools
import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import chi2

from aliasbench.renderers.sampling.filters import FILTERS, FilterSpec, make_filter
from aliasbench.renderers.sampling.warps import (
    DISC,
    IDENTITY,
    LECTURE,
    LOBES,
    QUANTILE,
    ROOT,
    STRETCH,
    Warp,
    filter_warp,
    make_warp,
    warp_lanes,
    warp_points,
)
from aliasbench.renderers.technique import FILTER_RADII, parse_technique
from aliasbench.scenes.model import FloatArray

Case = tuple[str, float, float]
INF = math.inf
CASES: list[Case] = [
    *[("box", r, 0.5) for r in (0.2, 0.5, 3.0)],
    *[("tent", r, 0.5) for r in (0.1, 0.4, 1.0, 20.0)],
    *[("cone", r, 0.5) for r in (0.2, 1.0, 20.0)],
    *[
        ("gaussian", r, s)
        for r, s in ((0.3, 0.5), (1.5, 0.5), (1.5, 1.5), (2.0, 90.0), (20.0, 0.7), (INF, 0.5), (INF, 0.1))
    ],
    *[("mitchell", r, 0.5) for r in (0.3, 2.0, 20.0)],
    *[("lanczos", r, 0.5) for r in (0.4, 1.0, 1.7, 2.0, 3.0, math.nextafter(3.0, 4.0), 3.0001, 20.0)],
]
PRODUCTS = [case for case in CASES if FILTERS[case[0]].separable]
WITH_LOBES = [case for case in CASES if case[0] in ("mitchell", "lanczos")]
EDGES = np.array(
    [0.0, 2.0**-60, 2.0**-53, 2.0**-32, 0.5 - 2.0**-53, 0.5, 0.5 + 2.0**-32, 1.0 - 2.0**-32, 1.0 - 2.0**-53]
)


@functools.cache
def pair(case: Case) -> tuple[FilterSpec, Warp]:
    spec = make_filter(*case)
    return spec, filter_warp(spec)


def units(count: int, seed: int) -> FloatArray:
    """Return (2, count) numbers as the hashes give them, multiples of 2^-32 in [0, 1), none of them 0."""
    return np.random.default_rng(seed).integers(1, 2**32, (2, count)) * 2.0**-32


def axis(warp: Warp, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the offsets and signs along x, at the middle of y, where every profile is positive."""
    dx, _, sign = warp_points(warp, u, np.full_like(u, 0.5))
    return dx, sign


@functools.cache
def turns(case: Case) -> tuple[FloatArray, FloatArray]:
    """Return where a profile changes sign, and the ends, with the integral of its absolute value up to each.

    Found by a scan of the profile, which knows nothing of what the warp does: a lobe is half a pixel wide or more, but
    for what a radius just beyond a whole number leaves, which holds less than 1e-12 of the mass.
    """
    spec = pair(case)[0]
    grid = np.linspace(-spec.support, spec.support, 2011)
    value = spec.profile(grid)
    inner = [
        brentq(lambda x: float(spec.profile(x)), grid[k], grid[k + 1], xtol=1e-15)
        for k in range(1, len(grid) - 2)
        if value[k] * value[k + 1] < 0.0
    ]
    places = np.array([-spec.support, *inner, spec.support])
    return places, np.concatenate([[0.0], np.cumsum(np.abs(np.diff(spec.integral(places))))])


def share_below(case: Case, x: FloatArray) -> FloatArray:
    """Return the integral of abs g up to x over the whole."""
    spec = pair(case)[0]
    places, sums = turns(case)
    k = np.clip(np.searchsorted(places, x, side="right") - 1, 0, len(places) - 2)
    return np.asarray((sums[k] + np.abs(spec.integral(x) - spec.integral(places[k]))) / sums[-1])


@pytest.mark.parametrize("case", PRODUCTS)
def test_the_share_of_the_filter_below_a_point_is_u(case: Case) -> None:
    spec, warp = pair(case)
    _, sums = turns(case)
    near = np.add.outer(sums[1:-1] / sums[-1], [-1e-3, -1e-7, -1e-12, 0.0, 1e-12, 1e-7, 1e-3]).ravel()
    u = np.concatenate([units(4000, 1)[0], near[(near >= 0.0) & (near < 1.0)], EDGES])
    dx, _ = axis(warp, u)
    miss = np.abs(share_below(case, dx) - u)
    assert miss.max() < 1e-11
    # in pixels, where the distribution is steep enough for its rounding (1e-15) not to hide the warp's
    slope = np.abs(spec.profile(dx)) / sums[-1]
    steep = slope > 1e-3 / spec.support
    assert steep.mean() > 0.95
    assert (miss[steep] / slope[steep]).max() < 1e-10 * max(1.0, spec.support / 3.0)


@pytest.mark.parametrize("case", [("mitchell", 2.0, 0.5), ("lanczos", 3.0, 0.5), ("lanczos", 1.7, 0.5)])
def test_tails_have_the_mass_that_is_asked_for(case: Case) -> None:
    """The share past a point is u, down to masses that the distribution function cannot resolve, in terms of pixels."""
    spec, warp = pair(case)
    u = np.exp2(-np.linspace(12.0, 40.0, 400))
    dx, _ = axis(warp, u)
    points, weights = np.polynomial.legendre.leggauss(12)
    depth = dx + spec.radius
    inside = np.abs(spec.profile(-spec.radius + depth[:, None] * 0.5 * (points + 1.0))) @ weights * 0.5 * depth
    slope = np.abs(spec.profile(dx))
    assert inside[-1] < 1e-11
    assert np.abs((inside - u * turns(case)[1][-1]) / slope).max() < 1e-11


@pytest.mark.parametrize("case", CASES)
def test_the_jacobian_is_one_over_the_density(case: Case) -> None:
    """Central differences with steps h and h / 2: the error of the second is a third of what they differ by, and below.

    Left out are the points next to where the map has no third derivative: knots, zeros and ends, diagonals of the cone.
    """
    spec, warp = pair(case)
    u, v = units(3000, 2)
    half = np.minimum(u, 1.0 - u), np.minimum(v, 1.0 - v)
    keep = (half[0] > 0.02) & (half[1] > 0.02) & (np.abs(u - 0.5) > 0.01) & (np.abs(v - 0.5) > 0.01)
    if warp.code == DISC:
        keep &= np.abs(half[0] - half[1]) > 0.01
    else:
        corners = np.concatenate([turns(case)[0], spec.knots])
        shares = share_below(case, corners)
        keep &= (np.abs(np.subtract.outer(u, shares)).min(axis=1) > 0.005) & (
            np.abs(np.subtract.outer(v, shares)).min(axis=1) > 0.005
        )
    u, v = u[keep], v[keep]
    assert len(u) > 300

    def jacobian(h: float) -> FloatArray:
        ax, ay, _ = warp_points(warp, u + h, v)
        bx, by, _ = warp_points(warp, u - h, v)
        cx, cy, _ = warp_points(warp, u, v + h)
        ex, ey, _ = warp_points(warp, u, v - h)
        return np.abs((ax - bx) * (cy - ey) - (ay - by) * (cx - ex)) / (4.0 * h * h)

    dx, dy, _ = warp_points(warp, u, v)
    density = np.abs(spec.evaluate(dx, dy)) / warp.gain
    h = 2.0**-10
    fine, coarse = jacobian(h / 2) * density, jacobian(h) * density
    # two differences of numbers that are 4e-12 of the support off, over steps h
    rounding = 2.0 * 4e-12 / h * spec.support * density**0.5
    bound = np.abs(fine - coarse) + 1e-6 + rounding
    assert np.median(bound) < 1e-3
    assert (np.abs(fine - 1.0) < bound).all()


@pytest.mark.parametrize("case", [case for case in CASES if case[0] == "cone"])
def test_squares_become_circles_of_their_share_of_the_cone(case: Case) -> None:
    """The disc of radius rho holds 3 rho^2 - 2 rho^3 of the unit cone, and eighths of a side are eighths of a turn."""
    spec, warp = pair(case)
    u, v = (np.concatenate([part, EDGES]) for part in units(3000, 2))
    dx, dy, _ = warp_points(warp, u, v)
    a, b = 2.0 * u - 1.0, 2.0 * v - 1.0
    rho = np.hypot(dx, dy) / spec.radius
    square = np.maximum(np.abs(a), np.abs(b))
    assert np.abs((3.0 - 2.0 * rho) * rho**2 - square**2).max() < 1e-11
    for x, y, right in ((a, b, a > np.abs(b)), (b, a, b > np.abs(a))):
        turn = np.arctan2(dy, dx) if x is a else np.arctan2(dx, dy)
        assert right.sum() > 500
        assert np.abs(turn[right] - 0.25 * np.pi * y[right] / x[right]).max() < 1e-15


def midpoints(bits: int) -> FloatArray:
    return (np.arange(1 << bits) + 0.5) * 2.0**-bits


@pytest.mark.parametrize("power", [0, 1, 2])
@pytest.mark.parametrize("case", PRODUCTS)
def test_moments_are_the_filters(case: Case, power: int) -> None:
    """The mean of sign x^k over midpoints, times the gain along an axis, against the integral of x^k g."""
    spec, warp = pair(case)
    u = midpoints(16)
    dx, sign = axis(warp, u)
    values = sign * dx**power
    places, _ = turns(case)
    ends = sorted({*places, *spec.knots, *(x for x in np.arange(-20.0, 21.0) if abs(x) < spec.support)})
    ends_at = np.array([(a, b) for a, b in itertools.pairwise(ends)])
    points, weights = np.polynomial.legendre.leggauss(64)  # at most a pixel, or all of a Gaussian: exact to rounding
    at = ends_at[:, :1] + np.diff(ends_at, axis=1) * 0.5 * (points + 1.0)
    exact = float((at**power * spec.profile(at) @ weights * 0.5 * np.diff(ends_at, axis=1)[:, 0]).sum())
    # a mean over midpoints is off by half a step times the total variation at most; the ends are not among them
    ends_of_it = np.abs(axis(warp, np.array([0.0, 1.0 - 2.0**-32]))[0]) ** power
    variation = np.abs(np.diff(values)).sum() + 2.0 * ends_of_it.sum()
    bound = math.sqrt(warp.gain) * variation / len(u) + 1e-11
    assert bound < 5e-3 * max(1.0, spec.support**power)
    assert abs(math.sqrt(warp.gain) * values.mean() - exact) < bound
    if power == 1:
        assert abs(values.mean()) < 1e-13 * spec.support


@pytest.mark.parametrize("case", [case for case in CASES if case[0] == "cone"])
def test_moments_of_the_cone(case: Case) -> None:
    """Means over midpoints of the square: rho has 3 rho^2 dF, so its moments are 1/2 and 3/10 (of the square)."""
    radius = case[1]
    u = midpoints(10)
    dx, dy, sign = warp_points(pair(case)[1], u[:, None], u[None, :])
    assert (sign == 1.0).all()
    # integrals of 6 rho^2 (1 - rho) and 6 rho^3 (1 - rho); half a step times what one axis varies by, on both
    for value, exact in ((np.hypot(dx, dy), 0.5 * radius), (dx**2 + dy**2, 0.3 * radius**2), (dx**2, 0.15 * radius**2)):
        assert abs(value.mean() - exact) < 2.0 * value.max() / len(u)
        assert abs(value.mean() - exact) < 2e-3 * value.max()
    assert abs(dx.mean()) < 1e-14 * radius
    assert abs((dx * dy).mean()) < 1e-14 * radius**2


@pytest.mark.parametrize("case", CASES)
def test_no_point_is_beyond_the_radius(case: Case) -> None:
    spec, warp = pair(case)
    u, v = (
        np.concatenate(parts)
        for parts in zip(units(5000, 3), np.array(list(itertools.product(EDGES, EDGES))).T, strict=True)
    )
    dx, dy, sign = warp_points(warp, u, v)
    assert np.isfinite(dx).all()
    assert np.isfinite(dy).all()
    assert set(sign.tolist()) <= {1.0, -1.0}
    reach = np.hypot(dx, dy) if warp.code == DISC else np.maximum(np.abs(dx), np.abs(dy))
    assert reach.max() <= min(spec.radius, 9.0 * spec.sigma if spec.name == "gaussian" else INF)
    assert reach.max() > 0.9 * min(spec.radius, 8.0 * spec.sigma if spec.name == "gaussian" else INF)


@pytest.mark.parametrize("case", CASES)
def test_signs_and_gain_are_the_filters(case: Case) -> None:
    spec, warp = pair(case)
    u, v = units(5000, 4)
    dx, dy, sign = warp_points(warp, u, v)
    value = spec.evaluate(dx, dy)
    clear = np.abs(value) > 1e-9 * spec.peak**2
    assert clear.mean() > 0.99
    assert np.array_equal(sign[clear], np.sign(value[clear]))
    expected = turns(case)[1][-1] ** 2 if FILTERS[case[0]].separable else 1.0
    assert warp.gain == pytest.approx(expected, rel=1e-12)


def test_gains_of_the_common_filters() -> None:
    # In t = 2 - abs x Mitchell's lobe is t^2 (7 t - 6) / 18 on [0, 6/7] with the integral -t^3 / 36 at the end.
    lobe = (6.0 / 7.0) ** 3 / 36.0
    assert pair(("mitchell", 2.0, 0.5))[1].gain == pytest.approx((1.0 + 4.0 * lobe) ** 2, rel=1e-13)
    assert [pair((name, FILTER_RADII[name], 0.5))[1].gain for name in ("box", "tent", "cone", "gaussian")] == [1.0] * 4
    assert pair(("lanczos", 1.0, 0.5))[1].gain == pytest.approx(1.0, rel=1e-13)


@pytest.mark.parametrize("case", CASES)
def test_warps_have_the_symmetry_of_the_square(case: Case) -> None:
    warp = pair(case)[1]
    u, v = units(2000, 5)
    dx, dy, sign = warp_points(warp, u, v)
    for mirrored, back in (
        (warp_points(warp, 1.0 - u, v), (-dx, dy, sign)),
        (warp_points(warp, u, 1.0 - v), (dx, -dy, sign)),
        (warp_points(warp, v, u), (dy, dx, sign)),
    ):
        assert all(np.array_equal(a, b) for a, b in zip(mirrored, back, strict=True))
    centre = warp_points(warp, 0.5, 0.5)
    assert max(abs(float(centre[0])), abs(float(centre[1]))) < 3e-16 * max(1.0, pair(case)[0].support)
    assert float(centre[2]) == 1.0


@pytest.mark.parametrize("case", PRODUCTS)
def test_products_take_each_axis_alone_and_keep_its_order(case: Case) -> None:
    warp = pair(case)[1]
    u = np.sort(units(3000, 6)[0])
    dx, sign = axis(warp, u)
    # the polynomials of two cells meet, each off by 2e-12 of a piece at most
    assert (np.diff(dx) > -1e-15 * pair(case)[0].support).all()
    v = units(3000, 7)[1]
    other, dy, signs = warp_points(warp, u, v)
    assert np.array_equal(other, dx)
    assert np.array_equal(dy, axis(warp, v)[0])
    assert np.array_equal(signs, sign * axis(warp, v)[1])


@pytest.mark.parametrize("name", FILTERS)
def test_random_points_are_spread_like_the_filter(name: str) -> None:
    """Chi-square on 24 x 24 squares over the support, expected counts by the rule of 40 x 40 midpoints in each."""
    case = (name, FILTER_RADII[name], 0.5)
    spec, warp = pair(case)
    dx, dy, _ = warp_points(warp, *units(200_000, 8))
    cells, inner = 24, 40
    x = (np.arange(cells * inner) + 0.5) / (cells * inner) * 2.0 * spec.radius - spec.radius
    weight = np.abs(spec.evaluate(x[:, None], x[None, :])).reshape(cells, inner, cells, inner).sum(axis=(1, 3))
    expected = len(dx) * weight / weight.sum()
    found = np.histogram2d(dx, dy, bins=cells, range=[[-spec.radius, spec.radius]] * 2)[0]
    assert found.sum() == len(dx)
    many = expected > 10.0
    statistic = ((found - expected)[many] ** 2 / expected[many]).sum()
    assert many.sum() > 300
    assert 1e-4 < chi2.sf(statistic, many.sum() - 1) < 1.0 - 1e-4


@pytest.mark.parametrize("radius", [0.2, 0.5, 3.0])
def test_the_box_is_affine(radius: float) -> None:
    u, v = units(1000, 9)
    dx, dy, sign = warp_points(filter_warp(make_filter("box", radius)), u, v)
    assert np.array_equal(dx, (u - 0.5) * (2.0 * radius))
    assert np.array_equal(dy, (v - 0.5) * (2.0 * radius))
    assert (sign == 1.0).all()


def lecture(name: str) -> Warp:
    return make_warp(parse_technique(f"raytrace:spp=4,filter={name},weighting=distribution,warp=lecture"))


def test_the_lectures_gaussian_is_as_printed() -> None:
    s, t = units(20_000, 10)
    s[:4], t[:9] = [1.0 - 2.0**-53, 0.5, 2.0**-32, 2.0**-50], np.arange(9) / 8.0 - np.array([0.0] * 8 + [2.0**-53])
    dx, dy, sign = warp_points(lecture("gaussian"), s, t)
    a, b = 0.4 * np.sqrt(-2.0 * np.log(s)), 2.0 * np.pi * t
    # b is rounded by 2^-53 of 2 pi twice (the constant and the product), a and the product by some units of 2^-53
    tolerance = a * (4.0 * np.pi + 8.0) * 2.0**-53
    assert (np.abs(dx - a * np.sin(b)) <= tolerance).all()
    assert (np.abs(dy - a * np.cos(b)) <= tolerance).all()
    assert (np.abs(np.hypot(dx, dy) - a) <= 8e-16 * a).all()
    assert (sign == 1.0).all()
    assert lecture("gaussian").gain == 1.0


def test_the_lectures_gaussian_takes_the_smallest_float_for_zero() -> None:
    dx, dy, _ = warp_points(lecture("gaussian"), np.zeros(5), np.array([0.0, 0.25, 0.5, 0.75, 0.125]))
    a = 0.4 * math.sqrt(-2.0 * math.log(5e-324))
    assert a == pytest.approx(15.43440, abs=1e-5)
    half = a * math.sqrt(0.5)
    assert np.allclose(dx, [0.0, a, 0.0, -a, half], rtol=4e-16, atol=4e-16)
    assert np.allclose(dy, [a, 0.0, -a, 0.0, half], rtol=4e-16, atol=4e-16)


def test_the_lectures_gaussian_is_a_gaussian_of_sigma_mu() -> None:
    dx, dy, _ = warp_points(lecture("gaussian"), *units(200_000, 11))
    for x in (dx, dy):
        # standard errors of a variance and of a mean
        assert abs(x.var() / 0.16 - 1.0) < 4.0 * math.sqrt(2.0 / len(x))
        assert abs(x.mean()) < 4.0 * 0.4 / math.sqrt(len(x))


def test_shirleys_formula_is_as_printed_and_the_tent_of_radius_1() -> None:
    s, t = units(5000, 12)
    s[:5] = [0.0, 0.5, 0.5 - 2.0**-53, 0.25, 1.0 - 2.0**-32]
    dx, dy, sign = warp_points(lecture("tent"), s, t)
    for offset, number in ((dx, s), (dy, t)):
        low, high = -0.5 + np.sqrt(2.0 * number), 1.5 - np.sqrt(2.0 - 2.0 * number)
        # printed around .5, whose subtraction rounds a number below 2 once more
        assert (np.abs(offset - (np.where(number < 0.5, low, high) - 0.5)) <= 2.0**-52).all()
        assert np.array_equal(
            offset, np.where(number < 0.5, np.sqrt(2.0 * number) - 1.0, 1.0 - np.sqrt(2.0 - 2.0 * number))
        )
    assert (sign == 1.0).all()
    wide = make_warp(parse_technique("raytrace:spp=4,filter=tent,radius=3,weighting=distribution,warp=lecture"))
    assert np.array_equal(warp_points(wide, s, t)[0], dx)
    assert np.array_equal(warp_points(filter_warp(make_filter("tent", 1.0)), s, t)[0], dx)


def test_techniques_name_their_warp() -> None:
    codes = {
        "raytrace:spp=4,filter=lanczos": IDENTITY,
        "raster:passes=4,weighting=distribution": IDENTITY,
        "raytrace:spp=4,radius=1,weighting=distribution": STRETCH,
        "raytrace:spp=4,filter=tent,weighting=distribution": ROOT,
        "raytrace:spp=4,filter=cone,weighting=distribution": DISC,
        "raytrace:spp=4,filter=gaussian,radius=inf,weighting=distribution": QUANTILE,
        "raytrace:spp=4,filter=gaussian,weighting=distribution,warp=lecture": LECTURE,
        "raytrace:spp=4,filter=mitchell,weighting=distribution": LOBES,
        "raytrace:spp=4,filter=lanczos,radius=2,weighting=distribution": LOBES,
    }
    assert {text: make_warp(parse_technique(text)).code for text in codes} == codes
    assert make_warp(parse_technique("raytrace:spp=4,filter=lanczos")).gain == 1.0
    narrow = make_warp(parse_technique("raytrace:spp=4,filter=gaussian,radius=1.2,sigma=.3,weighting=distribution"))
    assert np.array_equal(narrow.table, pair(("gaussian", 1.2, 0.3))[1].table)
    with pytest.raises(ValueError, match="read-only"):
        narrow.table[0, 0] = 1.0


@pytest.mark.parametrize("name", [*FILTERS, "lecture"])
def test_lanes_are_warped_alone_in_place_and_always_alike(name: str) -> None:
    warp = lecture("gaussian") if name == "lecture" else pair((name, FILTER_RADII[name], 0.5))[1]
    u, v = units(16, 13)
    expected = np.array(warp_points(warp, u, v))
    assert np.array_equal(expected, warp_points(warp, u, v))
    for lanes in (1, 7, 8, 16):
        scratch = np.full(100, np.nan)
        scratch[5:21], scratch[40:56] = u, v
        warp_lanes(warp, scratch, 40, 5, 70, lanes)  # rows in another order: x is read from v
        swapped = np.array(warp_points(warp, v, u))
        assert np.array_equal(scratch[[*range(40, 40 + lanes)]], swapped[0, :lanes])
        assert np.array_equal(scratch[5 : 5 + lanes], swapped[1, :lanes])
        assert np.array_equal(scratch[70 : 70 + lanes], swapped[2, :lanes])
        assert np.array_equal(scratch[5 + lanes : 21], u[lanes:])
        assert np.array_equal(scratch[40 + lanes : 56], v[lanes:])
        assert np.isnan(scratch[70 + lanes :]).all()


@pytest.mark.parametrize("case", [*PRODUCTS[-3:], ("gaussian", INF, 0.5), ("cone", 1.0, 0.5)])
def test_lanes_may_hold_what_somebody_left_there(case: Case) -> None:
    """A kernel warps whole packets, of which some lanes are nobody's samples: no table is read outside."""
    scratch = np.array([np.nan, np.inf, -np.inf, -1e300, 1e300, 512.3, -7.0, 1.0, 0.25] * 2 + [0.0] * 9)
    warp_lanes(pair(case)[1], scratch, 0, 9, 18, 9)
    assert scratch[[8, 17, 26]].tolist() == [float(part) for part in warp_points(pair(case)[1], 0.25, 0.25)]


def test_points_of_any_shape() -> None:
    warp = pair(("tent", 1.0, 0.5))[1]
    dx, dy, sign = warp_points(warp, np.array([[0.125], [0.5]]), np.array([0.125, 0.875, 0.5]))
    assert dx.tolist() == [[-0.5] * 3, [0.0] * 3]
    assert dy.tolist() == [[-0.5, 0.5, 0.0]] * 2
    assert sign.shape == (2, 3)
    assert all(part.shape == (0,) for part in warp_points(warp, np.empty(0), np.empty(0)))


@pytest.mark.parametrize("name", FILTERS)
def test_warped_strata_lower_the_variance(name: str) -> None:
    """k x k jittered strata against as many random samples, of a smooth picture.

    A function that is linear in its cell keeps 1 / k^2 of its variance: .03 for k = 6, and more where the map is steep.
    The sign of a filter with lobes jumps along whole rows of cells instead, 4 (Mitchell) or 8 (Lanczos) of some k cells
    out of k^2: hardly less than random samples for k = 8, and a half for k = 32.
    """
    warp = pair((name, FILTER_RADII[name], 0.5))[1]
    side, share, sets = (32, 0.75, 400) if name in ("mitchell", "lanczos") else (6, 0.15, 2000)
    u, v = np.random.default_rng(14).random((2, sets, side * side))
    cell = np.arange(side * side)
    variances = []
    for a, b in ((u, v), ((cell % side + u) / side, (cell // side + v) / side)):
        dx, dy, sign = warp_points(warp, a, b)
        variances.append((warp.gain * sign * np.exp(0.8 * dx - 0.5 * dy)).mean(axis=1).var())
    # the ratio of two variances of that many sets is known to sqrt(4 / sets), a tenth at most
    assert 0.0 < variances[1] < share * variances[0]
