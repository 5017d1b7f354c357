"""Where light goes next: the mathematics of light paths, one sample at a time, for kernels to inline lane by lane.

Everything is a function of scalars in float64 with tuples as results and takes its random numbers, in [0, 1], as
arguments; choices are written as selections where both sides are cheap, so that a loop over lanes can be vectorised.
Normals and directions come in and go out with length 1; directions point the way the light path is followed, so `d`
arrives at the surface. Nothing here is NaN for finite input: what can divide by zero is held above it or not chosen,
and a vector of length 0 stays one.

What cannot be drawn exactly in proportion to its contribution comes with a weight: the factor, beside the surface's
colour, by which a path's throughput is multiplied.
"""

import numpy as np
from numba import njit

from aliasbench.renderers.sampling.discs import disc_point
from aliasbench.scenes.model import FloatArray, Vec3

SHORTEST_NM, LONGEST_NM = 400.0, 700.0
D_LINE_NM, F_LINE_NM, C_LINE_NM = 587.56, 486.13, 656.27
LEAST_INDEX = 1.0001  # of a glass that disperses, at any wavelength

_TINY = 1e-300
_SMOOTHEST = 1e-6  # of alpha: lobes a thousandth of a pixel wide; at 0 the weight at grazing would be 0 / 0
_LEAST_ETA, _MOST_ETA = 1e-12, 1e12  # a scene file's limit is 1e9; squares must stay finite
_LEAST_ABBE = 1e-6  # glasses have 15 to 100
_SPREAD = 1.0 / F_LINE_NM**2 - 1.0 / C_LINE_NM**2


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def normalized(x: float, y: float, z: float) -> Vec3:
    """Return the vector with length 1; the zero vector as it is."""
    scale = 1.0 / np.sqrt(max(x * x + y * y + z * z, _TINY))
    return x * scale, y * scale, z * scale


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def frame_of(nx: float, ny: float, nz: float) -> tuple[Vec3, Vec3]:
    """Return tangent and bitangent: with the normal a right-handed orthonormal frame (Duff et al. 2017, listing 3)."""
    sign = np.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return (1.0 + sign * nx * nx * a, sign * b, -sign * nx), (b, sign + ny * ny * a, -ny)


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def cosine_direction(u: float, v: float, nx: float, ny: float, nz: float) -> Vec3:
    """Return a direction above the surface with density cos / pi: what a diffuse surface reflects, with weight 1.

    The disc lifted onto the hemisphere (Malley): dA = cos dw.
    """
    x, y = disc_point(u, v)
    z = np.sqrt(max(1.0 - x * x - y * y, 0.0))
    t, b = frame_of(nx, ny, nz)
    return x * t[0] + y * b[0] + z * nx, x * t[1] + y * b[1] + z * ny, x * t[2] + y * b[2] + z * nz


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _slant(cosine: float, square: float) -> float:
    """Return cos sqrt(1 + alpha^2 tan^2), which is finite at grazing; Smith's Lambda is (slant / cos - 1) / 2."""
    return np.sqrt(square + (1.0 - square) * cosine * cosine)


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def glossy_direction(
    u: float, v: float, alpha: float, nx: float, ny: float, nz: float, dx: float, dy: float, dz: float
) -> tuple[Vec3, float]:
    """Return where a ray goes on from a glossy surface, and its weight in [0, 1].

    The surface reflects as `ggx_brdf` says, on both sides. A normal is drawn from those the viewer sees, with density
    G1 D (i . m) / cos_i, and the ray mirrored at it. Stretched by alpha the visible normals are halfway vectors between
    the viewer and a spherical cap of even density (Dupuy & Benyoub 2023), z in [-s, 1] with s the viewer's cosine. The
    disc's r^2 is uniform: z = 1 - r^2 (1 + s). Weight: f cos_o / density = G2 / G1 = (1 + L_i) / (1 + L_i + L_o).

    Parameters
    ----------
    u, v : float
    alpha : float
        Roughness, 0 to 1; below 1e-6 it counts as that: a mirror.
    nx, ny, nz, dx, dy, dz : float
        Normal and the arriving direction.

    Returns
    -------
    direction : (3,) float
        Below the surface where the weight is 0: such light would hit the rough surface again and is lost.
    weight : float
    """
    alpha = max(alpha, _SMOOTHEST)
    facing = -(nx * dx + ny * dy + nz * dz)
    side = 1.0 if facing >= 0.0 else -1.0
    cos_i = abs(facing)
    nx, ny, nz = side * nx, side * ny, side * nz
    t, b = frame_of(nx, ny, nz)
    ix, iy = -(dx * t[0] + dy * t[1] + dz * t[2]), -(dx * b[0] + dy * b[1] + dz * b[2])
    sx, sy, sz = normalized(alpha * ix, alpha * iy, cos_i)

    px, py = disc_point(u, v)
    square = px * px + py * py
    height = 1.0 + sz
    # The cap's point (px k, py k, 1 - r^2 (1 + s)) has length 1 with k^2 = (1 + s) (2 - r^2 (1 + s)).
    k = np.sqrt(max(height * (2.0 - square * height), 0.0))
    mx, my, mz = normalized(alpha * (px * k + sx), alpha * (py * k + sy), height * (1.0 - square))

    twice = 2.0 * (ix * mx + iy * my + cos_i * mz)
    ox, oy, cos_o = normalized(twice * mx - ix, twice * my - iy, twice * mz - cos_i)
    slant_i, slant_o = _slant(cos_i, alpha * alpha), _slant(cos_o, alpha * alpha)
    weight = (slant_i + cos_i) * cos_o / (slant_i * cos_o + slant_o * cos_i)
    x = ox * t[0] + oy * b[0] + cos_o * nx
    y = ox * t[1] + oy * b[1] + cos_o * ny
    z = ox * t[2] + oy * b[2] + cos_o * nz
    return (x, y, z), (min(weight, 1.0) if cos_o > 0.0 else 0.0)


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def ggx_brdf(
    alpha: float, nx: float, ny: float, nz: float, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float
) -> float:
    """Return D G2 / (4 cos_i cos_o), the reflection of a white glossy surface; 0 where i and o are on different sides.

    GGX (Walter et al. 2007, eq. 33) with height-correlated masking and shadowing (Heitz 2014, eq. 99), no Fresnel
    factor: the colour is the whole reflectance, but for what is lost between the facets. i and o both point away from
    the surface. With slants S_i, S_o (see `_slant`) G2 / (4 cos_i cos_o) = 1 / (2 (S_i cos_o + S_o cos_i)).
    """
    alpha = max(alpha, _SMOOTHEST)
    cos_i, cos_o = nx * ix + ny * iy + nz * iz, nx * ox + ny * oy + nz * oz
    hx, hy, hz = normalized(ix + ox, iy + oy, iz + oz)
    cos_h = nx * hx + ny * hy + nz * hz
    # sin^2 from the part along the surface: 1 - cos^2 has no digits left where alpha^2 = 1e-6 needs them.
    tx, ty, tz = hx - cos_h * nx, hy - cos_h * ny, hz - cos_h * nz
    square = alpha * alpha
    spread = tx * tx + ty * ty + tz * tz + square * cos_h * cos_h
    density = square / (np.pi * spread * spread)
    is_seen = cos_i * cos_o > 0.0
    masked = 2.0 * (_slant(cos_i, square) * abs(cos_o) + _slant(cos_o, square) * abs(cos_i))
    return density / masked if is_seen else 0.0


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _interface(c: float, eta: float) -> tuple[float, float]:
    """Return the reflected share and g = eta cos_t, 0 under total reflection, for c = cos_i >= 0.

    g^2 = eta^2 - 1 + c^2 keeps its digits at eta = 1 and at grazing. Amplitudes: perpendicular (c - g) / (c + g),
    parallel (eta^2 c - g) / (eta^2 c + g).
    """
    square = (eta - 1.0) * (eta + 1.0) + c * c
    g = np.sqrt(max(square, 0.0))
    perpendicular = (c - g) / (c + g)
    parallel = (eta * eta * c - g) / (eta * eta * c + g)
    return (0.5 * (perpendicular * perpendicular + parallel * parallel) if square > 0.0 else 1.0), g


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def fresnel(cos_i: float, eta: float) -> float:
    """Return the share of unpolarised light that a smooth interface reflects, 1 under total reflection.

    Parameters
    ----------
    cos_i : float
        Cosine between the arriving ray and the normal; its sign does not matter.
    eta : float
        Refractive index beyond the interface over that before it, above 0.
    """
    return _interface(abs(cos_i), min(max(eta, _LEAST_ETA), _MOST_ETA))[0]


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def glass_direction(
    u: float, ior: float, nx: float, ny: float, nz: float, dx: float, dy: float, dz: float
) -> tuple[Vec3, bool]:
    """Return where a ray goes on from the surface of smooth glass, and whether it went through.

    It is reflected with the probability that `fresnel` says, else refracted: eta d_t = d + (c - g) n, c and g as in
    `_interface` and n on the ray's side. The weight is 1. The factor 1 / eta^2 of radiance that enters denser glass is
    left out: it comes back as eta^2 where the path leaves, and nothing shines inside.

    Parameters
    ----------
    u : float
        Below the reflected share: reflection.
    ior : float
        Refractive index of what is behind the surface over that of what is before it, above 0.
    nx, ny, nz, dx, dy, dz : float
        Geometric normal by the winding, outwards, and the arriving direction: d . n < 0 enters the glass.
    """
    facing = -(nx * dx + ny * dy + nz * dz)
    ratio = min(max(ior, _LEAST_ETA), _MOST_ETA)
    eta = ratio if facing > 0.0 else 1.0 / ratio
    c = abs(facing)
    share, g = _interface(c, eta)
    is_refracted = (u >= share) & (g > 0.0)
    shift = (c - g if is_refracted else 2.0 * c) * (1.0 if facing > 0.0 else -1.0)
    return normalized(dx + shift * nx, dy + shift * ny, dz + shift * nz), is_refracted


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def cauchy(ior: float, abbe: float) -> tuple[float, float]:
    """Return A and B (nm^2) of n = A + B / wavelength^2, from n_d and the Abbe number V = (n_d - 1) / (n_F - n_C).

    Lines d 587.56, F 486.13, C 656.27 nm. B is never negative; it is 0, no dispersion, for an infinite `abbe` and for
    an `ior` of at most LEAST_INDEX.
    """
    b = max(ior - 1.0, 0.0) / (max(abbe, _LEAST_ABBE) * _SPREAD)
    b = b if ior > LEAST_INDEX else 0.0
    return ior - b / D_LINE_NM**2, b


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def index_at(a: float, b: float, wavelength_nm: float) -> float:
    """Return the refractive index of Cauchy's A and B, held at LEAST_INDEX or more where there is dispersion.

    An Abbe number below about 0.45 asks for less than that in the red.
    """
    index = a + b / max(wavelength_nm * wavelength_nm, 1.0)
    return max(index, LEAST_INDEX) if b > 0.0 else index


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def wavelength_of(w: float) -> float:
    """Return the wavelength in nm, uniform over 400 to 700, of a random number."""
    return SHORTEST_NM + (LONGEST_NM - SHORTEST_NM) * w


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def spectral_weights(w: float) -> Vec3:
    """Return the red, green and blue weights of a path at `wavelength_of(w)`.

    Three times piecewise linear functions over 400 to 700 nm that sum to 1 at every wavelength and have mean 1/3: blue
    1 up to 450 and falling to 0 at 550, green a tent 450-550-650, red rising from 550 to 650 and 1 beyond. A path's
    light is white on average, whatever its colour at each wavelength: what does not disperse keeps its colour.
    """
    steps = 3.0 * w  # of 100 nm
    blue = 3.0 * min(max(1.5 - steps, 0.0), 1.0)
    red = 3.0 * min(max(steps - 1.5, 0.0), 1.0)
    return red, 3.0 - red - blue, blue


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def light_point(u: float, v: float, corner: Vec3, edge1: Vec3, edge2: Vec3) -> Vec3:
    """Return a point of a parallelogram, uniform over it: corner + u edge1 + v edge2."""
    x = corner[0] + u * edge1[0] + v * edge2[0]
    y = corner[1] + u * edge1[1] + v * edge2[1]
    z = corner[2] + u * edge1[2] + v * edge2[2]
    return x, y, z


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def quad_point(u: float, v: float, corners: FloatArray, at: int) -> tuple[Vec3, float]:
    """Return a point P of a convex planar quad and |dP/du x dP/dv|, the area it stands for.

    Bilinear: crowded where the quad is narrow, and the area makes up for it, so that the mean of area * f(P) is the
    integral of f. Of a parallelogram points are uniform and the area is its own.

    Parameters
    ----------
    u, v : float
    corners : (n,) float64
        Holds the four corners in order, 12 numbers from `at` on.
    at : int
    """
    x0, y0, z0 = corners[at], corners[at + 1], corners[at + 2]
    ax, ay, az = corners[at + 3] - x0, corners[at + 4] - y0, corners[at + 5] - z0
    bx, by, bz = corners[at + 9] - x0, corners[at + 10] - y0, corners[at + 11] - z0
    # How far the corner opposite is from where a parallelogram would have it.
    cx, cy, cz = corners[at + 6] - x0 - ax - bx, corners[at + 7] - y0 - ay - by, corners[at + 8] - z0 - az - bz
    px, py, pz = ax + v * cx, ay + v * cy, az + v * cz
    qx, qy, qz = bx + u * cx, by + u * cy, bz + u * cz
    nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    point = (x0 + u * px + v * bx, y0 + u * py + v * by, z0 + u * pz + v * bz)
    return point, np.sqrt(nx * nx + ny * ny + nz * nz)
