"""Values written as TOML read back as exactly the same."""

import struct
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aliasbench.scenes.toml_text import assignment, free_file_name, header, inline_table, safe_file_name, written


@settings(max_examples=200, deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_reads_back_to_the_bit(number: float) -> None:
    again = tomllib.loads(f"x = {written(number)}")["x"]
    assert struct.pack("<d", again) == struct.pack("<d", number)


@settings(max_examples=100, deadline=None)
@given(st.text(max_size=20), st.text(max_size=20))
def test_keys_and_texts_of_any_characters_read_back(key: str, text: str) -> None:
    values: dict[str, object] = {key: text}
    assert tomllib.loads(assignment(key, text)) == values
    assert tomllib.loads(f"t = {inline_table(values)}")["t"] == values
    assert tomllib.loads(header("a", key)) == {"a": {key: {}}}


def test_bools_integers_and_nested_lists_keep_their_kind() -> None:
    value = [True, [1, 2.0, ["x"]], ()]
    assert tomllib.loads(f"x = {written(value)}")["x"] == [True, [1, 2.0, ["x"]], []]
    with pytest.raises(TypeError, match="no TOML for dict"):
        written({})


@pytest.mark.parametrize(
    ("text", "name"),
    [("propeller:blades=5,rev_per_s=2.5", "propeller-blades=5-rev_per_s=2.5"), ("../a b", "a-b"), ("/", "scene")],
)
def test_a_file_name_holds_nothing_that_a_file_system_minds(text: str, name: str) -> None:
    assert safe_file_name(text) == name


def test_a_taken_file_name_is_numbered_whatever_its_case() -> None:
    taken: list[str] = []
    for stem in ("a", "A", "a-2", "a", "b"):
        taken.append(free_file_name(stem, ".exr", taken))
    assert taken == ["a.exr", "A-2.exr", "a-2-2.exr", "a-3.exr", "b.exr"]
