"""Values and names as messages show them: short, on one line, and without anything that a terminal would act upon.

Scene names, paths and values come from files and shells, and may hold escape sequences, line breaks or thousands of
digits. What is stored and exported stays as it was given; only what people read goes through here.
"""

import re

from aliasbench.scenes.errors import printable as printable

SHOWN = 60  # characters of a value in a message
LONGEST_WORD = 200  # long paths stay whole, endless values do not


def shortened(text: str, limit: int = SHOWN) -> str:
    """Return a text of at most `limit` characters: of a longer one its two ends."""
    if len(text) <= limit:
        return text
    head = (limit - 1) // 2
    return f"{text[:head]}…{text[head + 1 - limit :]}"


def shown(value: object) -> str:
    """Return a value as Python writes it, shortened; also values that Python cannot write."""
    try:
        return shortened(repr(value))
    except RecursionError:
        return "a value nested too deeply to be shown"
    except ValueError:
        return "a number too long to be shown"


def sentence(text: str) -> str:
    """Return a message as one printable line in which no word is endless."""
    words = re.sub(rf"\S{{{LONGEST_WORD + 1},}}", lambda match: shortened(match[0]), " ".join(text.split()))
    return printable(words)


def duration(seconds: float) -> str:
    """Return a time in three digits with the unit that suits it: 12.3 ms, 7.5 s, 20 min, 3 h."""
    if seconds < 0.9995:
        return f"{seconds * 1e3:.3g} ms"
    if seconds < 119.5:
        return f"{seconds:.3g} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{round(seconds / 3600)} h"


def certainty(uncertainty: float, kind: str | None) -> str:
    """Return how well a reference is known: certified to a bound, or by a 99 % confidence interval of its samples."""
    return f"{'99 % confident' if kind == 'confidence' else 'certified'} to {uncertainty:.2g}"
