"""Makes ``lantern.glb``: a paper lantern with a lattice, pleated, in a frame of wood; the project's own small model.

A model file made by hand here rather than by a modelling program: all of it can be read, changed and made again, to
the byte. It has what a usual glTF file has (two meshes, nodes with transforms, an indexed primitive with a texture
that repeats, a material that is a plain colour, an animation that turns it once in four seconds), in a few KiB.

Run as ``python -m aliasbench.scenes.assets.make_lantern``; a test makes it again and compares.
"""

import json
import math
import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

PATH = Path(__file__).parent / "lantern.glb"
PLEATS, RINGS = 16, 8
TILE = 32  # texels across one period of the lattice
TILES_AROUND, TILES_UP = 16, 5
TURN_S = 4.0
_FLOAT, _UNSIGNED_SHORT = 5126, 5123


def lantern_glb() -> bytes:
    """Return the model file's bytes."""
    body, frame = _body(), _frame()
    turn = np.array([[0.0, math.sin(math.pi * k / 4), 0.0, math.cos(math.pi * k / 4)] for k in range(5)], "<f4")
    blocks = [
        *(array.tobytes() for array in (*body, *frame)),
        np.linspace(0.0, TURN_S, 5).astype("<f4").tobytes(),
        turn.tobytes(),
        _png(_tile()),
    ]
    starts = np.cumsum([0, *(len(b) + -len(b) % 4 for b in blocks)]).tolist()
    binary = b"".join(block + bytes(-len(block) % 4) for block in blocks)
    points, uv, corners = body
    frame_points, frame_corners = frame
    accessors = [
        _accessor(0, points, "VEC3", _FLOAT),
        _accessor(1, uv, "VEC2", _FLOAT),
        _accessor(2, corners.reshape(-1, 1), "SCALAR", _UNSIGNED_SHORT),
        _accessor(3, frame_points, "VEC3", _FLOAT),
        _accessor(4, frame_corners.reshape(-1, 1), "SCALAR", _UNSIGNED_SHORT),
        {**_accessor(5, np.zeros((5, 1)), "SCALAR", _FLOAT), "min": [0.0], "max": [TURN_S]},
        _accessor(6, turn, "VEC4", _FLOAT),
    ]
    unlit: dict[str, object] = {"KHR_materials_unlit": {}}
    document = {
        "asset": {"version": "2.0", "generator": "aliasbench make_lantern", "copyright": "MIT"},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"name": "lantern", "children": [1, 2, 3]},
            {"name": "paper", "mesh": 0},
            {"name": "top", "mesh": 1, "translation": [0.0, 1.0, 0.0]},
            {"name": "bottom", "mesh": 1, "translation": [0.0, -1.0, 0.0], "scale": [1.0, -1.0, 1.0]},
        ],
        "meshes": [
            {
                "name": "paper",
                "primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}],
            },
            {"name": "frame", "primitives": [{"attributes": {"POSITION": 3}, "indices": 4, "material": 1}]},
        ],
        "materials": [
            {"name": "paper", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "extensions": unlit},
            {"name": "wood", "pbrMetallicRoughness": {"baseColorFactor": [0.18, 0.07, 0.03, 1.0]}, "extensions": unlit},
        ],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 10497, "wrapT": 10497}],
        "images": [{"name": "lattice", "mimeType": "image/png", "bufferView": 7}],
        "animations": [
            {
                "name": "turn",
                "samplers": [{"input": 5, "output": 6, "interpolation": "LINEAR"}],
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}],
            }
        ],
        "accessors": accessors,
        "bufferViews": [
            {"buffer": 0, "byteOffset": s, "byteLength": len(b)} for s, b in zip(starts, blocks, strict=False)
        ],
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def _body() -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint16]]:
    """Return the pleated paper: a barrel whose radius goes in and out around it, with its lattice's coordinates."""
    columns = 2 * PLEATS
    around, up = np.meshgrid(np.arange(columns + 1), np.arange(RINGS + 1))
    height = 2.0 * up / RINGS - 1.0
    radius = (0.45 + 0.4 * np.sqrt(1.0 - 0.9 * height**2)) * np.where(around % 2 == 0, 1.0, 0.93)
    angle = 2 * np.pi * (around % columns) / columns
    points = np.stack([radius * np.sin(angle), height, radius * np.cos(angle)], axis=-1)
    # v down, as the format has it.
    uv = np.stack([TILES_AROUND * around / columns, TILES_UP * (1.0 - up / RINGS)], axis=-1)
    return points.reshape(-1, 3).astype("<f4"), uv.reshape(-1, 2).astype("<f4"), _grid(columns, RINGS)


def _frame() -> tuple[NDArray[np.float32], NDArray[np.uint16]]:
    """Return a lid: a ring that closes the barrel's end, and a low cap on it."""
    columns = 2 * PLEATS
    outline = np.array([(0.66, -0.06), (0.66, 0.04), (0.3, 0.1), (0.12, 0.3), (0.0, 0.3)])
    around, along = np.meshgrid(np.arange(columns + 1), np.arange(len(outline)))
    angle = 2 * np.pi * (around % columns) / columns
    radius, height = outline[along, 0], outline[along, 1]
    points = np.stack([radius * np.sin(angle), height, radius * np.cos(angle)], axis=-1)
    return points.reshape(-1, 3).astype("<f4"), _grid(columns, len(outline) - 1)


def _grid(columns: int, rows: int) -> NDArray[np.uint16]:
    number = np.arange((columns + 1) * (rows + 1)).reshape(rows + 1, columns + 1)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3).astype("<u2")


def _tile() -> NDArray[np.uint8]:
    """Return one period of the lattice (TILE, TILE, 3), sRGB: paper, a thick bar and thin ones across it."""
    row, column = np.mgrid[:TILE, :TILE]
    paper = np.array([255.0, 214.0, 140.0]) * (0.85 + 0.15 * np.sin(np.pi * (row + 0.5) / TILE)[..., None])
    bars = (row < 3) | (column < 2) | (column == TILE // 2) | (row == TILE // 2)
    return np.where(bars[..., None], np.array([70.0, 20.0, 12.0]), paper).round().astype(np.uint8)


def _png(pixels: NDArray[np.uint8]) -> bytes:
    height, width = pixels.shape[:2]

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")


def _accessor(view: int, values: NDArray[np.generic], kind: str, component: int) -> dict[str, object]:
    out: dict[str, object] = {"bufferView": view, "componentType": component, "count": len(values), "type": kind}
    if kind == "VEC3":
        out |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
    return out


if __name__ == "__main__":
    PATH.write_bytes(lantern_glb())
