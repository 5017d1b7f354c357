"""Processing a picture as such, the symmetries any processing must have, and what edges of a scene are measured on."""

from contextlib import ExitStack

import numpy as np

from aliasbench.renderers.catalog import render
from aliasbench.renderers.raster.context import acquire_context
from aliasbench.renderers.raster.pictures import Uploaded
from aliasbench.scenes.model import Scene

# Of the square: what keeps it in its place, as functions of (h, w, 3) pictures that undo themselves.
SYMMETRIES = {
    "transposed": lambda p: p.swapaxes(0, 1),
    "mirrored": lambda p: p[:, ::-1],
    "upside down": lambda p: p[::-1],
}


def process(kind: type, pixels: np.ndarray, scale: float = 1.0) -> np.ndarray:
    """What a filter makes of a picture."""
    height, width = pixels.shape[:2]
    context = acquire_context()
    out = np.empty((height, width, 3), np.float32)
    with context.use(), ExitStack() as made:
        source = Uploaded(context, (width, height), made)
        stage = kind(context, source, (width, height), made)
        source.write(pixels)
        stage.run(scale)
        stage.output.framebuffer.read_into(out, components=3, dtype="f4")
        stage.release()
        context.check("processing")
    return out


def random_shapes(seed: int, side: int = 48, levels: int = 3) -> np.ndarray:
    """A picture of random half planes, discs and dots in a few colours: edges in all directions and exact ties."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:side, :side]
    out = np.zeros((side, side, 3), np.float32)
    for _ in range(8):
        a, b, r = rng.uniform(0, side, 3)
        angle = rng.uniform(0, 2 * np.pi)
        color = rng.integers(0, levels + 1, 3) / levels
        inside = (
            np.hypot(x - a, y - b) < r / 3
            if rng.random() < 0.5
            else np.cos(angle) * (x - a) + np.sin(angle) * (y - b) > r / 2
        )
        out[inside] = color
    out[rng.random((side, side)) < 0.01] = 1.0
    return out


def edge_rms(scene: Scene, techniques: list[str], size: tuple[int, int]) -> list[float]:
    """RMS errors over the pixels that the exact picture shows to be covered in part."""
    reference = render(scene, "reference:", size=size).pixels
    colors = [scene.background, *(s.color for s in scene.objects)]
    partly = np.all([np.abs(reference - c).max(axis=2) > 1e-9 for c in colors], axis=0)
    assert partly.sum() > max(size)
    errors = [(render(scene, t, size=size).pixels - reference)[partly] for t in techniques]
    return [float(np.sqrt(np.mean(e**2))) for e in errors]
