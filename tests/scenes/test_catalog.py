"""Laws over every scene of the catalog: names build what they name, and parameters keep to their ranges."""

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from aliasbench.scenes.catalog import SCENES, build_scene
from aliasbench.scenes.entries import Choice, Parameter
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.projection import view_at

NAMES = sorted(SCENES)
SETTINGS = [(name, key) for name in NAMES for key, p in SCENES[name].parameters.items() if isinstance(p, Parameter)]
CHOICES = [(name, key) for name in NAMES for key, p in SCENES[name].parameters.items() if isinstance(p, Choice)]
# Parameters that only make sense together: what one needs when set to its low or high end.
TOGETHER = {
    **{(name, "inner", 0.8): {"outer": 0.9} for name in NAMES if name.startswith("propeller")},
    **{(name, "outer", 0.2): {"inner": 0.1} for name in NAMES if name.startswith("propeller")},
    ("slivers", "narrowest_px", 2.0): {"widest_px": 2.0},
    ("slivers", "widest_px", 0.001): {"narrowest_px": 0.001},
    ("nyquist-sweep", "lowest", 16.0): {"highest": 32.0},
    ("nyquist-sweep", "highest", 0.5): {"lowest": 0.25},
}


@pytest.mark.parametrize("name", NAMES)
def test_an_entry_is_under_its_own_name_and_says_what_it_shows(name: str) -> None:
    entry = SCENES[name]
    assert entry.name == name
    assert entry.summary
    assert "\n" not in entry.summary
    assert SCENES[name].build().name == name
    __import__(f"aliasbench.scenes.{entry.family}")


def test_the_catalog_cannot_be_changed() -> None:
    catalog: Any = SCENES
    with pytest.raises(TypeError, match="does not support item assignment"):
        catalog["mine"] = SCENES["propeller"]


@pytest.mark.parametrize("name", NAMES)
def test_a_scenes_name_builds_it_again(name: str) -> None:
    scene = SCENES[name].build()
    assert load_scene(scene.name) == scene
    assert build_scene(f" {name}: ") == scene


@pytest.mark.parametrize(("name", "key"), SETTINGS)
def test_parameters_take_both_ends_of_their_range_and_the_name_says_so(name: str, key: str) -> None:
    entry = SCENES[name]
    parameter = entry.parameters[key]
    assert isinstance(parameter, Parameter)
    assert parameter.low <= parameter.default <= parameter.high
    for value in {parameter.low, parameter.high} - {parameter.default}:
        others = TOGETHER.get((name, key, value), {})
        scene = entry.build(**{key: value, **others})
        assert f"{key}=" in scene.name
        assert load_scene(scene.name) == scene
        assert scene != entry.build()


@pytest.mark.parametrize(("name", "key"), SETTINGS)
def test_parameters_refuse_what_is_out_of_range_or_no_number(name: str, key: str) -> None:
    entry = SCENES[name]
    parameter = entry.parameters[key]
    assert isinstance(parameter, Parameter)
    beyond: tuple[Any, ...] = (
        parameter.high + 1,
        parameter.low - 1,
        float("nan"),
        float("inf"),
        True,
        "3",
        None,
        10**5000,
    )
    for value in (*beyond, *((parameter.default + 0.5,) if parameter.kind == "int" else ())):
        with pytest.raises(InputError) as caught:
            entry.build(**{key: value})
        said = str(caught.value)
        assert said.startswith(f"scene '{name}': parameter {key} = ")
        assert (
            f"from {parameter.low:g} to {parameter.high:g} (default {parameter.default:g}; {parameter.meaning})" in said
        )


@pytest.mark.parametrize(("name", "key"), CHOICES)
def test_words_are_chosen_from_a_list_and_the_name_says_which(name: str, key: str) -> None:
    entry = SCENES[name]
    parameter = entry.parameters[key]
    assert isinstance(parameter, Choice)
    for word in parameter.names:
        scene = entry.build(**{key: word})
        assert (f"{key}={word}" in scene.name) == (word != parameter.default)
        assert load_scene(scene.name) == scene
    for wrong in (parameter.names[0] + "s", "", 1, None):
        with pytest.raises(InputError, match=f"parameter {key} = .*: must be {' or '.join(parameter.names)}"):
            entry.build(**{key: wrong})


@pytest.mark.parametrize("name", [name for name in NAMES if SCENES[name].parameters])
def test_unknown_parameters_are_refused_with_the_nearest(name: str) -> None:
    key = next(iter(SCENES[name].parameters))
    with pytest.raises(InputError, match=f"scene '{name}': unknown parameter '{key}s'; did you mean '{key}'") as caught:
        SCENES[name].build(**{key + "s": 1.0})
    assert all(known in str(caught.value) for known in SCENES[name].parameters)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("propeler", "unknown scene 'propeler'; did you mean 'propeller'"),
        ("propeller:blade=3", "scene 'propeller': unknown parameter 'blade'; did you mean 'blades'"),
        ("propeller:blades", "scene 'propeller': 'blades' is not key=value; known keys: blades, rev_per_s"),
        ("propeller:blades=3,", "scene 'propeller': '' is not key=value"),
        ("propeller:=3", "scene 'propeller': '=3' is not key=value"),
        ("propeller:blades=3,blades=3", "scene 'propeller': parameter blades is given twice"),
        ("propeller:blades=", "parameter blades = nothing: must be a whole number from 1 to 60"),
        ("propeller:blades=many", "parameter blades = many: must be a whole number from 1 to 60"),
        ("propeller:blades=2.5", "parameter blades = 2.5: must be a whole number from 1 to 60"),
        ("propeller:blades=61", "parameter blades = 61: must be a whole number from 1 to 60"),
        ("propeller:blades=1_0", "parameter blades = 1_0: must be a whole number from 1 to 60"),
        ("propeller:rev_per_s=nan", "parameter rev_per_s = nan: must be a number from -1000 to 1000"),
        ("propeller:rev_per_s=1e999", "parameter rev_per_s = inf: must be a number from -1000 to 1000"),
        ("propeller:inner=0.5,outer=0.4", "parameter inner = 0.5: must be less than outer, 0.4"),
        ("edge-fan:wedges=5", "parameter wedges = 5: must be even"),
        ("propeller-29:inner=0.5,outer=0.4", "scene 'propeller-29': parameter inner = 0.5: must be less than outer"),
        ("slivers:narrowest_px=1.5", "parameter narrowest_px = 1.5: must not be more than widest_px, 1"),
    ],
)
def test_wrong_texts_are_refused(text: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        build_scene(text)
    assert message in str(caught.value)


def test_a_scene_of_the_catalog_is_named_by_a_text() -> None:
    name: Any = 3
    with pytest.raises(TypeError, match="named by a text, not by int"):
        build_scene(name)


def test_long_values_are_shortened_in_refusals() -> None:
    for text in ("propeller:blades=" + "x" * 5000, "propeller:" + "x" * 5000, "propeller:" + "x" * 5000 + "=1"):
        with pytest.raises(InputError, match=r"xxx\.\.\.") as caught:
            build_scene(text)
        assert len(str(caught.value)) < 300


def test_a_name_carries_only_what_is_not_default_in_one_form() -> None:
    assert build_scene("propeller:rev_per_s=23.50,blades=5").name == "propeller:blades=5,rev_per_s=23.5"
    assert build_scene("propeller:blades=3,rev_per_s=1e0").name == "propeller"
    assert build_scene("propeller:blades=5.0").name == "propeller:blades=5"
    assert build_scene("confetti:speed=-0.0").name == build_scene("confetti:speed=0").name == "confetti:speed=0"
    tiny = build_scene(f"propeller:rev_per_s={1 / 3!r}")
    assert build_scene(tiny.name).facts.rotors[0].rev_per_s == 1 / 3


def test_numbers_of_numpy_are_numbers() -> None:
    assert SCENES["propeller"].build(blades=np.int64(5), rev_per_s=np.float32(2.5)) == build_scene(
        "propeller:blades=5,rev_per_s=2.5"
    )


def test_a_whole_parameter_is_an_int_and_a_real_one_a_float() -> None:
    whole, real = (Parameter(1, 0, 9, kind, "a count") for kind in ("int", "float"))
    assert isinstance(whole.check("here", 3.0), int)
    assert isinstance(real.check("here", 3), float)


@pytest.mark.parametrize("name", NAMES)
def test_scenes_keep_the_contract(name: str) -> None:
    scene = SCENES[name].build()
    assert scene.contrast == 1.0
    assert scene.animation.frames >= 1
    colors = np.array([scene.background, *(s.color for s in scene.objects)])
    assert colors.min() >= 0.0
    assert colors.max() <= 1.0
    assert {s.texture for s in scene.objects} - {None} <= set(scene.textures)
    for surface in scene.objects:
        assert np.isfinite(surface.vertices).all()
        assert not surface.vertices.flags.writeable
        assert surface.triangles.min() >= 0
        assert surface.triangles.max() < len(surface.vertices)
    view_at(scene.camera, scene.animation, scene.animation.frames - 1, scene.animation.shutter, (4, 4))


@pytest.mark.parametrize(
    ("name", "key", "value"),
    [
        ("propeller", "rev_per_s", 29.0),
        ("edge-fan", "rev_per_s", -3.0),
        ("confetti", "speed", 0.2),
        ("near-horizontal-edge", "speed", 0.1),
        ("brick-floor", "speed", 1.0),
        ("checker-floor", "speed", 1.0),
        ("distant-triangle", "speed_px", 3.0),
        ("grid", "speed", -2.0),
        ("propeller-30", "rev_per_s", 30.0),
        ("slivers", "rev_per_s", 0.2),
        ("window-screens", "speed", 0.5),
        ("zone-plate", "speed", 0.1),
    ],
)
def test_scenes_move_when_they_are_told_to_and_rest_at_zero(name: str, key: str, value: float) -> None:
    assert not SCENES[name].build(**{key: value}).is_static
    assert SCENES[name].build(**{key: 0.0}).is_static


def test_flat_scenes_load_no_geometry_or_image_library() -> None:
    program = (
        "import sys\n"
        "from aliasbench.scenes.catalog import SCENES\n"
        "[entry.build() for entry in SCENES.values() if entry.family not in ('floors', 'walls', 'lantern')]\n"
        "print(*(m for m in ('shapely', 'skimage', 'OpenImageIO', 'scipy', 'numba') if m in sys.modules))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "\n"
