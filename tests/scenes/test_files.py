"""Scene files: the whole schema is read as documented, and whatever is wrong is refused in one telling sentence."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import (
    Animation,
    Camera,
    Checker,
    EdgeFact,
    Facts,
    Grating,
    GratingFact,
    ImageTexture,
    Light,
    Material,
    Motion,
    PanFact,
    RotorFact,
    Scene,
    Spin,
    ZonePlate,
)
from aliasbench.scenes.shapes import polygon, quad

Write = Callable[[str], str]

WHOLE = """
schema = 1
name = "whole"
background = [0.0, 0.1, 0.2]
contrast = 0.8
bounces = 1
[animation]
fps = 24
frames = 12
shutter = 0.5
[camera]
projection = "perspective"
position = [0, 1, 5]
target = [0, 0, 0]
up = [0, 1, 0.5]
fov_y_deg = 35
velocity = [-0.5, 0.0, 0.0]
target_velocity = [0.0, 0.25, 0.0]
lens_radius = 0.1
focus_distance = 4.0
[[object]]
polygon = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]
color = [1, 0.5, 0.25]
uv = [[0, 0], [1, 0], [0.5, 1]]
texture = "tiles"
velocity = [0.5, 0, 0]
spin = { axis = [0, 0, 2], center = [0, 0.5, 0], rev_per_s = 29.0 }
[[object]]
quad = [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]]
texture = "wave"
material = "glossy"
roughness = 0.2
[[object]]
quad = [[-1, -1, -2], [1, -1, -2], [1, 1, -2], [-1, 1, -2]]
uv = [[0, 0], [2, 0], [2, 2], [0, 2]]
texture = "rings"
material = "glass"
ior = 1.6
abbe = 30
matrices = [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], [1, 0, 0, 2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]]
[[object]]
polygon = [[0, 0, 1], [1, 0, 1], [1, 1, 1]]
uv = [[0, 0], [1, 0], [1, 1]]
texture = "photo"
material = "diffuse"
[texture.tiles]
checker = { squares = [16, 8], black = [0.1, 0, 0], white = [1, 1, 0.9] }
[texture.wave]
grating = { cycles = 40.0, angle_deg = 30, phase = 0.25, profile = "square", low = [0, 0, 0.1], high = [0.5, 1, 1] }
[texture.rings]
zone_plate = { center = [0.25, 0.5], k = 9000, phase = 1 }
[texture.photo]
image = "pictures/one.png"
alpha_cutoff = 0.5
[[light]]
quad = [[-1, 2, -1], [1, 2, -1], [1, 2, 1], [-1, 2, 1]]
radiance = [4, 3, 2]
[[fact.edge]]
from = [-1, -1, 0]
to = [1, -1, 0]
[[fact.edge]]
from = [0.5, 1, -1]
to = [-0.5, 1, -1]
[fact.rotor]
center = [0, 0.5, 3]
axis = [0, 0, 1]
blades = 3
duty = 0.25
rev_per_s = 29
inner = 0.2
outer = 0.8
[fact.grating]
cycles_per_unit = [40.0, 0.0]
"""

FLAT = """
[camera]
projection = "orthographic"
[[object]]
quad = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
"""

IDENTITY = tuple(np.eye(4).ravel().tolist())
SHIFTED = (*IDENTITY[:3], 2.0, *IDENTITY[4:])


def write_picture(path: Path) -> None:
    path.parent.mkdir()
    out = oiio.ImageOutput.create(str(path))
    assert out is not None
    assert out.open(str(path), oiio.ImageSpec(1, 1, 4, oiio.UINT8))
    assert out.write_image(np.full((1, 1, 4), 255, np.uint8))
    out.close()


def test_every_key_of_the_schema_is_read(scene_file: Write) -> None:
    path = scene_file(WHOLE)
    write_picture(Path(path).parent / "pictures" / "one.png")
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float64)
    down, far = np.array([0, 0, 1.0]), np.array([0, 0, 2.0])
    expected = Scene(
        name="whole",
        background=(0.0, 0.1, 0.2),
        contrast=0.8,
        bounces=1,
        animation=Animation(24.0, 12, 0.5),
        camera=Camera(
            "perspective",
            (0.0, 1.0, 5.0),
            (0.0, 0.0, 0.0),
            (0.0, 1.0, 0.5),
            fov_y_deg=35.0,
            velocity=(-0.5, 0.0, 0.0),
            target_velocity=(0.0, 0.25, 0.0),
            lens_radius=0.1,
            focus_distance=4.0,
        ),
        objects=(
            polygon(
                [(-1, -1, 0), (1, -1, 0), (0, 1, 0)],
                color=(1.0, 0.5, 0.25),
                uv=[(0, 0), (1, 0), (0.5, 1)],
                texture="tiles",
                motion=Motion((0.5, 0.0, 0.0), Spin((0.0, 0.0, 2.0), (0.0, 0.5, 0.0), 29.0)),
            ),
            quad(corners - down, texture="wave", material=Material("glossy", roughness=0.2)),
            quad(
                corners - far,
                uv=[(0, 0), (2, 0), (2, 2), (0, 2)],
                texture="rings",
                material=Material("glass", ior=1.6, abbe=30.0),
                motion=Motion(matrices=(IDENTITY, SHIFTED)),
            ),
            polygon(
                [(0, 0, 1), (1, 0, 1), (1, 1, 1)],
                uv=[(0, 0), (1, 0), (1, 1)],
                texture="photo",
                material=Material("diffuse"),
            ),
        ),
        textures={
            "tiles": Checker((16.0, 8.0), (0.1, 0.0, 0.0), (1.0, 1.0, 0.9)),
            "wave": Grating(40.0, 30.0, 0.25, "square", (0.0, 0.0, 0.1), (0.5, 1.0, 1.0)),
            "rings": ZonePlate((0.25, 0.5), 9000.0, 1.0),
            "photo": ImageTexture(np.ones((1, 1, 4), np.float32), 0.5, "pictures/one.png"),
        },
        lights=(Light(((-1, 2, -1), (1, 2, -1), (1, 2, 1), (-1, 2, 1)), (4.0, 3.0, 2.0)),),
        facts=Facts(
            edges=(EdgeFact((-1, -1, 0), (1, -1, 0)), EdgeFact((0.5, 1, -1), (-0.5, 1, -1))),
            rotors=(RotorFact((0, 0.5, 3), (0, 0, 1), 3, 0.25, 29.0, 0.2, 0.8),),
            gratings=(GratingFact((40.0, 0.0)),),
        ),
    )
    assert load_scene(path) == expected


def test_what_is_left_out_takes_the_stated_defaults(scene_file: Write) -> None:
    scene = load_scene(scene_file(""))
    assert scene == Scene(name="given", camera=Camera("orthographic", height=2.0))
    assert scene.animation == Animation(30.0, 1, 0.0)
    flat = load_scene(scene_file(FLAT))
    assert flat.objects == (quad([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]),)


def test_a_pan_that_the_objects_make_is_read(scene_file: Write) -> None:
    moving = FLAT + "velocity = [0.1, 0, 0]\n"
    for way in ("0.1", "-0.1"):
        scene = load_scene(scene_file(f"{moving}[fact.pan]\nvelocity = [{way}, 0, 0]\nperiod = 1.0"))
        assert scene.facts.pans == (PanFact((float(way), 0.0, 0.0), 1.0),)


def test_facts_may_be_a_table_or_an_array_of_tables(scene_file: Write) -> None:
    one = load_scene(scene_file(FLAT + "[fact.edge]\nfrom = [-1, 1, 0]\nto = [1, 1, 0]"))
    many = load_scene(scene_file(FLAT + "[[fact.edge]]\nfrom = [-1, 1, 0]\nto = [1, 1, 0]"))
    assert one.facts == many.facts


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("schema = 1\nname = = 3\n", "line 2, column 8: not valid TOML: Invalid value"),
        ('schema = 1\n[camera\nup = "', "line 2, column 8: not valid TOML: "),
        ('name = "open', "line 1, column 13: not valid TOML: "),
        ("a = 1\nb = [1,\n", "line 3, column 1: not valid TOML: "),
        ("name = 'a'\nname = 'b'\n", "line 2, column 11: not valid TOML: Cannot overwrite a value"),
    ],
)
def test_broken_toml_is_refused_with_its_line_and_column(scene_file: Write, text: str, place: str) -> None:
    path = scene_file(text)
    with pytest.raises(InputError, match=f"^{re.escape(path)}: {re.escape(place)}"):
        load_scene(path)


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "binary.toml"
    path.write_bytes(b'name = "\xff"')
    with pytest.raises(InputError, match="byte 8 is not UTF-8"):
        load_scene(str(path))


def test_a_byte_order_mark_is_passed_over(scene_file: Write) -> None:
    assert load_scene(scene_file("\ufeff" + FLAT)) == load_scene(scene_file(FLAT))


def test_a_small_scene_far_from_the_origin_is_accepted(scene_file: Write) -> None:
    at, size = 1e6, 1e-6
    corners = [[at, at, 0.0], [at + size, at, 0.0], [at, at + size, 0.0]]
    scene = load_scene(
        scene_file(
            f"[camera]\nposition = [{at}, {at}, 5]\ntarget = [{at}, {at}, 0]\nheight = {size}\n"
            f"[[object]]\npolygon = {corners}"
        )
    )
    np.testing.assert_array_equal(scene.objects[0].vertices, corners)


@pytest.mark.parametrize("given", [3, None, b"propeller", Path("propeller")])
def test_a_scene_is_named_by_a_text(given: Any) -> None:
    with pytest.raises(TypeError, match=f"is named by a text .*, not by {type(given).__name__}"):
        load_scene(given)


def test_arrays_without_end_are_refused_in_a_sentence(scene_file: Write) -> None:
    with pytest.raises(InputError, match=r"line 1: nested more than 100 deep"):
        load_scene(scene_file("a = " + "[" * 100_000))


@pytest.mark.parametrize("name", ["gone.toml", "folder/gone", "./propeller", "GONE.TOML"])
def test_a_file_that_is_not_there_is_refused_as_a_file(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"cannot be read \(No such file or directory\)"):
        load_scene(name)


def test_a_folder_is_no_scene_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot be read \(Is a directory\)"):
        load_scene(str(tmp_path) + os.sep)


def test_model_files_that_are_not_there_are_refused_by_name(scene_file: Write) -> None:
    with pytest.raises(InputError, match=r"given\.toml: object\[0\]\.mesh: .*a\.glb: no such file"):
        load_scene(scene_file('[[object]]\nmesh = "a.glb"'))
    for name in ("a.glb", "b.OBJ", "c/d.ply"):
        with pytest.raises(InputError, match=f"{name}: no such file"):
            load_scene(name)


def test_an_existing_file_wins_over_a_name_of_the_catalog(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert load_scene("propeller").name == "propeller"
    Path("propeller").write_text("contrast = 0.25", encoding="utf-8")
    assert load_scene("propeller").contrast == 0.25
    Path("confetti").mkdir()
    assert load_scene("confetti") == SCENES["confetti"].build()


@pytest.mark.parametrize("text", ["propeler", "", " ", "x" * 5000, "no\0pe", "propeler:blades=3"])
def test_what_is_no_scene_is_refused_with_the_known_ones(text: str) -> None:
    with pytest.raises(
        InputError, match=r"unknown scene .*known: brick-floor, .*confetti, .*or the path of a scene file"
    ):
        load_scene(text)
    if text.startswith("propeler"):
        with pytest.raises(InputError, match="did you mean 'propeller'"):
            load_scene(text)


def test_image_paths_are_relative_to_the_scene_file(scene_file: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    path = scene_file(FLAT + 'texture = "a"\n[texture.a]\nimage = "pictures/one.png"')
    write_picture(Path(path).parent / "pictures" / "one.png")
    monkeypatch.chdir("/")
    texture = load_scene(path).textures["a"]
    assert isinstance(texture, ImageTexture)
    assert texture.source == "pictures/one.png"


EVERYTHING = """
schema = 1
name = "two-wedges"
background = [0.0, 0.0, 0.0]
contrast = 1.0
[animation]
fps = 30.0
frames = 30
shutter = 0.5
[camera]
projection = "orthographic"
position = [0, 0, 5]
target = [0, 0, 0]
up = [0, 1, 0]
height = 2.0
velocity = [0.0, 0.0, 0.0]
lens_radius = 0.0
focus_distance = 5.0
[[object]]
polygon = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]
color = [1, 1, 1]
uv = [[0, 0], [1, 0], [0.5, 1]]
texture = "tiles"
material = "unlit"
velocity = [0, 0, 0]
spin = { axis = [0, 0, 1], center = [0, 0, 0], rev_per_s = 29.0 }
[texture.tiles]
checker = { squares = [16, 16], black = [0, 0, 0], white = [1, 1, 1] }
[[light]]
quad = [[-1, 2, -1], [1, 2, -1], [1, 2, 1], [-1, 2, 1]]
radiance = [4, 4, 4]
[[fact.edge]]
from = [-1, 0, 0]
to = [1, 0.1, 0]
[fact.rotor]
center = [0, 0, 0]
axis = [0, 0, 1]
blades = 3
duty = 0.5
rev_per_s = 29.0
inner = 0.2
outer = 0.8
[fact.grating]
cycles_per_unit = [40.0, 0.0]
[fact.pan]
velocity = [0.1, 0, 0]
period = 1.0
"""


def test_a_file_with_every_table_of_the_schema_loads(scene_file: Write) -> None:
    scene = load_scene(scene_file(EVERYTHING))
    assert (len(scene.objects), len(scene.textures), len(scene.lights)) == (1, 1, 1)
    facts = scene.facts
    assert (len(facts.edges), len(facts.rotors), len(facts.gratings), len(facts.pans)) == (1, 1, 1, 1)


def test_the_scene_file_of_the_readme_is_one(scene_file: Write) -> None:
    text = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    scene = load_scene(scene_file(text.partition("```toml\n")[2].partition("```")[0]))
    assert (scene.name, len(scene.objects)) == ("two-wedges", 2)
