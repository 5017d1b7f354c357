"""The technique text, `renderer:key=value,key=value`, as a checked value.

One table says for every key which renderers know it, its type, its default and what it may be; the second half refuses
keys that would do nothing in the text at hand. What is not asked for is not antialiased. Whether a renderer of this
version has a feature is the renderer's to say, not this module's.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Literal

from aliasbench.scenes.errors import InputError, unknown_name

RendererName = Literal["raytrace", "raster", "reference"]
RENDERERS: tuple[RendererName, ...] = ("raytrace", "raster", "reference")

SAMPLER_SUMMARIES: Mapping[str, str] = {
    "center": "all samples in the middle of the pixel",
    "grid": "the centres of equal cells",
    "random": "independent points",
    "jittered": "one point in each cell",
    "multijittered": "jittered in cells, and in finer rows and columns as well",
    "sobol": "Owen-scrambled Sobol points: any number of them is well spread",
    "bluenoise": "Sobol points arranged so that neighbours' errors cancel under a small blur",
}
SAMPLER_NAMES = tuple(SAMPLER_SUMMARIES)
FILTER_RADII: Mapping[str, float] = {
    "box": 0.5,
    "tent": 1.0,
    "cone": 1.0,
    "gaussian": 1.5,
    "mitchell": 2.0,
    "lanczos": 3.0,
}
_ALL: tuple[RendererName, ...] = RENDERERS
_BOTH: tuple[RendererName, ...] = ("raytrace", "raster")


@dataclass(frozen=True, slots=True)
class Technique:
    """How to render: the fields are the keys of the technique text, with their defaults resolved.

    `sampler` is never None ("center" for one sample, else "jittered"); `radius_px` is the filter's half-width;
    `max_spp` of an adaptive technique defaults to 64 and `min_spp` to 4; `lod_bias` is a number or "auto".
    """

    renderer: RendererName
    spp: int = 1
    passes: int = 1
    msaa: int = 1
    ssaa: int = 1
    sampler: str = "center"
    pattern: str = "pixel"
    filter: str = "box"
    radius_px: float = 0.5
    sigma_px: float = 0.5
    weighting: str = "samples"
    warp: str = "exact"
    texture: str = "point"
    adaptive: str = "off"
    tolerance: float = 0.01
    min_spp: int = 4
    max_spp: int = 64
    time: str = "spread"
    motion: str = "exact"
    shadow_rays: int = 1
    reseed: str = "frame"
    robust: bool = True
    engine: str = "packet"
    post: str = "none"
    lod_bias: float | Literal["auto"] = 0.0
    alpha_to_coverage: bool = False
    anisotropy: int = 16
    backend: str = "auto"
    device: int | None = None
    text: str = ""

    @property
    def shading_samples(self) -> int:
        """Texture look-ups per pixel (MSAA shades once); adaptive counts as its minimum."""
        if self.renderer == "raster":
            return self.passes * self.ssaa**2
        return self.spp if self.adaptive == "off" else self.min_spp

    @property
    def is_deterministic(self) -> bool:
        """Whether the seed changes nothing in space (grid, centre and closed forms)."""
        return self.renderer == "reference" or self.sampler in ("center", "grid")


@dataclass(frozen=True, slots=True)
class _Key:
    """One row of the table: which field it sets, for which renderers, and how its text is read."""

    field: str
    renderers: tuple[RendererName, ...]
    read: Callable[[str, str], object]


def _choice(*allowed: str, **aliases: str) -> Callable[[str, str], object]:
    def read(key: str, value: str) -> object:
        if value not in allowed and value not in aliases:
            raise unknown_name(f"value of {key}:", value, (*allowed, *aliases))
        return aliases.get(value, value)

    return read


def _switch(key: str, value: str) -> object:
    return _choice("on", "off")(key, value) == "on"


def _integer(low: int, high: int) -> Callable[[str, str], object]:
    def read(key: str, value: str) -> object:
        try:
            number = int(value)
        except ValueError:
            number = low - 1
        if not low <= number <= high:
            raise InputError(f"{key}={value}: must be a whole number from {low} to {high}")
        return number

    return read


def _positive(key: str, value: str) -> object:
    number = _number(key, value)
    if not number > 0:
        raise InputError(f"{key}={value}: must be a number above 0")
    return number


def _number(key: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        raise InputError(f"{key}={value}: must be a number") from None
    if math.isnan(number) or (math.isinf(number) and key != "radius"):
        raise InputError(f"{key}={value}: must be a finite number")
    return number


def _lod_bias(key: str, value: str) -> object:
    return "auto" if value == "auto" else _number(key, value)


MAX_SAMPLES = 2**24
KEYS: Mapping[str, _Key] = {
    "spp": _Key("spp", ("raytrace",), _integer(1, MAX_SAMPLES)),
    "passes": _Key("passes", ("raster",), _integer(1, MAX_SAMPLES)),
    "msaa": _Key("msaa", ("raster",), _integer(1, 64)),
    "ssaa": _Key("ssaa", ("raster",), _integer(1, 64)),
    "sampler": _Key("sampler", _BOTH, _choice(*SAMPLER_NAMES)),
    "pattern": _Key("pattern", ("raytrace",), _choice("pixel", "shared")),
    "filter": _Key("filter", _ALL, _choice(*FILTER_RADII, pyramid="tent")),
    "radius": _Key("radius_px", _ALL, _positive),
    "sigma": _Key("sigma_px", _ALL, _positive),
    "weighting": _Key("weighting", _BOTH, _choice("samples", "distribution")),
    "warp": _Key("warp", _BOTH, _choice("exact", "lecture")),
    "texture": _Key(
        "texture",
        _ALL,
        _choice("point", "linear", "mipmap", "trilinear", "ewa", "anisotropic", nearest="point"),
    ),
    "adaptive": _Key("adaptive", ("raytrace",), _choice("off", "pooled", "unbiased")),
    "tolerance": _Key("tolerance", ("raytrace",), _positive),
    "min_spp": _Key("min_spp", ("raytrace",), _integer(1, MAX_SAMPLES)),
    "max_spp": _Key("max_spp", ("raytrace",), _integer(1, MAX_SAMPLES)),
    "time": _Key("time", _ALL, _choice("spread", "center")),
    "motion": _Key("motion", _ALL, _choice("exact", "matrix")),
    "shadow_rays": _Key("shadow_rays", _BOTH, _integer(1, 65536)),
    "reseed": _Key("reseed", _BOTH, _choice("frame", "never")),
    "robust": _Key("robust", ("raytrace",), _switch),
    "engine": _Key("engine", ("raytrace",), _choice("packet", "portable")),
    "post": _Key("post", ("raster",), _choice("none", "fxaa", "smaa", "taa")),
    "lod_bias": _Key("lod_bias", ("raster",), _lod_bias),
    "alpha_to_coverage": _Key("alpha_to_coverage", ("raster",), _switch),
    "anisotropy": _Key("anisotropy", ("raster",), _integer(1, 64)),
    "backend": _Key("backend", ("raster",), _choice("auto", "egl", "osmesa")),
    "device": _Key("device", ("raster",), _integer(0, 255)),
}


def parse_technique(text: str) -> Technique:
    """Return the technique that a text asks for, every default resolved.

    Parameters
    ----------
    text : str
        ``renderer`` or ``renderer:key=value,...``; a name of `catalog.TECHNIQUES` is the caller's to look up first.

    Raises
    ------
    InputError
        For an unknown renderer, key or value, a duplicate key, or a key without effect in this text; the message names
        it, the nearest match and the known ones.
    """
    head, _, tail = text.strip().partition(":")
    name = head.strip()
    if name not in RENDERERS:
        raise unknown_name("renderer", name, RENDERERS)
    renderer: RendererName = name
    given: dict[str, str] = {}
    for part in (p.strip() for p in tail.split(",") if tail.strip()):
        if not part:
            raise InputError(f"technique {text!r}: there is nothing between two commas or after the last; leave it out")
        key, equals, value = (s.strip() for s in part.partition("="))
        known = [k for k, row in KEYS.items() if renderer in row.renderers]
        if key not in known:
            elsewhere = [r for r in RENDERERS if key in KEYS and r in KEYS[key].renderers]
            where = f" ({key} belongs to {', '.join(elsewhere)})" if elsewhere else ""
            raise InputError(f"technique {text!r}: {unknown_name(f'key of {renderer}', key, known)}{where}")
        if not equals or not value:
            raise InputError(f"technique {text!r}: {key} needs a value, as in {key}=...")
        if key in given:
            raise InputError(f"technique {text!r}: {key} is given twice")
        given[key] = value
    values: dict[str, object] = {}
    for key, value in given.items():
        try:
            values[KEYS[key].field] = KEYS[key].read(key, value)
        except InputError as error:
            raise InputError(f"technique {text!r}: {error}") from None
    technique = _resolve(replace(Technique(renderer), **values), given)  # type: ignore[arg-type]
    problem = _conflict(technique, given)
    if problem:
        raise InputError(f"technique {text!r}: {problem}")
    return replace(technique, text=_canonical(renderer, given))


def _canonical(renderer: str, given: Mapping[str, str]) -> str:
    return renderer + (":" + ",".join(f"{k}={v}" for k, v in given.items()) if given else ":")


def _resolve(t: Technique, given: Mapping[str, str]) -> Technique:
    """Return the technique with the defaults that depend on other keys."""
    many = t.passes > 1 if t.renderer == "raster" else (t.spp > 1 or t.adaptive != "off")
    sampler = given.get("sampler", "jittered" if many else "center")
    radius = t.radius_px if "radius" in given else FILTER_RADII[t.filter]
    min_spp, max_spp = t.min_spp, t.max_spp
    if "min_spp" in given and "max_spp" not in given:
        max_spp = max(max_spp, min_spp)
    if "max_spp" in given and "min_spp" not in given:
        min_spp = min(min_spp, max_spp)
    return replace(t, sampler=sampler, radius_px=radius, min_spp=min_spp, max_spp=max_spp)


def _conflict(t: Technique, given: Mapping[str, str]) -> str | None:
    """Return what is wrong with the combination of keys, or None."""
    if t.adaptive != "off" and "spp" in given:
        return "spp cannot be given together with adaptive; use min_spp and max_spp"
    if t.min_spp > t.max_spp:
        return f"min_spp={t.min_spp} is above max_spp={t.max_spp}"
    if math.isinf(t.radius_px) and not (
        t.filter == "gaussian" and (t.renderer == "reference" or t.weighting == "distribution")
    ):
        return "radius=inf is for the gaussian filter of reference or with weighting=distribution"
    if t.pattern == "shared" and t.sampler == "bluenoise":
        return "sampler=bluenoise has a pattern of its own for each pixel; it cannot go with pattern=shared"
    if t.renderer == "raster" and t.texture == "ewa":
        return "texture=ewa is the ray tracer's; the rasterizer has anisotropic"
    if t.renderer == "raytrace" and t.texture == "anisotropic":
        return "texture=anisotropic is the rasterizer's; the ray tracer has ewa"
    if t.renderer == "reference" and t.texture not in ("point", "linear"):
        return "the reference's texture is point or linear"
    if t.warp == "lecture" and t.filter not in ("gaussian", "tent"):
        return "warp=lecture exists for filter=gaussian and filter=tent"
    if t.renderer == "raster" and t.sampler == "bluenoise":
        return "sampler=bluenoise needs a pattern for each pixel; an accumulation pass has one for all"
    needed: tuple[tuple[str, bool, str], ...] = (
        ("sigma", t.filter == "gaussian", "filter=gaussian"),
        ("warp", t.weighting == "distribution", "weighting=distribution"),
        ("tolerance", t.adaptive != "off", "adaptive"),
        ("min_spp", t.adaptive != "off", "adaptive"),
        ("max_spp", t.adaptive != "off", "adaptive"),
        ("anisotropy", t.texture == "anisotropic", "texture=anisotropic"),
        ("lod_bias", t.texture in ("mipmap", "trilinear", "anisotropic"), "a texture mode with levels (mipmap)"),
        ("alpha_to_coverage", t.msaa > 1, "msaa above 1"),
    )
    for key, has_effect, partner in needed:
        if key in given and not has_effect:
            return f"{key} has no effect without {partner}"
    return None


assert {k.field for k in KEYS.values()} <= {f.name for f in fields(Technique)}
