"""The technique text: defaults resolve as documented, and nothing unknown or without effect is accepted."""

from typing import Any, cast

import numpy as np
import pytest

from aliasbench.renderers.catalog import TECHNIQUES, prepare, resolve_technique
from aliasbench.renderers.technique import FILTER_RADII, KEYS, SAMPLER_NAMES, parse_technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, Scene

EMPTY = Scene("empty", Camera("orthographic", height=2.0))


def test_a_bare_renderer_is_the_point_sampled_default() -> None:
    for name in ("raytrace", "raytrace:", " raytrace : "):
        t = parse_technique(name)
        assert (t.spp, t.sampler, t.filter, t.radius_px, t.texture, t.pattern) == (
            1,
            "center",
            "box",
            0.5,
            "point",
            "pixel",
        )
        assert t.robust
        assert t.engine == "packet"
        assert t.text == "raytrace:"
    assert parse_technique("raster").sampler == "center"


@pytest.mark.parametrize(
    ("text", "sampler"),
    [
        ("raytrace:spp=4", "jittered"),
        ("raytrace:spp=1", "center"),
        ("raster:passes=9", "jittered"),
        ("raster:msaa=4", "center"),
        ("raytrace:adaptive=pooled", "jittered"),
        ("raytrace:spp=4,sampler=center", "center"),
    ],
)
def test_the_sampler_defaults_to_center_for_one_sample_and_jittered_for_more(text: str, sampler: str) -> None:
    assert parse_technique(text).sampler == sampler


@pytest.mark.parametrize(("name", "radius"), FILTER_RADII.items())
def test_every_filter_has_its_own_default_radius(name: str, radius: float) -> None:
    assert parse_technique(f"raytrace:spp=4,filter={name}").radius_px == radius
    assert parse_technique(f"reference:filter={name},radius=2.25").radius_px == 2.25


def test_aliases_mean_the_same() -> None:
    assert parse_technique("raytrace:filter=pyramid").filter == "tent"
    assert parse_technique("raster:texture=nearest").texture == "point"


def test_an_infinite_gaussian_is_for_reference_and_distribution() -> None:
    assert parse_technique("reference:filter=gaussian,radius=inf").radius_px == float("inf")
    assert parse_technique("raytrace:spp=4,filter=gaussian,radius=inf,weighting=distribution").radius_px == float("inf")
    with pytest.raises(InputError, match="radius=inf is for the gaussian"):
        parse_technique("raytrace:spp=4,filter=gaussian,radius=inf")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "unknown renderer ''; known: raster, raytrace, reference"),
        ("raytrac:spp=1", "unknown renderer 'raytrac'; did you mean 'raytrace'"),
        ("raytrace:ssp=1", "unknown key of raytrace 'ssp'; did you mean 'spp'"),
        ("raster:spp=4", "spp belongs to raytrace"),
        ("raytrace:spp=0", "spp=0: must be a whole number from 1"),
        ("raytrace:spp=-4", "spp=-4: must be a whole number"),
        ("raytrace:spp=4.5", "spp=4.5: must be a whole number"),
        ("raytrace:spp=nan", "must be a whole number"),
        ("raytrace:spp", "spp needs a value"),
        ("raytrace:spp=", "spp needs a value"),
        ("raytrace:spp=4,", "there is nothing between two commas or after the last"),
        ("raytrace:spp=4,spp=4", "spp is given twice"),
        ("raytrace:spp=4,sampler=jiterred", "did you mean 'jittered'"),
        ("raytrace:filter=gaussian,sigma=nan", "sigma=nan: must be a finite number"),
        ("raytrace:filter=tent,radius=0", "radius=0: must be a number above 0"),
        ("raytrace:filter=tent,radius=inf", "radius=inf is for the gaussian"),
        ("raytrace:spp=4,sigma=.5", "sigma has no effect without filter=gaussian"),
        ("raytrace:tolerance=.1", "tolerance has no effect without adaptive"),
        ("raytrace:adaptive=pooled,spp=4", "spp cannot be given together with adaptive"),
        ("raytrace:adaptive=pooled,min_spp=8,max_spp=4", "min_spp=8 is above max_spp=4"),
        ("raytrace:adaptive=pooled,tolerance=0", "tolerance=0: must be a number above 0"),
        ("raytrace:spp=4,sampler=bluenoise,pattern=shared", "bluenoise"),
        ("raster:texture=ewa", "ewa is the ray tracer's"),
        ("raytrace:texture=anisotropic", "anisotropic is the rasterizer's"),
        ("reference:texture=trilinear", "the reference's texture is point or linear"),
        ("raster:lod_bias=auto", "lod_bias has no effect"),
        ("raster:anisotropy=4", "anisotropy has no effect"),
        ("raster:alpha_to_coverage=on", "alpha_to_coverage has no effect without msaa"),
        ("raytrace:spp=4,filter=box,weighting=distribution,warp=lecture", "warp=lecture exists for"),
        ("raytrace:robust=yes", "unknown value of robust: 'yes'"),
    ],
)
def test_what_is_refused_is_named(text: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_technique(text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_every_key_is_read_by_some_renderer_and_every_preset_parses() -> None:
    assert all(row.renderers for row in KEYS.values())
    for name, text in TECHNIQUES.items():
        assert resolve_technique(name) == parse_technique(text)
    assert set(SAMPLER_NAMES) >= {"center", "grid", "random", "jittered"}


@pytest.mark.parametrize("size", [(0, 5), (5, 0), (-1, 5), (2**20, 5), (True, 5), (2.5, 5), ("4", 4)])
def test_impossible_sizes_are_refused_before_any_renderer_starts(size: tuple[int, int]) -> None:
    with pytest.raises(InputError, match="must be a whole number from 1 to 65536"):
        prepare(EMPTY, "raytrace:", size=size)


@pytest.mark.parametrize("size", [4, (4,), (4, 4, 4), "4x4", None])
def test_a_size_is_a_pair(size: Any) -> None:
    with pytest.raises(InputError, match=r"must be \(width, height\)"):
        prepare(EMPTY, "raytrace:", size=size)


@pytest.mark.parametrize("technique", ["raytrace:", "raster:", "reference:"])
def test_frames_and_seeds_are_whole_numbers_and_a_closed_scene_says_so(technique: str) -> None:
    with prepare(EMPTY, technique, size=(4, 3)) as prepared:
        for wrong in (-1, 1.5, True, "0", 2**70):
            with pytest.raises(InputError, match=r"frame=.*: must be a whole number from 0"):
                prepared.render(frame=cast(int, wrong))
            with pytest.raises(InputError, match=r"seed=.*: must be a whole number from 0"):
                prepared.render(seed=cast(int, wrong))
        assert prepared.render(frame=cast(int, np.int64(2)), seed=2**53).pixels.shape == (3, 4, 3)
    with pytest.raises(RuntimeError, match="closed"):
        prepared.render()


def test_other_types_are_named() -> None:
    with pytest.raises(TypeError, match=r"scene must be a Scene.*not str"):
        prepare(cast(Scene, "edge-fan"), "raytrace:", size=(4, 4))
    with pytest.raises(TypeError, match="technique must be a Technique or its text, not int"):
        prepare(EMPTY, cast(str, 3), size=(4, 4))
