"""Checking a scene file tells everything that is wrong with it at once, each with the line it is on."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.checking import check_scene_file
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.export import export_scene
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.lines import DEEPEST, key_lines
from aliasbench.scenes.model import ImageTexture

Write = Callable[[str], str]

WRONG = """schema = 1
backgroud = [0, 0, 0]
contrast = -1
[animation]
fps = 0
frame = 3
[camera]
height = 0
up = [0, 0]
[[object]]
quad = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
color = [2,
  -1, 0]
texture = "tils"
spin = { axis = [0, 0, 0], rev_per_s = 1 }
[[object]]
color = 3
[[object]]
polygon = [[0, 0, 0], [1, 0, 0]]
texture = "photo"
uv = [[0, 0], [1, 0], [1, 1]]
name = 3
[[object]]
vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
triangles = [[0, 1, 4]]
matrices = [[1, 2]]
material = "glas"
[texture.tiles]
checker = { squares = [0, 1] }
[texture.photo]
image = "gone.png"
alpha_cutoff = 3
[texture]
data.image = "data:image/png;base64,!"
[[light]]
quad = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]]
[fact.rotor]
blades = 0
duty = 0.5
rev_per_s = 1
inner = 0.5
outer = 0.2
"""
FOUND = [
    (2, "backgroud", "unknown key 'backgroud'; did you mean 'background'?"),
    (3, "contrast", "contrast = -1: must be a finite number"),
    (5, "animation.fps", "animation.fps = 0: must be a finite number"),
    (6, "animation.frame", "unknown key 'frame'; did you mean 'frames'?"),
    (8, "camera.height", "camera.height = 0: must be a finite number"),
    (9, "camera.up", "camera.up = [0, 0]: must be a list of 3"),
    (12, "object[0].color", "object[0].color = [2, -1, 0]: must be linear RGB"),
    (14, "object[0].texture", "unknown texture 'tils'; did you mean 'tiles'?"),
    (15, "object[0].spin.axis", "must be a direction"),
    (16, "object[1]", "object[1] has none of them; an object needs exactly one of polygon, quad, mesh, vertices"),
    (17, "object[1].color", "object[1].color = 3: must be a list of 3"),
    (19, "object[2].polygon", "object[2].polygon: has 2 points; at least 3 are needed"),
    (21, "object[2].uv", "must be a list of 2 points of 2 numbers each"),
    (22, "object[2].name", "object[2].name = 3: must be a text"),
    (25, "object[3].triangles", "must be a list of triples of whole numbers from 0 to 3"),
    (26, "object[3].matrices", "must be a list of 2 points of 16"),
    (27, "object[3].material", "unknown material 'glas'; did you mean 'glass'?"),
    (29, "texture.tiles.checker.squares", "must be two finite numbers over 0"),
    (31, "texture.photo.image", "no such file"),
    (32, "texture.photo.alpha_cutoff", "alpha_cutoff = 3: must be"),
    (34, "texture.data.image", "the data is not base64"),
    (35, "light[0].radiance", "light[0].radiance is missing; it must be"),
    (36, "light[0].quad", "must be the four corners of a parallelogram"),
    (38, "fact.rotor.blades", "fact.rotor.blades = 0: must be a whole number"),
]


def test_everything_that_is_wrong_is_told_with_its_line_and_key(scene_file: Write) -> None:
    checked = check_scene_file(Path(scene_file(WRONG)))
    assert checked.scene is None
    assert [(f.line, f.key) for f in checked.findings] == [(line, key) for line, key, _ in FOUND]
    for finding, (_, _, text) in zip(checked.findings, FOUND, strict=True):
        assert text in finding.text


def test_mending_what_is_told_leaves_the_rest(scene_file: Write) -> None:
    text = WRONG.replace("contrast = -1", "contrast = 1").replace("name = 3", 'name = "three"')
    left = [(line, key) for line, key, _ in FOUND if key not in ("contrast", "object[2].name")]
    assert [(f.line, f.key) for f in check_scene_file(Path(scene_file(text))).findings] == left


@pytest.mark.parametrize("name", ["edge-fan", "propeller", "brick-floor", "grid", "soft-shadow"])
def test_a_sound_file_gives_the_scene_that_loading_gives(scene_file: Write, name: str) -> None:
    path = scene_file(export_scene(SCENES[name].build()).text)
    checked = check_scene_file(Path(path))
    assert checked.findings == ()
    assert checked.scene == load_scene(path)


def test_a_newer_schema_is_all_that_is_told(scene_file: Write) -> None:
    findings = check_scene_file(Path(scene_file("name = 3\nschema = 2\nfuture = 1"))).findings
    assert [(f.line, f.key) for f in findings] == [(2, "schema")]


@pytest.mark.parametrize(
    ("text", "line", "said"), [("a = 1\nb = [1,\n", 3, "column 1: not valid TOML"), ("=", 1, "col")]
)
def test_what_is_no_toml_is_told_with_its_line(scene_file: Write, text: str, line: int, said: str) -> None:
    (finding,) = check_scene_file(Path(scene_file(text))).findings
    assert finding.line == line
    assert said in finding.text


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    for path, said in (
        (tmp_path, "Is a directory"),
        (tmp_path / "gone.toml", "No such file"),
        (tmp_path / "gone.glb", "No such file"),
        (Path("a\0b.toml"), "null"),
    ):
        with pytest.raises(InputError, match=f"cannot be read .*{said}"):
            check_scene_file(path)


def test_a_model_file_is_checked_by_loading_it(tmp_path: Path) -> None:
    path = tmp_path / "broken.glb"
    path.write_bytes(b"glTF")
    (finding,) = check_scene_file(path).findings
    assert finding.text


def test_names_of_thousands_of_parts_cost_no_more_than_their_text() -> None:
    text = f"[{'.'.join('a' * 20_000)}]\nb.c = 1\n{'.'.join('d' * 20_000)} = 2\n[[{'.'.join('e' * 20_000)}]]\nf = 1"
    lines = key_lines(text)
    assert max(map(len, lines)) == DEEPEST
    assert lines[("e",)] == 4


FOLLOWING = """[camera]
projection = "perspectiv"
fov_y_deg = 40
[[object]]
quad = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
material = "glosy"
roughness = 0.2
[[object]]
polgon = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
[texture.b]
imge = "x.png"
[texture.c]
grating = { cyles = 2 }
"""


def test_what_only_follows_from_a_misspelt_word_is_not_told(scene_file: Write) -> None:
    findings = check_scene_file(Path(scene_file(FOLLOWING))).findings
    assert [f.line for f in findings] == [2, 6, 9, 11, 13]
    assert all("did you mean" in f.text for f in findings)


def test_messages_are_one_printable_line_however_long_and_strange_what_they_quote_is(scene_file: Write) -> None:
    many = "".join(f"[texture.t{k}]\nchecker = {{ squares = [1, 1] }}\n" for k in range(200))
    text = f"""[[object]]
mesh = "\\u202e\\u0007\\n.obj"
[[object]]
mesh = "{"x" * 100_000}.obj"
[[object]]
quad = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
texture = "nope"
[texture.a]
image = "data:image/{"a" * 100_000};base64,AAAA"
{many}"""
    findings = check_scene_file(Path(scene_file(text))).findings
    assert [f.line for f in findings] == [2, 4, 7, 9]
    assert all(f.text.isprintable() and len(f.text) < 3000 for f in findings)
    assert "and 181 more" in findings[2].text


@pytest.mark.parametrize("stem", ["new\nline", "esc\x1b[31m", "x" * 240])
def test_a_file_of_any_name_is_a_scene(tmp_path: Path, stem: str) -> None:
    path = tmp_path / f"{stem}.toml"
    path.write_text("schema = 1")
    scene = check_scene_file(path).scene
    assert scene is not None
    assert scene.name.isprintable()
    assert len(scene.name) == min(len(stem), 200)


def test_an_image_is_read_once_and_all_together_stay_within_the_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 4\n" + bytes(64))
    (tmp_path / "b.hdr").write_bytes((tmp_path / "a.hdr").read_bytes())
    texts = [f"[texture.t{k}]\nimage = 'a.hdr'\nalpha_cutoff = 0.{k}\n" for k in range(1, 5)]
    path = tmp_path / "given.toml"
    path.write_text("".join(texts))
    monkeypatch.setattr("aliasbench.scenes.file_textures.FREE_TEXELS", 31)
    monkeypatch.setattr("aliasbench.scenes.file_textures.TEXELS_PER_BYTE", 0)
    images = [texture for texture in load_scene(str(path)).textures.values() if isinstance(texture, ImageTexture)]
    assert [image.alpha_cutoff for image in images] == [0.1, 0.2, 0.3, 0.4]
    assert all(image.texels is images[0].texels for image in images)
    path.write_text("".join([*texts, "[texture.b]\nimage = 'b.hdr'"]))
    (finding,) = check_scene_file(path).findings
    assert finding.key == "texture.b.image"
    assert "has 4 x 4 texels; at most 15 are allowed" in finding.text


def test_what_a_model_s_own_animation_does_is_told_of_the_mesh(
    tmp_path: Path, gltf: ModuleType, write: Callable[..., Path]
) -> None:
    builder = gltf.plain()
    gltf.add_animation(builder, 0, "translation", builder.array([0.0, 0.01]), builder.array([(0, 0, 0), (1e11, 0, 0)]))
    write(builder, "fast.glb")
    path = tmp_path / "given.toml"
    path.write_text("[animation]\nframes = 30\n[[object]]\nmesh = 'fast.glb'")
    (finding,) = check_scene_file(path).findings
    assert (finding.line, finding.key) == (4, "object[0].mesh")
    assert "must be a model with a velocity within 1e+12 of the origin" in finding.text
