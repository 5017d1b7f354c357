"""Edges and vertices exactly where samples are: who owns a sample on a border, and is it one owner alone."""

import numpy as np

from aliasbench.bench.hard.case import HardCase, Verdict, samples_key
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Camera, Scene, Surface
from aliasbench.scenes.shapes import polygon

SIZE = (24, 16)


def _in_pixels(*objects: Surface, size: tuple[int, int] = SIZE) -> Scene:
    """Return a scene of which a world unit is a pixel, the origin in the picture's middle."""
    return Scene("hard", Camera("orthographic", height=float(size[1])), objects)


def _shared_edges(subject: str) -> Verdict:
    """A fan about a vertex on a pixel's centre, its spokes through centres: parts must sum to the whole."""
    rim = [(8.5, 0.5), (8.5, 5.5), (0.5, 5.5), (-7.5, 5.5), (-7.5, 0.5), (-7.5, -4.5), (0.5, -4.5), (8.5, -4.5)]
    parts = [polygon([(0.5, 0.5, 0.0), (*a, 0.0), (*b, 0.0)]) for a, b in zip(rim, [*rim[1:], rim[0]], strict=True)]
    each = [render(_in_pixels(p), samples_key(subject, 1), size=SIZE).pixels[..., 0].astype(float) for p in parts]
    interior = np.s_[SIZE[1] // 2 - 5 : SIZE[1] // 2 + 4, SIZE[0] // 2 - 7 : SIZE[0] // 2 + 8]
    owners = np.sum(each, axis=0)[interior]
    return Verdict(
        float(np.abs(owners - 1.0).max()),
        "owners",
        0.0,
        0.0,
        "a sample on an edge that two parts share belongs to exactly one of them",
        note=f"{owners.size} samples, {int(np.sum(owners != 1.0))} of them with another number of owners than one",
    )


CASES = (
    HardCase(
        "shared-edges",
        "edges",
        "Eight triangles meet in a vertex on a pixel's centre, their edges run through pixel centres.",
        "Rendered one by one, every sample inside of the fan has exactly one owner.",
        _shared_edges,
    ),
)
