"""Values as a TOML file writes them, read back as exactly the same; Python's standard library only reads TOML."""

import json
import re
from collections.abc import Collection, Mapping, Sequence

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def written(value: object) -> str:
    """Return a text, number, bool or nested list of them in TOML; floats so that they read back to the bit."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # JSON's strings are TOML's, but for the delete character, which TOML wants escaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, Sequence):
        return f"[{', '.join(map(written, value))}]"
    raise TypeError(f"no TOML for {type(value).__name__}")


def key_text(key: str) -> str:
    """Return a key, quoted where it must be."""
    return key if _BARE_KEY.fullmatch(key) else written(key)


def assignment(key: str, value: object) -> str:
    """Return ``key = value``."""
    return f"{key_text(key)} = {written(value)}"


def inline_table(values: Mapping[str, object]) -> str:
    """Return ``{ key = value, ... }``."""
    return f"{{ {', '.join(assignment(key, value) for key, value in values.items())} }}"


def header(*keys: str) -> str:
    """Return ``[key.key]``."""
    return f"[{'.'.join(map(key_text, keys))}]"


def safe_file_name(text: str) -> str:
    """Return a text as part of a file's name that any file system takes."""
    return re.sub(r"[^A-Za-z0-9._=+-]+", "-", text)[:80].strip("-.") or "scene"


def free_file_name(stem: str, suffix: str, taken: Collection[str]) -> str:
    """Return a file's name that is not taken, numbered where it must be; to some file systems upper case is lower."""
    name, number = f"{stem}{suffix}", 2
    while name.lower() in {other.lower() for other in taken}:
        name, number = f"{stem}-{number}{suffix}", number + 1
    return name
