"""Time against error: the points of a scene, the Pareto front among them, and the chart as plain plotly JSON.

The figure is a plain dictionary and not a `plotly.graph_objects` object: importing those takes longer than the whole
page, and the browser wants JSON anyway (a test gives it to plotly's validator). Colours are placeholders that the
page's script replaces by those of the light or dark theme.
"""

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from aliasbench.reports.labels import Mark, place_labels
from aliasbench.reports.records import Record

RENDERER_NAMES: Mapping[str, str] = {"raytrace": "ray tracer", "raster": "rasterizer", "reference": "reference"}
_SYMBOLS: Mapping[str, str] = {"raytrace": "circle", "raster": "diamond", "reference": "square"}
_COLOURS: Mapping[str, str] = {"raytrace": "#1f6feb", "raster": "#d9730d", "reference": "#6e7781"}
_RUN_STYLES = ("", "-open", "-dot", "-open-dot")


@dataclass(frozen=True, slots=True)
class Point:
    """One timed record on the chart: milliseconds with their interval, and the RMSE.

    Where the error is too small for the reference to measure, `rmse` is the bound it is below (0 for no error at all)
    and `reason` says so; else `reason` is empty.
    """

    record: Record
    ms: float
    low_ms: float
    high_ms: float
    rmse: float
    reason: str = ""


def chart_points(records: Sequence[Record]) -> list[Point]:
    """Return a point for every record that has a time above 0 and an RMSE, or a status saying it is too small."""
    points = []
    for record in records:
        score, timing = record.metrics.get("rmse"), record.timing
        if score is None or timing is None or timing.median_s <= 0:
            continue
        times = (timing.median_s * 1e3, timing.low_s * 1e3, timing.high_s * 1e3)
        if score.value == 0 or score.status == "identical":
            points.append(Point(record, *times, 0.0, "equal to the reference"))
        elif score.status == "below_reference_floor":
            bound = score.floor or 0.0
            reason = f"RMSE below {number(bound)}" if bound else "RMSE below reference floor"
            points.append(Point(record, *times, bound, reason))
        elif score.value is not None and score.value > 0:
            points.append(Point(record, *times, score.value))
    return points


def pareto_front(points: Sequence[Point]) -> list[Point]:
    """Return the points that no other point beats or equals in both time and error, quickest first."""
    front: list[Point] = []
    for point in sorted(points, key=lambda p: (p.ms, p.rmse)):
        if not front or point.rmse < front[-1].rmse:
            front.append(point)
    return front


def findings(points: Sequence[Point]) -> list[str]:
    """Return what a millisecond buys here in sentences: each renderer's best, and the other's time to match it."""
    best = {
        name: min((p for p in points if p.record.renderer == name), key=lambda p: (p.rmse, p.ms), default=None)
        for name in ("raster", "raytrace")
    }
    lines = []
    for name, other in (("raster", "raytrace"), ("raytrace", "raster")):
        mine = best[name]
        if mine is None:
            continue
        line = f"Lowest error of the {RENDERER_NAMES[name]}: {describe(mine)}."
        rivals = [p for p in points if p.record.renderer == other and p.rmse <= mine.rmse]
        if rivals:
            rival = min(rivals, key=lambda p: p.ms)
            pace = _pace(rival, mine)
            line += (
                f" The {RENDERER_NAMES[other]} gets there with {rival.record.short} in {number(rival.ms)} ms, {pace}."
            )
        elif best[other] is not None:
            line += f" No setting of the {RENDERER_NAMES[other]} here gets there."
        lines.append(line)
    return lines


def _pace(rival: Point, mine: Point) -> str:
    """Return how the rival's time compares, without a verdict where the intervals overlap."""
    if rival.low_ms <= mine.high_ms and mine.low_ms <= rival.high_ms:
        return "too close to call"
    ratio = mine.ms / rival.ms
    return f"{ratio:.2g} times faster" if ratio >= 1 else f"{1 / ratio:.2g} times slower"


def describe(point: Point) -> str:
    """Return technique, error and time of a point in words."""
    error = f"RMSE {number(point.rmse)}" if not point.reason else point.reason
    return f"{point.record.short} ({error}, {number(point.ms)} ms)"


def number(value: float) -> str:
    """Return a number for people: three significant digits, no exponent between 0.0001 and a million."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    if not 1e-4 <= abs(value) < 1e6:
        return f"{value:.2e}"
    decimals = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{decimals}f}"


def speed_chart(points: Sequence[Point], runs: Sequence[str]) -> dict[str, Any]:
    """Return the plotly figure (data, layout) of time against error, both axes logarithmic.

    Points without measurable error are drawn hollow on dotted lines, at their bound or, equal to the reference, below
    all others, so that none vanishes from a logarithmic axis.

    Parameters
    ----------
    points : sequence of Point
        At least one.
    runs : sequence of str
        Labels of all runs of the page; each gets its own marker filling.
    """
    errors = [p.rmse for p in points if p.rmse > 0] or [1e-3]
    floor = min(errors) / 2.2 if any(p.rmse == 0 for p in points) else None
    x_range = _padded([p.low_ms for p in points if p.low_ms > 0] + [p.high_ms for p in points], 0.09)
    y_range = _padded(errors + ([floor] if floor else []), 0.09)
    marks = [Mark(p.record.short, p.ms, p.low_ms, p.high_ms, p.rmse or floor or 1.0) for p in points]
    lines = sorted({p.rmse or floor or 1.0 for p in points if p.reason})
    labels = place_labels(marks, x_range, y_range, lines=lines)
    data = [_front_trace(pareto_front(points), floor, x_range, y_range)]
    names = list(dict.fromkeys(p.record.renderer for p in points))
    for renderer in sorted(names, key=lambda n: list(RENDERER_NAMES).index(n) if n in RENDERER_NAMES else 9):
        for number_of_run, run in enumerate(runs):
            chosen = [i for i, p in enumerate(points) if p.record.renderer == renderer and p.record.run == run]
            if chosen:
                style = _RUN_STYLES[number_of_run % len(_RUN_STYLES)]
                title = RENDERER_NAMES.get(renderer, renderer) + (f" · {run}" if len(runs) > 1 else "")
                data.append(_renderer_trace(points, chosen, labels, floor, renderer, style, title))
    layout: dict[str, Any] = {
        "height": 430,
        "margin": {"l": 70, "r": 14, "t": 40, "b": 48},
        "xaxis": _axis("time of one frame [ms]", x_range),
        "yaxis": _axis("RMSE [contrast]", y_range),
        "legend": {"orientation": "h", "x": 0, "y": 1.01, "yanchor": "bottom"},
        "hovermode": "closest",
        "showlegend": True,
        "dragmode": False,
    }
    dots = {"width": 1, "dash": "dot"}
    layout["shapes"] = [
        {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": y, "y1": y, "line": dots} for y in lines
    ]
    return {"data": data, "layout": layout}


def _renderer_trace(
    points: Sequence[Point],
    chosen: Sequence[int],
    labels: Sequence[tuple[str, str]],
    floor: float | None,
    renderer: str,
    style: str,
    title: str,
) -> dict[str, Any]:
    shown = [points[i] for i in chosen]
    base = _SYMBOLS.get(renderer, "cross")
    colour = _COLOURS.get(renderer, "#6e7781")
    return {
        "type": "scatter",
        "mode": "markers+text",
        "name": html.escape(title),
        "meta": renderer if renderer in _COLOURS else "reference",
        "x": [p.ms for p in shown],
        "y": [p.rmse or floor for p in shown],
        "text": [html.escape(labels[i][0]) for i in chosen],
        "textposition": [labels[i][1] for i in chosen],
        "textfont": {"size": 11},
        "customdata": [_hover(p) for p in shown],
        "hovertemplate": "%{customdata}<extra></extra>",
        "cliponaxis": False,
        "marker": {
            "symbol": [f"{base}-open" if p.reason else f"{base}{style}" for p in shown],
            "size": 10,
            "color": colour,
            "line": {"width": 1.5, "color": colour},
        },
        "error_x": {
            "type": "data",
            "symmetric": False,
            "array": [p.high_ms - p.ms for p in shown],
            "arrayminus": [p.ms - p.low_ms for p in shown],
            "thickness": 1.5,
            "width": 4,
            "color": colour,
        },
    }


def _front_trace(
    front: Sequence[Point], floor: float | None, x_range: list[float], y_range: list[float]
) -> dict[str, Any]:
    """Return the staircase of the best error that each time buys, from the first point to the right border."""
    heights = [p.rmse or floor or 0.0 for p in front]
    return {
        "type": "scatter",
        "mode": "lines",
        "name": "best error for the time",
        "meta": "front",
        "x": [front[0].ms, *(p.ms for p in front), 10 ** x_range[1]],
        "y": [10 ** y_range[1], *heights, heights[-1]],
        "line": {"shape": "hv", "width": 6, "color": "rgba(128,128,128,.25)"},
        "hoverinfo": "skip",
    }


def _hover(point: Point) -> str:
    record, e = point.record, html.escape
    error = point.reason or f"RMSE {number(point.rmse)}"
    lines = [
        f"<b>{e(record.technique)}</b>",
        f"{number(point.ms)} ms [{number(point.low_ms)}, {number(point.high_ms)}]",
        e(error),
    ]
    if record.samples is not None:
        lines.append(f"{record.samples:,} samples")
    lines += [
        f"{e(name)} {number(score.value)}"
        for name, score in record.metrics.items()
        if score.value is not None and name != "rmse"
    ][:8]
    return "<br>".join(lines)


def _padded(values: Sequence[float], share: float) -> list[float]:
    """Return the log10 range of some positive values, at least half a decade, with a share added at both ends."""
    low, high = math.log10(min(values)), math.log10(max(values))
    missing = max(0.0, 0.5 - (high - low)) / 2
    low, high = low - missing, high + missing
    pad = share * (high - low)
    return [low - pad, high + pad]


def _axis(title: str, log_range: list[float]) -> dict[str, Any]:
    """Return a logarithmic axis with ticks at 1, 2, 5, or at whole decades where those would crowd."""
    low, high = log_range
    leads = (1, 2, 5) if high - low < 3.2 else (1,)
    values = [lead * 10.0**k for k in range(math.floor(low), math.ceil(high) + 1) for lead in leads]
    shown = [v for v in values if low <= math.log10(v) <= high]
    return {
        "type": "log",
        "title": {"text": title, "font": {"size": 13}},
        "range": log_range,
        "tickvals": shown,
        "ticktext": [f"{v:g}" for v in shown],
        "zeroline": False,
        "automargin": True,
        "fixedrange": True,
    }
