"""Textures on the graphics side: the shared mip chain, uploaded level by level, and the shader variant for each mode.

Levels come from `textures.scene_chain` and not from the driver, so both renderers minify the same numbers; they are
stored as 32-bit floats because drivers filter an 8-bit texture to 8 bits. Levels of detail and anisotropic taps are the
shader's own too: drivers differ in both, and the software device's anisotropy costs more and gains less. Analytic
textures are evaluated by the shader under point and linear, and are images otherwise.
"""

import math
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Checker, FloatArray, Grating, ImageTexture, Scene, ZonePlate
from aliasbench.scenes.textures import scene_chain

Uniform = float | int | tuple[float, ...]

KINDS = ("PLAIN", "IMAGE", "CHECKER", "SINE", "SQUARE", "ZONE_PLATE")
MODES = ("POINT", "LINEAR", "MIPMAP", "ANISOTROPIC")
_FILTERS = {
    "point": (moderngl.NEAREST, moderngl.NEAREST),
    "linear": (moderngl.LINEAR, moderngl.LINEAR),
    "mipmap": (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR),
    "trilinear": (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR),
    "anisotropic": (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR),
}


@dataclass(frozen=True, slots=True, eq=False)
class Shading:
    """How surfaces with one texture are coloured: the shader's variant, its parameters, and an image where it has one.

    Attributes
    ----------
    kind, mode : str
        Of `KINDS` and `MODES`.
    uv_matrix : (2, 3) float64
        Takes (u, v, 1) to the shader's texture coordinates.
    periodic : bool
        Whether whole numbers may be taken off those coordinates.
    uniforms : dict
    image : moderngl.Texture or None
    is_coverage : bool
        Whether alpha says how many hardware samples a fragment covers, and none is discarded.
    """

    kind: str
    mode: str
    uv_matrix: FloatArray
    periodic: bool
    uniforms: dict[str, Uniform] = field(default_factory=dict)
    image: moderngl.Texture | None = None
    is_coverage: bool = False


def chosen_lod_bias(technique: Technique) -> float:
    """Return the bias of the level of detail; auto = -log2(shading samples) / 2, as the samples filter too."""
    if technique.lod_bias == "auto":
        return -0.5 * math.log2(technique.shading_samples)
    return float(technique.lod_bias)


def make_shading(gl: moderngl.Context, scene: Scene, name: str | None, technique: Technique, max_size: int) -> Shading:
    """Return the shading for a scene's texture (None: colour alone), its image uploaded.

    Raises
    ------
    InputError
        If the image is larger than `max_size`, the device's limit.
    """
    identity = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    if name is None:
        return Shading("PLAIN", "POINT", identity, True)
    texture = scene.textures[name]
    exact = technique.texture in ("point", "linear")
    if exact and not isinstance(texture, ImageTexture):
        return _make_analytic(texture)
    chain = scene_chain(scene, name)
    levels = chain.levels[:1] if exact else chain.levels
    height, width = levels[0].shape[:2]
    if max(width, height) > max_size:
        raise InputError(f"a texture of {width}x{height} texels: this device takes at most {max_size}x{max_size}")
    image = gl.texture((width, height), 4, dtype="f4")
    if len(levels) > 1:
        # only allocates the levels
        image.build_mipmaps(0, len(levels) - 1)
    for number, level in enumerate(levels):
        image.write(level, level=number)
    image.filter = _FILTERS[technique.texture]
    image.repeat_x = image.repeat_y = True
    cutoff = texture.alpha_cutoff if isinstance(texture, ImageTexture) else None
    mode = "MIPMAP" if technique.texture == "trilinear" else technique.texture.upper()
    uniforms: dict[str, Uniform] = {
        "alpha_cutoff": -math.inf if cutoff is None else cutoff,
        # the shader sees sub-pixels; the footprint that the bias shifts is the pixel's
        "lod_bias": chosen_lod_bias(technique) + math.log2(technique.ssaa),
        "anisotropy": technique.anisotropy,
        # passes blur the border by a pixel themselves: a ramp of a whole pixel would do so twice
        "ramp_width": technique.passes**-0.5,
    }
    # no alpha is below a cutoff of 0
    is_coverage = technique.alpha_to_coverage and cutoff is not None and cutoff > 0.0
    return Shading("IMAGE", mode, chain.uv_matrix, True, uniforms, image, is_coverage)


def _make_analytic(texture: Checker | Grating | ZonePlate) -> Shading:
    if isinstance(texture, ZonePlate):
        matrix = np.array([[1.0, 0.0, -texture.center[0]], [0.0, 1.0, -texture.center[1]]])
        turns = {"turns_per_unit": texture.k / math.tau, "phase_turns": math.remainder(texture.phase / math.tau, 1.0)}
        return Shading("ZONE_PLATE", "POINT", matrix, False, {"low": (0.0,) * 3, "high": (1.0,) * 3, **turns})
    # the chain's coordinates: one period of a texture is one unit of them
    matrix = _period_matrix(texture)
    if isinstance(texture, Checker):
        return Shading("CHECKER", "POINT", matrix, True, {"low": texture.black, "high": texture.white})
    return Shading(texture.profile.upper(), "POINT", matrix, True, {"low": texture.low, "high": texture.high})


def _period_matrix(texture: Checker | Grating) -> FloatArray:
    if isinstance(texture, Checker):
        return np.array([[texture.squares[0] / 2, 0.0, 0.0], [0.0, texture.squares[1] / 2, 0.0]])
    angle = math.radians(texture.angle_deg)
    across = (texture.cycles * math.cos(angle), texture.cycles * math.sin(angle))
    return np.array([[*across, texture.phase], [0.0, 0.0, 0.0]])


def shader_coordinates(shading: Shading, uv: FloatArray) -> FloatArray:
    """Return (n, 2) float64 texture coordinates of one surface's vertices for a shading.

    The whole part of their mean is taken off where the texture repeats: float32 then keeps the fraction.
    """
    out: FloatArray = uv @ shading.uv_matrix[:, :2].T + shading.uv_matrix[:, 2]
    if shading.periodic and len(out):
        out = out - np.round(out.mean(axis=0))
    return out


def piece_coordinates(shading: Shading, uv: FloatArray, nearest: NDArray[np.int64]) -> FloatArray:
    """Return (m, 3, 2) float64 texture coordinates of triangles for a shading.

    As `shader_coordinates`, but of each triangle the whole part at its nearest corner is taken off: there the pixels
    resolve the texture, however far away the other corners are.
    """
    out: FloatArray = uv @ shading.uv_matrix[:, :2].T + shading.uv_matrix[:, 2]
    if shading.periodic:
        out = out - np.round(np.take_along_axis(out, nearest[:, None, None], axis=1))
    return out
