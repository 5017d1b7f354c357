"""The section on convergence: slopes, bounds and sentences as a reader meets them, and none where there is nothing."""

from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aliasbench.reports.convergence import Convergence, convergence_sections
from aliasbench.reports.page import write_report
from aliasbench.reports.records import load_runs
from aliasbench.reports.tables import Cell

MakeRecord = Callable[..., dict[str, Any]]
Fabricate = Callable[..., Path]
Rows = Callable[..., list[dict[str, Any]]]


@pytest.fixture
def by_law(make_record: MakeRecord, make_score: MakeRecord) -> Rows:
    """Records of a technique text with N replaced by counts, whose errors and times are power laws."""

    def make(
        text: str, counts: Sequence[int], *, error: float = 0.2, slope: float = -0.5, ms: float = 1.0, **changes: Any
    ) -> list[dict[str, Any]]:
        return [
            make_record(
                "edges",
                text.replace("N", str(n)),
                seconds=[1e-3 * ms * n] * 5,
                metrics={"rmse": make_score(error * n**slope)},
                **changes,
            )
            for n in counts
        ]

    return make


@pytest.fixture
def section(fabricate: Fabricate) -> Callable[[list[dict[str, Any]]], Convergence]:
    """The one section of some records."""
    names = count()

    def make(rows: list[dict[str, Any]]) -> Convergence:
        (run,) = load_runs([fabricate(rows, f"run-{next(names)}")])
        (found,) = convergence_sections([("edges", run.records)])
        return found

    return make


def cells(found: Convergence, heading: str) -> list[Cell]:
    (index,) = [i for i, h in enumerate(found.table.headings) if h.text.startswith(heading)]
    return [row[index] for row in found.table.rows]


def test_slopes_and_what_an_error_costs_are_in_the_table(section: Any, by_law: Rows) -> None:
    counts = (4, 16, 64, 1024)
    found = section(
        by_law("raytrace:spp=N,sampler=random", counts) + by_law("raster:passes=N", counts, slope=-0.75, ms=3)
    )
    assert [row[0].text for row in found.table.rows] == ["raytrace:spp=N,sampler=random", "raster:passes=N"]
    assert [c.text for c in cells(found, "samples")] == ["4, 16, 64, 1024"] * 2
    slope, other = cells(found, "error slope")
    assert (slope.text, slope.note) == ("−0.50", "−0.50 to −0.50")
    assert "by the scatter about the line" in slope.title
    assert other.text == "−0.75"
    assert [c.text for c in cells(found, "time slope")] == ["1.00", "1.00"]
    assert "over 5 repetitions" in cells(found, "time slope")[0].title
    time, faster = cells(found, "time to RMSE 0.01")
    assert (time.text, time.note, faster.text) == ("400", "400–400", "163")
    assert [c.text for c in cells(found, "RMSE in 16.7 ms")] == [
        "0.0490",
        "0.0553",
    ]  # .2 (16.67)^-1/2, .2 (16.67 / 3)^-3/4
    assert found.finding == (
        "raster:passes=N is the first at RMSE 0.01, in 163 ms;"
        " raytrace:spp=N,sampler=random takes 2.5 times as long (2.46–2.46)."
    )


def test_two_counts_have_no_slope_and_without_slopes_no_columns_for_them(section: Any, by_law: Rows) -> None:
    two = by_law("raytrace:spp=N", (4, 16))
    found = section(two)
    assert not found.has_slopes
    assert [h.text for h in found.table.headings][:2] == ["technique", "samples"]
    assert not [h for h in found.table.headings if "slope" in h.text]
    assert found.finding == ""


def test_a_family_of_two_counts_beside_one_of_three_says_why_it_has_no_slope(section: Any, by_law: Rows) -> None:
    found = section(by_law("raytrace:spp=N", (4, 16)) + by_law("raster:passes=N", (4, 16, 64)))
    two, three = cells(found, "error slope")
    assert (two.text, two.title) == ("–", "2 sample counts; a slope needs three")
    assert three.text == "−0.50"


def test_what_was_not_measured_is_a_bound_and_called_extrapolated(section: Any, by_law: Rows) -> None:
    rows = (
        by_law("raytrace:spp=N,sampler=random", (4, 16, 64), error=0.022)  # .011 to .00275
        + by_law("raytrace:spp=N", (4, 64), error=0.022)
        + by_law("raster:ssaa=N", (2, 4), error=0.04, slope=-1.0, ms=0.5)  # .02 and .01 less rounding, in 1 and 2 ms
        + by_law("raster:passes=N", (4, 16), error=0.2, ms=0.5)  # .1 and .05, in 2 and 8 ms
        + by_law("raster:msaa=4,passes=N", (4, 16), error=0.002, ms=2)  # .001 and .0005
    )
    found = section(rows)
    times = cells(found, "time to RMSE 0.01")
    assert [c.text for c in times[:3]] == ["4.84", "4.84", "2.00"]
    # Five times less error takes 25 times the longest time, which is too far to say; at .025 it is four times.
    assert (times[3].text, times[3].note, times[3].style) == ("> 8.00", "", "doubtful")
    assert (times[4].text, times[4].title) == ("< 8.00", "its quickest setting has RMSE 0.00100 already")
    assert found.finding.startswith("raster:ssaa=k is the first at RMSE 0.01, in 2.00 ms; raytrace:spp=N")
    near = section([*rows[:5], *by_law("raster:passes=N", (4, 16), error=0.08, ms=0.1)])  # .04 and .02, in .4 and 1.6
    cell = cells(near, "time to RMSE 0.01")[2]
    assert (cell.text, cell.note, cell.title) == ("> 1.60", "≈ 6.40 extrapolated", "measured down to RMSE 0.0200")
    errors = cells(near, "RMSE in 16.7 ms")
    assert [c.text for c in errors] == ["0.00539", "0.00539", "≤ 0.0200"]
    assert (errors[2].note, errors[2].style) == ("≈ 0.00620 extrapolated", "doubtful")


def test_a_bias_that_samples_do_not_take_away_is_said(section: Any, by_law: Rows) -> None:
    found = section(
        by_law("raytrace:spp=N", (4, 16, 64, 1024)) + by_law("raster:passes=N", (4, 16, 64, 1024), error=0.3, slope=0.0)
    )
    cell = cells(found, "time to RMSE")[1]
    assert (cell.text, cell.title) == ("–", "more samples do not take it below RMSE 0.300")
    assert cells(found, "error slope")[1].text == "0.00"


def test_seeds_give_intervals(section: Any, by_law: Rows, make_score: MakeRecord) -> None:
    rng = np.random.default_rng(1)
    rows = by_law("raytrace:spp=N", (4, 16, 64))
    for row in rows:
        value = row["metrics"]["rmse"]["value"]
        seeds = (value * np.exp(0.05 * rng.normal(size=8))).tolist()
        row["metrics"]["rmse"] = make_score(value, by_seed=seeds)
    cell = cells(section(rows), "error slope")[0]
    assert "over 8 repetitions" in cell.title
    low, high = (float(end.replace("−", "-")) for end in cell.note.split(" to "))
    assert low < -0.5 < high
    assert high - low < 0.2


def test_times_that_overlap_are_too_close_to_call(section: Any, by_law: Rows) -> None:
    rows = by_law("raytrace:spp=N", (4, 16, 64, 1024)) + by_law("raster:passes=N", (4, 16, 64, 1024), ms=1.05)
    for row in rows:
        row["seconds"] = [s * f for s, f in zip(row["seconds"], (0.7, 0.9, 1.0, 1.2, 1.4), strict=True)]
    finding = section(rows).finding
    assert "takes about as long (1.1 times" in finding or "takes about as long (1 times" in finding
    assert finding.endswith("too close to call.")


def test_failed_untimed_and_unmeasured_records_are_in_no_family(fabricate: Fabricate, by_law: Rows) -> None:
    rows = by_law("raytrace:spp=N", (4, 16, 64))
    rows[0] |= {"status": "failed"}
    rows[1] |= {"seconds": []}
    rows[2]["metrics"]["rmse"] = {"value": None, "status": "below_reference_floor", "extras": {"floor": 1e-3}}
    (run,) = load_runs([fabricate(rows)])
    assert convergence_sections([("edges", run.records)]) == []


def test_the_page_has_the_section_with_a_link_and_each_run_apart(
    fabricate: Fabricate, by_law: Rows, tmp_path: Path
) -> None:
    rows = by_law("raytrace:spp=N", (4, 16, 64))
    one = write_report([fabricate(rows, "before")], tmp_path / "one").read_text(encoding="utf-8")
    assert one.count('id="convergence"') == one.count('href="#convergence"') == 1
    assert "Error slope." in one
    assert one.count('class="family"') == 1
    both = write_report([fabricate(rows, "now"), fabricate(rows[:2], "then")], tmp_path / "two")
    text = both.read_text(encoding="utf-8")
    assert text.count('class="family"') == 2
    assert "<small>now</small>" in text
    assert "<small>then</small>" in text
    few = write_report([fabricate(rows[:2], "few")], tmp_path / "few").read_text(encoding="utf-8")
    assert 'class="family"' in few
    assert "Error slope." not in few
    none = write_report([fabricate(rows[:1], "none")], tmp_path / "none").read_text(encoding="utf-8")
    assert "convergence" not in none.replace("convergence of", "").partition("<script")[0]
