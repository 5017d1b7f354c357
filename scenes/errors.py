"""The errors a user can cause, and the sentence that helps: what was given, what is allowed, what was probably meant.

Everything that refuses input raises `InputError` (the command line turns it into one sentence and exit code 2); a
renderer that cannot do a valid scene raises `UnsupportedScene` (a record, not a failure of the run).
"""

import re
from bisect import bisect_left
from collections.abc import Iterable
from difflib import get_close_matches

LONGEST_WORD = 1000  # characters: any path is shorter
_ENDLESS = re.compile(rf"\S{{{LONGEST_WORD + 1},}}")
SHOWN = 60  # characters of a value in a message
MOST_LISTED, LISTED = 100, 20  # of more known names than the first, so many are listed as the second says


def printable(text: str) -> str:
    """Return a text with everything that does not print (escapes, line breaks, bytes of no encoding) written out."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def one_line(text: str) -> str:
    """Return a text as one printable line in which no word is endless."""
    half = LONGEST_WORD // 2
    return printable(_ENDLESS.sub(lambda word: f"{word[0][:half]}...{word[0][-half:]}", text))


class InputError(ValueError):
    """Bad usage or input; the message is one sentence naming the value and what is allowed, in one line."""

    def __init__(self, message: object) -> None:
        # What a message quotes comes from anywhere.
        super().__init__(one_line(str(message)))


class NotAvailableError(InputError):
    """A documented feature that this version does not have yet."""


class UnsupportedScene(Exception):  # noqa: N818 - the name is part of the public contract
    """A valid scene that this renderer cannot render; the message names the feature."""


def shortened(text: str) -> str:
    """Return a text as a message quotes it: whole, or its beginning where it is long."""
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."


def reason_of(error: Exception) -> str:
    """Return what the system says of an error, without its number and file, or what the error itself says."""
    return getattr(error, "strerror", None) or str(error)


def unknown_name(kind: str, given: str, known: Iterable[str]) -> InputError:
    """Return the error for a name that is in no registry, with the nearest match and the known ones.

    Parameters
    ----------
    kind : str
        What the name should have been, for example ``"scene"``.
    given : str
        The name as the user wrote it.
    known : iterable of str
        Every name that would have been right.
    """
    names = sorted(known)
    given = shortened(given)
    near = nearest(given, names)
    hint = f"; did you mean {near!r}?" if near else ";"
    more = ""
    if len(names) > MOST_LISTED:
        more = f" and {len(names) - LISTED} more"
        first = min(max(0, bisect_left(names, given) - LISTED // 2), len(names) - LISTED)
        names = names[first : first + LISTED]
    return InputError(f"unknown {kind} {given!r}{hint} known: {', '.join(map(shortened, names)) or 'none'}{more}")


def nearest(given: str, known: Iterable[str]) -> str | None:
    """Return the known name that was probably meant, None where none is near."""
    return next(iter(get_close_matches(shortened(given), list(known), n=1, cutoff=0.5)), None)
