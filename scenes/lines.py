"""Lines of the keys of a TOML text: what the standard reader does not tell.

A scanner of tokens that trusts the text to be valid TOML (the standard reader has accepted it) and follows only what
decides where a key stands: headers, keys, brackets, and strings and comments so that nothing inside them counts.
"""

import re
import tomllib
from collections.abc import Iterator, Mapping

from aliasbench.scenes.problems import Place

# Alternatives in this order: a multi-line string begins like a short one.
_TOKEN = re.compile(
    r"""
    (?P<skip>[ \t\r]+|\#[^\n]*)
    |(?P<newline>\n)
    |(?P<string>\"\"\"(?:[^"\\]+|\\.|"(?!""))*+"{3,5}
        |'''(?:[^']+|'(?!''))*+'{3,5}
        |(?!\"\"\")"[^"\\\n]*+(?:\\.[^"\\\n]*+)*+"
        |(?!''')'[^'\n]*+')
    |(?P<mark>[\[\]{}=,.])
    |(?P<bare>[^\s\[\]{}=,.\#"']+)
    """,
    re.VERBOSE | re.DOTALL,
)
_KEY_BREAK = ("=", "]")
# Keys deeper than this are taken for their table: no scene has any, and names of thousands of parts are a few bytes.
DEEPEST = 12
# What a text may have for the standard reader, which takes a time that grows with the square of a name's parts, and
# up to two microseconds for each token, to read it within seconds. Data of scenes is in strings, each a single token.
MOST_PARTS = 50
MOST_NESTED = 100
MOST_TOKENS = 5_000_000


class _Tokens:
    """The tokens of a text with their lines, one ahead."""

    __slots__ = ("_stream", "kind", "line", "text")

    def __init__(self, text: str) -> None:
        self._stream = self._scan(text)
        self.kind, self.text, self.line = "newline", "\n", 1
        self.advance()

    @staticmethod
    def _scan(text: str) -> Iterator[tuple[str, str, int]]:
        line = 1
        for match in _TOKEN.finditer(text):
            kind = match.lastgroup or ""
            if kind != "skip":
                yield kind, match[0], line
            if kind in ("newline", "string"):
                line += match[0].count("\n")
        yield "end", "", line

    def advance(self) -> None:
        """Go on to the next token."""
        self.kind, self.text, self.line = next(self._stream, ("end", "", self.line))


def key_lines(text: str) -> Mapping[Place, int]:
    """Return the line, from 1, on which each key, table and array entry of a valid TOML text begins.

    Parameters
    ----------
    text : str
        What `tomllib.loads` accepts.

    Returns
    -------
    mapping of tuple of str and int to int
        By keys and indices from the root: ``("object", 2, "spin", "axis")``. A table that is only written as part of
        longer names has the line of the first.
    """
    lines: dict[Place, int] = {(): 1}
    arrays: dict[Place, int] = {}  # entries of arrays of tables so far
    tokens = _Tokens(text)
    table: Place = ()
    while tokens.kind != "end":
        if tokens.kind == "newline":
            tokens.advance()
        elif tokens.text == "[":
            table = _read_header(tokens, lines, arrays)
        else:
            _read_pair(tokens, table, lines)
    return lines


def excess(text: str) -> tuple[int, str] | None:
    """Return the line of a text, TOML or not, from which on it asks too much of a reader, and what is too much there.

    None where it asks nothing of the kind. The time grows with the text's length alone: what is no token ends the
    search, as it ends the reading.
    """
    end = parts = nested = 0
    too_much = None
    for count, match in enumerate(_TOKEN.finditer(text)):
        if match.start() != end:
            return None
        begin, end = match.span()
        if match.lastgroup == "mark":
            mark = text[begin]
            parts = parts + 1 if mark == "." else 0
            if mark in "[{":
                nested += 1
            elif mark in "]}":
                nested -= 1
            if parts >= MOST_PARTS:
                too_much = f"a name of more than {MOST_PARTS} parts"
            elif nested > MOST_NESTED:
                too_much = f"nested more than {MOST_NESTED} deep"
        elif match.lastgroup == "newline":
            parts = 0
        if count >= MOST_TOKENS:
            too_much = f"more than {MOST_TOKENS} numbers, names and marks; long arrays may be data URIs"
        if too_much is not None:
            return text.count("\n", 0, begin) + 1, too_much
    return None


def line_of(lines: Mapping[Place, int], place: Place) -> int:
    """Return the line of a place: its own, or of what it is missing from."""
    while place not in lines:
        place = place[:-1]
    return lines[place]


def _read_header(tokens: _Tokens, lines: dict[Place, int], arrays: dict[Place, int]) -> Place:
    line = tokens.line
    tokens.advance()
    is_array = tokens.text == "[" and tokens.kind == "mark"
    if is_array:
        tokens.advance()
    *outer, last = _read_key(tokens)
    place: Place = ()
    for part in outer:
        place = _below(place, part)
        lines.setdefault(place, line)
        if place in arrays:
            place = _below(place, arrays[place] - 1)
    is_deep = len(place) == DEEPEST
    place = _below(place, last)
    lines.setdefault(place, line)
    if is_deep:
        while tokens.kind not in ("newline", "end"):
            tokens.advance()
        return place
    if is_array:
        arrays[place] = arrays.get(place, 0) + 1
        place = _below(place, arrays[place] - 1)
        lines[place] = line
        tokens.advance()
    else:
        lines[place] = line
    tokens.advance()
    return place


def _read_pair(tokens: _Tokens, table: Place, lines: dict[Place, int]) -> None:
    """Read ``key = value`` of a table and all that the value holds."""
    # Of open brackets: their place, and the index of the entry being read, -1 in an inline table.
    nested: list[tuple[Place, int]] = []
    place = _read_name(tokens, table, lines)
    while True:
        text, kind = tokens.text, tokens.kind
        if kind == "mark" and text in "[{":
            nested.append((place, 0 if text == "[" else -1))
            tokens.advance()
        else:
            # A scalar, possibly of several tokens (1.5, a date with a space), or the end of something empty.
            while tokens.kind in ("bare", "string") or (tokens.kind == "mark" and tokens.text == "."):
                tokens.advance()
        while True:
            while nested and tokens.kind == "newline":
                tokens.advance()
            if not nested:
                return
            if tokens.text in ("]", "}") and tokens.kind == "mark":
                nested.pop()
                tokens.advance()
            elif tokens.text == "," and tokens.kind == "mark":
                if nested[-1][1] >= 0:
                    nested[-1] = (nested[-1][0], nested[-1][1] + 1)
                tokens.advance()
            elif tokens.kind == "end":
                return
            else:
                break
        outer, index = nested[-1]
        if index >= 0:
            place = _below(outer, index)
            lines.setdefault(place, tokens.line)
        else:
            place = _read_name(tokens, outer, lines)


def _read_name(tokens: _Tokens, table: Place, lines: dict[Place, int]) -> Place:
    """Read a key with its ``=`` and return its place."""
    line = tokens.line
    place = table
    for part in _read_key(tokens):
        place = _below(place, part)
        lines.setdefault(place, line)
    tokens.advance()
    return place


def _below(place: Place, part: str | int) -> Place:
    return (*place, part) if len(place) < DEEPEST else place


def _read_key(tokens: _Tokens) -> list[str]:
    """Read a key, dotted or not, up to what follows it."""
    parts: list[str] = []
    while tokens.kind != "end" and not (tokens.kind == "mark" and tokens.text in _KEY_BREAK):
        if tokens.kind == "string":
            parts.append(_unquoted(tokens.text))
        elif tokens.kind == "bare":
            parts.append(tokens.text)
        tokens.advance()
    return parts or [""]


def _unquoted(text: str) -> str:
    return str(tomllib.loads(f"{text} = 1").popitem()[0])
