"""The errors a user can cause, and the sentence that helps: what was given, what is allowed, what was probably meant.

Everything that refuses input raises `InputError` (the command line turns it into one sentence and exit code 2); a
renderer that cannot do a valid scene raises `UnsupportedScene` (a record, not a failure of the run).
"""

from collections.abc import Iterable
from difflib import get_close_matches

SHOWN = 60  # characters of a value in a message


class InputError(ValueError):
    """Bad usage or input; the message is one sentence naming the value and what is allowed."""


class NotAvailableError(InputError):
    """A documented feature that this version does not have yet."""


class UnsupportedScene(Exception):  # noqa: N818 - the name is part of the public contract
    """A valid scene that this renderer cannot render; the message names the feature."""


def shortened(text: str) -> str:
    """Return a text as a message quotes it: whole, or its beginning where it is long."""
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."


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
    near = get_close_matches(given, names, n=1, cutoff=0.5)
    hint = f"; did you mean {near[0]!r}?" if near else ";"
    return InputError(f"unknown {kind} {given!r}{hint} known: {', '.join(names) or 'none'}")
