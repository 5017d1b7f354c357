"""Pixel filters, once for both renderers and the references: f(x, y) around a pixel's centre, integral 1.

The contract is short (after pbrt's filter.h): `radius`, `evaluate(x, y)`, integral 1, zero past the radius. All but the
cone are products g(x) g(y), and have a profile g, its integral G from minus infinity, and the knots between which g is
smooth: that is all an exact reference needs. Kernels see a filter as `params`, an array that starts with its code, so
that compiled code and Python share one definition and a new filter costs no new specialisation.

    box       1 / (2 r)
    tent      (1 - abs(x) / r) / r
    cone      3 (1 - rho / r) / (pi r^2), radial
    gaussian  exp(-x^2 / (2 sigma^2)), cut at r and renormalised (r may be infinite)
    mitchell  Mitchell & Netravali 1988 with B = C = 1/3, stretched from 2 to r
    lanczos   sinc(x) sinc(x / r), divided by its integral (not 1: .997 for r = 3)
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numba import njit

from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError, unknown_name
from aliasbench.scenes.model import FloatArray, read_only

BOX, TENT, CONE, GAUSSIAN, MITCHELL, LANCZOS = 0, 1, 2, 3, 4, 5
LEAST = 1e-9  # of a radius or sigma: the values of narrower filters, and their squares, would leave float32's range
MOST_LOBES = 256.0  # the Lanczos filter's integral has a table that grows with its radius
FAR_SIGMAS = 8.3  # beyond it a Gaussian profile has less than 1e-16 of its mass
_CODE, _RADIUS, _SIGMA, _NORM, _PARTS, _TABLE = 0, 1, 2, 3, 4, 5
_MITCHELL_ZERO = 4.0 / 7.0  # where its lobe begins, as a share of the radius
_TERMS = 18  # coefficients of the Lanczos integral in each part of [0, r], for 1e-15


@dataclass(frozen=True, slots=True)
class FilterKind:
    """What is common to a filter at all radii.

    Attributes
    ----------
    code : int
        Its number in kernels.
    separable : bool
        Whether f(x, y) = g(x) g(y).
    degree : int or None
        Of the polynomials that the profile is made of; None where it is no polynomial.
    knots : tuple of float
        Where the profile is not smooth, as multiples of the radius; ascending, first -1, last 1.
    """

    code: int
    separable: bool
    degree: int | None
    knots: tuple[float, ...]


FILTERS: Mapping[str, FilterKind] = {
    "box": FilterKind(BOX, True, 0, (-1.0, 1.0)),
    "tent": FilterKind(TENT, True, 1, (-1.0, 0.0, 1.0)),
    "cone": FilterKind(CONE, False, None, (-1.0, 0.0, 1.0)),
    "gaussian": FilterKind(GAUSSIAN, True, None, (-1.0, 1.0)),
    "mitchell": FilterKind(MITCHELL, True, 3, (-1.0, -0.5, 0.0, 0.5, 1.0)),
    "lanczos": FilterKind(LANCZOS, True, None, (-1.0, 1.0)),
}


@dataclass(frozen=True, slots=True, eq=False)
class FilterSpec:
    """A filter of one radius; all lengths in pixels.

    Attributes
    ----------
    name : str
    kind : FilterKind
    radius : float
        Half-width of the support; inf for the whole Gaussian.
    sigma : float
        Of the Gaussian; no meaning for the others.
    params : (n,) float64
        What kernels are given: see `profile_at`, `integral_at` and `filter_at`.
    """

    name: str
    kind: FilterKind
    radius: float
    sigma: float
    params: FloatArray

    @property
    def support(self) -> float:
        """The half-width outside which the profile has less than 1e-16 of its mass; finite, at most the radius."""
        return min(self.radius, FAR_SIGMAS * self.sigma) if self.kind.code == GAUSSIAN else self.radius

    @property
    def margin(self) -> int:
        """How many pixels beyond its own a pixel's filter reaches into, on every side."""
        return max(0, math.ceil(self.support - 0.5))

    @property
    def knots(self) -> tuple[float, ...]:
        """Where the profile is not smooth, ascending; the first and the last bound the support."""
        return tuple(k * self.support for k in self.kind.knots)

    @property
    def peak(self) -> float:
        """The largest value of the profile (of the cone: of its integral over one axis)."""
        if self.kind.code == CONE:
            return 3.0 / (math.pi * self.radius)
        return float(profile_at(self.params, 0.0))

    @property
    def gain(self) -> float:
        """The integral of abs f: 1, or more with negative lobes."""
        if self.name not in ("mitchell", "lanczos"):
            return 1.0
        zeros = (
            np.arange(1, math.ceil(self.radius)) if self.name == "lanczos" else np.array([self.radius * _MITCHELL_ZERO])
        )
        steps = np.diff(self.integral(np.concatenate([-zeros[::-1], zeros, [self.radius]])), prepend=0.0)
        return float(np.abs(steps).sum()) ** 2

    def evaluate(self, x: FloatArray | float, y: FloatArray | float) -> FloatArray:
        """Return f(x, y) for offsets from the pixel's centre, per square pixel; shaped like their broadcast."""
        a, b = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        return _filter_many(self.params, a.ravel(), b.ravel()).reshape(a.shape)

    def profile(self, x: FloatArray | float) -> FloatArray:
        """Return g(x) of a separable filter, per pixel."""
        a = np.asarray(x, dtype=np.float64)
        return _profile_many(self.params, self._separable(a)).reshape(a.shape)

    def integral(self, x: FloatArray | float) -> FloatArray:
        """Return G(x), the integral of g up to x: 0 at -radius, 1 at radius."""
        a = np.asarray(x, dtype=np.float64)
        return _integral_many(self.params, self._separable(a)).reshape(a.shape)

    def smooth_pieces(self) -> tuple[Callable[[FloatArray], FloatArray], ...]:
        """Return the profile of a separable filter as functions of x that are smooth on each side of 0.

        They go on beyond the radius as they are within. There is one, but for Mitchell's filter: up to half the radius,
        and from there on.
        """
        r, code = self.radius, self.kind.code
        if code == MITCHELL:
            return (
                lambda x: _mitchell_inner(2.0 * np.abs(x) / r) / (3.0 * r),
                lambda x: _mitchell_outer(2.0 * np.abs(x) / r) / (3.0 * r),
            )
        if code == TENT:
            return (lambda x: (1.0 - np.abs(x) / r) / r,)
        if code == GAUSSIAN:
            return (lambda x: self.peak * np.exp(-0.5 * (x / self.sigma) ** 2),)
        if code == LANCZOS:
            return (lambda x: self.peak * np.sinc(x) * np.sinc(x / r),)
        if code == BOX:
            return (lambda x: np.full_like(x, 0.5 / r),)
        raise InputError(f"filter={self.name} is radial: it has no profile along one axis")

    def _separable(self, x: FloatArray) -> FloatArray:
        if not self.kind.separable:
            raise InputError(f"filter={self.name} is radial: it has no profile along one axis")
        return x.ravel()


def make_filter(name: str, radius: float, sigma: float = 0.5) -> FilterSpec:
    """Return a filter of a radius in pixels.

    Parameters
    ----------
    name : str
        A key of `FILTERS`.
    radius : float
        From 1e-9; inf for the Gaussian alone, at most 256 for Lanczos.
    sigma : float
        Of the Gaussian, from 1e-9.

    Raises
    ------
    InputError
        For another name, radius or sigma.
    """
    if name not in FILTERS:
        raise unknown_name("filter", name, FILTERS)
    if not radius > 0.0 or (math.isinf(radius) and name != "gaussian"):
        raise InputError(f"radius={radius:g}: must be a finite number above 0, or inf with filter=gaussian")
    if not 0.0 < sigma < math.inf:
        raise InputError(f"sigma={sigma:g}: must be a finite number above 0")
    for key, value in (("radius", radius), ("sigma", sigma)):
        if value < LEAST:
            raise InputError(f"{key}={value:g}: must be at least {LEAST:g} pixels")
    if name == "lanczos" and radius > MOST_LOBES:
        raise InputError(f"radius={radius:g}: must be at most {MOST_LOBES:g} with filter=lanczos")
    kind = FILTERS[name]
    norm, table, parts = 1.0, np.empty(0), 0
    if kind.code == GAUSSIAN:
        norm = 1.0 / (sigma * math.sqrt(2.0 * math.pi) * math.erf(radius / (sigma * math.sqrt(2.0))))
    elif kind.code == LANCZOS:
        from scipy.special import sici

        half = _lanczos_integral(np.array([radius]), radius, sici)[0]
        norm = 0.5 / half
        parts = max(2, math.ceil(2.0 * radius))
        table = _lanczos_table(radius, norm, parts, sici)
    head = np.array([kind.code, radius, sigma, norm, parts], dtype=np.float64)
    return FilterSpec(name, kind, float(radius), float(sigma), read_only(np.concatenate([head, table])))


def filter_of(technique: Technique) -> FilterSpec:
    """Return the filter that a technique names."""
    return make_filter(technique.filter, technique.radius_px, technique.sigma_px)


SineIntegral = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


def _lanczos_integral(x: FloatArray, radius: float, sici: SineIntegral) -> FloatArray:
    """Return the integral of sinc(t) sinc(t / r) over [0, x], x > 0.

    The product of sines is (cos a t - cos b t) / 2 with a, b = pi (1 -+ 1/r); by parts each cosine over t^2 leaves a
    sine integral.
    """
    a, b = math.pi * (1.0 - 1.0 / radius), math.pi * (1.0 + 1.0 / radius)
    edge = 2.0 * np.sin(math.pi * x) * np.sin(math.pi * x / radius) / x
    return radius / (2.0 * math.pi**2) * (b * sici(b * x)[0] - a * sici(a * x)[0] - edge)


def _lanczos_table(radius: float, norm: float, parts: int, sici: SineIntegral) -> FloatArray:
    """Return the normalised integral from 0 as polynomials in t of [-1, 1], one for each equal part of [0, r].

    The integral is entire of exponential type pi (1 + 1/r): parts of at most half a pixel and half the radius make the
    terms fall below 1e-16 within `_TERMS`.
    """
    from numpy.polynomial import chebyshev

    nodes = np.cos(np.pi * (np.arange(_TERMS) + 0.5) / _TERMS)
    rows = []
    for k in range(parts):
        x = (k + 0.5 + 0.5 * nodes) * radius / parts
        series = chebyshev.chebfit(nodes, _lanczos_integral(x, radius, sici) * norm, _TERMS - 1)
        rows.append(chebyshev.cheb2poly(series))
    return np.concatenate(rows)


@njit(inline="always", cache=True)
def _mitchell_inner(u: float) -> float:
    return (7.0 * u - 12.0) * u * u + 16.0 / 3.0


@njit(inline="always", cache=True)
def _mitchell_outer(u: float) -> float:
    return ((-7.0 / 3.0 * u + 12.0) * u - 20.0) * u + 32.0 / 3.0


@njit(cache=True, nogil=True, error_model="numpy")
def profile_at(params: FloatArray, x: float) -> float:
    """Return g(x) of a separable filter given by its `FilterSpec.params`."""
    code, radius = int(params[_CODE]), params[_RADIUS]
    d = abs(x)
    if d > radius:
        return 0.0
    if code == GAUSSIAN:
        s = d / params[_SIGMA]
        return params[_NORM] * math.exp(-0.5 * s * s)
    if code == TENT:
        return (1.0 - d / radius) / radius
    if code == MITCHELL:
        u = 2.0 * d / radius
        if u < 1.0:
            return _mitchell_inner(u) / (3.0 * radius)
        return _mitchell_outer(u) / (3.0 * radius)
    if code == LANCZOS:
        return params[_NORM] * _sinc(d) * _sinc(d / radius)
    return 0.5 / radius


@njit(cache=True, nogil=True, error_model="numpy")
def integral_at(params: FloatArray, x: float) -> float:
    """Return G(x), the integral of g up to x, of a separable filter given by its `FilterSpec.params`."""
    code, radius = int(params[_CODE]), params[_RADIUS]
    d = abs(x)
    if d >= radius:
        return 1.0 if x > 0.0 else 0.0
    if code == GAUSSIAN:
        scale = params[_NORM] * params[_SIGMA] * math.sqrt(0.5 * math.pi)
        half = scale * math.erf(d / (params[_SIGMA] * math.sqrt(2.0)))
    elif code == TENT:
        half = (d / radius) * (1.0 - 0.5 * d / radius)
    elif code == MITCHELL:
        u = 2.0 * d / radius
        if u < 1.0:
            half = u * ((1.75 * u - 4.0) * u * u + 16.0 / 3.0) / 6.0
        else:
            half = 0.5 + (u * (((-7.0 / 12.0 * u + 4.0) * u - 10.0) * u + 32.0 / 3.0) - 4.0) / 6.0
    elif code == LANCZOS:
        parts = int(params[_PARTS])
        place = d / radius * parts
        part = min(int(place), parts - 1)
        t = 2.0 * (place - part) - 1.0
        first = _TABLE + part * _TERMS
        half = params[first + _TERMS - 1]
        for k in range(_TERMS - 2, -1, -1):
            half = half * t + params[first + k]
    else:
        half = 0.5 * d / radius
    return 0.5 + half if x > 0.0 else 0.5 - half


@njit(cache=True, nogil=True, error_model="numpy")
def filter_at(params: FloatArray, x: float, y: float) -> float:
    """Return f(x, y) of a filter given by its `FilterSpec.params`."""
    if int(params[_CODE]) == CONE:
        radius = params[_RADIUS]
        rho = math.sqrt(x * x + y * y)
        return max(0.0, 1.0 - rho / radius) * 3.0 / (math.pi * radius * radius)
    return profile_at(params, x) * profile_at(params, y)


@njit(cache=True, nogil=True, error_model="numpy")
def _sinc(x: float) -> float:
    z = math.pi * x
    return math.sin(z) / z if z > 1e-9 else 1.0


@njit(cache=True, nogil=True, error_model="numpy")
def _profile_many(params: FloatArray, x: FloatArray) -> FloatArray:
    out = np.empty(len(x))
    for i in range(len(x)):
        out[i] = profile_at(params, x[i])
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _integral_many(params: FloatArray, x: FloatArray) -> FloatArray:
    out = np.empty(len(x))
    for i in range(len(x)):
        out[i] = integral_at(params, x[i])
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _filter_many(params: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    out = np.empty(len(x))
    for i in range(len(x)):
        out[i] = filter_at(params, x[i], y[i])
    return out
