"""Area lights in accumulation passes: each pass is lit by one point of the lights for each shadow ray.

The points are those that the ray tracer takes for that sample (`renderers.lights`), so both make the same picture of
equal samples. Whether a fragment sees a point is decided exactly, against all triangles (`occluders`), in scenes of up
to MOST_EXACT of them; in larger ones by a depth map drawn from the point (`shadow_maps`).

Measured on llvmpipe at 512 x 512, a floor all over the picture under a ball, a pass with one shadow ray: exact shadows
take 33 ms with 10 triangles, 58 with 82, 177 with 442 and 306 with 962; maps 43, 49, 54 and 58. Up to MOST_EXACT, which
costs about twice a map, shadows are exact. With hardware samples the light, and
with it the border of a shadow, is evaluated once a pixel.
"""

import numpy as np

from aliasbench.renderers.lights import (
    AREA,
    CHANCE,
    CHANCES_BEFORE,
    CORNER,
    EDGE_1,
    EDGE_2,
    LIGHT_NORMAL,
    RADIANCE,
    light_values,
)
from aliasbench.renderers.raster.exposures import Exposure
from aliasbench.renderers.raster.graphics import GraphicsContext, read_shader
from aliasbench.renderers.raster.minification import Shading, shader_coordinates
from aliasbench.renderers.raster.occluders import (
    GROUP,
    box_corners,
    cones,
    may_come_between,
    neighbours_order,
    pyramids,
)
from aliasbench.renderers.raster.shadow_maps import FACE_TEXELS, FACES, ShadowMaps
from aliasbench.renderers.raster.surfaces import DIFFUSE, Surfaces
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import UnsupportedScene
from aliasbench.scenes.model import FloatArray, ImageTexture, Scene
from aliasbench.scenes.projection import View, view_at

MOST_EXACT = 256  # triangles
# Of all loops of a fragment: drivers may end them after 65535, and say nothing.
_MOST_TURNS = 1 << 15
# As many as have maps of full size, five sides each.
_MOST_MAPPED_RAYS = 3
_MOST_CUTOUTS = 8  # textures: OpenGL 3.3 grants a shader 16
_HEADER = 3  # texels of a light point before its occluders: place, what it brings, normal
_MAP_SLOT, _FIRST_SLOT = 7, 8  # texture units: of shadow maps, and of cut-out textures from there on


class LightPoints:
    """The pass's points on the lights.

    Attributes
    ----------
    places, normals, brought : (k, 3) float64
        In the pass's coordinates; `brought` is what a white surface facing a point squarely at distance 1 shows.
    """

    def __init__(self, scene: Scene, view: View, surfaces: Surfaces, numbers: FloatArray) -> None:
        values = light_values(scene, view, surfaces.anchor)
        which = np.searchsorted(values[1:, CHANCES_BEFORE], numbers[:, 0], side="right")
        chosen = values[which]
        chance = chosen[:, CHANCE : CHANCE + 1]
        drawn = chance > 0.0
        u = np.minimum((numbers[:, :1] - chosen[:, CHANCES_BEFORE, None]) / np.where(drawn, chance, 1.0), 1.0)
        corner, one, other = (chosen[:, k : k + 3] for k in (CORNER, EDGE_1, EDGE_2))
        unit = surfaces.unit
        self.places = (corner + u * one + numbers[:, 1:] * other) / unit
        self.normals = chosen[:, LIGHT_NORMAL : LIGHT_NORMAL + 3]
        area = chosen[:, AREA, None] / unit**2 / (np.pi * len(numbers))
        self.brought = np.where(drawn, chosen[:, RADIANCE : RADIANCE + 3] * area / np.where(drawn, chance, 1.0), 0.0)


class Lighting:
    """The lights of a scene on the device; made and used inside the context's `use`.

    Attributes
    ----------
    text : str
        The shader's functions.
    most_rays : int
        How many shadow rays a pass may have at a time.
    """

    def __init__(
        self,
        context: GraphicsContext,
        scene: Scene,
        technique: Technique,
        surfaces: Surfaces,
        shadings: dict[str | None, Shading],
        slot: int,
    ) -> None:
        self._scene, self._technique, self._surfaces, self._slot = scene, technique, surfaces, slot
        cut = _cutouts(scene)
        holed = np.array([o.texture in cut for o in scene.objects], dtype=bool)[surfaces.owners]
        of_texture = [np.array([o.texture == name for o in scene.objects])[surfaces.owners] for name in cut]
        self._maps: ShadowMaps | None = None
        # every triangle is a turn of a loop, and every group of them
        self.most_rays = max(1, _MOST_TURNS // (2 * len(surfaces.owners) + 2))
        if len(surfaces.owners) > MOST_EXACT:
            uv = np.zeros_like(surfaces.uv)
            for name, mine in zip(cut, of_texture, strict=True):
                uv[mine] = _coordinates(surfaces, shadings[name], np.flatnonzero(mine))
            holes = [(shadings[name], mine) for name, mine in zip(cut, of_texture, strict=True)]
            self.most_rays = _MOST_MAPPED_RAYS
            self._maps = ShadowMaps(context, uv, holes, min(technique.shadow_rays, self.most_rays))
            cut, of_texture, holed = [], [], np.ones_like(holed)
        self._solid = np.flatnonzero(~holed)
        self._cut = [np.flatnonzero(mine) for mine in of_texture]
        self._images = [image for name in cut if (image := shadings[name].image) is not None]
        self._cut_uv = [_coordinates(surfaces, shadings[name], mine) for name, mine in zip(cut, self._cut, strict=True)]
        self._lit = surfaces.kinds == DIFFUSE
        self._groups = -(-len(self._solid) // GROUP)
        self._version = 0
        first = _HEADER + self._groups * (1 + 3 * GROUP)
        self._first_cut = first
        width = first + 4 * sum(len(c) for c in self._cut) + (FACES * FACE_TEXELS if self._maps else 0)
        self._points = context.gl.texture((width, min(technique.shadow_rays, self.most_rays)), 4, dtype="f4")
        self._count = 0
        self._points.filter = (context.gl.NEAREST, context.gl.NEAREST)
        self.text = self._make_text(cut, shadings)

    def _make_text(self, cut: list[str], shadings: dict[str | None, Shading]) -> str:
        shadows = "EXACT" if self._maps is None else "MAPS"
        lines = ["#define EXACT 0", "#define MAPS 1", f"#define SHADOWS {shadows}", f"#define GROUP {GROUP}"]
        lines += [f"#define FACE_TEXELS {FACE_TEXELS}"]
        lines += [f"#define FIRST_GROUP {_HEADER}", f"#define FIRST_TRIANGLE {_HEADER + self._groups}"]
        light = read_shader("light.glsl")
        declared, rest = light.split("#if SHADOWS", 1)
        functions, at = [], self._first_cut
        for k, (name, mine) in enumerate(zip(cut, self._cut, strict=True)):
            text = read_shader("cutouts.glsl")
            values = {
                "IMAGE_NAME": f"cutout_{k}",
                "FUNCTION_NAME": f"is_behind_cutout_{k}",
                "FIRST_TEXEL": at,
                "END_TEXEL": at + 4 * len(mine),
                "TEXEL_MODE": shadings[name].mode,
                "CUTOFF": repr(shadings[name].uniforms["alpha_cutoff"]),
            }
            for word, value in values.items():
                text = text.replace(word, str(value))
            functions.append(text)
            at += 4 * len(mine)
        calls = " || ".join(f"is_behind_cutout_{k}(row, back, most)" for k in range(len(cut))) or "false"
        functions.append(f"bool is_behind_cutouts(int row, vec3 back, float most) {{ return {calls}; }}\n")
        return "\n".join(lines) + "\n" + declared + "".join(functions) + "#if SHADOWS" + rest

    def update(self, exposure: Exposure, frame: int) -> None:
        """Draw the pass's points on the lights, and find what may hide them."""
        scene, surfaces = self._scene, self._surfaces
        # as the ray tracer turns lights: by the view in which the shutter opens
        view = view_at(scene.camera, scene.animation, frame, _opening(scene, self._technique), (1, 1))
        points = LightPoints(scene, view, surfaces, exposure.lights)
        if self._version != surfaces.version:
            self._version = surfaces.version
            self._solid = self._solid[neighbours_order(surfaces.corners[self._solid])]
        self._count = len(exposure.lights)
        room = np.zeros((self._points.height, self._points.width, 4), np.float32)
        rows = room[: self._count]
        rows[:, 0, :3], rows[:, 1, :3], rows[:, 2, :3] = points.places, points.brought, points.normals
        if self._lit.any():
            lit = box_corners(surfaces.corners[self._lit])
            if self._maps is not None:
                self._draw_maps(self._maps, points, lit, rows)
            else:
                self._write_solid(points, lit, rows)
                self._write_cutouts(points, lit, rows)
        self._points.write(room.tobytes())

    def _write_solid(self, points: LightPoints, lit: FloatArray, rows: np.ndarray) -> None:
        corners = self._surfaces.corners[self._solid]
        shares, may_hide = pyramids(corners, lit, points.places, points.normals)
        first = _HEADER + self._groups
        for row, place, mine, chosen in zip(rows, points.places, shares, may_hide, strict=True):
            kept = np.flatnonzero(chosen)
            count = -(-len(kept) // GROUP)
            row[0, 3] = count
            row[first : first + 3 * len(kept), :3] = mine[kept].reshape(-1, 3)
            if count:
                # the last group is filled up with its last triangle
                padded = np.concatenate([kept, np.repeat(kept[-1:], count * GROUP - len(kept))])
                row[_HEADER : _HEADER + count] = cones((corners[padded] - place).reshape(count, GROUP, 3, 3))

    def _draw_maps(self, maps: ShadowMaps, points: LightPoints, lit: FloatArray, rows: np.ndarray) -> None:
        corners = self._surfaces.corners
        maps.place(corners, self._surfaces.version)
        may_hide = may_come_between(corners, lit, points.places, points.normals)
        for row, faces in zip(rows, maps.draw(corners, may_hide, points.places, points.normals), strict=True):
            row[0, 3] = len(faces)
            row[_HEADER : _HEADER + FACE_TEXELS * len(faces)] = faces.reshape(-1, 4)

    def _write_cutouts(self, points: LightPoints, lit: FloatArray, rows: np.ndarray) -> None:
        at = self._first_cut
        for mine, uv in zip(self._cut, self._cut_uv, strict=True):
            shares, _ = pyramids(self._surfaces.corners[mine], lit, points.places, points.normals)
            texels = rows[:, at : at + 4 * len(mine)].reshape(len(rows), len(mine), 4, 4)
            texels[:, :, :3, :3] = shares
            texels[:, :, :3, 3], texels[:, :, 3, :3] = uv[..., 0], uv[..., 1]
            rows[:, at : at + 4 * len(mine)] = texels.reshape(len(rows), -1, 4)
            at += 4 * len(mine)

    def use(self) -> dict[str, int]:
        """Bind what shaders read; return the uniforms that say where it is."""
        self._points.use(self._slot)
        uniforms = {"lights": self._slot, "light_points": self._count}
        if self._maps is not None:
            self._maps.use(_MAP_SLOT)
            uniforms["shadow_map"] = _MAP_SLOT
        for k, image in enumerate(self._images):
            image.use(_FIRST_SLOT + k)
            uniforms[f"cutout_{k}"] = _FIRST_SLOT + k
        return uniforms

    def release(self) -> None:
        """Free everything."""
        self._points.release()
        if self._maps is not None:
            self._maps.release()


def _cutouts(scene: Scene) -> list[str]:
    """Return the names of the textures with holes that objects have."""
    found: dict[str, None] = {}
    for surface in scene.objects:
        if surface.texture is not None:
            texture = scene.textures[surface.texture]
            if isinstance(texture, ImageTexture) and texture.alpha_cutoff is not None:
                found[surface.texture] = None
    if len(found) > _MOST_CUTOUTS:
        raise UnsupportedScene(
            f"raster: {len(found)} cut-out textures under lights are not drawn; up to {_MOST_CUTOUTS} are"
        )
    return list(found)


def _coordinates(surfaces: Surfaces, shading: Shading, mine: np.ndarray) -> FloatArray:
    """Return (m, 3, 2) texture coordinates of triangles: of each the whole part is taken off where it may."""
    out = np.array([shader_coordinates(shading, uv) for uv in surfaces.uv[mine]])
    return out.reshape(-1, 3, 2)


def _opening(scene: Scene, technique: Technique) -> float:
    """Return when the first sample may lie, as a fraction of the frame interval; see the ray tracer's `exposure`."""
    single = technique.passes == 1 and technique.sampler in ("center", "grid")
    return scene.animation.shutter / 2 if technique.time == "center" or single else 0.0
