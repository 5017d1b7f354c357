"""Which reference a technique is measured against."""

import numpy as np
import pytest

from aliasbench.bench.truth import crop_radius, reference_technique, render_reference
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.model import Camera, Scene

SCENE = Scene("s", Camera("orthographic", height=2.0))


@pytest.mark.parametrize(
    ("technique", "truth", "reference"),
    [
        ("raytrace:spp=4,sampler=random", "point", "reference:"),
        ("raster:msaa=4,texture=trilinear", "point", "reference:"),
        ("raster:", "linear", "reference:texture=linear"),
        ("raytrace:filter=tent", "point", "reference:filter=tent"),
        ("raytrace:filter=tent,radius=2", "linear", "reference:filter=tent,radius=2.0,texture=linear"),
        ("raytrace:filter=gaussian,sigma=0.7", "point", "reference:filter=gaussian,sigma=0.7"),
        (
            "raytrace:filter=gaussian,radius=inf,weighting=distribution",
            "point",
            "reference:filter=gaussian,sigma=0.5,radius=inf",
        ),
        (
            "raytrace:filter=gaussian,weighting=distribution,warp=lecture",
            "point",
            "reference:filter=gaussian,sigma=0.4,radius=inf",
        ),
        ("raytrace:filter=tent,weighting=distribution,warp=lecture", "point", "reference:filter=tent"),
        ("raytrace:time=center,motion=matrix,spp=4", "point", "reference:"),
        ("reference:filter=cone", "point", "reference:filter=cone"),
    ],
)
def test_the_truth_has_the_filter_of_the_technique_and_nothing_else_of_it(
    technique: str, truth: str, reference: str
) -> None:
    found = reference_technique(parse_technique(technique), truth)
    assert found == (parse_technique(reference))


def test_the_border_left_out_is_the_filter_and_finite_for_an_endless_one() -> None:
    assert crop_radius(parse_technique("raytrace:")) == 0.5
    assert crop_radius(parse_technique("raytrace:filter=tent,radius=3")) == 3.0
    endless = "raytrace:filter=gaussian,sigma=0.6,radius=inf,weighting=distribution"
    assert crop_radius(parse_technique(endless)) == pytest.approx(2.4)
    assert crop_radius(parse_technique("raytrace:filter=gaussian,weighting=distribution,warp=lecture")) == 1.6


def test_a_reference_is_all_its_frames_in_float64_with_the_largest_uncertainty(fakes, pixels_of) -> None:
    technique = parse_technique("reference:")
    calls: list[int] = []
    found = render_reference(SCENE, technique, (4, 3), 3, lambda: calls.append(1))
    assert found.pixels.shape == (3, 3, 4, 3)
    assert found.pixels.dtype == np.float64
    assert np.array_equal(found.pixels[2], pixels_of(SCENE, technique, (4, 3), 2, 0))
    assert (found.uncertainty, found.uncertainty_kind) == (1e-9, "bound")
    assert len(calls) == 3
    assert [entry[2] for entry in fakes.log] == [0, 1, 2]


def test_a_reference_that_is_not_finite_is_a_bug_and_stops(fakes) -> None:
    fakes.change = lambda _, pixels: np.where(pixels > 0.5, np.nan, pixels)
    with pytest.raises(ValueError, match="reference: of s has pixels that are not finite"):
        render_reference(SCENE, parse_technique("reference:"), (4, 3), 1, lambda: None)
