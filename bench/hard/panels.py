"""Pictures of upright rectangles placed in pixels, and how subjects are asked for them: what cases about values share.

By edges and by a texture's squares, so that the same values take both ways through a renderer.
"""

from collections.abc import Iterable

from aliasbench.bench.hard.case import samples_key, with_keys
from aliasbench.scenes.model import Animation, Camera, Checker, Motion, Scene, Surface, Vec3
from aliasbench.scenes.shapes import quad

HALF_ULP = 2.0**-24  # of float32, in terms of the number


def is_raster(subject: str) -> bool:
    """Return whether a subject is a rasterizer."""
    return subject.startswith("raster")


def sampled(subject: str, count: int, filtering: str = "", more: str = "") -> str:
    """Return a technique of `count` samples a pixel under a filter; for the reference, of the filter alone."""
    if subject.startswith("reference"):
        return with_keys(subject, filtering)
    return samples_key(subject, count, ",".join(keys for keys in (filtering, more) if keys))


def gray(value: float) -> Vec3:
    """Return a colour of three equal channels."""
    return (value, value, value)


def panel(
    left: float,
    top: float,
    right: float,
    bottom: float,
    size: tuple[int, int],
    color: Vec3,
    motion: Motion | None = None,
) -> Surface:
    """Return the rectangle between two columns and two rows (rows downwards) of a picture of `size`, in pixels."""
    x0, x1, y0, y1 = left - size[0] / 2, right - size[0] / 2, size[1] / 2 - bottom, size[1] / 2 - top
    return quad([(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0)], color=color, motion=motion)


def picture(
    panels: Iterable[Surface], size: tuple[int, int], background: float = 0.0, shutter: float = 0.0, **textures: Checker
) -> Scene:
    """Return the scene of which a world unit is a pixel of a picture of `size`, one frame a second."""
    camera = Camera("orthographic", height=float(size[1]))
    return Scene(
        "hard",
        camera,
        tuple(panels),
        background=gray(background),
        animation=Animation(1.0, 1, shutter),
        textures=textures,
    )


def halved(size: tuple[int, int], dark: float, bright: float, *, textured: bool, tint: float = 1.0) -> Scene:
    """Return a picture of which every pixel's left half is bright and its right half dark; `tint` multiplies texels."""
    width, height = size
    if textured:
        # two columns of squares a pixel; one row, and all of it ends far beyond the picture
        far = 64 + 4 * height
        x, y = width / 2 + far, height / 2 + far
        corners = [(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)]
        squares = Checker((4.0 * x, 1.0), black=gray(bright), white=gray(dark))
        return picture([quad(corners, texture="squares", color=gray(tint))], size, squares=squares)
    strips = [panel(k, -4 * height, k + 0.5, 5 * height, size, gray(tint * bright)) for k in range(width)]
    return picture(strips, size, background=tint * dark)
