"""Texels as an EXR file's bytes: float32 RGBA, compressed without loss, the same bytes for the same texels."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError


def exr_bytes(texels: NDArray[np.float32]) -> bytes:
    """Return the EXR file of texels (h, w, 4), float32, bottom row first; `load_image` reads them back to the bit.

    Raises
    ------
    InputError
        If it cannot be written to the temporary folder.
    """
    import OpenImageIO as oiio

    height, width = texels.shape[:2]
    spec = oiio.ImageSpec(width, height, 4, oiio.FLOAT)
    spec.attribute("compression", "zip")
    # Otherwise the time of writing.
    spec.attribute("DateTime", "1970:01:01 00:00:00")
    with TemporaryDirectory(prefix="aliasbench-") as folder:
        path = Path(folder) / "texels.exr"
        output = oiio.ImageOutput.create(str(path))
        if output is None or not output.open(str(path), spec):
            raise InputError(f"cannot write an image to {folder!r}: {(output or oiio).geterror().strip()}")
        complete = output.write_image(np.ascontiguousarray(texels[::-1], dtype=np.float32))
        if not output.close() or not complete:
            raise InputError(f"cannot write an image to {folder!r}: {output.geterror().strip()}")
        return path.read_bytes()
