"""What is sampled where an instant of a textured scene is too fine to be drawn exactly."""

from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference import converged
from aliasbench.scenes.model import Animation, Checker, Motion, Spin

SQUARE = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
SIZE = (8, 6)


@pytest.fixture
def scene(make_polygon, make_scene):
    surface = make_polygon(SQUARE, texture="c", motion=Motion(spin=Spin((0, 0, 1), (0, 0, 0), 7.0)))
    return replace(make_scene([surface], textures={"c": Checker((3.0, 5.0))}), animation=Animation(30.0, 2, 0.5))


def test_a_filter_is_sampled_without_bias_where_means_are_not_known(scene, monkeypatch, tmp_path):
    text = "reference:filter=tent,time=center"
    exact = render(scene, text, size=SIZE)
    monkeypatch.setenv("ALIASBENCH_CACHE", str(tmp_path))
    monkeypatch.setattr(converged, "draw_smoothed", lambda *_: None)
    monkeypatch.setattr(converged, "draw_textured", lambda *_: None)
    sampled = render(scene, text, size=SIZE)
    assert (exact.uncertainty_kind, sampled.uncertainty_kind) == ("bound", "confidence")
    assert np.abs(sampled.pixels - exact.pixels).max() <= sampled.uncertainty < 0.05


def test_one_instant_that_is_too_fine_sends_the_shutter_to_lines(scene, monkeypatch, tmp_path):
    averaged = render(scene, "reference:", size=SIZE)
    monkeypatch.setenv("ALIASBENCH_CACHE", str(tmp_path))
    draw, drawn = converged.draw_textured, []

    def fail_once(instant):
        drawn.append(instant)
        return None if len(drawn) == 3 else draw(instant)

    monkeypatch.setattr(converged, "draw_textured", fail_once)
    by_lines = render(scene, "reference:", size=SIZE)
    assert len(drawn) > 3
    assert by_lines.uncertainty_kind == "confidence"
    assert np.abs(by_lines.pixels - averaged.pixels).max() <= by_lines.uncertainty + averaged.uncertainty
    assert by_lines.uncertainty > averaged.uncertainty
