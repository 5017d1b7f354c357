"""A scene written as a scene file loads as an equal scene: every scene of the catalog, and whatever a file can say."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aliasbench.scenes import export
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.entries import Parameter, SceneEntry, Value
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.export import LONGEST_LIST, Exported, export_scene
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.limits import MAX_NAME
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
    Surface,
    ZonePlate,
    read_only,
)
from aliasbench.scenes.photographs import load_photograph
from aliasbench.scenes.shapes import mesh, polygon, quad

CORNERS = ((-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0))
# All ends of all parameters with TRIALS=all; otherwise one end of each, by turns.
ENDS = 2 if os.environ.get("TRIALS") else 1
TURN = np.eye(4)
TURN[0, 3] = 1 / 3


def loaded(exported: Exported, folder: Path) -> Scene:
    for name, content in exported.images.items():
        (folder / name).write_bytes(content)
    path = folder / "exported.toml"
    path.write_text(exported.text, encoding="utf-8")
    return load_scene(str(path))


def noise(width: int, height: int, seed: int = 0) -> ImageTexture:
    texels = np.random.default_rng(seed).random((height, width, 4)).astype(np.float32)
    return ImageTexture(read_only(texels * np.float32(3.0)), 0.25, "made of noise")


@pytest.mark.parametrize("name", sorted(SCENES))
def test_every_scene_of_the_catalog_loads_as_an_equal_one(name: str, tmp_path: Path) -> None:
    scene = SCENES[name].build()
    whole = export_scene(scene)
    assert whole.images == {}
    assert loaded(whole, tmp_path) == scene
    if any(isinstance(texture, ImageTexture) for texture in scene.textures.values()):
        assert loaded(export_scene(scene, beside="mine"), tmp_path) == scene


def built(entry: SceneEntry, key: str, value: Value) -> Scene | None:
    """Return a scene with one parameter changed, None where it only makes sense together with another."""
    try:
        return entry.build(**{key: value})
    except InputError:
        return None


@pytest.mark.parametrize("name", sorted(SCENES))
def test_every_parameter_at_its_ends_is_written_and_read_back(name: str) -> None:
    entry = SCENES[name]
    tried = 0
    for turn, (key, parameter) in enumerate(entry.parameters.items()):
        ends: tuple[Value, ...] = (
            (parameter.low, parameter.high) if isinstance(parameter, Parameter) else parameter.names
        )
        for value in (ends * 2)[turn % 2 : turn % 2 + ENDS]:
            scene = built(entry, key, value)
            if scene is not None:
                # What is handed out was read back and compared; that this is so is tested below.
                assert export_scene(scene).text
                tried += 1
    assert tried >= len(entry.parameters) - 2


def test_names_may_be_as_long_as_the_catalog_makes_them(tmp_path: Path) -> None:
    entry = SCENES["window-screens"]
    numbers = {key: p for key, p in entry.parameters.items() if isinstance(p, Parameter) and p.kind == "float"}
    scene = entry.build(**{key: p.low + (p.high - p.low) / 4.2857144 for key, p in numbers.items()})
    assert len(scene.name) > MAX_NAME
    assert loaded(export_scene(scene), tmp_path) == scene


def everything() -> Scene:
    """Return a scene with every key of a scene file away from its default."""
    rows = np.random.default_rng(1).random((3 * LONGEST_LIST, 3))
    many = mesh(rows, np.arange(3 * LONGEST_LIST).reshape(-1, 3)[::-1], name="many")
    few = replace(
        mesh([*CORNERS, (0.0, 0.0, -0.0)], [(0, 1, 4), (1, 2, 4)], color=(0.5, 0.25, 1 / 3)),
        uv=read_only(np.random.default_rng(2).random((5, 2))),
        texture="a photo",
        material=Material("diffuse"),
    )
    spin = Spin((0.0, 0.0, 2.0), (0.1, 0.2, 0.0), 29.0)
    surfaces = (
        quad(CORNERS, texture="tiles", motion=Motion(velocity=(1e-9, -0.0, 0.3), spin=spin), name='a "quad"\\ → é'),
        quad(CORNERS, uv=np.array(CORNERS)[:, :2] / 3, texture="wave", material=Material("glossy", roughness=0.2)),
        polygon(CORNERS, material=Material("glass", ior=1.7, abbe=30.0)),
        polygon(CORNERS[:3], uv=np.zeros((3, 2)), texture="rings"),
        quad(
            CORNERS, texture="a/noise", motion=Motion(matrices=(tuple(np.eye(4).ravel().tolist()), tuple(TURN.ravel())))
        ),
        many,
        replace(many, uv=read_only(rows[:, :2]), texture="photo.2"),
        few,
    )
    corner_list = tuple((x, y, -0.0) for x, y, _ in CORNERS)
    return Scene(
        name="everything: all of it",
        camera=Camera(
            "perspective",
            position=(0.1, 0.2, 5.0),
            target=(-0.0, 0.0, 0.0),
            up=(0.0, 1.0, 0.5),
            fov_y_deg=33.3,
            velocity=(1.0, 0.0, 0.0),
            target_velocity=(0.0, 0.0, 0.0),
            lens_radius=0.1,
            focus_distance=1e-3,
        ),
        objects=surfaces,
        textures={
            "tiles": Checker((16.0, 1 / 3), (0.1, 0.0, 0.0), (1.0, 0.9, 1e-15)),
            "wave": Grating(40.0, 30.0, 0.25, "square", (0.0, 0.0, 0.1), (0.5, 1.0, 1.0)),
            "rings": ZonePlate((0.25, -0.0), 9000.0, 1.0),
            "": ZonePlate((0.5, 0.5), 1.0),
            "a photo": load_photograph("brick"),
            "photo.2": replace(load_photograph("grass"), alpha_cutoff=0.5),
            "noise": noise(7, 5),
            "NOISE": noise(3, 2, 1),
            "a/noise": replace(noise(1, 1), source="", alpha_cutoff=None),
            "cut photo": replace(noise(4, 4), source="skimage:brick.png"),
        },
        lights=(Light((corner_list[0], corner_list[1], corner_list[2], corner_list[3]), (4.0, 3.0, 1 / 3)),),
        background=(0.0, 0.1, 1e-7),
        contrast=0.7,
        animation=Animation(23.976, 12, 0.5),
        facts=Facts(
            edges=(EdgeFact(CORNERS[0], CORNERS[1]), EdgeFact(CORNERS[2], CORNERS[3])),
            rotors=(RotorFact((0.1, 0.2, 0.0), (0.0, 0.0, 1.0), 3, 0.25, 29.0, 0.2, 0.8),),
            gratings=(GratingFact((40.0, -0.0)), GratingFact((1 / 3, 1e-9))),
            pans=(PanFact((1.0, 0.0, 0.0), 1 / 3),),
        ),
    )


@pytest.mark.parametrize("beside", [None, "everything"])
def test_all_that_a_file_can_say_loads_as_an_equal_scene_and_exports_as_the_same_text(
    tmp_path: Path, beside: str | None
) -> None:
    scene = everything()
    exported = export_scene(scene, beside=beside)
    again = loaded(exported, tmp_path)
    assert again == scene
    assert export_scene(again, beside=beside) == exported
    assert len({name.lower() for name in exported.images}) == (0 if beside is None else 4)
    assert 'image = "skimage:brick.png"' in exported.text
    assert f"# {3 * LONGEST_LIST} rows of 3 float64" in exported.text


def test_an_image_of_a_scene_file_is_kept_to_the_bit_wherever_the_copy_goes(
    tmp_path: Path,
) -> None:
    first = export_scene(Scene("first", Camera("orthographic", height=2.0), textures={"n": noise(5, 3)}), beside="pic")
    original = loaded(first, tmp_path)
    inside, elsewhere = export_scene(original), tmp_path / "elsewhere"
    elsewhere.mkdir()
    assert loaded(inside, elsewhere) == original
    assert 'source = "made of noise"' in inside.text


def test_what_scene_files_cannot_say_is_refused_and_not_left_out() -> None:
    flat = Camera("orthographic", height=2.0)
    shiny = quad(CORNERS, material=Material("unlit", roughness=0.3), name="sheet")
    bent = Surface(read_only(np.array(CORNERS)), read_only(np.array([[0, 1, 3], [1, 2, 3]], np.int32)), name="bent")
    for scene, said in (
        (Scene("a\nb", flat), 'name = "a\\\\nb": must be a text of printable'),
        (Scene("a", flat, objects=(shiny,)), 'roughness = 0.3: must be left out: it belongs to material = "glossy"'),
        (Scene("a", flat, objects=(bent,)), r"it has something that scene files do not say \(object bent\)"),
        (Scene("a", replace(flat, height=None)), r"scene files do not say \(camera\)"),
    ):
        with pytest.raises(InputError, match=f"cannot be written as a scene file: .*{said}"):
            export_scene(scene)


def test_an_image_too_large_for_the_text_belongs_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(export, "MAX_IMAGE_BYTES", 10_000)
    large = noise(40, 30)
    scene = Scene("large", Camera("orthographic", height=2.0), textures={"n": large})
    with pytest.raises(InputError, match=r"texture 'n' is an image of 40 x 30 texels, too large .* folder with -o"):
        export_scene(scene)
    assert loaded(export_scene(scene, beside="large"), tmp_path) == scene
