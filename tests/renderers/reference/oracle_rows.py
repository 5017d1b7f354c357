"""Rows under a filter, integrated exactly from border to border: see `oracle`."""

from dataclasses import dataclass

import numpy as np
from oracle import TIE, Stage, cross, disc, dot
from scipy.stats import qmc

from aliasbench.scenes.model import ImageTexture

# --- rows ---------------------------------------------------------------------------------------------------------


@dataclass
class Rows:
    """What rows of the picture show: for each face where it is, and linear forms of xh, the place along the row.

    Nearness is p + q xh; a texture coordinate is (n0 + n1 xh) / (d0 + d1 xh). Places are in pixels.
    """

    first: list
    last: list
    near: list
    u: list
    v: list


def _rows(stage: Stage, py, fraction, a, b, window):
    """Return the faces along rows at heights py (n,), clipped to x in window (x0, x1) in pixels."""
    w, h = stage.size
    corners, _, focus = stage.local(fraction)
    yh = (h / 2 - py) / stage.scale
    to_px = lambda xh: w / 2 + xh * stage.scale  # noqa: E731
    out = Rows([], [], [], [], [])
    for face, c in zip(stage.faces, corners, strict=True):
        c = c.copy()
        # where the ray through the lens' place meets the plane in focus with the pinhole's
        shift = 1 - c[..., 2] / focus[:, None]
        c[..., 0] -= a[:, None] * shift
        c[..., 1] -= b[:, None] * shift
        side = c[..., 1] - yh[:, None] * (c[..., 2] if stage.perspective else 1.0)
        crossed, met = [], []
        for i in range(3):
            j = (i + 1) % 3
            crossed.append((side[:, i] > 0) != (side[:, j] > 0))
            with np.errstate(all="ignore"):
                s = np.where(crossed[-1], side[:, i] / (side[:, i] - side[:, j]), 0.0)
            met.append(c[:, i] + s[:, None] * (c[:, j] - c[:, i]))
        # none or two of the three are crossed
        p, q = np.where(crossed[0][:, None], met[0], met[1]), np.where(crossed[2][:, None], met[2], met[1])
        zp, zq = p[:, 2], q[:, 2]
        with np.errstate(all="ignore"):
            s0 = np.where((zp <= 0) & (zq > 0), zp / (zp - zq), 0.0)
            s1 = np.where((zq <= 0) & (zp > 0), zp / (zp - zq), 1.0)
            ends_x = []
            for s, cut in ((s0, zp <= 0), (s1, zq <= 0)):
                e = p + s[:, None] * (q - p)
                if stage.perspective:
                    ends_x.append(np.where(cut, np.copysign(np.inf, e[:, 0]), to_px(e[:, 0] / e[:, 2])))
                else:
                    ends_x.append(to_px(e[:, 0]))
        lo, hi = np.minimum(*ends_x), np.maximum(*ends_x)
        there = (crossed[0] | crossed[1]) & ((zp > 0) | (zq > 0)) & (hi > lo)
        lo = np.where(there, np.clip(lo, *window), window[1])
        hi = np.where(there, np.clip(hi, *window), window[1])
        out.first.append(lo)
        out.last.append(hi)
        e1, e2 = c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]
        n = cross(e1, e2)
        d = dot(n, c[:, 0])
        square = dot(n, n)
        with np.errstate(all="ignore"):
            if stage.perspective:
                out.near.append(((n[:, 1] * yh + n[:, 2]) / d, n[:, 0] / d))
            else:
                out.near.append((-(d - n[:, 1] * yh) / n[:, 2], n[:, 0] / n[:, 2]))
            forms = []
            if face.uv is not None:
                ab, ag = cross(e2, n) / square[:, None], cross(n, e1) / square[:, None]
                for axis in range(2):
                    g = (face.uv[1, axis] - face.uv[0, axis]) * ab + (face.uv[2, axis] - face.uv[0, axis]) * ag
                    k = face.uv[0, axis] - dot(g, c[:, 0])
                    if stage.perspective:
                        den = (n[:, 1] * yh + n[:, 2], n[:, 0])
                        num = (d * (g[:, 1] * yh + g[:, 2]), d * g[:, 0])
                        forms.append((num[0] + k * den[0], num[1] + k * den[1], *den))
                    else:
                        z0, z1 = (d - n[:, 1] * yh) / n[:, 2], -n[:, 0] / n[:, 2]
                        forms.append((g[:, 1] * yh + g[:, 2] * z0 + k, g[:, 0] + g[:, 2] * z1, np.ones_like(d), 0 * d))
        out.u.append(forms[0] if forms else None)
        out.v.append(forms[1] if forms else None)
    return out


def levels(stage, texture, axis):
    """Return (multiplier, offset) such that a texture changes where multiplier * coordinate + offset is whole."""
    if isinstance(texture, ImageTexture):
        return texture.texels.shape[1 - axis], 0.5 if stage.linear else 0.0
    squares = getattr(texture, "squares", None)
    return (None, 0.0) if squares is None else (squares[axis], 0.0)


def _wave_form(texture, u, v):
    """Return the linear forms of a square grating's argument, in quarter waves off its zeros."""
    angle = np.radians(texture.angle_deg)
    c, s = 2 * texture.cycles * np.cos(angle), 2 * texture.cycles * np.sin(angle)
    k = 2 * texture.phase - 0.5
    return c * u[0] + s * v[0] + k * u[2], c * u[1] + s * v[1] + k * u[3], u[2], u[3]


def _crossings(form, multiplier, offset, lo, hi, stage):
    """Return the places (n, k) in pixels between lo and hi where multiplier * form + offset is a whole number."""
    w = stage.size[0]
    n0, n1, d0, d1 = form
    n0, n1 = multiplier * n0 + offset * d0, multiplier * n1 + offset * d1
    xl, xr = (lo - w / 2) / stage.scale, (hi - w / 2) / stage.scale
    with np.errstate(all="ignore"):
        fl, fr = (n0 + n1 * xl) / (d0 + d1 * xl), (n0 + n1 * xr) / (d0 + d1 * xr)
        empty = ~((hi > lo) & np.isfinite(fl) & np.isfinite(fr))
        low = np.where(empty, 0.0, np.floor(np.minimum(fl, fr)))
        count = np.where(empty, 0.0, np.ceil(np.maximum(fl, fr)) - low + 1)
        most = int(count.max(initial=0))
        if most > 4000:
            raise OverflowError("too many texels along a row")
        k = low[:, None] + np.arange(most)
        x = w / 2 + stage.scale * (k * d0[:, None] - n0[:, None]) / (n1[:, None] - k * d1[:, None])
    return np.where(np.isfinite(x), np.clip(x, lo[:, None], hi[:, None]), lo[:, None])


def row_values(stage: Stage, kernel, pixel, py, fraction, a, b, nodes):
    """Return the integrals (n, 3) of filter times picture along rows; `nodes` Gauss nodes where a texture is smooth."""
    w, _ = stage.size
    centre = pixel[1] + 0.5
    window = (centre - kernel.support, centre + kernel.support)
    n = len(py)
    rows = _rows(stage, py, fraction, a, b, window)
    keep = [k for k in range(len(stage.faces)) if (rows.last[k] > rows.first[k]).any()]
    breaks = [np.full((n, 1), window[0]), np.full((n, 1), window[1])]
    smooth = False
    for k in keep:
        face = stage.faces[k]
        lo, hi = rows.first[k], rows.last[k]
        breaks += [lo[:, None], hi[:, None]]
        for j in keep:
            if j < k and (stage.faces[j].owner != face.owner or not stage.scene.objects[face.owner].is_polygon):
                (p0, p1), (q0, q1) = rows.near[k], rows.near[j]
                with np.errstate(all="ignore"):
                    x = w / 2 + stage.scale * (q0 - p0) / (p1 - q1)
                breaks.append(np.where(np.isfinite(x), np.clip(x, *window), window[0])[:, None])
        if face.uv is None:
            continue
        texture = stage.scene.textures[stage.scene.objects[face.owner].texture]
        for axis, form in enumerate((rows.u[k], rows.v[k])):
            multiplier, offset = levels(stage, texture, axis)
            if multiplier is not None:
                breaks.append(_crossings(form, multiplier, offset, lo, hi, stage))
        if getattr(texture, "profile", None) == "square":
            breaks.append(_crossings(_wave_form(texture, rows.u[k], rows.v[k]), 1.0, 0.0, lo, hi, stage))
        elif multiplier is None:
            smooth = True
            parts = int(np.ceil(_wave_count(stage, texture, rows.u[k], rows.v[k], lo, hi))) + 1
            breaks.append(lo[:, None] + (hi - lo)[:, None] * np.linspace(0.0, 1.0, parts + 1))
        elif stage.linear and isinstance(texture, ImageTexture):
            smooth = True
    if smooth:
        knots = np.unique([*window, *(centre + np.array(kernel.knots))])
        breaks.append(np.broadcast_to(knots, (n, len(knots))))
    oy = (py - pixel[0] - 0.5)[:, None]
    if kernel.name == "cone":
        half = np.sqrt(np.maximum(kernel.support**2 - oy**2, 0.0))
        breaks += [centre - half, centre + half]
    x = np.sort(np.concatenate(breaks, axis=1), axis=1)
    left, right = x[:, :-1], x[:, 1:]
    if smooth:
        g, gw = np.polynomial.legendre.leggauss(nodes)
        out = np.zeros((n, 3))
        mid = (left + right) / 2
        who = _winner(stage, rows, keep, mid)
        for node, weight in zip(g, gw, strict=True):
            at = mid + (right - left) / 2 * node
            mass = kernel.density(at - centre, np.broadcast_to(oy, at.shape)) * weight * (right - left) / 2
            out += np.einsum("nb,nbc->nc", mass, _color(stage, rows, who, at))
        return out
    mid = (left + right) / 2
    mass = np.diff(kernel.primitive(x - centre, oy), axis=1)
    return np.einsum("nb,nbc->nc", mass, _color(stage, rows, _winner(stage, rows, keep, mid), mid))


def _wave_count(stage, texture, u, v, lo, hi):
    """Return about how many waves of a smooth texture the widest row spans."""
    some = hi > lo
    if not some.any():
        return 0.0
    w = stage.size[0]
    places = np.linspace(lo[some], hi[some], 9)
    xh = (places - w / 2) / stage.scale
    with np.errstate(all="ignore"):
        uu = (u[0][some] + u[1][some] * xh) / (u[2][some] + u[3][some] * xh)
        vv = (v[0][some] + v[1][some] * xh) / (v[2][some] + v[3][some] * xh)
    if hasattr(texture, "cycles"):
        angle = np.radians(texture.angle_deg)
        s = texture.cycles * (uu * np.cos(angle) + vv * np.sin(angle))
    else:
        s = texture.k / (2 * np.pi) * ((uu - texture.center[0]) ** 2 + (vv - texture.center[1]) ** 2)
    total = np.abs(np.diff(s, axis=0)).max(axis=0) * 8
    if not np.isfinite(total).all() or total.max() > 400:
        raise OverflowError("too many waves along a row")
    return float(total.max())


def _winner(stage, rows, keep, at):
    """Return the number of the face that is seen at places (n, b) in pixels, -1 for none."""
    xh = (at - stage.size[0] / 2) / stage.scale
    who, best = np.full(at.shape, -1), np.full(at.shape, -np.inf)
    for k in keep:
        face = stage.faces[k]
        p, q = rows.near[k]
        with np.errstate(all="ignore"):
            near = p[:, None] + q[:, None] * xh
            slack = TIE * (np.abs(best) if stage.perspective else stage.extent)
            hit = (at > rows.first[k][:, None]) & (at < rows.last[k][:, None])
            hit &= (best == -np.inf) | (near >= best - slack)
        cut = stage.cutoff(face.owner) if face.uv is not None else None
        if cut is not None and hit.any():
            alpha = stage.rgba(face.owner, _uv(rows, k, xh, hit))[..., 3]
            hit[hit] &= alpha.astype(np.float32) >= np.float32(cut)
        who[hit], best[hit] = k, near[hit]
    return who


def _uv(rows, k, xh, where):
    """Return texture coordinates (m, 2) at the chosen places."""
    row = np.nonzero(where)[0]
    x = xh[where]
    return np.stack(
        [(f[0][row] + f[1][row] * x) / (f[2][row] + f[3][row] * x) for f in (rows.u[k], rows.v[k])], axis=-1
    )


def _color(stage, rows, who, at):
    out = np.empty((*at.shape, 3))
    out[...] = stage.scene.background
    xh = (at - stage.size[0] / 2) / stage.scale
    for k in np.unique(who[who >= 0]):
        face, mine = stage.faces[k], who == k
        color = np.array(stage.scene.objects[face.owner].color, dtype=float)
        out[mine] = color if face.uv is None else color * stage.rgba(face.owner, _uv(rows, k, xh, mine))[:, :3]
    return out


def sample_lines(stage: Stage, kernel, pixel, shutter, *, log2=9, replicates=32, seed=0, nodes=6):
    """Return the mean (3,) and the standard error (3,) of a pixel of an unlit scene; see `sample_points`."""
    camera = stage.scene.camera
    offset, means = None, []
    for replicate in range(replicates + 1):
        u = qmc.Sobol(4, rng=np.random.default_rng([seed, replicate, *pixel])).random_base2(log2)
        if shutter[0] == shutter[1]:
            u[:, 3] = u[:, 1]
        y, wy = kernel.draw(u[:, 0])
        a, b = disc(u[:, 2], u[:, 1], camera.lens_radius)
        fraction = shutter[0] + (shutter[1] - shutter[0]) * u[:, 3]
        value = row_values(stage, kernel, pixel, pixel[0] + 0.5 + y, fraction, a, b, nodes)
        whole = kernel.primitive(np.full(len(y), kernel.support), y)
        if offset is None:
            offset = value.mean(axis=0) / whole.mean()
            continue
        means.append(offset + (wy[:, None] * (value - offset * whole[:, None])).mean(axis=0))
    return np.mean(means, axis=0), np.std(means, axis=0, ddof=1) / np.sqrt(replicates)
