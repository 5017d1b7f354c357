"""Every way in which a scene file can be wrong is refused in one sentence: file, key, value and what is allowed."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aliasbench.scenes.checking import check_scene_file
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene

Write = Callable[[str], str]

IDENTITY = tuple(np.eye(4).ravel().tolist())
ROLLING = "[animation]\nfps = 1\nframes = 9\n[camera]\n"
OBJECT = "[[object]]\nquad = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]\n"
EDGE = "[[fact.edge]]\nfrom = [-1, 1, 0]\n"
ROTOR = (
    OBJECT + "spin = { axis = [0, 0, 1], rev_per_s = 2 }\n"
    "[fact.rotor]\nblades = 3\nduty = 0.5\nrev_per_s = 2\ninner = 0.2\nouter = 0.8\n"
)
PAN = OBJECT + "velocity = [1, 0, 0]\n[fact.pan]\n"
# A scene file with one thing wrong, and what the refusal says of it.
REFUSED = {
    "newer schema": ("schema = 2\nfuture = 1", "schema = 2: must be 1, the only version"),
    "schema is no number": ("schema = true", "schema = true: must be a whole number, 0 or more"),
    "unknown root key": ("backgroud = [0, 0, 0]", "backgroud = [0, 0, 0]: unknown key 'backgroud'; did you mean 'back"),
    "name is no text": ("name = 3", "name = 3: must be a text that is not empty"),
    "name is empty": ('name = ""', 'name = "": must be a text that is not empty'),
    "background too short": ("background = [0, 0]", "background = [0, 0]: must be a list of 3 finite numbers"),
    "background holds a bool": ("background = [0, true, 0]", "background = [0, true, 0]: must be a list of 3 finite"),
    "background not finite": ("background = [0, nan, 0]", "background = [0, NaN, 0]: must be a list of 3 finite"),
    "background negative": ("background = [0, -1, 0]", "background = [0, -1, 0]: must be linear RGB"),
    "bounces too many": ("bounces = 2", "bounces = 2: must be a whole number, 0 to 1"),
    "bounces negative": ("bounces = -1", "bounces = -1: must be a whole number, 0 to 1"),
    "bounces a share": ("bounces = 0.5", "bounces = 0.5: must be a whole number, 0 to 1"),
    "contrast zero": ("contrast = 0", "contrast = 0: must be a finite number at least 1e-15 and at most 1e+15"),
    "contrast infinite": ("contrast = inf", "contrast = Infinity: must be a finite number at least 1e-15"),
    "contrast beyond float64": ("contrast = 1" + "0" * 400, "contrast = 1000"),
    "contrast a text": ('contrast = "1"', 'contrast = "1": must be a finite number at least 1e-15'),
    "animation no table": ("animation = 3", "animation = 3: must be a table"),
    "unknown animation key": (
        "[animation]\nframe = 3",
        "animation.frame = 3: unknown key 'frame'; did you mean 'frames'",
    ),
    "fps zero": ("[animation]\nfps = 0", "animation.fps = 0: must be a finite number at least 1e-06 and at most 1e+09"),
    "frames zero": ("[animation]\nframes = 0", "animation.frames = 0: must be a whole number, 1 or more"),
    "frames real": ("[animation]\nframes = 2.0", "animation.frames = 2.0: must be a whole number, 1 or more"),
    "shutter negative": (
        "[animation]\nshutter = -0.1",
        "animation.shutter = -0.1: must be a finite number at least 0 and",
    ),
    "shutter over one": (
        "[animation]\nshutter = 1.5",
        "animation.shutter = 1.5: must be a finite number at least 0 and at",
    ),
    "unknown camera key": ("[camera]\nfov = 30", "camera.fov = 30: unknown key 'fov'"),
    "unknown projection": (
        '[camera]\nprojection = "ortographic"',
        "unknown projection 'ortographic'; did you mean 'ortho",
    ),
    "height zero": (
        "[camera]\nheight = 0",
        "camera.height = 0: must be a finite number at least 1e-12 and at most 1e+12",
    ),
    "no fov": (
        '[camera]\nprojection = "perspective"',
        "camera.fov_y_deg is missing; it must be a finite number at least 1e-06 and",
    ),
    "fov too wide": (
        '[camera]\nprojection = "perspective"\nfov_y_deg = 180',
        "camera.fov_y_deg = 180: must be a finite number at least 1e-06 and under 180",
    ),
    "fov of an orthographic": (
        "[camera]\nfov_y_deg = 30",
        "camera.fov_y_deg = 30: must be left out: it belongs to proj",
    ),
    "height of a perspective": (
        '[camera]\nprojection = "perspective"\nfov_y_deg = 30\nheight = 2',
        'camera.height = 2: must be left out: it belongs to projection = "orthographic"',
    ),
    "camera at its target": ("[camera]\nposition = [0, 0, 0]", "camera: position equals target at t = 0 s"),
    "camera reaches its target": (
        ROLLING + "velocity = [0, 0, -1]\ntarget_velocity = [0, 0, 0]",
        "camera: position equals target at t = 5 s",
    ),
    "up along the axis": ("[camera]\nup = [0, 0, 2]", "camera: up [0.0, 0.0, 2.0] is along the viewing axis"),
    "up comes along the axis": (
        ROLLING + "position = [4, 3, 0]\nvelocity = [-1, 0, 0]\ntarget_velocity = [0, 0, 0]",
        "camera: up [0.0, 1.0, 0.0] is along the viewing axis",
    ),
    "no up": ("[camera]\nup = [0, 0, 0]", "camera.up = [0, 0, 0]: must be a direction"),
    "lens negative": ("[camera]\nlens_radius = -1", "camera.lens_radius = -1: must be a finite number at least 0"),
    "focus zero": (
        "[camera]\nfocus_distance = 0",
        "camera.focus_distance = 0: must be a finite number at least 1e-12 and at most",
    ),
    "object no array": ("object = 3", "object = 3: must be an array of tables, each under [[object]]"),
    "object a table": ("[object]\nquad = 3", "must be an array of tables, each under [[object]]"),
    "no shape": (
        "[[object]]\ncolor = [1, 1, 1]",
        "object[0] has none of them; an object needs exactly one of polygon, ",
    ),
    "two shapes": (
        OBJECT + "polygon = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]",
        "object[0] has polygon and quad together; an object needs exactly one of polygon, quad, mesh",
    ),
    "unknown object key": (
        OBJECT + "colour = [1, 1, 1]",
        "object[0].colour = [1, 1, 1]: unknown key 'colour'; did you mean 'c",
    ),
    "second object": (OBJECT * 2 + "color = 1", "object[1].color = 1: must be a list of 3 finite numbers"),
    "quad of three": ("[[object]]\nquad = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]", "must be a list of 4 points of 3 finite"),
    "flat point": (
        "[[object]]\npolygon = [[0, 0], [1, 0], [0, 1]]",
        "object[0].polygon = [[0, 0], [1, 0], [0, 1]]: must",
    ),
    "point of texts": (
        '[[object]]\npolygon = ["a"]',
        'object[0].polygon = ["a"]: must be a list of points of 3 finite',
    ),
    "no points": (
        "[[object]]\npolygon = []",
        "object[0].polygon = []: must be a list of points of 3 finite numbers each",
    ),
    "two points": (
        "[[object]]\npolygon = [[0, 0, 0], [1, 0, 0]]",
        "object[0].polygon: has 2 points; at least 3 are needed",
    ),
    "not planar": (
        "[[object]]\nquad = [[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]]",
        "of the polygon's size off its plane; at most 1e-06 is allowed",
    ),
    "crossing": (
        "[[object]]\nquad = [[0, 0, 0], [3, 0, 0], [3, 3, 0], [1, -1, 0]]",
        "object[0].quad: its outline crosses or touches itself",
    ),
    "texture unknown": (
        OBJECT + 'texture = "brick"\n[texture.bricks]\nchecker = { squares = [1, 1] }',
        "object[0].texture: unk",
    ),
    "texture without uv": (
        '[[object]]\npolygon = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\ntexture = "a"\n[texture.a]\nzone_plate = { k = 1 }',
        "object[0].uv is missing; it must be given with a texture: 3 points of 2 numbers each",
    ),
    "uv too short": (
        OBJECT + "uv = [[0, 0], [1, 0], [1, 1]]",
        "object[0].uv = [[0, 0], [1, 0], [1, 1]]: must be a list of 4",
    ),
    "material unknown": (
        OBJECT + 'material = "glas"',
        "object[0].material = \"glas\": unknown material 'glas'; did you mean 'gl",
    ),
    "roughness of the unlit": (
        OBJECT + "roughness = 0.1",
        "object[0].roughness = 0.1: must be left out: it belongs to mat",
    ),
    "roughness too large": (
        OBJECT + 'material = "glossy"\nroughness = 1.5',
        "object[0].roughness = 1.5: must be a finite number over 0 and at most 1",
    ),
    "ior zero": (OBJECT + 'material = "glass"\nior = 0', "object[0].ior = 0: must be a finite number over 0"),
    "spin no table": (OBJECT + "spin = 3", "object[0].spin = 3: must be a table"),
    "spin without rate": (
        OBJECT + "spin = { axis = [0, 0, 1] }",
        "object[0].spin.rev_per_s is missing; it must be a finite",
    ),
    "spin about nothing": (
        OBJECT + "spin = { axis = [0, 0, 0], rev_per_s = 1 }",
        "object[0].spin.axis = [0, 0, 0]: must be a direction: three finite numbers, not all zero",
    ),
    "spin key unknown": (
        OBJECT + "spin = { rev_per_sec = 1 }",
        "object[0].spin.rev_per_sec = 1: unknown key 'rev_per_sec'; did y",
    ),
    "matrices with velocity": (
        OBJECT + f"velocity = [0, 0, 0]\nmatrices = [{list(IDENTITY)}, {list(IDENTITY)}]",
        "object[0].velocity = [0, 0, 0]: must be left out: matrices say the whole motion",
    ),
    "matrices with spin": (
        OBJECT + f"spin = {{ rev_per_s = 1 }}\nmatrices = [{list(IDENTITY)}, {list(IDENTITY)}]",
        'object[0].spin = {"rev_per_s": 1}: must be left out: matrices say the whole motion',
    ),
    "one matrix": (OBJECT + f"matrices = [{list(IDENTITY)}]", "must be a list of 2 points of 16 finite numbers each"),
    "matrix not affine": (
        OBJECT + f"matrices = [{list(IDENTITY)}, {[*IDENTITY[:15], 2.0]}]",
        "must be two affine row-major 4 x 4 matrices, each ending in 0, 0, 0, 1",
    ),
    "empty texture": (
        "[texture.a]",
        "texture.a has none of them; a texture needs exactly one of checker, image, grating",
    ),
    "texture no table": ("[texture]\na = 1", "texture.a = 1: must be a table"),
    "two textures in one": (
        "[texture.a]\nchecker = { squares = [1, 1] }\nzone_plate = { k = 1 }",
        "texture.a has checker and zone_plate together; a texture needs exactly one of",
    ),
    "texture key unknown": (
        "[texture.a]\nchecked = 1",
        "texture.a.checked = 1: unknown key 'checked'; did you mean 'checker'",
    ),
    "cutoff without image": (
        "[texture.a]\nalpha_cutoff = 0.5\nzone_plate = { k = 1 }",
        "texture.a.alpha_cutoff = 0.5: must be left out: it belongs to textures with an image",
    ),
    "cutoff over one": (
        '[texture.a]\nimage = "x"\nalpha_cutoff = 2',
        "texture.a.alpha_cutoff = 2: must be a finite number at",
    ),
    "no such image": ('[texture.a]\nimage = "gone.png"', "texture.a.image: image '"),
    "squares zero": (
        "[texture.a]\nchecker = { squares = [0, 1] }",
        "texture.a.checker.squares = [0, 1]: must be two finite",
    ),
    "checker without squares": (
        "[texture.a]\nchecker = {}",
        "texture.a.checker.squares is missing; it must be a list of 2",
    ),
    "profile unknown": (
        '[texture.a]\ngrating = { cycles = 4, profile = "sin" }',
        "texture.a.grating.profile = \"sin\": unknown profile 'sin'; did you mean 'sine'",
    ),
    "cycles missing": (
        "[texture.a]\ngrating = {}",
        "texture.a.grating.cycles is missing; it must be a finite number at least 0",
    ),
    "zone plate without k": (
        "[texture.a]\nzone_plate = {}",
        "texture.a.zone_plate.k is missing; it must be a finite number over",
    ),
    "light without radiance": (
        "[[light]]\nquad = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]",
        "light[0].radiance is missing; it must be a list of 3 finite numbers",
    ),
    "light without area": (
        "[[light]]\nquad = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]\nradiance = [1, 1, 1]",
        "light[0].quad: has no area",
    ),
    "light a trapezium": (
        "[[light]]\nquad = [[0, 0, 0], [3, 0, 0], [2, 1, 0], [0, 1, 0]]\nradiance = [1, 1, 1]",
        "must be the four corners of a parallelogram, in order",
    ),
    "fact unknown": ("[fact.edges]", "fact.edges = {}: unknown key 'edges'; did you mean 'edge'"),
    "edge of no length": (
        OBJECT + EDGE + "to = [-1, 1, 0]",
        "fact.edge[0].to = [-1, 1, 0]: must be a point that differs",
    ),
    "edge in front of every object": (
        OBJECT + "[[fact.edge]]\nfrom = [-1, 1, 0.001]\nto = [1, 1, 0.001]",
        "fact.edge[0] from [-1.0, 1.0, 0.001] to [1.0, 1.0, 0.001] touches no object; it must lie on one",
    ),
    "edge beside its side": (OBJECT + "[[fact.edge]]\nfrom = [2, 1, 0]\nto = [3, 1, 0]", "touches no object"),
    "edge without end": (OBJECT + EDGE, "fact.edge[0].to is missing; it must be a list of 3 finite numbers"),
    "no blades": (
        ROTOR.replace("blades = 3", "blades = 0"),
        "fact.rotor.blades = 0: must be a whole number, 1 or more",
    ),
    "duty of all": (
        ROTOR.replace("duty = 0.5", "duty = 1"),
        "fact.rotor.duty = 1: must be a finite number over 0 and under 1",
    ),
    "annulus inside out": (
        ROTOR.replace("inner = 0.2", "inner = 0.9"),
        "fact.rotor.inner = 0.9: must be less than outer, 0.8",
    ),
    "rotor about nothing": (ROTOR + "axis = [0, 0, 0]", "fact.rotor.axis = [0, 0, 0]: must be a direction"),
    "rotor of another rate": (
        ROTOR.replace("rev_per_s = 2\ninner", "rev_per_s = 3\ninner"),
        "fact.rotor.rev_per_s = 3: must be the rate at which an object spins about this axis and center (2)",
    ),
    "rotor the other way round": (
        ROTOR + "axis = [0, 0, -1]",
        "must be the rate at which an object spins about this axis and",
    ),
    "rotor elsewhere": (ROTOR + "center = [1, 0, 0]", "spins about this axis and center (none)"),
    "grating of nothing": (
        "[fact.grating]\ncycles_per_unit = [0, 0]",
        "fact.grating.cycles_per_unit = [0, 0]: must be a freq",
    ),
    "pan without period": (
        PAN + "velocity = [1, 0, 0]\nperiod = 0",
        "fact.pan.period = 0: must be a finite number at least 1e-09",
    ),
    "pan of nothing": (PAN + "velocity = [0, 0, 0]\nperiod = 1", "fact.pan.velocity = [0, 0, 0]: must be a direction"),
    "pan that nothing makes": (
        PAN + "velocity = [0, 2, 0]\nperiod = 1",
        "fact.pan.velocity = [0, 2, 0]: must be how an object moves against the camera ([1.0, 0.0, 0.0])",
    ),
}

FAR = "[[object]]\npolygon = [[0, 0, 0], [1, 0, 0], [0, {}, 0]]\n"
TURNING = OBJECT + "spin = {{ rev_per_s = {} }}"
TEXTURED = OBJECT + 'texture = "a"\n'
LATE = "[animation]\nfps = 1\nframes = 1001\n"
# Numbers by which pictures would be infinite, or nowhere right, though each is finite in float64.
OUT_OF_RANGE = {
    "background over float32": (
        "background = [1e39, 0, 0]",
        "background = [1e+39, 0, 0]: must be linear RGB, three fin",
    ),
    "colour": (OBJECT + "color = [1e308, 1, 1]", "object[0].color = [1e+308, 1, 1]: must be linear RGB, three finite"),
    "contrast": ("contrast = 1e-320", "contrast = 1e-320: must be a finite number at least 1e-15 and at most 1e+15"),
    "squares": (
        "[texture.a]\nchecker = { squares = [1e308, 4] }",
        "texture.a.checker.squares = [1e+308, 4]: must be a list of 2 finite numbers from -1e+09 to 1e+09",
    ),
    "cycles": (
        "[texture.a]\ngrating = { cycles = 1e10 }",
        "cycles = 10000000000.0: must be a finite number at least 0",
    ),
    "zone plate": ("[texture.a]\nzone_plate = { k = 1e300 }", "k = 1e+300: must be a finite number over 0 and at most"),
    "uv": (
        TEXTURED + "uv = [[0, 0], [1e300, 0], [1, 1], [0, 1]]\n[texture.a]\nzone_plate = { k = 1 }",
        "must be a list of points of 2 finite numbers each from -1e+09 to 1e+09",
    ),
    "fps low": ("[animation]\nfps = 1e-300", "animation.fps = 1e-300: must be a finite number at least 1e-06 and at"),
    "fps high": ("[animation]\nfps = 1e308", "animation.fps = 1e+308: must be a finite number at least 1e-06 and at m"),
    "velocity": (OBJECT + "velocity = [1e308, 0, 0]", "object[0].velocity = [1e+308, 0, 0]: must be a list of 3 finit"),
    "spin": (TURNING.format("1e308"), "spin.rev_per_s = 1e+308: must be a finite number at least -1e+09 and at most 1"),
    "axis too short": (OBJECT + "spin = { axis = [0, 0, 1e-200], rev_per_s = 1 }", "must be a direction: three finite"),
    "coordinate": (
        FAR.format("1e40"),
        "object[0].polygon = [[0, 0, 0], [1, 0, 0], [0, 1e+40, 0]]: must be a list of po",
    ),
    "height": ("[camera]\nheight = 1e-18", "camera.height = 1e-18: must be a finite number at least 1e-12 and at most"),
    "fov": (
        '[camera]\nprojection = "perspective"\nfov_y_deg = 1e-300',
        "camera.fov_y_deg = 1e-300: must be a finite number at least 1e-06 and under 180",
    ),
    "camera far away": (
        "[camera]\nposition = [0, 0, 1e308]",
        "camera.position = [0, 0, 1e+308]: must be a list of 3 finite numbers from -1e+12 to 1e+12",
    ),
    "camera far away for its height": (
        "[camera]\nheight = 1e-6\nposition = [0, 0, 2e7]",
        "camera.position = [0, 0, 20000000.0]: must be within 1e+07 of the origin along each axis (1e+13 times the p",
    ),
    "camera gets too far": (
        LATE + "[camera]\nvelocity = [0, 1e10, 0]",
        "camera.velocity = [0, 10000000000.0, 0]: must be within 1e+12 of the origin along each axis until the end of",
    ),
    "target gets too far": (LATE + "[camera]\ntarget_velocity = [1e10, 0, 0]", "camera.target_velocity = [1000000"),
    "object far away for the height": (
        FAR.format("2e7") + "[camera]\nheight = 1e-6",
        "object[0].polygon = [[0, 0, 0], [1, 0, 0], [0, 20000000.0, 0]]: must be within 1e+07 of the origin",
    ),
    "object far away for the angle": (
        FAR.format("1e9") + '[camera]\nprojection = "perspective"\nfov_y_deg = 1e-6\nposition = [0, 0, 1e-3]',
        "object[0].polygon = [[0, 0, 0], [1, 0, 0], [0, 1000000000.0, 0]]: must be within 174.533 of the origin",
    ),
    "object gets too far": (
        LATE + OBJECT + "velocity = [0, 1e10, 0]",
        "object[0].velocity = [0, 10000000000.0, 0]: must be within 1e+12 of the origin along each axis until the end",
    ),
    "turns without end": (
        LATE + TURNING.format("1e7"),
        'object[0].spin = {"rev_per_s": 10000000.0}: must be at most 1e+09 turns by the end of the animation, at t = 1',
    ),
    "turns far away": (
        OBJECT + "spin = { center = [1e9, 0, 0], rev_per_s = 1 }\n[camera]\nheight = 1e-6",
        "must be about a center within 1e+07 of the origin along each axis",
    ),
    "matrices that throw far away": (
        OBJECT + f"matrices = [{list(IDENTITY)}, {[1e12, 1e12, *IDENTITY[2:]]}]",
        "must be within 1e+12 of the origin along each axis",
    ),
}
# What is given must say something of the picture.
NAMES = {
    "line break": ('name = "a\\nb"', 'name = "a\\nb": must be a text of printable characters, at most 200'),
    "escape": ('name = "\\u001b[31mx"', 'name = "\\u001b[31mx": must be a text of printable characters, at most 200'),
    "delete": ('name = "\\u007f"', 'name = "\\u007f": must be a text of printable characters, at most 200'),
    "long": (f'name = "{"x" * 201}"', "...: must be a text of printable characters, at most 200"),
}
HUGE = {
    "integer": ("contrast = 1" + "0" * 5000, "line 1: a number of thousands of digits"),
    "hexadecimal": ("contrast = 0x1" + "0" * 5000, "contrast = 0x1000000"),
    "table name": (f"\n[{'.'.join('a' * 20_000)}]", "line 2: a name of more than 50 parts"),
    "longest table name": (f"[{'.'.join('a' * 50)}]", 'a = {"a": {"a": {"a": '),
    "nested tables": (f"a = 1\nb = {'{a = ' * 400}1{'}' * 400}", "line 2: nested more than 100 deep"),
    "key": (f"{'x' * 5000} = 1", "unknown key 'xxxxx"),
    "quoted key": ('[texture."a\\nb"]\nx = 1', 'texture."a\\nb".x = 1: unknown key'),
    "repeated table name": (f"[{'.'.join('a' * 50)}]\n" * 2, "not valid TOML: "),
}
# Cases that have two things wrong: a misspelt key is missing as well, and an image is, where only its name matters.
MORE_THAN_ONE = {"quoted key": 2, "cutoff over one": 2}
GROUPS = {"wrong": REFUSED, "out of range": OUT_OF_RANGE, "name": NAMES, "huge": HUGE}
CASES = [(group, case) for group, cases in GROUPS.items() for case in cases]


@pytest.mark.parametrize(("group", "case"), CASES)
def test_what_is_wrong_is_refused_with_file_key_value_and_what_is_allowed(
    scene_file: Write, group: str, case: str
) -> None:
    text, message = GROUPS[group][case]
    path = scene_file(text)
    with pytest.raises(InputError) as caught:
        load_scene(path)
    said = str(caught.value)
    assert said.startswith(f"{path}: ")
    assert message in said
    assert said.isprintable()
    assert len(said) < len(path) + 400
    # Checking says the same, with its line; one thing wrong does not cause further complaints.
    findings = check_scene_file(Path(path)).findings
    assert len(findings) == MORE_THAN_ONE.get(case, 1)
    assert all(finding.line is not None for finding in findings)
    told = [form for f in findings for form in (f.text, f"line {f.line}: {f.text}", f"line {f.line}, {f.text}")]
    assert said.removeprefix(f"{path}: ") in told


def test_long_values_are_shortened(scene_file: Write) -> None:
    path = scene_file(f"background = {list(range(1000))}")
    with pytest.raises(InputError, match=r"background = \[0, 1, .*\.\.\.: must be") as caught:
        load_scene(path)
    assert len(str(caught.value)) < len(path) + 150
