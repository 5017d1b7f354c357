"""The buffers of a glTF file, each read when something in it is needed, and each file once however often it is named.

A few hundred characters can name a file of a gigabyte forty times. So what the buffers come to is counted before any is
read, and read is what is drawn.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.gltf_data_uris import decode_data_uri
from aliasbench.scenes.local_files import MOST_BYTES, path_beside, read_local, size_of_local
from aliasbench.scenes.schema import Table


class Buffers:
    """The buffers of a file.

    Parameters
    ----------
    tables : sequence of Table
        The file's list of buffers.
    binary : bytes or None
        The binary chunk of a GLB file.
    folder : Path
        Where the files that it names must be.

    Raises
    ------
    InputError
        If one is missing, is not beside the file, is shorter than it should be; or if all are larger than is allowed.
    """

    __slots__ = ("_binary", "_files", "_paths", "_read", "_tables", "size")

    def __init__(self, tables: Sequence[Table], binary: bytes | None, folder: Path) -> None:
        self._tables = tables
        self._binary = binary
        self._paths: dict[int, Path] = {}
        self._files: dict[Path, bytes] = {}
        self._read: dict[int, NDArray[np.uint8]] = {}
        sizes: dict[Path | int, int] = {}
        for k, table in enumerate(tables):
            length = table.whole("byteLength", at_least=1)
            uri = table.text("uri") if table.has("uri") else ""
            if not uri:
                if k != 0 or binary is None:
                    table.refuse("uri", "given: only the first buffer of a GLB file is inside it")
                sizes[k] = len(binary)
                self._check_length(table, length, len(binary))
            elif uri.startswith("data:"):
                sizes[k] = 3 * len(uri) // 4
            else:
                path = path_beside(folder, uri, _place(table), escaped=True)
                if path not in sizes:
                    sizes[path] = size_of_local(path, f"{_place(table)}: buffer {path.name!r}")
                self._paths[k] = path
                self._check_length(table, length, sizes[path])
        self.size = sum(sizes.values())
        if self.size > MOST_BYTES:
            raise InputError(f"{tables[0].file}: buffers: come to {self.size} bytes; at most {MOST_BYTES} are allowed")

    def bytes_of(self, index: int) -> NDArray[np.uint8]:
        """Return the content of a buffer."""
        if index not in self._read:
            table = self._tables[index]
            data = self._content(index)
            length = table.whole("byteLength", at_least=1)
            self._check_length(table, length, len(data))
            self._read[index] = np.frombuffer(data, np.uint8)[:length]
        return self._read[index]

    def _content(self, index: int) -> bytes:
        table = self._tables[index]
        path = self._paths.get(index)
        if path is not None:
            if path not in self._files:
                self._files[path] = read_local(path, f"{_place(table)}: buffer {path.name!r}")
            return self._files[path]
        if table.has("uri"):
            return decode_data_uri(table.text("uri"), _place(table))
        return self._binary or b""

    def _check_length(self, table: Table, length: int, size: int) -> None:
        if length > size:
            table.refuse("byteLength", f"at most {size}, the bytes that are there (cut off?)")


def _place(table: Table) -> str:
    return f"{table.file}: {table.path}"
