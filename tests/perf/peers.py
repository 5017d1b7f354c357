"""Mitsuba 3 on our scenes: the same triangles, textures and camera, for comparisons of speed and of noise.

Mitsuba is an optional peer (the extra `peers`), so only tests import this module, and only where it is installed. The
integrator gives albedo alone, which is what our unlit surfaces shine with; of what Mitsuba has it is the fastest for
that, and `path` and `direct`, which would take emitters, end the process with an LLVM error on some processors. What a
scene has beyond that is refused, never left out.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.model import Camera, Checker, Scene, Surface, Vec3

VARIANT = "llvm_ad_rgb"
mi.set_variant(VARIANT)

# The samples a pixel, of 1 to 256, at which a sampler is compared; others it rounds to what it can do.
SAMPLERS: Mapping[str, Sequence[int]] = {
    "independent": (1, 4, 16, 64, 256),
    "stratified": (1, 4, 16, 64, 256),
    "multijitter": (1, 4, 16, 64, 256),
    "orthogonal": (4, 9, 25, 49, 121),
    "ldsampler": (4, 16, 64, 256),
}


class MitsubaScene:
    """A scene held by Mitsuba, ready to be rendered with a sampler's `spp` samples a pixel.

    Raises
    ------
    ValueError
        For what the scene has and this does not translate, and for a count that the sampler does not take.
    """

    __slots__ = ("_scene", "_spp", "samples")

    def __init__(self, scene: Scene, *, size: tuple[int, int], sampler: str, spp: int, robust: bool) -> None:
        _check(scene)
        parts = {f"mesh{k}": part for k, part in enumerate(_meshes(scene))}
        film = {
            "type": "hdrfilm",
            "width": size[0],
            "height": size[1],
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        }
        sensor = {
            **_camera(scene.camera, size),
            "film": film,
            "sampler": {"type": sampler, "sample_count": spp},
        }
        self._scene = mi.load_dict(
            {
                "type": "scene",
                "embree_use_robust_intersections": robust,
                "integrator": {"type": "aov", "aovs": "albedo:albedo"},
                "sensor": sensor,
                **parts,
            }
        )
        taken = int(self._scene.sensors()[0].sampler().sample_count())
        if taken != spp:
            raise ValueError(f"Mitsuba's {sampler} takes {taken} samples a pixel where {spp} were asked for")
        self._spp = spp
        self.samples = size[0] * size[1] * spp

    def render(self, seed: int = 0) -> NDArray[np.float32]:
        """Return the picture (h, w, 3), in host memory."""
        picture = np.array(mi.render(self._scene, spp=self._spp, seed=seed))
        return picture[:, :, -3:]


def _check(scene: Scene) -> None:
    """Raise for what is not translated."""
    camera = scene.camera
    faults = {
        "motion under an open shutter": scene.animation.shutter > 0 and not scene.is_static,
        "lights": bool(scene.lights),
        "a lens": camera.lens_radius > 0,
        "a background": scene.background != (0.0, 0.0, 0.0),
        "no objects": not scene.objects,
    }
    for surface in scene.objects:
        texture = scene.textures[surface.texture] if surface.texture is not None else None
        faults[f"material {surface.material.kind}"] = surface.material.kind != "unlit"
        faults[f"texture {type(texture).__name__}"] = not isinstance(texture, Checker | None)
    for name, has_it in faults.items():
        if has_it:
            raise ValueError(f"scene {scene.name!r} has {name}, which is not translated for Mitsuba")


def _camera(camera: Camera, size: tuple[int, int]) -> dict[str, Any]:
    """Return the sensor without film and sampler."""
    transform = mi.ScalarTransform4f
    placed = transform().look_at(origin=list(camera.position), target=list(camera.target), up=list(camera.up))
    if camera.projection == "perspective":
        return {"type": "perspective", "fov": camera.fov_y_deg, "fov_axis": "y", "to_world": placed}
    assert camera.height is not None
    # Mitsuba's orthographic picture is two units wide before it is placed.
    half_width = 0.5 * camera.height * size[0] / size[1]
    return {"type": "orthographic", "to_world": placed @ transform().scale([half_width, half_width, 1.0])}


def _meshes(scene: Scene) -> list[Any]:
    """Return one mesh for every look, as our tracer too has one for all that stands still."""
    looks: dict[tuple[Vec3, str | None], list[Surface]] = {}
    for surface in scene.objects:
        looks.setdefault((surface.color, surface.texture), []).append(surface)
    return [_mesh(scene, color, texture, parts) for (color, texture), parts in looks.items()]


def _mesh(scene: Scene, color: Vec3, texture: str | None, parts: Sequence[Surface]) -> Any:
    first = np.cumsum([0] + [len(part.vertices) for part in parts])
    vertices = np.concatenate([part.vertices for part in parts]).astype(np.float32)
    faces = np.concatenate([part.triangles + k for part, k in zip(parts, first[:-1], strict=True)]).astype(np.uint32)
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({"type": "diffuse", "reflectance": _reflectance(scene, color, texture)})
    mesh = mi.Mesh(
        "mesh", len(vertices), len(faces),
        has_vertex_normals=False, has_vertex_texcoords=texture is not None, props=properties,
    )  # fmt: skip
    values = mi.traverse(mesh)
    values["vertex_positions"], values["faces"] = vertices.ravel(), faces.ravel()
    if texture is not None:
        uv = [part.uv for part in parts if part.uv is not None]
        values["vertex_texcoords"] = np.concatenate(uv).astype(np.float32).ravel()
    values.update()
    return mesh


def _reflectance(scene: Scene, color: Vec3, texture: str | None) -> dict[str, Any]:
    if texture is None:
        return {"type": "rgb", "value": list(color)}
    checker = scene.textures[texture]
    assert isinstance(checker, Checker)
    # Mitsuba's checkerboard repeats once for two of our squares, and the squares it starts with are of `color0`.
    black, white = (
        {"type": "rgb", "value": [c * t for c, t in zip(color, shade, strict=True)]}
        for shade in (checker.black, checker.white)
    )
    scale = mi.ScalarTransform4f().scale([checker.squares[0] / 2, checker.squares[1] / 2, 1.0])
    return {"type": "checkerboard", "color0": black, "color1": white, "to_uv": scale}
