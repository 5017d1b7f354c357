"""Lines of keys: the scanner finds what the standard reader finds, on the lines on which it was written."""

import tomllib
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aliasbench.scenes.lines import MOST_NESTED, MOST_PARTS, excess, key_lines, line_of
from aliasbench.scenes.problems import Place
from aliasbench.scenes.toml_text import key_text, written

TRICKY = '''# c [x]
schema = 1
a.b."c d" = "]#"   # dotted
m = """
[no]
x = 1 \\"""
""""
n = \'\'\'
[no]\'\'\'\'
[camera]
up = [0, # "one [
  1.5,
  -2e-3
]
d = 1979-05-27 07:32:00
[[object]]
quad = [[0, 0], [1,
 1]]
spin = { axis = [1, 2], center.x = 1, e = {} }
[object.extra]
q = 1
[[object]]
poly = [ {x = 1},
 {x = 2, y = [{z = 1}]} ]
[[object.inner]]
k = 1
[[object.inner]]
k = 2
[ texture . "a b".'c.d' ]
z = 1.5
e = []
"" = 1
'''


def places(value: object, at: Place = ()) -> Iterator[Place]:
    yield at
    if isinstance(value, dict):
        for key, item in value.items():
            yield from places(item, (*at, key))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from places(item, (*at, index))


def test_every_way_of_writing_a_key_has_its_line() -> None:
    lines = key_lines(TRICKY)
    assert set(lines) == set(places(tomllib.loads(TRICKY)))
    expected: dict[Place, int] = {
        ("schema",): 2,
        ("a", "b", "c d"): 3,
        ("m",): 4,
        ("n",): 8,
        ("camera", "up"): 11,
        ("camera", "up", 2): 13,
        ("camera", "d"): 15,
        ("object", 0): 16,
        ("object", 0, "quad", 1, 1): 18,
        ("object", 0, "spin", "center", "x"): 19,
        ("object", 0, "extra", "q"): 21,
        ("object", 1): 22,
        ("object", 1, "poly", 1, "y", 0, "z"): 24,
        ("object", 1, "inner", 1, "k"): 28,
        ("texture", "a b", "c.d", "z"): 30,
        ("texture", "a b", "c.d", ""): 32,
    }
    assert {place: lines[place] for place in expected} == expected


@pytest.mark.parametrize(("place", "line"), [(("object", 1, "gone", 3), 22), (("gone",), 1), (("camera", "fov"), 10)])
def test_what_is_missing_is_where_it_is_missing_from(place: Place, line: int) -> None:
    assert line_of(key_lines(TRICKY), place) == line


VALUES = st.recursive(
    st.integers(-9, 9) | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=6) | st.booleans(),
    lambda inner: st.lists(inner, max_size=3),
    max_leaves=6,
)
TABLES = st.dictionaries(st.text(max_size=5), VALUES, max_size=4)


@settings(max_examples=60, deadline=None)
@given(st.dictionaries(st.text(min_size=1, max_size=5), TABLES | st.lists(TABLES, min_size=1, max_size=3), max_size=4))
def test_keys_are_found_on_the_lines_on_which_they_were_written(file: dict[str, object]) -> None:
    text: list[str] = []
    expected: dict[Place, int] = {}
    for name, content in file.items():
        entries = content if isinstance(content, list) else [content]
        for index, table in enumerate(entries):
            place: Place = (name, index) if isinstance(content, list) else (name,)
            text.append(f"[[{key_text(name)}]]" if isinstance(content, list) else f"[{key_text(name)}] # [x]")
            expected[place] = len(text)
            for key, value in table.items():
                text.append(f"{key_text(key)} = {written(value)}")
                expected[(*place, key)] = len(text)
    joined = "\n".join(text)
    assert tomllib.loads(joined) == file
    lines = key_lines(joined)
    assert set(lines) == set(places(file))
    assert {place: lines[place] for place in expected} == expected


@pytest.mark.parametrize(
    "text",
    [
        f"[{'.'.join('a' * MOST_PARTS)}]\n{' . '.join('b' * MOST_PARTS)} = 1",
        f"a = {'[' * MOST_NESTED}{']' * MOST_NESTED}\n" * 3,
        f'a = \'{"[." * 1000}\' # {"{." * 1000}\nb = """\n{"a." * 1000}"""\nc = [{"1.5, " * 1000}]',
    ],
)
def test_what_is_within_strings_and_comments_is_not_counted(text: str) -> None:
    assert excess(text) is None


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (f"# a\n\n{'.'.join('b' * (MOST_PARTS + 1))} = 1", "a name of more than 50 parts"),
        ("\n\n[[" + ".".join(['"b"'] * (MOST_PARTS + 1)) + "]]", "a name of more than 50 parts"),
        (f"a = [\n1,\n{'[' * MOST_NESTED}", "nested more than 100 deep"),
    ],
)
def test_what_is_too_much_is_told_with_its_line(text: str, found: str) -> None:
    assert excess(text) == (3, found)


def test_the_time_to_look_grows_with_the_length_whatever_the_text_is() -> None:
    # A string that never ends is looked for once, not from every line on.
    assert excess('\\"""\n' * 100_000) is None
    assert excess(f"x {chr(39) * 3}\n" * 100_001) is None
