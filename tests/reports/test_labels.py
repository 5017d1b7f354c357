"""Laws of label placing: no label lies over another, over a marker, over a bar or outside the plot."""

from itertools import combinations

import numpy as np

from aliasbench.reports import labels
from aliasbench.reports.labels import Mark

RANGES = ([-0.2, 2.2], [-3.2, -0.8])


def scatter(count: int) -> list[Mark]:
    rng = np.random.default_rng(5)
    xy = 10 ** rng.uniform((0, -3), (2, -1), (count, 2))
    return [Mark(f"{number} passes", x, x * 0.97, x * 1.1, y) for number, (x, y) in enumerate(xy.tolist(), 2)]


def pixel(x: float, y: float) -> tuple[float, float]:
    (left, right), (bottom, top) = RANGES
    return (
        (np.log10(x) - left) / (right - left) * labels.PLOT_WIDTH,
        (top - np.log10(y)) / (top - bottom) * labels.PLOT_HEIGHT,
    )


def test_labels_cover_nothing() -> None:
    marks = scatter(40)
    placed = labels.place_labels(marks, *RANGES, lines=[0.01])
    boxes = [
        labels.label_box(text, *pixel(m.x, m.y), place) for m, (text, place) in zip(marks, placed, strict=True) if text
    ]
    assert len(boxes) > 15
    assert not any(labels.overlap(a, b) for a, b in combinations(boxes, 2))
    height = pixel(1.0, 0.01)[1]
    for left, top, right, bottom in boxes:
        assert left >= 0
        assert right <= labels.PLOT_WIDTH
        assert not top < height < bottom
        for mark in marks:
            x, y = pixel(mark.x, mark.y)
            end, _ = pixel(mark.high_x, mark.y)
            assert not (left < x < right and top < y < bottom)
            assert not (left < end < right and top < y < bottom)


def test_a_lone_label_stands_at_the_right_and_at_the_border_turns_round() -> None:
    assert labels.place_labels([Mark("x", 1.0, 1.0, 1.0, 0.01)], *RANGES) == [("x", "middle right")]
    assert labels.place_labels([Mark("a long one", 150.0, 150.0, 150.0, 0.01)], *RANGES) == [
        ("a long one", "middle left")
    ]


def test_what_fits_nowhere_is_left_out() -> None:
    crowd = [Mark(f"label {n}", 10.0, 10.0, 10.0, 0.01) for n in range(30)]
    texts = [text for text, _ in labels.place_labels(crowd, *RANGES)]
    assert 0 < sum(map(bool, texts)) <= len(labels.PLACES)
    assert texts[0] == "label 0"
