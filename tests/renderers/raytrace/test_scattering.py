"""Laws of light paths: densities against analytic ones, energy against integrals, optics against its textbook forms."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, stats

from aliasbench.renderers.raytrace.scattering import (
    C_LINE_NM,
    D_LINE_NM,
    F_LINE_NM,
    LEAST_INDEX,
    cauchy,
    cosine_direction,
    disc_point,
    frame_of,
    fresnel,
    ggx_brdf,
    glass_direction,
    glossy_direction,
    index_at,
    light_point,
    normalized,
    quad_point,
    spectral_weights,
    wavelength_of,
)
from aliasbench.renderers.reference.irradiance import lambert
from aliasbench.scenes.lamps import square_form_factor
from aliasbench.scenes.model import FloatArray

LAST = 1.0 - 2.0**-32  # the largest number the samplers give
# Seeds are fixed, so the tests are too; a right answer would be refused by one seed in 150 000.
STANDARD_ERRORS = 4.5
LEAST_P = 1e-4
EPS = np.finfo(np.float64).eps
# Rows x, y, z of a right-handed frame that leans against all axes; surfaces face its z.
FRAME = np.linalg.qr(np.array([[0.3, -0.5, 0.7], [0.9, 0.2, 0.1], [-0.4, 0.8, 0.5]]))[0]
FRAME *= np.sign(np.linalg.det(FRAME))
NORMAL = tuple(FRAME[2].tolist())

ALPHAS = (0.1, 0.3, 1.0)
ANGLES_DEG = (0.0, 45.0, 75.0, 88.0)

units = st.floats(0.0, LAST)
anything = st.floats(-1e12, 1e12)
roughnesses = st.one_of(st.floats(0.001, 1.0), st.floats(0.0, 1.0, exclude_min=True))
indices = st.one_of(st.floats(0.5, 3.0), st.floats(0.0, 1e9, exclude_min=True))


@st.composite
def directions(draw: Any) -> tuple[float, float, float]:
    """Return unit vectors, those near the axes and their planes more often than by chance."""
    x, y, z = (draw(st.one_of(st.floats(-1.0, 1.0), st.sampled_from([0.0, -0.0, 1.0, -1.0, 1e-9]))) for _ in range(3))
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-6:
        return 0.0, 0.0, -1.0
    return x / length, y / length, z / length


def columns(count: int, *, seed: int, size: int = 2) -> list[list[float]]:
    return np.random.default_rng(seed).random((count, size)).tolist()


def viewed(angle_deg: float) -> tuple[float, ...]:
    """Return a ray's direction that meets the surface of NORMAL at an angle to it, from the x side of FRAME."""
    angle = math.radians(angle_deg)
    return tuple((-np.array([math.sin(angle), 0.0, math.cos(angle)]) @ FRAME).tolist())


def assert_mean(values: FloatArray, expected: float, slack: float = 0.0) -> None:
    error = values.std(ddof=1) / math.sqrt(len(values))
    assert abs(values.mean() - expected) <= STANDARD_ERRORS * error + slack


def assert_frequencies(counts: FloatArray, shares: FloatArray) -> None:
    """Assert that counts come from these shares, by chi-square; cells expecting under ten are put together."""
    counts, expected = counts.ravel().astype(float), shares.ravel() * counts.sum()
    few = expected < 10
    counts, expected = (np.append(a[~few], a[few].sum()) for a in (counts, expected))
    if expected[-1] < 10:
        counts, expected = (np.append(a[:-2], a[-2:].sum()) for a in (counts, expected))
    assert len(counts) > 20
    assert stats.chisquare(counts, expected * (counts.sum() / expected.sum())).pvalue > LEAST_P


# Discs, frames, diffuse directions


def test_the_disc_is_the_square_s_with_areas_kept() -> None:
    step = 1e-6
    for u, v in columns(500, seed=1):
        a, b = 2 * u - 1, 2 * v - 1
        x, y = disc_point(u, v)
        assert abs(math.hypot(x, y) - max(abs(a), abs(b))) < 4 * EPS
        if abs(abs(a) - abs(b)) < 4 * step or max(abs(a), abs(b)) < 0.01:
            continue  # the map has a kink on the diagonals
        by_u, by_v = (
            (np.array(disc_point(u + du, v + dv)) - disc_point(u - du, v - dv)) / (2 * step)
            for du, dv in ((step, 0.0), (0.0, step))
        )
        # Differences: 2e-16 / step of rounding and third derivatives (some 100 at radius .01) times step^2 / 6.
        assert np.linalg.det([by_u, by_v]) == pytest.approx(math.pi, abs=1e-8)


def test_the_disc_has_the_square_s_middle_sides_corners_and_neighbours() -> None:
    assert disc_point(0.5, 0.5) == (0.0, 0.0)
    places = {(1.0, 0.5): 0.0, (1.0, 1.0): 45.0, (0.5, 1.0): 90.0, (0.0, 1.0): 135.0, (0.0, 0.5): 180.0}
    places |= {(0.0, 0.0): 225.0, (0.5, 0.0): 270.0, (1.0, 0.0): 315.0}
    for (u, v), degrees in places.items():
        angle = math.radians(degrees)
        np.testing.assert_allclose(disc_point(u, v), (math.cos(angle), math.sin(angle)), atol=4 * EPS)
    # No jump anywhere, across the diagonals, across the middle: lengths grow less than 3 times (the two derivatives are
    # 2 sqrt(1 + (pi / 4)^2) and pi / 2 long at most).
    for u, v in [*columns(500, seed=2), *[[t, t] for t in np.linspace(0.001, 0.999, 99)], [0.5, 0.5], [0.5, 0.2]]:
        for du, dv in ((1e-9, 0.0), (0.0, 1e-9), (-1e-9, 1e-9)):
            moved = math.dist(disc_point(u, v), disc_point(u + du, v + dv))
            assert moved < 3 * math.hypot(du, dv) + 4 * EPS


@given(directions())
def test_frames_are_right_handed_and_orthonormal(n: tuple[float, float, float]) -> None:
    frame = np.array([*frame_of(*n), n])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=8 * EPS)
    assert np.linalg.det(frame) > 0


@pytest.mark.parametrize("nz", [-1.0, -1.0 + 1e-16, -1.0 + 1e-12, -1.0 + 1e-6, -1e-300, -0.0, 0.0, 1.0])
def test_frames_hold_near_the_pole_where_older_ones_break(nz: float) -> None:
    n = (math.sqrt((1 - nz) * (1 + nz)) * 0.6, math.sqrt((1 - nz) * (1 + nz)) * -0.8, nz)
    frame = np.array([*frame_of(*n), n])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=8 * EPS)


def test_diffuse_directions_have_the_cosine_s_density() -> None:
    out = np.array([cosine_direction(u, v, *NORMAL) for u, v in columns(100_000, seed=3)]) @ FRAME.T
    assert_mean(out[:, 2], 2 / 3)
    # Seen from above the points are uniform on the disc: r^2 and the angle are.
    square, turn = (out[:, :2] ** 2).sum(axis=1), np.arctan2(out[:, 1], out[:, 0]) / (2 * np.pi) % 1.0
    counts = np.histogram2d(square, turn, bins=(10, 16), range=((0, 1), (0, 1)))[0]
    assert counts.sum() == len(out)
    assert_frequencies(counts, np.full(counts.shape, 1 / counts.size))


# Glossy surfaces


def textbook_brdf(alpha: float, cos_i: float, cos_o: float, cos_h: float) -> float:
    """Return D G2 / (4 cos_i cos_o) as Heitz 2014 prints it (eq. 71, 72, 99)."""
    tan2 = [1 / c**2 - 1 for c in (cos_i, cos_o, cos_h)]
    masked = [(math.sqrt(1 + alpha**2 * t) - 1) / 2 for t in tan2[:2]]
    density = 1 / (math.pi * alpha**2 * cos_h**4 * (1 + tan2[2] / alpha**2) ** 2)
    return density / (1 + sum(masked)) / (4 * cos_i * cos_o)


def facet(alpha: float, psi: float, phi: float) -> tuple[FloatArray, float]:
    """Return the normal with tan(theta) = alpha tan(psi), and its solid angle d omega / (d psi d phi)."""
    slope = alpha * math.tan(psi)
    cos = 1 / math.sqrt(1 + slope * slope)
    sin = slope * cos
    return np.array([sin * math.cos(phi), sin * math.sin(phi), cos]), sin * cos**2 * alpha / math.cos(psi) ** 2


def albedo(alpha: float, angle_deg: float) -> float:
    """Return the reflected share by quadrature over halfway vectors: d omega_o = 4 (i . m) d omega_m."""
    i = np.array([math.sin(math.radians(angle_deg)), 0.0, math.cos(math.radians(angle_deg))])

    def integrand(psi: float, phi: float) -> float:
        m, solid = facet(alpha, psi, phi)
        seen = float(i @ m)
        cos_o = 2 * seen * m[2] - i[2]
        if seen <= 0 or cos_o <= 0:
            return 0.0
        return textbook_brdf(alpha, i[2], cos_o, m[2]) * cos_o * 4 * seen * solid

    value, error = integrate.dblquad(integrand, 0, math.pi, 0, math.pi / 2 - 1e-9, epsabs=1e-5, epsrel=0)
    assert error < 5e-5
    if alpha == 1:
        # D = 1 / pi and both slants are 1: the integral of c / (c + cos_i) over c in [0, 1].
        assert 2 * value == pytest.approx(1 - i[2] * math.log(1 + 1 / i[2]), abs=1e-4)
    return 2 * value


def glossy(alpha: float, angle_deg: float, count: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return directions in FRAME and weights."""
    d = viewed(angle_deg)
    drawn = [glossy_direction(u, v, alpha, *NORMAL, *d) for u, v in columns(count, seed=seed)]
    return np.array([o for o, _ in drawn]) @ FRAME.T, np.array([weight for _, weight in drawn])


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("angle", [20.0, 60.0, 85.0, 89.9])
def test_glossy_directions_have_the_visible_normals_density(alpha: float, angle: float) -> None:
    out, _ = glossy(alpha, angle, 60_000, seed=4)
    i = np.array([math.sin(math.radians(angle)), 0.0, math.cos(math.radians(angle))])
    m = out + i
    m /= np.linalg.norm(m, axis=1)[:, None]
    psi = np.arctan2(np.hypot(m[:, 0], m[:, 1]) / alpha, m[:, 2])
    phi = np.abs(np.arctan2(m[:, 1], m[:, 0]))
    bins, fine = (12, 12), 60
    counts = np.histogram2d(psi, phi, bins=bins, range=((0, np.pi / 2), (0, np.pi)))[0]
    assert counts.sum() == len(out)
    # D cos_m d omega = sin(2 psi) d psi d phi / 2 pi, so D_v = G1 D (i . m) / cos_i has this density; midpoint rule.
    grid_psi = (np.arange(bins[0] * fine) + 0.5) / (bins[0] * fine) * np.pi / 2
    grid_phi = (np.arange(bins[1] * fine) + 0.5) / (bins[1] * fine) * np.pi
    mean_i = 0.5 * (1 + math.sqrt(1 + (alpha * i[0] / i[2]) ** 2))  # 1 / G1
    tilt = i[0] / i[2] * alpha * np.tan(grid_psi)[:, None] * np.cos(grid_phi)
    density = np.maximum(1 + tilt, 0) * np.sin(2 * grid_psi)[:, None] / (np.pi * mean_i)
    shares = density.reshape(bins[0], fine, bins[1], fine).mean(axis=(1, 3)) * (np.pi / 2 / bins[0]) * (np.pi / bins[1])
    # That it sums to 1 is Smith's G1 itself (the weak white furnace): the shares were not scaled to.
    assert shares.sum() == pytest.approx(1, abs=1e-3)
    assert_frequencies(counts, shares)


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("angle", ANGLES_DEG)
def test_the_mean_weight_is_the_directional_albedo(alpha: float, angle: float) -> None:
    out, weights = glossy(alpha, angle, 40_000, seed=5)
    assert_mean(weights, albedo(alpha, angle), slack=1e-4)
    assert weights.min() >= 0
    assert weights.max() <= 1
    np.testing.assert_array_equal(weights == 0, out[:, 2] <= 1e-15)


@pytest.mark.parametrize("alpha", [0.001, *ALPHAS])
def test_seen_from_straight_above_squared_slopes_have_a_closed_form(alpha: float) -> None:
    # P(tan theta_m < k alpha) = k^2 / (1 + k^2).
    out, _ = glossy(alpha, 0.0, 20_000, seed=6)
    m = out + np.array([0, 0, 1])
    square = (m[:, :2] ** 2).sum(axis=1) / (alpha * m[:, 2]) ** 2
    assert stats.kstest(square / (1 + square), "uniform").pvalue > LEAST_P


@pytest.mark.parametrize("angle", [0.0, 30.0, 60.0, 80.0])
def test_the_smoothest_surface_is_a_mirror(angle: float) -> None:
    out, weights = glossy(0.001, angle, 10_000, seed=7)
    mirrored = np.array([-math.sin(math.radians(angle)), 0.0, math.cos(math.radians(angle))])
    # A facet's slope is below k alpha with probability k^2 / (1 + k^2) from any angle, but for the factor G1 > 1 - 1e-5
    # (visibility is odd in the slope to the viewer), and it turns the ray by at most twice its own angle.
    for k in (1, 3, 10):
        share = k**2 / (1 + k**2)
        near = np.linalg.norm(out - mirrored, axis=1) < 2 * k * 0.001
        assert near.mean() > share - STANDARD_ERRORS * math.sqrt(share * (1 - share) / len(out)) - 1e-5
    # At 80 degrees only facets that lean by 2.5 degrees turn the ray to within 5 of the surface or below: 1 / (1 + k^2)
    # = 5.2e-4, 5.2 +- 2.3 of 10 000. Of the others Lambda_o < (alpha tan 85)^2 / 4 = 3.3e-5 is lost.
    assert weights.mean() > 1 - (5.2 + STANDARD_ERRORS * 2.3) / len(out) - 3.3e-5
    assert weights.max() <= 1


@pytest.mark.parametrize("alpha", [0.001, *ALPHAS])
def test_the_brdf_is_the_textbook_s_and_reciprocal(alpha: float) -> None:
    rng = np.random.default_rng(8)
    i = np.column_stack([rng.normal(size=(600, 2)), rng.uniform(0.02, 2, 600)])
    i /= np.linalg.norm(i, axis=1)[:, None]
    m = np.column_stack([alpha * rng.normal(size=(600, 2)), np.ones(600)])
    m /= np.linalg.norm(m, axis=1)[:, None]
    o = 2 * (i * m).sum(axis=1)[:, None] * m - i
    checked = 0
    for a, b, h in zip(i, o, m, strict=True):
        value, swapped = ggx_brdf(alpha, 0.0, 0.0, 1.0, *a, *b), ggx_brdf(alpha, 0.0, 0.0, 1.0, *b, *a)
        turned = ggx_brdf(alpha, *NORMAL, *(a @ FRAME), *(b @ FRAME))
        if b[2] <= 0:
            assert value == 0
            continue
        checked += 1
        assert value == pytest.approx(swapped, rel=1e-13)
        # The tangent of h, some alpha, is right to some EPS, relatively to EPS / alpha, and the density goes with its
        # fourth power at most; the textbook's own tan^2 = 1 / cos^2 - 1 is right to EPS / alpha^2.
        assert value == pytest.approx(textbook_brdf(alpha, a[2], b[2], h[2]), rel=40 * EPS / alpha**2)
        assert value == pytest.approx(turned, rel=40 * EPS / alpha)
        assert value == ggx_brdf(alpha, 0.0, 0.0, -1.0, *a, *b)
        assert ggx_brdf(alpha, 0.0, 0.0, 1.0, *a, *-b) == 0
    assert checked > 200


def test_glossy_surfaces_have_two_sides() -> None:
    for u, v in columns(200, seed=9):
        d = viewed(50.0)
        front = glossy_direction(u, v, 0.3, *NORMAL, *d)
        back = glossy_direction(u, v, 0.3, *(-x for x in NORMAL), *d)
        # The frame on the other normal is another, and with it which way u and v turn; the side is the viewer's.
        for o, weight in (front, back):
            assert (weight > 0) == (np.dot(o, NORMAL) > 0)


@pytest.mark.parametrize("alpha", [0.001, *ALPHAS])
def test_rounding_at_the_rim_and_at_the_pole_stays_within_bounds(alpha: float) -> None:
    # On the square's border the disc's points are at radius 1 but for rounding, on either side of it.
    border = [(t, side) for t in np.linspace(0, 1, 200) for side in (0.0, 1.0)]
    for u, v in [*border, *((v, u) for u, v in border), *columns(2000, seed=15)]:
        for d in ((0.0, 0.0, -1.0), (1e-9, 0.0, -1.0), (0.28, 0.0, -0.96)):
            out, weight = glossy_direction(u, v, alpha, 0.0, 0.0, 1.0, *d)
            assert math.hypot(*out) == pytest.approx(1, abs=16 * EPS)
            assert 0 <= weight <= 1


@pytest.mark.parametrize("alpha", [1e-300, 1e-9, 0.001, 0.3, 1.0])
def test_exactly_along_the_surface_nothing_is_lost_between_the_facets(alpha: float) -> None:
    # G1 = G2 = 0 there, and (1 + L_i) / (1 + L_i + L_o) goes to 1 as L_i grows.
    for u, v in [*columns(50, seed=14), [0.25, 0.5], [0.5, 0.5]]:
        out, weight = glossy_direction(u, v, alpha, 0.0, 0.0, 1.0, 0.6, -0.8, 0.0)
        assert out[2] > 0
        assert weight == pytest.approx(1, abs=4 * EPS)


# Glass


def fresnel_by_angles(angle_i: float, eta: float) -> tuple[float, float]:
    """Return the perpendicular and parallel shares by Fresnel's sine and tangent laws; angles in (0, pi/2)."""
    angle_t = math.asin(math.sin(angle_i) / eta)
    between, both = angle_i - angle_t, angle_i + angle_t
    return (math.sin(between) / math.sin(both)) ** 2, (math.tan(between) / math.tan(both)) ** 2


@pytest.mark.parametrize("eta", [1.0001, 1.33, 1.5, 2.4, 1 / 1.5, 1 / 2.4])
def test_fresnel_s_closed_forms(eta: float) -> None:
    assert fresnel(1.0, eta) == pytest.approx(((eta - 1) / (eta + 1)) ** 2, rel=1e-11)
    assert fresnel(0.0, eta) == 1.0
    critical = math.asin(eta) if eta < 1 else math.pi / 2
    for angle in np.linspace(0.01, 0.999, 50) * critical:
        # Near eta = 1 both laws lose digits in differences: 1e-16 / 1e-4, twice.
        assert fresnel(math.cos(angle), eta) == pytest.approx(np.mean(fresnel_by_angles(angle, eta)), rel=1e-9)
        # The same way back.
        beyond = math.cos(math.asin(math.sin(angle) / eta))
        assert fresnel(beyond, 1 / eta) == pytest.approx(fresnel(math.cos(angle), eta), rel=1e-9)
    brewster = math.atan(eta)
    # No parallel part there, and the perpendicular one is ((eta^2 - 1) / (eta^2 + 1))^2 (angles add up to pi / 2).
    assert fresnel(math.cos(brewster), eta) == pytest.approx(((eta**2 - 1) / (eta**2 + 1)) ** 2 / 2, rel=1e-11)


def test_total_reflection_begins_at_the_critical_angle() -> None:
    for ior in (1.1, 1.5, 2.4):
        critical = math.asin(1 / ior)
        assert fresnel(math.cos(critical + 1e-9), 1 / ior) == 1.0
        # To first order in g, (c - g) / (c + g) = 1 - 2 g / c, and with eta^2 c for c likewise; g^2 = 2 c sin(t) 1e-9.
        c = math.cos(critical)
        missing = 2 * math.sqrt(2e-9 * c / ior) * (1 + ior**2) / c
        assert 1 - fresnel(math.cos(critical - 1e-9), 1 / ior) == pytest.approx(missing, rel=2e-3)
        inside = (math.sin(critical + 0.1), 0.0, math.cos(critical + 0.1))
        for u in (0.0, LAST, 1.0):
            out, is_refracted = glass_direction(u, ior, 0.0, 0.0, 1.0, *inside)
            assert not is_refracted
            np.testing.assert_allclose(out, (inside[0], 0.0, -inside[2]), atol=4 * EPS)
    assert all(fresnel(c, 1.0) == 0.0 for c in np.linspace(1e-6, 1, 100))


@pytest.mark.parametrize("ior", [0.8, 1.1, 1.5, 2.4])
@pytest.mark.parametrize("angle", [0.0, 1e-6, 10.0, 45.0, 52.0])
def test_refraction_is_snell_s_and_a_slab_leaves_directions_as_they_are(ior: float, angle: float) -> None:
    d = viewed(angle)
    inside, is_refracted = glass_direction(LAST, ior, *NORMAL, *d)
    assert is_refracted
    # Components along the surface: n1 sin1 = n2 sin2, in the same direction.
    np.testing.assert_allclose(ior * (FRAME @ inside)[:2], (FRAME @ d)[:2], atol=1e-14)
    assert (FRAME @ inside)[2] < 0
    outside, is_refracted = glass_direction(LAST, ior, *(-x for x in NORMAL), *inside)
    assert is_refracted
    np.testing.assert_allclose(outside, d, atol=1e-14)


@pytest.mark.parametrize("ior", [0.8, 1.5, 2.4])
def test_reflection_is_chosen_with_fresnel_s_share_and_mirrors(ior: float) -> None:
    for sign in (1.0, -1.0):  # from outside, and from inside
        d = viewed(30.0)
        normal = [sign * x for x in NORMAL]
        eta = ior if sign > 0 else 1 / ior
        share = np.mean(fresnel_by_angles(math.radians(30.0), eta)) if math.sin(math.radians(30)) < eta else 1.0
        out, is_refracted = glass_direction(float(share) - 1e-9, ior, *normal, *d)
        assert not is_refracted
        np.testing.assert_allclose(FRAME @ out, (FRAME @ d) * [1, 1, -1], atol=4 * EPS)
        if share < 1:
            assert glass_direction(float(share) + 1e-9, ior, *normal, *d)[1]


def test_absurd_indices_are_mirrors() -> None:
    for eta in (5e-324, 1e-300, 1e300):
        assert fresnel(0.5, eta) == pytest.approx(1, abs=1e-11)
        for u in (0.0, LAST, 1.0):
            for normal in (NORMAL, [-x for x in NORMAL]):
                out, _ = glass_direction(u, eta, *normal, *viewed(30.0))
                assert math.hypot(*out) == pytest.approx(1, abs=4 * EPS)


@pytest.mark.parametrize(("ior", "angle"), [(1.5, 0.0), (2.4, 0.0), (1.5, 60.0), (1.5, 80.0)])
def test_a_slab_lets_through_what_its_two_faces_and_all_echoes_do(ior: float, angle: float) -> None:
    count = 20_000
    start = viewed(angle)
    rng = np.random.default_rng(10)
    through = np.zeros(count, dtype=bool)
    for path in range(count):
        d, is_inside, side = start, False, 1.0  # of the face, as its outward normal points
        for _ in range(200):
            d, is_refracted = glass_direction(rng.random(), ior, *(side * x for x in NORMAL), *d)
            is_inside ^= is_refracted
            downward = np.dot(d, NORMAL) < 0
            if not is_inside:
                break
            side = -1.0 if downward else 1.0
        assert not is_inside
        through[path] = downward
    reflected = ((ior - 1) / (ior + 1)) ** 2 if angle == 0 else np.mean(fresnel_by_angles(math.radians(angle), ior))
    share = (1 - reflected) / (1 + reflected)
    if angle == 0:
        assert share == pytest.approx(2 * ior / (ior**2 + 1), rel=1e-12)
    assert abs(through.mean() - share) < STANDARD_ERRORS * math.sqrt(share * (1 - share) / count)


# Colours


@pytest.mark.parametrize("ior", [1.0002, 1.2, 1.5, 1.728, 4.0])
@pytest.mark.parametrize("abbe", [10.0, 28.4, 60.0, 100.0])
def test_cauchy_has_the_glass_s_index_and_abbe_number(ior: float, abbe: float) -> None:
    a, b = cauchy(ior, abbe)
    d, f, c = (index_at(a, b, line) for line in (D_LINE_NM, F_LINE_NM, C_LINE_NM))
    assert b > 0
    assert d == pytest.approx(ior, rel=1e-12)
    # n_F - n_C is a difference of numbers near n, each right to EPS n.
    assert (d - 1) / (f - c) == pytest.approx(abbe, rel=max(1e-12, 4 * EPS * ior / (f - c)))
    assert d == pytest.approx(a + b / 587.56**2, rel=1e-14)
    values = [index_at(a, b, x) for x in np.linspace(400, 700, 31)]
    assert (np.diff(values) < 0).all()


@given(indices, st.floats(0.0, 1e9, exclude_min=True), units)
def test_indices_stay_above_the_least(ior: float, abbe: float, w: float) -> None:
    a, b = cauchy(ior, abbe)
    index = index_at(a, b, wavelength_of(w))
    assert b >= 0
    assert math.isfinite(index)
    if ior > LEAST_INDEX:
        assert index >= LEAST_INDEX
    else:
        assert index == ior  # what is lighter than air, or as light, does not disperse


def test_an_infinite_abbe_number_is_no_dispersion() -> None:
    assert cauchy(1.5, math.inf) == (1.5, 0.0)
    assert index_at(1.5, 0.0, 400.0) == 1.5


def test_white_stays_white_at_every_wavelength_together() -> None:
    knots = [0.0, 1 / 6, 0.5, 5 / 6, 1.0]  # 400, 450, 550, 650, 700 nm
    np.testing.assert_allclose([wavelength_of(w) for w in knots], [400, 450, 550, 650, 700], rtol=1e-15)
    values = np.array([spectral_weights(w) for w in knots])
    np.testing.assert_allclose(values, [[0, 0, 3], [0, 0, 3], [0, 3, 0], [3, 0, 0], [3, 0, 0]], atol=1e-14)
    # Linear in between, so that the trapezoid rule is exact: means 1.
    np.testing.assert_allclose(integrate.trapezoid(values, knots, axis=0), 1, atol=1e-14)
    fine = np.linspace(0, 1, 3001)
    between = np.array([spectral_weights(w) for w in fine])
    np.testing.assert_allclose(between, [[np.interp(w, knots, v) for v in values.T] for w in fine], atol=1e-14)
    np.testing.assert_allclose(between.sum(axis=1), 3, atol=1e-15)
    assert (between >= 0).all()
    # Continuous: 3 within 100 nm at most.
    assert np.abs(np.diff(between, axis=0)).max() <= 9 / 3000 * (1 + 1e-9)


# Lights

QUADS = {
    "square": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "parallelogram": [(-1, 0.5), (2, 1), (2.5, 3), (-0.5, 2.5)],
    "trapezoid": [(-2, -1), (2, -1), (0.5, 1), (-0.3, 1)],
    "kite": [(0, -3), (0.7, 0), (0, 0.4), (-0.7, 0)],
}


def placed(name: str, lift: float = 4.0) -> FloatArray:
    """Return (4, 3) corners of a quad above the origin, tilted."""
    tilt = np.array([[1, 0, 0.3], [0, 1, -0.2]])
    corners: FloatArray = np.array(QUADS[name], dtype=float) @ tilt + [0, 0, lift]
    return corners


def at_offset(corners: FloatArray) -> tuple[FloatArray, int]:
    return np.concatenate([[np.nan] * 5, corners.ravel(), [np.nan]]), 5


@pytest.mark.parametrize("name", QUADS)
def test_quads_are_covered_from_corner_to_corner_by_their_area(name: str) -> None:
    corners = placed(name)
    flat, at = at_offset(corners)
    for (u, v), corner in zip([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], corners, strict=True):
        np.testing.assert_allclose(quad_point(u, v, flat, at)[0], corner, atol=1e-14)
    # Of a convex planar quad the Jacobian is linear in u and in v: two Gauss points each integrate it exactly.
    gauss = [0.5 - math.sqrt(1 / 12), 0.5 + math.sqrt(1 / 12)]
    total = np.mean([quad_point(u, v, flat, at)[1] for u in gauss for v in gauss])
    area = np.linalg.norm(np.cross(corners[2] - corners[0], corners[3] - corners[1])) / 2
    assert total == pytest.approx(area, rel=1e-14)
    for u, v in columns(100, seed=11):
        # P is linear in u and in v alone: differences across the square are derivatives.
        by_u = np.subtract(quad_point(1.0, v, flat, at)[0], quad_point(0.0, v, flat, at)[0])
        by_v = np.subtract(quad_point(u, 1.0, flat, at)[0], quad_point(u, 0.0, flat, at)[0])
        point, jacobian = quad_point(u, v, flat, at)
        assert jacobian == pytest.approx(np.linalg.norm(np.cross(by_u, by_v)), rel=1e-13)
        inward = np.cross(np.roll(corners, -1, axis=0) - corners, point - corners)
        assert (inward @ np.cross(corners[2] - corners[0], corners[3] - corners[1]) >= 0).all()
        assert np.dot(point - corners[0], np.cross(by_u, by_v)) == pytest.approx(0, abs=1e-13 * area)
        if name in ("square", "parallelogram"):
            assert jacobian == pytest.approx(area, rel=1e-13)
            edges = (tuple((corners[k] - corners[0]).tolist()) for k in (1, 3))
            np.testing.assert_allclose(light_point(u, v, tuple(corners[0].tolist()), *edges), point, atol=1e-14)


def form_factors(points: FloatArray, areas: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the integrand cos cos' / (pi r^2) times areas, of a point at the origin that faces z."""
    across = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    square = (points**2).sum(axis=1)
    beyond = np.abs(points @ across) / np.linalg.norm(across)
    return np.asarray(points[:, 2] * beyond / (np.pi * square**2) * areas)


def test_a_square_light_over_a_point_has_lambert_s_form_factor() -> None:
    half, height = 1.5, 1.0
    corners = np.array([(-half, -half, height), (half, -half, height), (half, half, height), (-half, half, height)])
    flat, at = at_offset(corners)
    pairs = columns(50_000, seed=12)
    sampled = [quad_point(u, v, flat, at) for u, v in pairs]
    of_quad = form_factors(np.array([p for p, _ in sampled]), np.array([a for _, a in sampled]), corners)
    side = 2 * half
    points = [light_point(u, v, (-half, -half, height), (side, 0.0, 0.0), (0.0, side, 0.0)) for u, v in pairs]
    of_light = form_factors(np.array(points), np.full(len(points), side**2), corners)
    for values in (of_quad, of_light):
        assert_mean(values, square_form_factor(half, height))


@pytest.mark.parametrize("name", QUADS)
def test_any_quad_s_samples_estimate_its_irradiance(name: str) -> None:
    corners = placed(name, lift=2.0)
    flat, at = at_offset(corners)
    sampled = [quad_point(u, v, flat, at) for u, v in columns(30_000, seed=13)]
    values = form_factors(np.array([p for p, _ in sampled]), np.array([a for _, a in sampled]), corners)
    assert_mean(values, abs(lambert(corners, 4, np.array([0.0, 0.0, 1.0]))) / np.pi)


# Any input


def components(result: Any) -> list[float]:
    return [x for part in result for x in components(part)] if isinstance(result, tuple) else [float(result)]


@given(units, units, roughnesses, indices, directions(), directions(), st.integers(0, 3))
def test_directions_have_length_1_on_the_side_they_belong_to(
    u: float, v: float, alpha: float, ior: float, n: Any, d: Any, case: int
) -> None:
    if case == 1:
        d = tuple(-x for x in n)
    elif case == 2:
        d = n
    elif case == 3:  # grazing
        d = frame_of(*n)[0]
    facing = -float(np.dot(n, d))
    diffuse = cosine_direction(u, v, *n)
    glossy_out, weight = glossy_direction(u, v, alpha, *n, *d)
    glass, is_refracted = glass_direction(u, ior, *n, *d)
    for out in (diffuse, glossy_out, glass):
        assert math.hypot(*out) == pytest.approx(1, abs=16 * EPS)
    assert np.dot(diffuse, n) >= -4 * EPS
    assert 0 <= weight <= 1
    if weight > 0 and abs(facing) > 1e-15:
        assert np.dot(glossy_out, n) * math.copysign(1, facing) > -4 * EPS
    if abs(facing) > 1e-15:
        onward = float(np.dot(glass, n)) * math.copysign(1, facing)
        assert onward < 4 * EPS if is_refracted else onward > -4 * EPS


vectors = st.tuples(anything, anything, anything)

LONG = 1 + 2 * EPS  # what rounding leaves of length 1
EDGES = [
    (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, LONG, 0.0), (LONG, 0.0, -0.0), (0.6, 0.0, 0.8), (1.0, 0.0, 1e-160),
    (1e-160, 0.0, 0.0), (-1e12, 1e12, 1e12),
]  # fmt: skip


@pytest.mark.parametrize("n", EDGES)
@pytest.mark.parametrize("d", EDGES)
def test_no_edge_makes_a_number_that_is_none(n: Any, d: Any) -> None:
    away = tuple(-x for x in d)
    for u in (0.0, 0.5, LAST, 1.0):
        for v in (0.0, 0.5, LAST, 1.0):
            for alpha in (0.0, 1e-200, 0.001, 1.0):
                for arriving in (d, away):
                    out, weight = glossy_direction(u, v, alpha, *n, *arriving)
                    assert np.isfinite(out).all()
                    assert 0 <= weight <= 1
            assert np.isfinite(cosine_direction(u, v, *n)).all()
        for ior in (1e-9, 0.5, 1.0, 1.5, 1e9):
            assert np.isfinite(components(glass_direction(u, ior, *n, *d))).all()
    for alpha in (0.0, 1e-200, 0.001, 1.0):
        for e in (n, d, away):
            assert ggx_brdf(alpha, *n, *d, *e) >= 0
            assert np.isfinite(ggx_brdf(alpha, *n, *d, *e))
    for eta in (1e-9, 0.5, 1.0, 1.5, 1e9):
        assert all(0 <= fresnel(c, eta) <= 1 for c in (-1.0, 0.0, 5e-324, 1e-160, 1e-9, 1.0, LONG, 1e12))


@given(units, units, roughnesses, indices, vectors, vectors, vectors)
def test_nothing_is_ever_not_a_number(u: float, v: float, alpha: float, ior: float, n: Any, d: Any, e: Any) -> None:
    results: list[Callable[[], Any]] = [
        lambda: disc_point(u, v),
        lambda: normalized(*n),
        lambda: frame_of(*n),
        lambda: cosine_direction(u, v, *n),
        lambda: glossy_direction(u, v, alpha, *n, *d),
        lambda: ggx_brdf(alpha, *n, *d, *e),
        lambda: fresnel(n[0], ior),
        lambda: glass_direction(u, ior, *n, *d),
        lambda: index_at(*cauchy(ior, abs(d[0])), n[0]),
        lambda: spectral_weights(u),
        lambda: light_point(u, v, n, d, e),
        lambda: quad_point(u, v, np.array([*n, *d, *e, 0.0, 0.0, 0.0]), 0),
    ]
    for result in results:
        assert np.isfinite(components(result())).all()
