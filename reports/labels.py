"""Where the chart's labels go: beside their points, and over nothing else.

plotly places a label where it is told and lets labels overlap; a dozen techniques on one chart would be unreadable. The
places are found here, for a plot of a typical size, by trying eight directions for one point after the other; a label
that fits nowhere is left out, and the point still says its name when it is pointed at.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

# The browser's plot differs a little in size, which the gap around markers absorbs. All in pixels.
PLOT_WIDTH, PLOT_HEIGHT = 760.0, 350.0
CHARACTER_WIDTH, LINE_HEIGHT, MARKER = 6.3, 14.0, 8.0
PLACES: Mapping[str, tuple[float, float]] = {
    "middle right": (1, 0),
    "middle left": (-1, 0),
    "top center": (0, -1),
    "bottom center": (0, 1),
    "top right": (1, -1),
    "bottom right": (1, 1),
    "top left": (-1, -1),
    "bottom left": (-1, 1),
}

Box = tuple[float, float, float, float]
LogRange = Sequence[float]


@dataclass(frozen=True, slots=True)
class Mark:
    """A point with its label, both coordinates above 0, and the ends of its horizontal bar."""

    text: str
    x: float
    low_x: float
    high_x: float
    y: float


def place_labels(
    marks: Sequence[Mark], x_range: LogRange, y_range: LogRange, *, lines: Sequence[float] = ()
) -> list[tuple[str, str]]:
    """Return (text, plotly text position) for every mark; the text is empty where every place is taken.

    Parameters
    ----------
    marks : sequence of Mark
    x_range, y_range : (low, high)
        log10 of the ends of the axes.
    lines : sequence of float
        Heights of horizontal lines that labels keep clear of.
    """

    def across(x: float) -> float:
        return (math.log10(x) - x_range[0]) / (x_range[1] - x_range[0]) * PLOT_WIDTH

    def down(y: float) -> float:
        return (y_range[1] - math.log10(y)) / (y_range[1] - y_range[0]) * PLOT_HEIGHT

    centres = [(across(m.x), down(m.y)) for m in marks]
    taken: list[Box] = [(x - MARKER, y - MARKER, x + MARKER, y + MARKER) for x, y in centres]
    taken += [
        (across(m.low_x or m.x), y - 3, across(m.high_x), y + 3) for m, (_, y) in zip(marks, centres, strict=True)
    ]
    taken += [(0.0, down(y) - 1, PLOT_WIDTH, down(y) + 1) for y in lines]
    labels = []
    for mark, (x, y) in zip(marks, centres, strict=True):
        boxes = {place: label_box(mark.text, x, y, place) for place in PLACES}
        free = [place for place, box in boxes.items() if _inside(box) and not any(overlap(box, b) for b in taken)]
        if free:
            taken.append(boxes[free[0]])
            labels.append((mark.text, free[0]))
        else:
            labels.append(("", "middle right"))
    return labels


def label_box(text: str, x: float, y: float, place: str) -> Box:
    """Return (left, top, right, bottom) of a label at a place beside a point, in pixels."""
    dx, dy = PLACES[place]
    width = len(text) * CHARACTER_WIDTH
    centre_x = x + dx * (width / 2 + MARKER + 1)
    centre_y = y + dy * (LINE_HEIGHT / 2 + MARKER + 1)
    return (centre_x - width / 2, centre_y - LINE_HEIGHT / 2, centre_x + width / 2, centre_y + LINE_HEIGHT / 2)


def overlap(a: Box, b: Box) -> bool:
    """Return whether two boxes share more than their border."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _inside(box: Box) -> bool:
    return box[0] >= 0 and box[2] <= PLOT_WIDTH and box[1] >= 0 and box[3] <= PLOT_HEIGHT
