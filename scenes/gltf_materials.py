"""What a glTF material comes to without light: a colour, a texture, and what is cut out.

All surfaces are drawn unlit in their base colour, factor times texture (a file may say KHR_materials_unlit, or not);
of KHR_materials_pbrSpecularGlossiness it is the diffuse colour. What shines by itself is seen without light, too: the
emissive factor (times KHR_materials_emissive_strength) is added to the base colour where no texture is in either, and
where the base factor is black and cuts nothing out the emissive texture is drawn. Two textures are not added: beside a
base texture, and of a base that is not black, the emissive one is left out.

Alpha cuts out, it does not blend: MASK below its cutoff, BLEND below one half (of two half-transparent layers one is
drawn, as a screen door would), OPAQUE not at all.
Alpha at vertices cuts out whole triangles (`gltf`).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from aliasbench.scenes.gltf_document import Document
from aliasbench.scenes.limits import COUNT, RADIANCE
from aliasbench.scenes.model import FloatArray, Vec3
from aliasbench.scenes.schema import Table

_BLEND_CUTOFF = 0.5
_WRAPS: Mapping[int, str] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """How a primitive looks.

    Attributes
    ----------
    color : Vec3
        Linear RGB.
    image : int or None
        An index of images.
    cutoff : float or None
        Of the alpha of the image times that of vertices.
    uv_set : int
        Which TEXCOORD it uses.
    uv_matrix : (2, 3) float64
        From (u, v, 1) of the file to the image's, v down.
    wraps : pair of str
        Along u and v: ``repeat``, ``mirror`` or ``clamp``.
    absent : str
        Why nothing of it is left by its alpha, empty where something is.
    emissive : Vec3
        Linear RGB, added to the colour times that of vertices.
    is_emitted : bool
        The image is the emissive one: neither its alpha nor the colours of vertices count.
    """

    color: Vec3 = (1.0, 1.0, 1.0)
    image: int | None = None
    cutoff: float | None = None
    uv_set: int = 0
    uv_matrix: FloatArray = field(default_factory=lambda: np.eye(3)[:2])
    wraps: tuple[str, str] = ("repeat", "repeat")
    absent: str = ""
    emissive: Vec3 = (0.0, 0.0, 0.0)
    is_emitted: bool = False


def read_look(document: Document, material: Table | None) -> Look:
    """Return how a material looks; None is the default material, white."""
    if material is None:
        return Look()
    glossy = material.table("extensions").table("KHR_materials_pbrSpecularGlossiness")
    if glossy.values and not material.has("pbrMetallicRoughness"):
        base, factor_key, texture_key = glossy, "diffuseFactor", "diffuseTexture"
    else:
        base, factor_key, texture_key = material.table("pbrMetallicRoughness"), "baseColorFactor", "baseColorTexture"
    red, green, blue, alpha = base.numbers(factor_key, 4, RADIANCE) if base.has(factor_key) else (1.0, 1.0, 1.0, 1.0)
    if min(red, green, blue, alpha) < 0.0:
        base.refuse(factor_key, "four numbers of at least 0")
    mode = material.choice("alphaMode", ("OPAQUE", "MASK", "BLEND"), "OPAQUE")
    cutoff = None
    if mode != "OPAQUE":
        least = material.number("alphaCutoff", 0.5, at_least=0.0, at_most=COUNT) if mode == "MASK" else _BLEND_CUTOFF
        if alpha < least:
            rule = "its cutoff" if mode == "MASK" else "at which BLEND is drawn as a cut-out"
            return Look(
                absent=f"{material.path} has alphaMode {mode}, and its alpha {alpha:g} is below {least:g}, {rule}"
            )
        cutoff = least / alpha if alpha > 0.0 else None
    color = (red, green, blue)
    emissive = _emissive(material)
    if any(emissive) and material.has("emissiveTexture"):
        if not any(color) and (cutoff is None or not base.has(texture_key)):
            look = _with_texture(document, material.table("emissiveTexture"), emissive, None)
            return replace(look, is_emitted=True)
        emissive = (0.0, 0.0, 0.0)
    if not base.has(texture_key):
        return Look(color, cutoff=cutoff, emissive=emissive)
    if any(emissive) and not any(color) and cutoff is None:
        # Black times any texture is black.
        return Look(color, emissive=emissive)
    return _with_texture(document, base.table(texture_key), color, cutoff)


def _emissive(material: Table) -> Vec3:
    """Return what a material shines by itself, linear RGB before its texture."""
    extensions = material.table("extensions")
    if not material.has("emissiveFactor") or extensions.has("KHR_materials_unlit"):
        return (0.0, 0.0, 0.0)
    strength = extensions.table("KHR_materials_emissive_strength").number(
        "emissiveStrength", 1.0, at_least=0.0, at_most=RADIANCE
    )
    red, green, blue = (strength * factor for factor in material.numbers("emissiveFactor", 3, RADIANCE))
    if not 0.0 <= min(red, green, blue) <= max(red, green, blue) <= RADIANCE:
        material.refuse("emissiveFactor", f"three numbers of at least 0, with their strength at most {RADIANCE:g}")
    return (red, green, blue)


def _with_texture(document: Document, info: Table, color: Vec3, cutoff: float | None) -> Look:
    found = document.follow(info, "index", "textures")
    if found is None:
        info.refuse("index", "an index of textures")
    texture = found[1]
    image = document.follow(texture, "source", "images")
    if image is None:
        texture.refuse("source", "an index of images (PNG or JPEG; images of extensions are not read)")
    sampler = document.follow(texture, "sampler", "samplers")
    wraps = ("repeat", "repeat") if sampler is None else (_wrap(sampler[1], "wrapS"), _wrap(sampler[1], "wrapT"))
    transform = info.table("extensions").table("KHR_texture_transform")
    uv_set = (transform if transform.has("texCoord") else info).whole("texCoord", 0, at_least=0)
    return Look(color, image[0], cutoff, uv_set, _uv_matrix(transform), wraps)


def _wrap(sampler: Table, key: str) -> str:
    code = sampler.whole(key, 10497, at_least=0)
    if code not in _WRAPS:
        sampler.refuse(key, f"one of {', '.join(f'{number} ({name})' for number, name in _WRAPS.items())}")
    return _WRAPS[code]


def _uv_matrix(transform: Table) -> FloatArray:
    """Return the (2, 3) matrix of KHR_texture_transform: translation times rotation times scale.

    The extension's README writes a GLSL constructor, which takes columns: its rows are this matrix' columns.
    """
    dx, dy = transform.numbers("offset", 2, COUNT) if transform.has("offset") else (0.0, 0.0)
    sx, sy = transform.numbers("scale", 2, COUNT) if transform.has("scale") else (1.0, 1.0)
    angle = transform.number("rotation", 0.0, at_least=-COUNT, at_most=COUNT)
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c * sx, s * sy, dx], [-s * sx, c * sy, dy]])
