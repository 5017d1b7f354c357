"""Values and names in messages."""

import pytest

from aliasbench.bench.wording import SHOWN, certainty, duration, printable, sentence, shortened, shown


def test_only_what_does_not_print_is_written_out() -> None:
    assert printable("Größe 测试 – x") == "Größe 测试 – x"
    assert printable("a\x1b[31m\r\n\x9b\u202e\udcff") == r"a\x1b[31m\r\n\x9b\u202e\udcff"


@pytest.mark.parametrize("length", [0, SHOWN - 1, SHOWN, SHOWN + 1, 10_000])
def test_of_a_long_text_the_two_ends_are_left(length: int) -> None:
    text = "".join(chr(0x4E00 + i) for i in range(length))
    short = shortened(text)
    assert len(short) == min(length, SHOWN)
    head, _, tail = short.partition("…")
    assert text.startswith(head)
    assert text.endswith(tail)


def test_every_value_can_be_shown() -> None:
    nested: object = 1
    for _ in range(100_000):
        nested = [nested]
    assert shown([1, "a"]) == "[1, 'a']"
    assert shown(16**9000) == "a number too long to be shown"
    assert shown(nested) == "a value nested too deeply to be shown"
    while isinstance(nested, list):
        nested = nested.pop()


def test_a_sentence_is_one_line_without_endless_words_and_keeps_paths() -> None:
    path = "/" + "/".join(["folder"] * 25)
    assert sentence(f"cannot write\n{path!r}:  no") == f"cannot write {path!r}: no"
    assert len(sentence("x" * 5000 + " y")) == SHOWN + 2


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 ms"),
        (0.00123, "1.23 ms"),
        (0.9994, "999 ms"),
        (0.9996, "1 s"),
        (7.5, "7.5 s"),
        (119.4, "119 s"),
        (119.6, "2 min"),
        (3600 * 1.99, "119 min"),
        (3600 * 2.0, "2 h"),
    ],
)
def test_a_duration_has_the_unit_that_suits_it(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_a_bound_and_a_confidence_interval_read_differently() -> None:
    assert certainty(2.31e-9, "bound") == "certified to 2.3e-09"
    assert certainty(7e-4, "confidence") == "99 % confident to 0.0007"
