"""Pixels by Gauss rules over rows, and over time: see `oracle`. Exact at an instant, without a lens."""

import time

import numpy as np
from oracle import Stage
from oracle_rows import levels, row_values
from scipy.integrate import quad_vec


def integrate_lines(stage: Stage, kernel, pixel, fraction, *, most=2000, rules=(12, 19)):
    """Return the value (3,) of a pixel at an instant without a lens, and an error bar (3,), by two Gauss rules.

    With one rule the error bar is 0.

    Raises
    ------
    OverflowError
        Where rows change at more than `most` heights.
    """
    centre, s = pixel[0] + 0.5, kernel.support
    ends = np.unique([*_heights(stage, kernel, pixel, fraction, most), *(centre + np.array(kernel.knots))])
    ends = ends[(ends >= centre - s) & (ends <= centre + s)]
    values = []
    for count in rules:
        g, gw = np.polynomial.legendre.leggauss(count)
        mid, half = (ends[1:] + ends[:-1]) / 2, np.diff(ends) / 2
        py, weight = (mid[:, None] + half[:, None] * g).ravel(), (half[:, None] * gw).ravel()
        total, zero = np.zeros(3), np.zeros(len(py))
        for k in range(0, len(py), 2048):
            part = slice(k, k + 2048)
            z = zero[part]
            row = row_values(stage, kernel, pixel, py[part], z + fraction, z, z, count + 2)
            total += weight[part] @ row
        values.append(total)
    return values[-1], np.abs(values[-1] - values[0])


def integrate_times(stage: Stage, kernel, pixel, shutter, *, close=2e-7, seconds=20.0):
    """Return the value (3,) of a pixel over the open shutter and an error bar (3,): adaptive rules over exact instants.

    For flat colours without a lens. The bar is that of scipy's adaptive Gauss-Kronrod rule, never under `close`, and
    infinite where it did not get there in time.
    """
    # between two heights a row's integral is a polynomial in y under the first three
    rule = {"box": 2, "tent": 3, "mitchell": 5, "gaussian": 12, "lanczos": 9, "cone": 19}[kernel.name]
    end = time.monotonic() + seconds

    def value(fraction):
        if time.monotonic() > end:
            return np.zeros(3)
        return integrate_lines(stage, kernel, pixel, fraction, rules=(rule,))[0]

    width = shutter[1] - shutter[0]
    # many intervals to begin with: what is seen for a short time only must not fall between nodes
    total, bar = quad_vec(
        value, *shutter, epsabs=close * width, epsrel=0.0, norm="max", limit=400,
        points=np.linspace(*shutter, 25)[1:-1], quadrature="gk15",
    )  # fmt: skip
    return total / width, np.full(3, np.inf if time.monotonic() > end else max(close, bar / width))


def _heights(stage, kernel, pixel, fraction, most):
    """Return the heights in pixels at which what is along a row may change: where any two lines of the picture meet."""
    w, h = stage.size
    corners, _, _ = stage.local(np.array([fraction]))
    cx, cy, s = pixel[1] + 0.5, pixel[0] + 0.5, kernel.support
    # a line (a, b, c): a x + b y + c = 0 in pixels relative to the pixel's centre
    lines = [(1.0, 0.0, -k) for k in kernel.knots]
    planes = []
    for face, corner in zip(stage.faces, corners, strict=True):
        c = corner[0]
        n = np.cross(c[1] - c[0], c[2] - c[0])
        planes.append((n, n @ c[0]))
        if not stage.perspective:
            lines.append((n[0], n[1], -(n @ c[0])))  # where it passes through the camera's plane
        for i in range(3):
            p, q = c[i], c[(i + 1) % 3]
            if stage.perspective:
                lines.append(tuple(np.cross(p, q)))
            else:
                d = q - p
                lines.append((-d[1], d[0], d[1] * p[0] - d[0] * p[1]))
        if face.uv is not None:
            lines += _texture_lines(stage, face, c, kernel, pixel, most)
    for i in range(len(planes)):
        for j in range(i):
            if stage.faces[i].owner == stage.faces[j].owner and stage.scene.objects[stage.faces[i].owner].is_polygon:
                continue
            (n, d), (m, e) = planes[i], planes[j]
            if stage.perspective:
                lines.append(tuple(n * e - m * d))
            else:
                lines.append((n[0] * m[2] - m[0] * n[2], n[1] * m[2] - m[1] * n[2], e * n[2] - d * m[2]))
    px = []
    for k, (a, b, c) in enumerate(lines):
        if k >= len(kernel.knots):
            # camera plane xh = (cx + x - w/2) / scale, yh = (h/2 - cy - y) / scale
            a, b, c = (
                a / stage.scale, -b / stage.scale, c + a * (cx - w / 2) / stage.scale + b * (h / 2 - cy) / stage.scale
            )  # fmt: skip
        size = np.hypot(a, b)
        if size > 0 and abs(c) / size < 2 * s:
            px.append((a / size, b / size, c / size))
    lines = np.unique(np.round(np.array(px), 13), axis=0)
    if len(lines) ** 2 > 4 * most:
        raise OverflowError("too many lines in a pixel")
    a, b, c = lines.T
    with np.errstate(all="ignore"):
        y = (np.outer(c, a) - np.outer(a, c)) / (np.outer(a, b) - np.outer(b, a))
        x = (np.outer(b, c) - np.outer(c, b)) / (np.outer(a, b) - np.outer(b, a))
    inside = np.isfinite(y) & (np.abs(y) <= s) & (np.abs(x) <= s * (1 + 1e-9))
    if inside.sum() > 2 * most:
        raise OverflowError("too many places in a pixel")
    heights = [y[inside]]
    if kernel.name == "cone":
        # a line leaves the disc at its foot plus or minus half the chord
        half = np.sqrt(np.maximum(s * s - c**2, 0.0))
        heights += [-c * b + a * half, -c * b - a * half]
    return cy + np.unique(np.concatenate(heights))


def _texture_lines(stage, face, c, kernel, pixel, most):
    """Return the lines of the camera plane along which a face's texture changes."""
    texture = stage.scene.textures[stage.scene.objects[face.owner].texture]
    e1, e2 = c[1] - c[0], c[2] - c[0]
    n = np.cross(e1, e2)
    d, square = n @ c[0], n @ n
    ab, ag = np.cross(e2, n) / square, np.cross(n, e1) / square
    forms = []
    for axis in range(2):
        g = (face.uv[1, axis] - face.uv[0, axis]) * ab + (face.uv[2, axis] - face.uv[0, axis]) * ag
        forms.append((g, face.uv[0, axis] - g @ c[0]))
    if getattr(texture, "profile", None) == "square":
        angle = np.radians(texture.angle_deg)
        co, si = 2 * texture.cycles * np.cos(angle), 2 * texture.cycles * np.sin(angle)
        forms = [(co * forms[0][0] + si * forms[1][0], co * forms[0][1] + si * forms[1][1] + 2 * texture.phase - 0.5)]
    else:
        scaled = []
        for axis, (g, k) in enumerate(forms):
            multiplier, offset = levels(stage, texture, axis)
            if multiplier is not None:
                scaled.append((multiplier * g, multiplier * k + offset))
        forms = scaled
    w, h = stage.size
    s = kernel.support
    # the four corners of what the filter sees bound the coordinate's range there
    px, py = np.meshgrid(pixel[1] + 0.5 + s * np.linspace(-1, 1, 5), pixel[0] + 0.5 + s * np.linspace(-1, 1, 5))
    q = np.stack([(px - w / 2) / stage.scale, (h / 2 - py) / stage.scale, np.ones_like(px)], axis=-1)
    out = []
    for g, k in forms:
        with np.errstate(all="ignore"):
            if stage.perspective:
                z = d / (q @ n)
                value = z * (q @ g) + k
                value = value[z > 0]
            else:
                z = (d - q[..., :2] @ n[:2]) / n[2]
                value = (q[..., :2] @ g[:2] + z * g[2] + k).ravel()
        # a horizon within the window lets the range run off to infinity: the face's corners bound it then
        ends = np.array([g @ p + k for p in c])
        low, high = float(ends.min()), float(ends.max())
        value = value[np.isfinite(value)]
        if len(value) == px.size:
            low, high = max(low, value.min() - 1), min(high, value.max() + 1)
        if high - low > most:
            raise OverflowError("too many texels in a pixel")
        for level in np.arange(np.floor(low), np.ceil(high) + 1):
            if stage.perspective:
                # g . P + k = level with P = q d / (n . q)
                out.append(tuple(g * d + (k - level) * n))
            else:
                out.append((g[0] - n[0] / n[2] * g[2], g[1] - n[1] / n[2] * g[2], d / n[2] * g[2] + k - level))
    return out
