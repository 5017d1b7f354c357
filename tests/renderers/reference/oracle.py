"""What a pixel shows, by sampling and by quadrature that share no code with the renderers.

A `Stage` is a scene and a picture, set up anew from the scene's plain data: cameras, motions, planes and lenses are
written out here once more, for arrays of samples, each with its own time and place on the lens. On it stand

* `sample_points`: rays through places under the filter; every feature, slowly. Lights are sampled by a point each.
* `sample_lines`: rows under the filter, each integrated exactly from one border or texel to the next: unlit scenes.
* `integrate_lines`: the same rows at Gauss nodes between all heights where anything changes: exact, for an instant
  without a lens.

The first two draw scrambled Sobol points (scipy's) in independent replicates and return their mean and its standard
error.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from aliasbench.scenes.model import ImageTexture, Scene
from aliasbench.scenes.textures import evaluate_point

TIE = 1e-9
LIGHT = -2


@dataclass(frozen=True)
class Face:
    """A triangle: what it belongs to, and its corners among the vertices of that."""

    owner: int
    corners: tuple[int, int, int]
    uv: np.ndarray | None


class Stage:
    """A scene in a picture of `size` = (width, height), at a frame."""

    def __init__(self, scene: Scene, size, frame, *, linear=False, matrix=False):
        self.scene, self.size, self.frame = scene, size, frame
        self.linear, self.matrix = linear, matrix
        self.faces = []
        for k, o in enumerate(scene.objects):
            for t in o.triangles.tolist():
                if len(set(t)) == 3:
                    self.faces.append(
                        Face(k, tuple(t), o.uv[t] if o.texture is not None and o.uv is not None else None)
                    )
        camera = scene.camera
        self.perspective = camera.projection == "perspective"
        half = size[1] / 2
        self.scale = half / np.tan(np.radians(camera.fov_y_deg) / 2) if self.perspective else size[1] / camera.height
        self.extent = max([1.0] + [float(np.abs(o.vertices).max()) for o in scene.objects])

    # --- places ---------------------------------------------------------------------------------------------------

    def axes(self, fraction):
        """Return the camera's origin and axes (right, up, forward) at fractions (n,) of the frame, each (n, 3)."""
        c = self.scene.camera
        t = (self.frame + np.asarray(fraction))[:, None] / self.scene.animation.fps
        v = np.array(c.velocity)
        tv = v if c.target_velocity is None else np.array(c.target_velocity)
        origin = np.array(c.position) + v * t
        forward = np.array(c.target) + tv * t - origin
        self_focus = np.linalg.norm(forward, axis=1)
        forward = forward / self_focus[:, None]
        right = np.cross(forward, np.array(c.up))
        right /= np.linalg.norm(right, axis=1)[:, None]
        focus = self_focus if c.focus_distance is None else np.full(len(t), c.focus_distance)
        return origin, right, np.cross(right, forward), forward, focus

    def world(self, index, fraction):
        """Return the vertices (n, k, 3) of an object at fractions (n,) of the frame."""
        o = self.scene.objects[index]
        m = o.motion
        fps = self.scene.animation.fps
        v = o.vertices
        f = np.asarray(fraction)[:, None, None]
        if m.matrices is not None:
            begin, end = (np.array(x).reshape(4, 4) for x in m.matrices)
            return (v @ begin[:3, :3].T + begin[:3, 3]) * (1 - f) + (v @ end[:3, :3].T + end[:3, 3]) * f
        if self.matrix and not m.is_static:
            begin, end = (self._place(v, m, fps, np.array([[[x]]])) for x in (0.0, 1.0))
            return begin * (1 - f) + end * f
        return self._place(v, m, fps, f)

    def _place(self, v, m, fps, f):
        out = np.broadcast_to(v, (len(f), *v.shape))
        if m.spin is not None:
            k = np.array(m.spin.axis) / np.linalg.norm(m.spin.axis)
            c = np.array(m.spin.center)
            d = v - c
            turns = np.fmod(m.spin.rev_per_s / fps * self.frame, 1.0) + m.spin.rev_per_s / fps * f
            a = 2 * np.pi * turns
            # Rodrigues
            out = c + d * np.cos(a) + np.cross(k, d) * np.sin(a) + np.outer(d @ k, k) * (1 - np.cos(a))
        return out + np.array(m.velocity) * ((self.frame + f) / fps)

    def local(self, fraction):
        """Return corners in camera coordinates, (n, 3, 3) of each face and (n, 4, 3) of each light, and the focus (n,).

        Right, up and forward are left-handed: cross products there point the other way.
        """
        origin, right, up, forward, focus = self.axes(fraction)
        basis = np.stack([right, up, forward], axis=1)
        objects = [
            np.einsum("nij,nkj->nki", basis, self.world(i, fraction) - origin[:, None])
            for i in range(len(self.scene.objects))
        ]
        lights = [np.einsum("nij,nkj->nki", basis, np.array(q.quad) - origin[:, None]) for q in self.scene.lights]
        return [objects[f.owner][:, f.corners] for f in self.faces], lights, focus

    # --- values ---------------------------------------------------------------------------------------------------

    def rgba(self, owner, uv):
        """Return the texture's value (..., 4) of an object."""
        texture = self.scene.textures[self.scene.objects[owner].texture]
        if not (self.linear and isinstance(texture, ImageTexture)):
            return evaluate_point(texture, uv)
        h, w = texture.texels.shape[:2]
        x, y = uv[..., 0] * w - 0.5, uv[..., 1] * h - 0.5
        i, j = np.floor(x), np.floor(y)
        a, b = (x - i)[..., None], (y - j)[..., None]
        i0, i1 = np.mod(i, w).astype(int), np.mod(i + 1, w).astype(int)
        j0, j1 = np.mod(j, h).astype(int), np.mod(j + 1, h).astype(int)
        t = texture.texels.astype(np.float64)
        return (t[j0, i0] * (1 - a) + t[j0, i1] * a) * (1 - b) + (t[j1, i0] * (1 - a) + t[j1, i1] * a) * b

    def cutoff(self, owner):
        o = self.scene.objects[owner]
        texture = None if o.texture is None else self.scene.textures[o.texture]
        return texture.alpha_cutoff if isinstance(texture, ImageTexture) else None

    # --- rays -----------------------------------------------------------------------------------------------------

    def nearest(self, origin, direction, corners, lights=(), *, far=None):
        """Return (owner, distance, uv, normal) of what rays (n, 3) hit first: owner -1 for none, LIGHT - k for light k.

        With `far` (n,): only whether anything of the objects is hit before it.
        """
        n = len(origin)
        owner, best = np.full(n, -1), np.full(n, np.inf)
        uv, normal = np.zeros((n, 2)), np.zeros((n, 3))
        items = [(f.owner, c, f.uv) for f, c in zip(self.faces, corners, strict=True)]
        for k, q in enumerate(lights):
            items += [(LIGHT - k, q[:, [0, 1, 2]], None), (LIGHT - k, q[:, [0, 2, 3]], None)]
        for who, c, coords in items:
            e1, e2 = c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]
            nn = cross(e1, e2)
            with np.errstate(all="ignore"):
                z = dot(nn, c[:, 0] - origin) / dot(nn, direction)
                r = origin + z[:, None] * direction - c[:, 0]
                square = dot(nn, nn)
                beta, gamma = dot(cross(r, e2), nn) / square, dot(cross(e1, r), nn) / square
                hit = (z > 0) & (beta >= 0) & (gamma >= 0) & (beta + gamma <= 1) & np.isfinite(z)
            if far is not None:
                hit &= (z < far * (1 - 1e-9)) & (z > 1e-9 * far)
            else:
                slack = TIE * np.minimum(best, self.extent if not self.perspective else best)
                hit &= z <= np.where(np.isfinite(best), best + slack, np.inf)
            if not hit.any():
                continue
            at = np.zeros((n, 2))
            if coords is not None:
                beta, gamma = np.where(hit, beta, 0.0)[:, None], np.where(hit, gamma, 0.0)[:, None]
                at = coords[0] + beta * (coords[1] - coords[0]) + gamma * (coords[2] - coords[0])
                cut = self.cutoff(who)
                if cut is not None:
                    hit &= self.rgba(who, at)[:, 3].astype(np.float32) >= np.float32(cut)
            owner[hit], best[hit], uv[hit], normal[hit] = who, z[hit], at[hit], nn[hit]
        return owner, best, uv, normal

    def shade(self, origin, direction, corners, lights, u):
        """Return the radiance (n, 3) along rays; `u` (n, 2 lights) chooses points on the lights."""
        owner, z, uv, normal = self.nearest(origin, direction, corners, lights)
        out = np.tile(np.array(self.scene.background, dtype=float), (len(origin), 1))
        for k, o in enumerate(self.scene.objects):
            mine = np.flatnonzero(owner == k)
            if not len(mine):
                continue
            value = np.tile(np.array(o.color, dtype=float), (len(mine), 1))
            if o.texture is not None and o.uv is not None:
                value *= self.rgba(k, uv[mine])[:, :3]
            if o.material.kind == "diffuse" and lights:
                place = origin[mine] + z[mine, None] * direction[mine]
                near, quads = [c[mine] for c in corners], [q[mine] for q in lights]
                value *= self._direct(place, direction[mine], normal[mine], near, quads, u[mine]) / np.pi
            out[mine] = value
        for k, light in enumerate(self.scene.lights):
            mine = owner == LIGHT - k
            q = lights[k]
            front = dot(cross(q[:, 1] - q[:, 0], q[:, 3] - q[:, 0]), direction) > 0  # left-handed, see `local`
            out[mine] = np.where(front[mine, None], np.array(light.radiance), 0.0)
        return out

    def _direct(self, place, direction, normal, corners, lights, u):
        """Return the irradiance of the side that is seen, one point of each light for every place."""
        normal = normal / np.linalg.norm(normal, axis=1)[:, None]
        normal = normal * -np.sign(dot(normal, direction))[:, None]
        out = np.zeros((len(place), 3))
        for k, q in enumerate(lights):
            a, b = q[:, 1] - q[:, 0], q[:, 3] - q[:, 0]
            area = cross(b, a)  # left-handed, see `local`
            to = q[:, 0] + u[:, [2 * k]] * a + u[:, [2 * k + 1]] * b - place
            r2 = dot(to, to)
            value = np.maximum(dot(normal, to), 0) * np.maximum(-dot(area, to), 0) / r2**2
            others = [x for j, x in enumerate(lights) if j != k]
            lit = np.flatnonzero(value > 0)
            if len(lit):
                hit = self.nearest(
                    place[lit], to[lit], [c[lit] for c in corners], [x[lit] for x in others], far=np.ones(len(lit))
                )[0]
                value[lit[hit != -1]] = 0.0
            out += value[:, None] * np.array(self.scene.lights[k].radiance)
        return out


def dot(a, b):
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def cross(a, b):
    return np.stack(
        [
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        ],
        axis=1,
    )


def disc(u, v, radius):
    return radius * np.sqrt(u) * np.cos(2 * np.pi * v), radius * np.sqrt(u) * np.sin(2 * np.pi * v)


def sample_points(stage: Stage, kernel, pixel, shutter, *, log2=12, replicates=32, seed=0):
    """Return the mean (3,) and the standard error (3,) of a pixel (row, column).

    Parameters
    ----------
    stage : Stage
    kernel : oracle_filters.Kernel
    shutter : (float, float)
        The first and last fraction of the frame; equal for an instant.
    """
    camera, (w, h) = stage.scene.camera, stage.size
    places = 2 * len(stage.scene.lights)
    offset, means = None, []
    for replicate in range(replicates + 1):
        n = log2 if replicate else max(4, log2 - 3)
        u = qmc.Sobol(5 + places, rng=np.random.default_rng([seed, replicate, *pixel])).random_base2(n)
        (x, wx), (y, wy) = kernel.draw(u[:, 0]), kernel.draw(u[:, 1])
        weight = kernel.density(x, y) * wx * wy
        fraction = shutter[0] + (shutter[1] - shutter[0]) * u[:, 2]
        corners, lights, focus = stage.local(fraction)
        a, b = disc(u[:, 3], u[:, 4], camera.lens_radius)
        xh, yh = (pixel[1] + 0.5 + x - w / 2) / stage.scale, (h / 2 - pixel[0] - 0.5 - y) / stage.scale
        zero, one = np.zeros(len(u)), np.ones(len(u))
        chief, axis = np.stack([xh, yh, zero], axis=1), np.stack([zero, zero, one], axis=1)
        if stage.perspective:
            sharp, origin = (chief + axis) * focus[:, None], np.stack([a, b, zero], axis=1)
        else:
            sharp, origin = chief + axis * focus[:, None], chief + np.stack([a, b, zero], axis=1)
        value = stage.shade(origin, (sharp - origin) / focus[:, None], corners, lights, u[:, 5:])
        if offset is None:
            offset = value.mean(axis=0)
            continue
        means.append(offset + (weight[:, None] * (value - offset)).mean(axis=0))
    return np.mean(means, axis=0), np.std(means, axis=0, ddof=1) / np.sqrt(replicates)
