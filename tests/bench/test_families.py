"""Families of techniques: who belongs together, what is read off their curves, and who is first."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from aliasbench.bench.families import (
    TARGET_RMSE,
    TARGET_SECONDS,
    Family,
    Measured,
    compare_families,
    find_lead,
    group_families,
    samples_per_pixel,
)
from aliasbench.renderers.technique import parse_technique


def by_law(
    text: str, counts: Sequence[int], *, error: float = 0.2, slope: float = -0.5, seconds: float = 1e-3, rounds: int = 9
) -> list[Measured]:
    """Records of `text` with N replaced by each count, whose errors and times are power laws."""
    return [Measured(text.replace("N", str(n)), (error * n**slope,), tuple([seconds * n] * rounds)) for n in counts]


def one_family(measured: Sequence[Measured]) -> Family:
    (family,) = group_families(measured)
    return family


@pytest.mark.parametrize(
    ("texts", "name", "counts"),
    [
        (["raytrace:spp=4,sampler=random", "raytrace:sampler=random,spp=16"], "raytrace:sampler=random,spp=N", (4, 16)),
        # The default sampler of several samples is jittered; a single one is in the middle and stays alone.
        (["raytrace:spp=16", "raytrace:spp=4,sampler=jittered", "raytrace:"], "raytrace:spp=N", (4, 16)),
        (["raster:", "raster:ssaa=4", "raster:ssaa=2", "raster:msaa=4"], "raster:ssaa=k", (1, 4, 16)),
        (["raster:passes=4", "raster:passes=4,ssaa=2"], "raster:passes=4,ssaa=k", (4, 16)),
        (["raster-passes-4", "raster-passes-64", "raster-1"], "raster:passes=N,sampler=jittered", (4, 64)),
        (
            ["raytrace:spp=4,filter=tent", "raytrace:spp=16,filter=pyramid", "raytrace:spp=4"],
            "raytrace:spp=N,filter=pyramid",
            (4, 16),
        ),
        (["raster:msaa=4,passes=4", "raster:msaa=4,passes=16"], "raster:msaa=4,passes=N", (4, 16)),
    ],
)
def test_a_family_differs_in_its_sample_count_only(texts: list[str], name: str, counts: tuple[int, ...]) -> None:
    family = one_family([Measured(text, (0.1,), (0.01,)) for text in texts])
    assert (family.name, family.counts, family.renderer) == (name, counts, name.partition(":")[0])


@pytest.mark.parametrize(
    "texts",
    [
        ["raytrace:spp=4", "raster:passes=16"],
        ["raytrace:spp=4,sampler=random", "raytrace:spp=16,sampler=sobol"],
        ["raytrace:spp=4,filter=gaussian", "raytrace:spp=16,filter=gaussian,sigma=0.4"],
        ["raytrace:spp=4", "raytrace:spp=16,pattern=shared"],
        ["raytrace:adaptive=pooled,tolerance=0.1", "raytrace:adaptive=pooled,tolerance=0.01"],
        ["raytrace:spp=4", "raytrace:spp=4,sampler=jittered"],
        ["raytrace:spp=4", "raytrace:of=later,spp=16"],
        [],
    ],
)
def test_what_differs_in_more_or_in_nothing_is_no_family(texts: list[str]) -> None:
    assert group_families([Measured(text, (0.1,), (0.01,)) for text in texts]) == ()


def test_records_without_time_or_error_are_left_out() -> None:
    rows = [Measured("raytrace:spp=4", (0.1,), (0.01,)), Measured("raytrace:spp=16", (0.05,), (0.04,))]
    extra = [
        Measured("raytrace:spp=64", (), (0.1,)),
        Measured("raytrace:spp=64", (0.02,), ()),
        Measured("raytrace:spp=64", (0.02,), (0.0,)),
    ]
    assert one_family(rows + extra).counts == (4, 16)


def test_samples_are_counted_by_the_keys_that_ask_for_them() -> None:
    for text, count in (("raytrace:spp=9", 9), ("raster:passes=3,ssaa=2", 12), ("raster:msaa=4", 1), ("raster:", 1)):
        assert samples_per_pixel(parse_technique(text)) == count


def test_slopes_are_those_of_the_records_from_three_counts_on() -> None:
    family = one_family(by_law("raytrace:spp=N", (64, 4, 16), slope=-0.75))
    assert family.counts == (4, 16, 64)
    assert family.slope is not None
    assert family.time_slope is not None
    assert family.slope.value == pytest.approx(-0.75, abs=1e-12)
    assert family.time_slope.value == pytest.approx(1.0, abs=1e-12)
    assert family.time_slope.extras["interval"] == pytest.approx([1.0, 1.0])
    assert family.slope.extras["interval"] is None
    two = one_family(by_law("raytrace:spp=N", (4, 16)))
    assert (two.slope, two.time_slope) == (None, None)


def test_seeds_give_the_slope_its_interval_and_are_pooled_where_they_do_not_match() -> None:
    rng = np.random.default_rng(1)
    rows = [
        Measured(f"raytrace:spp={n}", tuple(0.2 * n**-0.5 * np.exp(0.05 * rng.normal(size=8))), tuple([1e-3 * n] * 5))
        for n in (4, 16, 64)
    ]
    family = one_family(rows)
    assert family.slope is not None
    low, high = family.slope.extras["interval"]  # type: ignore[misc]
    assert low < -0.5 < high
    assert np.shape(family.curve.errors) == (8, 3)
    odd = one_family([*rows[:2], Measured(rows[2].technique, rows[2].errors[:7], rows[2].seconds[:3])])
    assert np.shape(odd.curve.errors) == (1, 3)
    assert np.shape(odd.curve.times) == (3, 3)
    assert np.asarray(odd.curve.errors)[0, 0] == pytest.approx(math.sqrt(np.mean(np.square(rows[0].errors))))


def test_families_are_compared_at_the_declared_error_and_time_where_they_have_them() -> None:
    counts = (4, 16, 64, 256, 1024)
    families = group_families(
        by_law("raytrace:spp=N,sampler=random", counts) + by_law("raster:passes=N", counts, slope=-0.75, seconds=3e-3)
    )
    comparison = compare_families(families)
    assert (comparison.rmse, comparison.seconds) == (TARGET_RMSE, TARGET_SECONDS)
    assert [score.status for score in comparison.times + comparison.errors] == ["ok"] * 4
    assert [score.value for score in comparison.times] == pytest.approx([1e-3 * 400.0, 3e-3 * 20.0 ** (4 / 3)])
    assert comparison.errors[0].value == pytest.approx(0.2 * (TARGET_SECONDS / 1e-3) ** -0.5)
    lead = find_lead(comparison)
    assert lead is not None
    assert (lead.first.renderer, lead.other.renderer) == ("raster", "raytrace")
    assert lead.speedup.value == pytest.approx(400.0 / (3.0 * 20.0 ** (4 / 3)))


def test_elsewhere_they_are_compared_where_most_of_them_were_measured() -> None:
    rows = (
        by_law("raytrace:spp=N,sampler=random", (4, 16, 64), error=0.83)  # .415 to .1038
        + by_law("raytrace:spp=N", (4, 16, 64), error=0.83, slope=-0.75)  # .293 to .0367
        + by_law("raster:ssaa=N", (2, 4), error=0.9, slope=-0.1, seconds=1.0)  # .84 to .78 in 2 and 4 s
    )
    comparison = compare_families(group_families(rows))
    # .11, the least of the first rounded up, is within two ranges; .037 and .79 are within one, .01 in none. Of the
    # times, 1/60 s is within two as 64 ms is, and the one declared.
    assert comparison.rmse == 0.11
    assert comparison.seconds == TARGET_SECONDS
    assert [score.status for score in comparison.times] == ["ok", "ok", "extrapolated"]
    slow = compare_families(group_families(by_law("raytrace:spp=N", (4, 16), seconds=0.0123)))
    assert slow.seconds == 0.19  # 16 times .0123 is .1968
    assert slow.rmse == pytest.approx(0.05)


def test_the_other_renderer_is_compared_with_where_it_has_been_there() -> None:
    rows = (
        by_law("raytrace:spp=N,sampler=random", (4, 16, 64, 1024))
        + by_law("raytrace:spp=N", (4, 16, 64, 1024), slope=-0.6)
        + by_law("raster:passes=N", (4, 16, 64, 1024), seconds=5e-3)
    )
    lead = find_lead(compare_families(group_families(rows)))
    assert lead is not None
    assert (lead.first.name, lead.other.name) == ("raytrace:spp=N", "raster:passes=N")
    alone = find_lead(compare_families(group_families(rows[:8])))
    assert alone is not None
    assert alone.other.name == "raytrace:spp=N,sampler=random"
    assert find_lead(compare_families(group_families(rows[:4]))) is None


def test_nobody_is_first_while_another_may_be_sooner_where_it_was_not_measured() -> None:
    rows = by_law("raytrace:spp=N,sampler=random", (4, 16, 1024)) + by_law("raytrace:spp=N", (4, 16, 1024), slope=-0.6)
    better = by_law("raster:ssaa=N", (2, 4), error=0.008, seconds=1e-4)
    assert find_lead(compare_families(group_families(rows + better))) is None
    # .01 lies within the first two only, and the third's line goes on to it.
    low = by_law("raytrace:spp=N,sampler=random", (4, 16, 64), error=0.022) + by_law(
        "raytrace:spp=N", (4, 64), error=0.022
    )
    for slope, seconds, told in ((-2.0, 1e-4, False), (-2.0, 1.0, True), (-0.1, 1e-4, True)):
        third = by_law("raster:ssaa=N", (2, 4), error=0.2, slope=slope, seconds=seconds)
        comparison = compare_families(group_families(low + third))
        assert comparison.rmse == TARGET_RMSE
        assert comparison.times[2].status == "extrapolated"
        assert (find_lead(comparison) is not None) == told


def test_families_of_exact_pictures_are_compared_too() -> None:
    rows = by_law("raytrace:spp=N", (4, 16), error=0.0) + by_law("raster:passes=N", (4, 16), error=0.0)
    comparison = compare_families(group_families(rows))
    assert comparison.rmse == TARGET_RMSE
    assert [score.value for score in comparison.times] == pytest.approx([4e-3, 4e-3])
    assert [score.value for score in comparison.errors] == [0.0, 0.0]
    three = one_family(by_law("raytrace:spp=N", (4, 16, 64), error=0.0))
    assert three.slope is not None
    assert (three.slope.value, three.slope.status) == (None, "identical")
