"""Damaged model files by the thousand: each must load, or be refused in one sentence, soon and in little memory.

Valid small files are damaged in the ways that files are: bits flipped, ends cut off, pieces put elsewhere, bytes
replaced; and in ways that nobody but an enemy damages them: numbers in the JSON and in headers replaced by huge,
negative and wrong ones, keys removed, values of other types. `damaged_files` is what the tests draw a few of;

    python tests/scenes/fuzz_meshes.py --count 10000

runs a campaign in a process of its own with 1.5 GB of memory and an alarm of 5 s for each file, and prints its figures.
The first file of a campaign is sound, small, and as large in memory as any may be: a coloured mesh shown many times.
"""

import argparse
import base64
import itertools
import json
import random
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from aliasbench.scenes.assets.make_lantern import lantern_glb
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene

MEMORY = 1_500_000_000
SECONDS = 5
BAD_VALUES = (
    *(-1, 0, 1, 3, 255, 65535, 2**31 - 1, 2**31, 2**63, 10**30, 1e308, -1e308, 0.5, "NaN", "x", "", None, True, [], {}),
    *([0], [1e39] * 3, {"a": 1}, "../../etc/passwd", "http://example.org/a.png", "file:///etc/passwd", "/dev/zero"),
)
OBJ = """mtllib seed.mtl
v 0 0 0
v 1 0 0 1 0 0
v 1 1 0
v 0 1 0.5
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
usemtl red
f 1/1/1 2/2/1 3/3/1
usemtl plain
f 1//1 3//1 4//1
f 1 2 3 4
f -1/-1 -2/-2 -3/-3
"""
MTL = "newmtl red\nKd 1 0.5 0.2\nmap_Kd seed.png\nnewmtl plain\nKd 0.2 0.2 0.9\n"
PLY_HEAD = """ply
format {} 1.0
comment a pyramid
element vertex 5
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 5
property list uchar int vertex_indices
end_header
"""
POINTS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1))
FACES = ((0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))


def seeds() -> dict[str, bytes]:
    """Return small valid files by name: models of every kind, and what they name."""
    glb = lantern_glb()
    length = struct.unpack_from("<I", glb, 12)[0]
    document, binary = json.loads(glb[20 : 20 + length]), glb[28 + length :]
    view = document["bufferViews"][7]
    png = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    inside = {**document, "buffers": [{"byteLength": len(binary), "uri": data_uri(binary)}]}
    beside = {**document, "buffers": [{"byteLength": len(binary), "uri": "seed.bin"}], "images": [{"uri": "seed.png"}]}
    rows = [struct.pack("<3f3B", *p, 200, 10 * k, 0) for k, p in enumerate(POINTS)]
    faces = [struct.pack(f"<B{len(f)}i", len(f), *f) for f in FACES]
    lines = [f"{x} {y} {z} 200 {10 * k} 0" for k, (x, y, z) in enumerate(POINTS)]
    lines += [" ".join(map(str, (len(f), *f))) for f in FACES]
    return {
        "a.glb": glb,
        "inside.gltf": json.dumps(inside).encode(),
        "beside.gltf": json.dumps(beside).encode(),
        "a.obj": OBJ.encode(),
        "binary.ply": PLY_HEAD.format("binary_little_endian").encode() + b"".join(rows + faces),
        "colors.gltf": colored_copies(500, 12),
        "text.ply": PLY_HEAD.format("ascii").encode() + "\n".join(lines).encode() + b"\n",
        "seed.mtl": MTL.encode(),
        "seed.png": png,
        "seed.bin": binary,
    }


def data_uri(data: bytes) -> str:
    """Return bytes as a data URI."""
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()


def colored_copies(triangles: int, copies: int) -> bytes:
    """Return a glTF file with a mesh of colours and alpha at its vertices, indexed, that is shown `copies` times."""
    rng = np.random.default_rng(1)
    corners = np.tile(np.stack([rng.permutation(300)[:3] for _ in range(100)]), (triangles // 100, 1)).astype("<u2")
    arrays = (rng.random((300, 3)).astype("<f4"), rng.random((300, 4)).astype("<f4"), corners.reshape(-1, 1))
    binary = b"".join(array.tobytes() for array in arrays)
    starts = np.cumsum([0, *(array.nbytes for array in arrays)]).tolist()
    kinds = ((5126, "VEC3"), (5126, "VEC4"), (5123, "SCALAR"))
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0}
    document = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0, "translation": [k, 0, 0]} for k in range(copies)],
        "materials": [{"alphaMode": "MASK", "alphaCutoff": 0.25}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": [
            {"bufferView": k, "componentType": component, "type": kind, "count": len(array)}
            for k, ((component, kind), array) in enumerate(zip(kinds, arrays, strict=True))
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": array.nbytes}
            for start, array in zip(starts, arrays, strict=False)
        ],
        "buffers": [{"byteLength": len(binary), "uri": data_uri(binary)}],
    }
    return json.dumps(document).encode()


def damaged_files(folder: Path, count: int, seed: int) -> Iterator[Path]:
    """Write `count` damaged files, one after the other, and yield the path of the model to load each time.

    What is damaged is a model, or (one time in five) a file that one names.
    """
    random_ = random.Random(seed)
    sound = seeds()
    models = [name for name in sound if not name.startswith("seed")]
    for name, data in sound.items():
        (folder / name).write_bytes(data)
    for number in range(count):
        model = models[number % len(models)]
        named = {"beside.gltf": ("seed.png", "seed.bin"), "a.obj": ("seed.mtl", "seed.png")}.get(model)
        target = random_.choice(named) if named and random_.random() < 0.4 else model
        (folder / target).write_bytes(damage(sound[target], target, random_))
        yield folder / model
        (folder / target).write_bytes(sound[target])


def damage(data: bytes, name: str, random_: random.Random) -> bytes:
    """Return a file's content, damaged in one of the ways that fit it."""
    if name.endswith(".gltf") and random_.random() < 0.7:
        return json.dumps(with_wrong_values(json.loads(data), random_)).encode()
    if name.endswith(".glb") and random_.random() < 0.6:
        length = struct.unpack_from("<I", data, 12)[0]
        text = json.dumps(with_wrong_values(json.loads(data[20 : 20 + length]), random_)).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + data[20 + length :]
        return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks
    out = bytearray(data)
    # A header is short and easily spoilt: most damage is done behind it.
    body = data.find(b"end_header") + 11 if name.endswith(".ply") and random_.random() < 0.8 else 0
    for _ in range(random_.choice((1, 1, 1, 2, 5))):
        at = random_.randrange(min(body, len(out)), len(out) + 1)
        way = random_.randrange(6)
        if way == 0 and at < len(out):
            out[at] ^= 1 << random_.randrange(8)
        elif way == 1 and len(out) > 1:
            del out[at:]
        elif way == 2:
            start = random_.randrange(len(out) + 1)
            out[at:at] = out[start : start + random_.randrange(64)]
        elif way == 3:
            out[at : at + 4] = random_.choice((b"\xff" * 4, b"\0" * 4, b"\xff\xff\xff\x7f", b"\0\0\xc0\x7f"))
        elif way == 4:
            # A number in a text becomes another.
            digits = [k for k in range(min(body, len(out)), len(out)) if 48 <= out[k] <= 57]
            if digits:
                k = random_.choice(digits)
                out[k : k + 1] = random_.choice((b"99999999999", b"-1", b"nan", b"1e400", b"", b"x", b"/", b" "))
        else:
            del out[at : at + random_.randrange(1, 16)]
        if not out:
            break
    return bytes(out)


def with_wrong_values(document: object, random_: random.Random) -> object:
    """Return a JSON value in which a few values, anywhere, are replaced or removed."""
    places: list[tuple[object, object]] = []
    stack = [document]
    while stack:
        value = stack.pop()
        items = (
            list(value.items())
            if isinstance(value, dict)
            else list(enumerate(value))
            if isinstance(value, list)
            else []
        )
        for key, item in items:
            places.append((value, key))
            stack.append(item)
    for _ in range(random_.choice((1, 1, 1, 2, 4))):
        owner, key = random_.choice(places)
        if isinstance(owner, dict):
            if key in owner and random_.random() < 0.2:
                del owner[key]
            else:
                owner[key] = random_.choice(BAD_VALUES)
        elif isinstance(owner, list) and isinstance(key, int) and key < len(owner):
            owner[key] = random_.choice(BAD_VALUES)
    return document


def campaign(count: int, seed: int) -> str:
    """Load damaged files and return the figures; whatever is neither loaded nor refused is raised."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    warnings.simplefilter("error")
    outcome: Counter[str] = Counter()
    slowest, where = 0.0, ""
    with tempfile.TemporaryDirectory() as name:
        largest = Path(name) / "largest.gltf"
        largest.write_bytes(colored_copies(100_000, 20))
        files = itertools.chain([largest], damaged_files(Path(name), count, seed))
        for number, path in enumerate(files):
            signal.alarm(SECONDS)
            start = time.perf_counter()
            finished = False
            try:
                load_scene(str(path))
                outcome["loaded"] += 1
                finished = True
            except InputError as error:
                outcome["refused"] += 1
                finished = "\n" not in str(error) and len(str(error)) <= 900 and path.name in str(error)
                if not finished:
                    raise AssertionError(f"no good sentence: {error}") from error
            finally:
                if not finished:
                    print(f"file {number} ({path.name}), seed {seed}:", file=sys.stderr)
            took = time.perf_counter() - start
            signal.alarm(0)
            if took > slowest:
                slowest, where = took, f"{path.name}, number {number}"
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return f"{dict(outcome)}, slowest {slowest * 1e3:.0f} ms ({where}), peak {peak:.2f} GB"


def main() -> None:
    """Run a campaign in a process of its own, so that its limits are its own too."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--inside", action="store_true", help="run in this very process")
    options = parser.parse_args()
    if options.inside:
        print(campaign(options.count, options.seed))
    else:
        same = [sys.executable, __file__, "--inside", "--count", str(options.count), "--seed", str(options.seed)]
        sys.exit(subprocess.run(same, check=False).returncode)


if __name__ == "__main__":
    main()
