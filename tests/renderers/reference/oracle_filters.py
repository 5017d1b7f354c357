"""Pixel filters by the formulas of their definitions, for the oracle: nothing of `renderers.sampling` is used.

What the oracle needs of a filter: its value, its integral along a row up to a place, where it is not smooth, and a way
to draw places with weights that undo the drawing.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.special import erf, ndtr, ndtri

SIGMAS = 8.6  # an endless Gaussian is cut here: 1e-17 of it is left
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)


@dataclass(frozen=True)
class Kernel:
    """A filter around (0, 0): `support` is the half-width past which it is zero."""

    name: str
    radius: float
    sigma: float = 0.5

    @property
    def support(self) -> float:
        return min(self.radius, SIGMAS * self.sigma) if self.name == "gaussian" else self.radius

    @property
    def knots(self) -> tuple[float, ...]:
        """Return where the filter is not smooth along an axis, and places between, near enough for quadrature."""
        s = self.support
        scale = self.sigma if self.name == "gaussian" else 1.0
        # an even number on each side has 0 and half the radius among them
        return tuple(np.linspace(-s, s, 4 * int(np.ceil(s / scale)) + 1))

    def density(self, x, y):
        """Return f(x, y), of integral 1."""
        if self.name == "cone":
            rho = np.hypot(x, y) / self.radius
            return np.maximum(0.0, 1.0 - rho) * 3.0 / (np.pi * self.radius**2)
        return self.profile(x) * self.profile(y)

    def profile(self, x):
        """Return g(x) of a separable filter."""
        r, d = self.radius, np.abs(x)
        if self.name == "box":
            out = np.full(np.shape(d), 0.5 / r)
        elif self.name == "tent":
            out = (1.0 - d / r) / r
        elif self.name == "gaussian":
            s = self.sigma
            out = np.exp(-(d**2) / (2 * s * s)) / (s * np.sqrt(2 * np.pi) * erf(r / (s * np.sqrt(2.0))))
        elif self.name == "mitchell":
            u = 2.0 * d / r
            # Mitchell & Netravali 1988, eq. 8 with B = C = 1/3, times 6
            b = c = 1.0 / 3.0
            inner = (12 - 9 * b - 6 * c) * u**3 + (-18 + 12 * b + 6 * c) * u**2 + (6 - 2 * b)
            outer = (-b - 6 * c) * u**3 + (6 * b + 30 * c) * u**2 + (-12 * b - 48 * c) * u + (8 * b + 24 * c)
            out = np.where(u < 1.0, inner, outer) / 6.0 * 2.0 / r
        else:
            out = np.sinc(d) * np.sinc(d / r) / _lanczos_norm(r)
        return np.where(d <= r, out, 0.0)

    def primitive(self, x, y):
        """Return the integral of f(t, y) over t up to x."""
        s = self.support
        x, y = np.broadcast_arrays(np.clip(x, -s, s), y)
        if self.name == "cone":
            half = np.sqrt(np.maximum(s * s - y * y, 0.0))
            x = np.clip(x, -half, half)
            return np.where(half > 0.0, (_cone(x, y, s) - _cone(-half, y, s)) * 3.0 / (np.pi * s * s), 0.0)
        return self.mass(x) * self.profile(y)

    def mass(self, x):
        """Return the integral of g up to x."""
        r = self.radius
        x = np.clip(x, -self.support, self.support)
        d = np.abs(x)
        if self.name == "box":
            half = d / (2 * r)
        elif self.name == "tent":
            half = d / r - d * d / (2 * r * r)
        elif self.name == "gaussian":
            half = erf(d / (self.sigma * np.sqrt(2.0))) / (2 * erf(r / (self.sigma * np.sqrt(2.0))))
        else:
            half = _accumulate(self, d)
        return 0.5 + np.where(x < 0, -half, half)

    def draw(self, u):
        """Return offsets for u in [0, 1) along one axis, and the reciprocal of their density."""
        if self.name == "gaussian":
            top = ndtr(min(self.radius / self.sigma, SIGMAS))
            x = np.clip(ndtri((1 - top) + u * (2 * top - 1)) * self.sigma, -self.support, self.support)
            return x, (2 * top - 1) * self.sigma * np.sqrt(2 * np.pi) * np.exp(x**2 / (2 * self.sigma**2))
        return (2 * u - 1) * self.support, np.full(np.shape(u), 2 * self.support)


def _cone(x, y, r):
    """Return an integral over x of 1 - sqrt(x^2 + y^2) / r."""
    y = np.abs(y)
    rho = np.hypot(x, y)
    tail = np.where(y > 0, y * y * np.arcsinh(x / np.where(y > 0, y, 1.0)), 0.0)
    return x - (x * rho + tail) / (2 * r)


def _lanczos_norm(r):
    return 2 * sum(_rule(lambda t: np.sinc(t) * np.sinc(t / r), a, b) for a, b in _segments(r))


def _segments(r):
    ends = np.unique([*np.arange(0.0, r, 0.5), r / 2, r])
    return list(itertools.pairwise(ends))


def _rule(f, a, b):
    return float((WEIGHTS * f((a + b) / 2 + (b - a) / 2 * NODES)).sum() * (b - a) / 2)


def _accumulate(kernel, d):
    """Return the integral of a profile from 0 to d >= 0: whole segments, and a Gauss rule over the rest."""
    starts = np.array([a for a, _ in _segments(kernel.radius)])
    whole = np.cumsum([0.0] + [_rule(kernel.profile, a, b) for a, b in _segments(kernel.radius)])
    k = np.clip(np.searchsorted(starts, d, side="right") - 1, 0, len(starts) - 1)
    a, width = starts[k], d - starts[k]
    nodes, weights = np.polynomial.legendre.leggauss(8)
    rest = np.zeros(np.shape(d))
    for node, weight in zip(nodes, weights, strict=True):
        rest += weight * kernel.profile(a + width * (node + 1) / 2)
    return whole[k] + rest * width / 2
