"""Laws of the chart: nothing is lost on the logarithmic axis, the front is a front, labels do not overlap."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

from aliasbench.reports import charts
from aliasbench.reports.charts import Point
from aliasbench.reports.records import Record, load_runs

MakeRecord = Callable[..., dict[str, Any]]


def make_point(technique: str, ms: float, rmse: float, run: str = "run", reason: str = "") -> Point:
    record = Record(run, Path(), "s", technique, (8, 8), "0", 1, "ok", "", None, None, 64)
    reason = reason or ("" if rmse else "equal to the reference")
    return Point(record, ms, ms * 0.95, ms * 1.1, rmse, reason)


SOME = [
    make_point("raytrace:", 1.0, 0.1),
    make_point("raytrace:spp=4", 3.0, 0.04),
    make_point("raytrace:spp=16", 12.0, 0.01),
    make_point("raster:", 2.0, 0.12),
    make_point("raster:msaa=4", 6.0, 0.03),
    make_point("raster:passes=64", 90.0, 0.01),
]


def traces(figure: dict[str, Any]) -> list[dict[str, Any]]:
    return [t for t in figure["data"] if t["meta"] != "front"]


def test_the_front_holds_exactly_the_points_that_no_other_beats() -> None:
    rng = np.random.default_rng(3)
    points = [make_point("raster:", float(t), float(e)) for t, e in rng.integers(1, 12, (60, 2))]
    front = charts.pareto_front(points)
    beaten = {
        (p.ms, p.rmse)
        for p in points
        if any(q.ms <= p.ms and q.rmse <= p.rmse and (q.ms, q.rmse) != (p.ms, p.rmse) for q in points)
    }
    assert {(p.ms, p.rmse) for p in front} == {(p.ms, p.rmse) for p in points} - beaten
    assert front == sorted(front, key=lambda p: p.ms)


def test_every_point_is_drawn_and_renderers_differ_in_colour_and_shape() -> None:
    figure = charts.speed_chart(SOME, ["run"])
    drawn = [(x, y) for t in traces(figure) for x, y in zip(t["x"], t["y"], strict=True)]
    assert sorted(drawn) == sorted((p.ms, p.rmse) for p in SOME)
    ray, raster = traces(figure)
    assert {ray["name"], raster["name"]} == {"ray tracer", "rasterizer"}
    assert not set(ray["marker"]["symbol"]) & set(raster["marker"]["symbol"])
    assert ray["marker"]["color"] != raster["marker"]["color"]


def test_points_without_measurable_error_are_drawn_hollow_on_a_line_below_all_others() -> None:
    figure = charts.speed_chart([*SOME, make_point("raster:msaa=8", 7.0, 0.0)], ["run"])
    floor = figure["layout"]["shapes"][0]["y0"]
    assert 0 < floor < min(p.rmse for p in SOME)
    (raster,) = [t for t in traces(figure) if t["meta"] == "raster"]
    assert (raster["y"][-1], raster["marker"]["symbol"][-1]) == (floor, "diamond-open")
    low, high = (10**edge for edge in figure["layout"]["yaxis"]["range"])
    assert low < floor < high


def test_points_below_the_floor_are_hollow_at_their_bound() -> None:
    below = make_point("raytrace:spp=64", 40.0, 0.01, reason="RMSE below 0.0100")
    figure = charts.speed_chart([*SOME[:2], below], ["run"])
    (ray,) = traces(figure)
    assert (ray["y"][-1], ray["marker"]["symbol"][-1]) == (0.01, "circle-open")
    assert [shape["y0"] for shape in figure["layout"]["shapes"]] == [0.01]
    assert charts.findings([below]) == ["Lowest error of the ray tracer: 64 spp (RMSE below 0.0100, 40.0 ms)."]


def test_bars_end_at_the_interval() -> None:
    for trace in traces(charts.speed_chart(SOME, ["run"])):
        bars = trace["error_x"]
        for x, up, down in zip(trace["x"], bars["array"], bars["arrayminus"], strict=True):
            assert x + up == pytest.approx(1.1 * x)
            assert x - down == pytest.approx(0.95 * x)


@pytest.mark.parametrize(
    "points",
    [
        SOME,
        SOME[:1],
        [make_point("reference:", 1.0, 0.0)],
        [make_point("odd<b>:", 1e-3, 1e-9), make_point("raster:", 1e6, 9.0)],
    ],
)
def test_plotly_accepts_the_figure(points: list[Point]) -> None:
    figure = charts.speed_chart(points, ["run"])
    assert len(go.Figure(figure).data) == len(figure["data"])


def test_runs_have_their_own_fillings_and_names() -> None:
    figure = charts.speed_chart([SOME[0], make_point("raytrace:", 2.0, 0.1, "other")], ["run", "other"])
    first, second = traces(figure)
    assert (first["name"], second["name"]) == ("ray tracer · run", "ray tracer · other")
    assert first["marker"]["symbol"] != second["marker"]["symbol"]


def test_names_cannot_inject_markup_into_the_chart() -> None:
    figure = charts.speed_chart([make_point("raster:post=<i>x</i>", 1.0, 0.1, "<b>")], ["<b>", "r"])
    assert "<i>" not in str(figure)
    assert "<b>·" not in str(figure)
    assert "· <b>" not in str(figure)


def test_ticks_lie_in_the_range_and_read_as_decimals() -> None:
    axis = charts._axis("t", [-3.1, -1.9])
    assert axis["ticktext"] == ["0.001", "0.002", "0.005", "0.01"]


def test_findings_name_the_quickest_way_to_the_others_best() -> None:
    raster, raytrace = charts.findings(SOME)
    assert raster.startswith("Lowest error of the rasterizer: 64 passes (RMSE 0.0100, 90.0 ms).")
    assert raster.endswith("The ray tracer gets there with 16 spp in 12.0 ms, 7.5 times faster.")
    assert raytrace.endswith("The rasterizer gets there with 64 passes in 90.0 ms, 7.5 times slower.")
    assert charts.findings(SOME[:3]) == ["Lowest error of the ray tracer: 16 spp (RMSE 0.0100, 12.0 ms)."]
    close = charts.findings([make_point("raster:", 10.0, 0.1), make_point("raytrace:", 10.5, 0.1)])
    assert all(line.endswith("too close to call.") for line in close)
    worse = charts.findings(SOME[:4])[1]
    assert worse.endswith("No setting of the rasterizer here gets there.")


def test_only_timed_records_with_an_error_or_its_floor_become_points(
    fabricate: Callable[..., Path], make_record: MakeRecord, make_score: MakeRecord
) -> None:
    rows = [
        make_record("s", "raster:", metrics={"rmse": make_score(0.5)}),
        make_record("s", "raster:msaa=2", metrics={"rmse": make_score(0.0)}),
        make_record("s", "raster:msaa=4", metrics={"rmse": make_score(None, "below_reference_floor")}),
        make_record("s", "raster:msaa=4", metrics={"rmse": make_score(None, "below_reference_floor", floor=0.03)}),
        make_record("s", "raster:msaa=8", metrics={"rmse": make_score(None, "nonfinite")}),
        make_record("s", "raster:ssaa=2", seconds=[]),
        make_record("s", "raster:ssaa=3", metrics={}),
    ]
    (run,) = load_runs([fabricate(rows)])
    points = charts.chart_points(run.records)
    assert [(p.rmse, p.reason) for p in points] == [
        (0.5, ""),
        (0.0, "equal to the reference"),
        (0.0, "RMSE below reference floor"),
        (0.03, "RMSE below 0.0300"),
    ]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (0.0123456, "0.0123"),
        (1.0, "1.00"),
        (123.4, "123"),
        (-0.5, "-0.500"),
        (1e-7, "1.00e-07"),
        (2e9, "2.00e+09"),
        (99999.0, "99999"),
    ],
)
def test_numbers_have_three_significant_digits(value: float, text: str) -> None:
    assert charts.number(value) == text
