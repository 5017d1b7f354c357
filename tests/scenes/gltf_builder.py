"""glTF documents in the making, for tests: a square of the unit's size with whatever it is to be tried with.

Tests get this module as the fixture `gltf`.
"""

import json
import struct
from collections.abc import Mapping
from io import BytesIO
from typing import Any

import numpy as np
from PIL import Image

SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
UV = [(0, 1), (1, 1), (1, 0), (0, 0)]  # v down: the square's bottom-left corner is the image's
CORNERS = [0, 1, 2, 0, 2, 3]
COMPONENTS = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125, "i2": 5122}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
FOUR = [[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [128, 128, 128]]]  # top row first


class Builder:
    """A glTF document in the making: arrays are added, indices of accessors come back."""

    def __init__(self) -> None:
        self.data = b""
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "accessors": [],
            "bufferViews": [],
        }

    def view(self, data: bytes, **more: Any) -> int:
        views = self.document["bufferViews"]
        views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **more})
        self.data += data + bytes(-len(data) % 4)
        return len(views) - 1

    def array(self, values: Any, kind: str = "f4", **more: Any) -> int:
        array = np.array(values, "<" + kind)
        array = array.reshape(len(array), -1)
        entry = {"bufferView": self.view(array.tobytes()), "componentType": COMPONENTS[kind], **more}
        self.document["accessors"].append({**entry, "count": len(array), "type": KINDS[array.shape[1]]})
        return len(self.document["accessors"]) - 1

    def square(self, **more: Any) -> dict[str, Any]:
        attributes = {"POSITION": self.array(SQUARE), "TEXCOORD_0": self.array(UV)}
        return {"attributes": attributes, "indices": self.array(CORNERS, "u2"), **more}

    def bytes(self, **changes: Any) -> bytes:
        document = {**self.document, "buffers": [{"byteLength": len(self.data)}], **changes}
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self.data), b"BIN\0") + self.data
        return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def png(pixels: Any) -> bytes:
    """Return pixels as the bytes of a PNG file."""
    out = BytesIO()
    Image.fromarray(np.array(pixels, np.uint8)).save(out, "PNG")
    return out.getvalue()


def textured(pixels: Any = FOUR, *, sampler: Mapping[str, Any] | None = None, **material: Any) -> Builder:
    """Return the square with a texture; keys are the material's, `info` those of its texture."""
    builder = Builder()
    info = {"index": 0, **material.pop("info", {})}
    factor = material.pop("factor", [1, 1, 1, 1])
    image = builder.view(png(pixels))
    builder.document |= {
        "images": [{"bufferView": image, "mimeType": "image/png"}],
        "textures": [{"source": 0, **({} if sampler is None else {"sampler": 0})}],
        "samplers": [] if sampler is None else [dict(sampler)],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": info, "baseColorFactor": factor}, **material}],
        "meshes": [{"primitives": [builder.square(material=0)]}],
    }
    return builder


def plain(**primitive: Any) -> Builder:
    """Return the square without a material."""
    builder = Builder()
    builder.document["meshes"] = [{"primitives": [builder.square(**primitive)]}]
    return builder


def add_animation(builder: Builder, node: int, path: str, times: int, values: int, kind: str = "LINEAR") -> None:
    """Add a channel to a document's animation."""
    animation = builder.document.setdefault("animations", [{"samplers": [], "channels": []}])[0]
    animation["samplers"].append({"input": times, "output": values, "interpolation": kind})
    target = {"node": node, "path": path}
    animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})


def rotating(keys: int, turns: float, seconds: float, axis: tuple[float, float, float]) -> Builder:
    """Return the square on a node that turns about an axis under another that scales and mirrors it."""
    builder = plain()
    angle = np.linspace(0, 2 * np.pi * turns, keys)[:, None]
    unit = np.array(axis) / np.linalg.norm(axis)
    first = np.array([0.5, 0.5, 0.5, 0.5])  # a third of a turn about (1, 1, 1): the keys start turned
    quaternions = [product(np.append(np.sin(a / 2) * unit, np.cos(a / 2)), first) for a in angle]
    times = builder.array(np.linspace(0, seconds, keys))
    add_animation(builder, 1, "rotation", times, builder.array(quaternions))
    builder.document["nodes"] = [
        {"children": [1], "translation": [1, 2, 3], "scale": [2, -2, 2]},
        {"mesh": 0, "translation": [5, 0, 0]},
    ]
    return builder


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the product of two quaternions, the real part last."""
    vector = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
    return np.append(vector, p[3] * q[3] - p[:3] @ q[:3])
