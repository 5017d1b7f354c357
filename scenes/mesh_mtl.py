"""The materials of OBJ files (MTL): of each its diffuse colour Kd, as linear light, and its texture map_Kd.

Names are bytes of an encoding that nobody wrote down: what is not UTF-8 of them is kept as it is, so that two names
never become one and a file of that name is found. Lines end where bytes say so, not where Unicode might. Source:
Wavefront, Object Files (.obj), version 3.0, and the MTL format that goes with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from aliasbench.scenes.errors import InputError, shortened
from aliasbench.scenes.limits import RADIANCE
from aliasbench.scenes.local_files import is_local, path_beside, read_local
from aliasbench.scenes.mesh_parts import parse_numbers
from aliasbench.scenes.model import Vec3

_MOST_LIBRARIES = 64


@dataclass(frozen=True, slots=True)
class Material:
    """What a material says.

    Attributes
    ----------
    color : Vec3
        Linear RGB.
    image : str or None
        The path of its texture, with slashes, as the file writes it.
    name : str
    image_place : str
        Where the texture is named, for messages.
    """

    color: Vec3 = (1.0, 1.0, 1.0)
    image: str | None = None
    name: str = ""
    image_place: str = ""


def decoded(name: bytes) -> str:
    """Return a name of a file as text, in which a byte that is not UTF-8 is still told apart from any other."""
    return name.strip().decode("utf-8", "surrogateescape")


def read_materials(libraries: Sequence[str], path: Path) -> dict[str, Material]:
    """Return the materials of the libraries that lines mtllib of the OBJ file at `path` name.

    Raises
    ------
    InputError
        If a library is missing or not beside the file, or a line of it cannot be read.
    """
    out: dict[str, Material] = {}
    what = f"{path}: mtllib"
    files = [found for line in libraries[: _MOST_LIBRARIES + 1] for found in _library_files(line, path, what)]
    if len(files) > _MOST_LIBRARIES:
        raise InputError(f"{path}: names more than {_MOST_LIBRARIES} material libraries; so many are allowed")
    for name, library in files:
        data = read_local(library, f"{what}: {shortened(ascii(name))}")
        current = ""
        for number, line in enumerate(data.splitlines(), 1):
            words = line.split(None, 1)
            if len(words) < 2:
                continue
            key, rest = words
            place = f"{path}: {library.name}: line {number}"
            if key == b"newmtl":
                current = decoded(rest)
                out[current] = Material(name=current)
            elif key == b"Kd" and current in out:
                out[current] = replace(out[current], color=_color(rest, place))
            elif key == b"map_Kd" and current in out:
                out[current] = replace(out[current], image=_image_name(decoded(rest), place), image_place=place)
    return out


def _library_files(line: str, path: Path, what: str) -> list[tuple[str, Path]]:
    """Return the names and files of a line mtllib: several names, or one with blanks in it if it is a file's."""
    whole = path_beside(path.parent, line.replace("\\", "/"), what, escaped=False)
    names = [line] if is_local(whole) else line.split()[: _MOST_LIBRARIES + 1]
    return [(name, path_beside(path.parent, name.replace("\\", "/"), what, escaped=False)) for name in names]


def _color(rest: bytes, place: str) -> Vec3:
    numbers = parse_numbers(rest, place).tolist()
    if len(numbers) not in (1, 3) or not all(0.0 <= n <= RADIANCE for n in numbers):
        raise InputError(
            f"{place}: Kd {shortened(ascii(decoded(rest))[1:-1])} must be one number or three from 0 to {RADIANCE:g}"
        )
    red, green, blue = numbers if len(numbers) == 3 else numbers * 3
    return (red, green, blue)


def _image_name(rest: str, place: str) -> str:
    if rest.startswith("-"):
        raise InputError(f"{place}: map_Kd has options ({shortened(ascii(rest))}); a path alone is read")
    return rest.replace("\\", "/")
