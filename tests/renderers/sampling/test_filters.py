"""Laws of every filter at several radii: integral 1, nothing past the radius, symmetry, and G as the integral of g."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad, quad_vec

from aliasbench.renderers.sampling.filters import FILTERS, FilterSpec, filter_of, make_filter
from aliasbench.renderers.technique import FILTER_RADII, parse_technique
from aliasbench.scenes.errors import InputError

SEPARABLE = [name for name, kind in FILTERS.items() if kind.separable]
RADII = (0.07, 0.3, 0.5, 0.5000001, 0.8, 1.0, 1.5, 2.0, 2.71, 3.0, 7.0)
# sums of some ten terms of size 1, or 3 with lobes
CLOSE = 3e-15


def integrate(spec: FilterSpec, low: float, high: float) -> float:
    """Integrate the profile piece by piece between its knots, and within lobes, by scipy."""
    inner = [k for k in {*spec.knots, *np.arange(-8.0, 9.0)} if low < k < high]
    ends = [low, *sorted(inner), high]
    return sum(
        quad(lambda x: float(spec.profile(x)), a, b, epsabs=1e-13, epsrel=1e-12)[0] for a, b in itertools.pairwise(ends)
    )


def test_registry_has_every_filter_of_the_technique_text() -> None:
    assert set(FILTERS) == set(FILTER_RADII)
    assert sorted(kind.code for kind in FILTERS.values()) == list(range(len(FILTERS)))


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("name", SEPARABLE)
def test_integral_of_the_profile_is_one(name: str, radius: float) -> None:
    spec = make_filter(name, radius)
    assert abs(integrate(spec, -radius, radius) - 1.0) < 1e-12
    assert spec.integral(np.array([-radius, 0.0, radius])) == pytest.approx([0.0, 0.5, 1.0], abs=CLOSE)
    assert spec.integral(np.array([-radius - 1.0, radius + 1.0])).tolist() == [0.0, 1.0]


@pytest.mark.parametrize("radius", RADII)
def test_integral_of_the_cone_is_one(radius: float) -> None:
    spec = make_filter("cone", radius)
    ring = quad(lambda rho: 2 * np.pi * rho * float(spec.evaluate(rho * 0.6, rho * 0.8)), 0, radius)[0]
    assert abs(ring - 1.0) < 1e-13
    assert float(spec.evaluate(0.0, 0.0)) == pytest.approx(3 / (np.pi * radius**2), rel=1e-15)


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("name", FILTERS)
def test_filter_is_zero_past_its_radius(name: str, radius: float) -> None:
    spec = make_filter(name, radius)
    past = radius * np.array([1.0 + 1e-12, 1.1, 5.0, 1e6])
    assert not spec.evaluate(past, 0.0).any()
    assert not spec.evaluate(0.1 * radius, -past).any()
    assert float(spec.evaluate(0.9 * radius, 0.1 * radius)) != 0.0


@pytest.mark.parametrize("name", FILTERS)
def test_filter_is_symmetric(name: str) -> None:
    spec = make_filter(name, 1.7)
    x, y = np.random.default_rng(1).uniform(-1.8, 1.8, (2, 500))
    value = spec.evaluate(x, y)
    assert np.array_equal(value, spec.evaluate(-x, y))
    assert np.array_equal(value, spec.evaluate(x, -y))
    assert np.allclose(value, spec.evaluate(y, x), rtol=1e-14, atol=0)


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("name", SEPARABLE)
def test_integral_up_to_x_is_the_integral_of_the_profile(name: str, radius: float) -> None:
    spec = make_filter(name, radius, sigma=0.4)
    for share in (-0.97, -0.6, -0.41, -0.05, 0.0, 0.3, 0.5, 0.77, 0.999):
        x = share * radius
        assert abs(float(spec.integral(x)) - integrate(spec, -radius, x)) < 1e-12
        assert abs(float(spec.integral(x)) + float(spec.integral(-x)) - 1.0) < CLOSE


@pytest.mark.parametrize("name", SEPARABLE)
def test_slope_of_the_integral_is_the_profile(name: str) -> None:
    spec = make_filter(name, 2.3, sigma=0.7)
    x = np.random.default_rng(2).uniform(-2.2, 2.2, 200)
    x = x[np.min(np.abs(x[:, None] - np.array(spec.knots)), axis=1) > 1e-3]
    h = 1e-4
    slope = (
        8 * (spec.integral(x + h) - spec.integral(x - h)) - spec.integral(x + 2 * h) + spec.integral(x - 2 * h)
    ) / (12 * h)
    # rounding of G over h, and h^4 / 30 times the fourth derivative of g
    assert len(x) > 150
    assert np.abs(slope - spec.profile(x)).max() < 1e-11


@pytest.mark.parametrize("name", SEPARABLE)
def test_filter_is_the_product_of_its_profiles(name: str) -> None:
    spec = make_filter(name, 1.3)
    x, y = np.random.default_rng(3).uniform(-1.3, 1.3, (2, 100))
    assert np.array_equal(spec.evaluate(x, y), spec.profile(x) * spec.profile(y))


@pytest.mark.parametrize("name", FILTERS)
def test_peak_is_the_largest_value_along_one_axis(name: str) -> None:
    spec = make_filter(name, 1.4)
    x = np.linspace(-1.4, 1.4, 41)
    along = quad_vec(lambda y: spec.evaluate(x, y), -1.4, 1.4, points=[-0.7, 0.0, 0.7])[0]
    assert along.max() == pytest.approx(spec.peak, rel=1e-7)
    x = np.linspace(-1.4, 1.4, 2001)
    assert np.abs(spec.evaluate(x[:, None], x[None, :])).mean() * 2.8**2 == pytest.approx(spec.gain, rel=3e-3)


def test_figures_of_the_gaussian() -> None:
    cut, whole = make_filter("gaussian", 1.5), make_filter("gaussian", np.inf)
    # the share of the infinite Gaussian within the square of half-width 3 sigma
    assert (float(whole.integral(1.5)) - float(whole.integral(-1.5))) ** 2 == pytest.approx(0.9946077, abs=5e-8)
    ratio = float(whole.evaluate(0.2, 0.9)) / float(cut.evaluate(0.2, 0.9))
    assert ratio == pytest.approx(0.9946077, abs=5e-8)
    assert float(whole.evaluate(0.0, 0.0)) == pytest.approx(1 / (2 * np.pi * 0.25), rel=1e-15)
    assert whole.margin == 4
    assert float(whole.integral(-whole.support)) < 1e-16


def test_filters_have_their_closed_forms() -> None:
    x = np.array([-1.9, -0.8, 0.0, 0.3, 1.0, 1.6])
    absolute = np.abs(x)
    assert np.allclose(make_filter("tent", 2.0).profile(x), (1 - absolute / 2) / 2, atol=1e-16)
    mitchell = np.where(
        absolute < 1,
        (7 * absolute**3 - 12 * absolute**2 + 16 / 3) / 6,
        (-7 / 3 * absolute**3 + 12 * absolute**2 - 20 * absolute + 32 / 3) / 6,
    )
    assert np.allclose(make_filter("mitchell", 2.0).profile(x), mitchell, atol=1e-15)
    assert np.allclose(make_filter("mitchell", 5.0).profile(2.5 * x), mitchell / 2.5, atol=1e-15)
    lanczos = make_filter("lanczos", 3.0)
    # the same shape as the unnormalised window, whose integral is not 1
    assert np.allclose(lanczos.profile(x), np.sinc(x) * np.sinc(x / 3) * float(lanczos.profile(0.0)), atol=1e-15)
    assert float(lanczos.profile(0.0)) == pytest.approx(1 / 0.9970553459, rel=1e-9)
    # zeros at the whole pixels are what the lobes are counted by
    assert np.abs(lanczos.profile(np.array([1.0, 2.0, 3.0]))).max() < 1e-16


def test_margin_reaches_what_the_filter_does() -> None:
    margins = {r: make_filter("tent", r).margin for r in (0.2, 0.5, 0.51, 1.0, 1.5, 1.6, 2.5)}
    assert margins == {0.2: 0, 0.5: 0, 0.51: 1, 1.0: 1, 1.5: 1, 1.6: 2, 2.5: 2}


def test_technique_names_the_filter() -> None:
    assert filter_of(parse_technique("reference:filter=pyramid")).name == "tent"
    spec = filter_of(parse_technique("reference:filter=gaussian,radius=inf,sigma=.4"))
    assert (spec.name, spec.radius, spec.sigma) == ("gaussian", np.inf, 0.4)
    assert filter_of(parse_technique("raytrace:spp=4")).radius == 0.5


def test_bad_filters_are_named() -> None:
    with pytest.raises(InputError, match="unknown filter 'gausian'; did you mean 'gaussian'"):
        make_filter("gausian", 1.0)
    with pytest.raises(InputError, match="radius=0: must be a finite number above 0"):
        make_filter("tent", 0.0)
    with pytest.raises(InputError, match="radius=inf: must be a finite number"):
        make_filter("tent", np.inf)
    with pytest.raises(InputError, match="sigma=-1: must be"):
        make_filter("gaussian", 1.0, -1.0)
    with pytest.raises(InputError, match="filter=cone is radial: it has no profile"):
        make_filter("cone", 1.0).profile(0.0)


def test_params_cannot_be_written() -> None:
    with pytest.raises(ValueError, match="read-only"):
        make_filter("box", 0.5).params[0] = 3.0
