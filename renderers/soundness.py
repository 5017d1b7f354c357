"""Numbers that no scene file can hold, but a scene built in Python may: they would vanish, spread, or never end.

Scene files are checked where they are read, with their keys and lines. Here every scene that is to be rendered is held
to the same limits, whatever it was built by.
"""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError, unknown_name
from aliasbench.scenes.model import Camera, Checker, Grating, ImageTexture, Scene, Surface, Texture

_Named = Iterable[tuple[str, Iterable[float] | None]]


def check_scene(scene: Scene) -> None:
    """Raise InputError for the first number of a scene that is not finite or means nothing; the message names both."""
    _check_finite(scene, [("background", scene.background)])
    _check_camera(scene, scene.camera)
    animation = scene.animation
    _check_finite(
        scene, [("fps of the animation", (animation.fps,)), ("shutter of the animation", (animation.shutter,))]
    )
    _check(scene, animation.fps > 0.0, "fps of the animation", animation.fps, "above 0")
    _check(scene, 0.0 <= animation.shutter <= 1.0, "shutter of the animation", animation.shutter, "from 0 to 1")
    for k, surface in enumerate(scene.objects):
        _check_surface(scene, surface, surface.name or f"number {k}")
    for name, texture in scene.textures.items():
        _check_texture(scene, texture, repr(name))
    for k, light in enumerate(scene.lights):
        _check_finite(scene, [(f"quad of light {k}", sum(light.quad, ())), (f"radiance of light {k}", light.radiance)])


def _check_camera(scene: Scene, camera: Camera) -> None:
    vectors: _Named = [
        ("position of the camera", camera.position),
        ("target of the camera", camera.target),
        ("up of the camera", camera.up),
        ("velocity of the camera", camera.velocity),
        ("target_velocity of the camera", camera.target_velocity),
        ("lens_radius of the camera", (camera.lens_radius,)),
    ]
    _check_finite(scene, vectors)
    _check(scene, camera.lens_radius >= 0.0, "lens_radius of the camera", camera.lens_radius, "0 or more")
    for name in ("height", "fov_y_deg", "focus_distance"):
        value = getattr(camera, name)
        if value is not None:
            _check(scene, 0.0 < value < math.inf, f"{name} of the camera", value, "a finite number above 0")
    if camera.fov_y_deg is not None:
        _check(scene, camera.fov_y_deg < 180.0, "fov_y_deg of the camera", camera.fov_y_deg, "below 180")


def _check_surface(scene: Scene, surface: Surface, label: str) -> None:
    for what, values in (("vertices", surface.vertices), ("uv", surface.uv)):
        if values is not None and not np.isfinite(values).all():
            raise InputError(f"scene {scene.name!r}: {what} of object {label} are not all finite numbers")
    _check_triangles(scene, surface, label)
    motion, material = surface.motion, surface.material
    spin = motion.spin
    named: _Named = [
        (f"color of object {label}", surface.color),
        (f"velocity of object {label}", motion.velocity),
        (f"spin of object {label}", None if spin is None else (*spin.axis, *spin.center, spin.rev_per_s)),
        (f"matrices of object {label}", None if motion.matrices is None else sum(motion.matrices, ())),
        (f"material of object {label}", (material.roughness, material.ior, material.abbe or 1.0)),
    ]
    _check_finite(scene, named)
    if spin is not None:
        _check(scene, any(spin.axis), f"axis of the spin of object {label}", spin.axis, "other than zero")
    if material.kind == "glossy":
        roughness = material.roughness
        _check(scene, 0.0 <= roughness <= 1.0, f"roughness of object {label}", roughness, "from 0 to 1")


def _check_triangles(scene: Scene, surface: Surface, label: str) -> None:
    """Raise for what would be looked up where there is nothing: kernels and engines follow it into foreign memory."""
    count = len(surface.vertices)
    low, high = int(surface.triangles.min(initial=0)), int(surface.triangles.max(initial=-1))
    if low < 0 or high >= count:
        raise InputError(
            f"scene {scene.name!r}: triangles of object {label} name vertices {low} to {high}; "
            f"it has {count}, numbered from 0"
        )
    if surface.texture is None:
        return
    if surface.texture not in scene.textures:
        raise InputError(
            f"scene {scene.name!r}: object {label}: {unknown_name('texture', surface.texture, scene.textures)}"
        )
    if surface.uv is None or surface.uv.shape != (count, 2):
        shape = "none" if surface.uv is None else f"an array of shape {surface.uv.shape}"
        raise InputError(f"scene {scene.name!r}: uv of object {label} is {shape}; its texture needs shape ({count}, 2)")


def _check_texture(scene: Scene, texture: Texture, label: str) -> None:
    if isinstance(texture, ImageTexture):
        texels, cutoff = texture.texels, texture.alpha_cutoff
        if texels.ndim != 3 or texels.shape[2] != 4 or texels.size == 0:
            raise InputError(
                f"scene {scene.name!r}: texels of texture {label} have shape {texels.shape}; "
                "(height, width, 4) is needed, each at least 1"
            )
        if not _all_finite(texels):
            row, column = (int(i) for i in np.argwhere(~np.isfinite(texels))[0][:2])
            raise InputError(
                f"scene {scene.name!r}: texels of texture {label} are not all finite numbers, "
                f"the first at row {row} from the bottom, column {column}"
            )
        if cutoff is not None:
            _check(scene, 0.0 <= cutoff <= 1.0, f"alpha_cutoff of texture {label}", cutoff, "from 0 to 1")
    elif isinstance(texture, Checker):
        what = f"squares of texture {label}"
        _check_finite(scene, [(what, texture.squares)])
        _check(scene, min(texture.squares) > 0.0, what, texture.squares, "above 0")
        _check_finite(
            scene, [(f"black of texture {label}", texture.black), (f"white of texture {label}", texture.white)]
        )
    elif isinstance(texture, Grating):
        wave = (texture.cycles, texture.angle_deg, texture.phase)
        named: _Named = [("cycles, angle_deg and phase", wave), ("low", texture.low), ("high", texture.high)]
        _check_finite(scene, [(f"{key} of texture {label}", values) for key, values in named])
    else:
        _check_finite(scene, [(f"center, k and phase of texture {label}", (*texture.center, texture.k, texture.phase))])


def _all_finite(values: NDArray[np.floating]) -> bool:
    """Return whether all values are; their sum in float64 tells, but where it overflows."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(values.sum(dtype=np.float64))) or bool(np.isfinite(values).all())


def _check_finite(scene: Scene, named: _Named) -> None:
    for what, numbers in named:
        if numbers is not None and not all(map(math.isfinite, numbers)):
            raise InputError(f"scene {scene.name!r}: {what} must be finite numbers, not {tuple(numbers)}")


def _check(scene: Scene, holds: bool, what: str, value: object, allowed: str) -> None:
    if not holds:
        raise InputError(f"scene {scene.name!r}: {what} is {value}; it must be {allowed}")
