"""Pictures in files: EXR holds exactly the float32 values, PNG is sRGB encoded for people.

A file appears under its name only when it is complete (written beside it and renamed), so that a run that is killed
leaves no torn picture behind. OpenImageIO does the encoding, and is imported only when a picture is read or written.
"""

import os
import secrets
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError, reason_of, unknown_name
from aliasbench.scenes.textures import linear_to_srgb

EXTENSIONS = (".exr", ".png")
TEMPORARY_PREFIX = ".writing-"


def check_output(path: Path) -> None:
    """Refuse a picture's path that could not be written, before anything is rendered.

    Raises
    ------
    InputError
        If the extension is not known, the folder is missing or not writable, or the path is a folder.
    """
    if path.suffix.lower() not in EXTENSIONS:
        raise unknown_name(f"extension of {str(path)!r}:", path.suffix, EXTENSIONS)
    folder = path.parent
    check_folder_name(folder)
    try:
        if not folder.is_dir():
            raise InputError(f"cannot write {str(path)!r}: no such folder {str(folder)!r}")
        if path.is_dir():
            raise InputError(f"cannot write {str(path)!r}: it is a folder")
        make_temporary(folder).unlink()
    except OSError as error:
        raise InputError(f"cannot write {str(path)!r}: {reason_of(error)}") from None


def make_temporary(folder: Path, suffix: str = "") -> Path:
    """Return the path of a new, empty file in a folder, to be renamed when it is complete.

    Who may read it is what the umask says, as of any file; those of `tempfile` are for their owner alone.
    """
    path = folder / f"{TEMPORARY_PREFIX}{secrets.token_hex(8)}{suffix}"
    path.touch(exist_ok=False)
    return path


def check_folder_name(folder: Path) -> None:
    """Raise `InputError` for a folder in which OpenImageIO could not write: its file names are UTF-8 alone."""
    try:
        str(folder).encode()
    except UnicodeEncodeError:
        raise InputError(f"cannot write into {str(folder)!r}: its name is not UTF-8") from None


def write_image(path: Path, pixels: NDArray[np.floating]) -> None:
    """Write a picture as its extension says, all of it or nothing.

    Parameters
    ----------
    path : Path
        ``.exr`` (float32, linear; float64 is rounded) or ``.png`` (8 bits, sRGB, clamped to [0, 1]).
    pixels : (h, w, 3) float
        Linear radiance, row 0 at the top.

    Raises
    ------
    InputError
        If the extension is not known or the file cannot be written.
    """
    if path.suffix.lower() not in EXTENSIONS:
        raise unknown_name(f"extension of {str(path)!r}:", path.suffix, EXTENSIONS)
    if pixels.ndim != 3 or pixels.shape[2] != 3:
        raise ValueError(f"pixels must be (h, w, 3), not {pixels.shape}")
    try:
        temporary = make_temporary(path.parent, path.suffix.lower())
    except OSError as error:
        raise InputError(f"cannot write {str(path)!r}: {reason_of(error)}") from None
    try:
        _encode(temporary, pixels)
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        temporary.replace(path)
    except OSError as error:
        raise InputError(f"cannot write {str(path)!r}: {reason_of(error)}") from None
    finally:
        temporary.unlink(missing_ok=True)


def _encode(path: Path, pixels: NDArray[np.floating]) -> None:
    import OpenImageIO as oiio

    height, width = pixels.shape[:2]
    if path.suffix == ".exr":
        spec = oiio.ImageSpec(width, height, 3, oiio.FLOAT)
        spec.attribute("compression", "zip")
        # Otherwise the time of writing: the same pixels shall be the same bytes.
        spec.attribute("DateTime", "1970:01:01 00:00:00")
        # what float32 cannot hold is infinite in the file
        with np.errstate(over="ignore"):
            data = np.ascontiguousarray(pixels, dtype=np.float32)
    else:
        spec = oiio.ImageSpec(width, height, 3, oiio.UINT8)
        spec.attribute("oiio:ColorSpace", "sRGB")
        shown = np.nan_to_num(np.asarray(pixels, dtype=np.float64), nan=0.0, posinf=1.0, neginf=0.0)
        data = np.rint(linear_to_srgb(shown) * 255.0).astype(np.uint8)
    output = oiio.ImageOutput.create(str(path))
    if output is None or not output.open(str(path), spec):
        raise OSError(f"OpenImageIO cannot open it ({(output.geterror() if output else oiio.geterror()).strip()})")
    complete = output.write_image(data)
    if not output.close() or not complete:
        raise OSError(f"OpenImageIO cannot write it ({output.geterror().strip()})")


def read_image(path: Path) -> NDArray[np.float32]:
    """Return a picture that `write_image` wrote as EXR, (h, w, 3) float32, bit for bit.

    Raises
    ------
    InputError
        If the file is missing or is not a picture of three or more channels.
    """
    import OpenImageIO as oiio

    if not path.is_file():
        raise InputError(f"picture {str(path)!r}: no such file")
    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise InputError(f"picture {str(path)!r}: cannot be read ({oiio.geterror().strip()})")
    try:
        data = source.read_image(0, 0, 0, 3, oiio.FLOAT)
        reason = source.geterror().strip()
    finally:
        source.close()
    if data is None or data.ndim != 3 or data.shape[2] != 3:
        raise InputError(f"picture {str(path)!r}: cannot be read ({reason or 'it has fewer than 3 channels'})")
    return np.asarray(data, dtype=np.float32)


def remove_unfinished(folder: Path) -> None:
    """Remove what writers that were killed left in a folder."""
    for path in folder.glob(f"{TEMPORARY_PREFIX}*"):
        path.unlink(missing_ok=True)
