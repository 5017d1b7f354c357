"""Families of techniques: records that differ in nothing but their sample count are one curve of time against error.

A family is what its members resolve to, so that a sampler that is named and one that is the default are the same. What
is compared between families (the time to one error, the error in one time) is read off at an error and a time that at
least two of them have really reached, declared ones where possible.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aliasbench.metrics.convergence import fit_slope
from aliasbench.metrics.equal_error import Curve, error_at_time, speedup_at_error, time_to_error
from aliasbench.metrics.score import Score
from aliasbench.renderers.catalog import resolve_technique
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError

# A hundredth of the contrast is where an edge begins to look smooth; a sixtieth of a second is a screen's frame.
TARGET_RMSE = 0.01
TARGET_SECONDS = 1.0 / 60.0
FEWEST_COUNTS = 3  # for a slope: through two points any line is straight
COUNT_KEYS = ("spp", "passes", "ssaa")


@dataclass(frozen=True, slots=True)
class Measured:
    """What is known of one technique on one scene.

    Attributes
    ----------
    technique : str
        Its text, or a name of `TECHNIQUES`.
    errors : tuple of float
        RMSE of each seed, or of all of them as one number.
    seconds : tuple of float
        Raw timings, round after round.
    """

    technique: str
    errors: tuple[float, ...]
    seconds: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Family:
    """Techniques that differ in their sample count only, in order of it.

    Attributes
    ----------
    name : str
        The technique text with N for the count, as in ``raytrace:spp=N,sampler=jittered``.
    renderer : str
    counts : tuple of int
        Samples a pixel; at least two different ones.
    curve : Curve
        Seconds (rounds, counts) and RMSE (seeds, counts).
    slope, time_slope : Score or None
        Of log RMSE and log time over log count (see `fit_slope`); None of fewer than `FEWEST_COUNTS` counts.
    """

    name: str
    renderer: str
    counts: tuple[int, ...]
    curve: Curve
    slope: Score | None
    time_slope: Score | None

    @property
    def errors(self) -> tuple[float, float]:
        """The largest RMSE and the least."""
        pooled = np.sqrt(np.mean(np.square(np.asarray(self.curve.errors)), axis=0))
        return float(pooled.max()), float(pooled.min())

    @property
    def seconds(self) -> tuple[float, float]:
        """The least time and the greatest."""
        medians = np.median(np.asarray(self.curve.times), axis=0)
        return float(medians.min()), float(medians.max())


@dataclass(frozen=True, slots=True)
class Comparison:
    """Families at one error and in one time; `times` and `errors` are scores in the order of `families`."""

    families: tuple[Family, ...]
    rmse: float
    seconds: float
    times: tuple[Score, ...]
    errors: tuple[Score, ...]


@dataclass(frozen=True, slots=True)
class Lead:
    """The family that is first at the common error, the one it is compared with, and how many times sooner it is."""

    first: Family
    other: Family
    time: Score
    speedup: Score


def group_families(measured: Sequence[Measured]) -> tuple[Family, ...]:
    """Return the families of some records of one scene, in order of appearance; records without a sibling are in none.

    Records without a time or an error, and texts that are no technique of this version, are left out.
    """
    groups: dict[Technique, list[tuple[int, Technique, Measured]]] = {}
    for one in measured:
        if not one.errors or not one.seconds or min(one.seconds) <= 0.0:
            continue
        try:
            technique = resolve_technique(one.technique)
        except InputError:
            continue
        groups.setdefault(_without_count(technique), []).append((samples_per_pixel(technique), technique, one))
    families = []
    for members in groups.values():
        members.sort(key=lambda member: member[0])
        counts = tuple(count for count, _, _ in members)
        if len(set(counts)) > 1:
            families.append(_family(counts, [t for _, t, _ in members], [one for _, _, one in members]))
    return tuple(families)


def samples_per_pixel(technique: Technique) -> int:
    """Return the samples that the count keys ask for: `spp`, or `passes` times the square of `ssaa`."""
    return technique.spp * technique.passes * technique.ssaa**2


def compare_families(families: Sequence[Family]) -> Comparison:
    """Return all families (at least one) at one error and in one time.

    The error is the one that most have within what was measured of them, of `TARGET_RMSE` and the least of each rounded
    up to two digits; of several such errors the nearest to `TARGET_RMSE`. So is the time, of `TARGET_SECONDS` and the
    longest of each rounded down.
    """
    rmse = _most_common([f.errors[::-1] for f in families], TARGET_RMSE, [f.errors[1] for f in families], math.ceil)
    seconds = _most_common([f.seconds for f in families], TARGET_SECONDS, [f.seconds[1] for f in families], math.floor)
    return Comparison(
        tuple(families),
        rmse,
        seconds,
        tuple(time_to_error(*f.curve, rmse) for f in families),
        tuple(error_at_time(*f.curve, seconds) for f in families),
    )


def find_lead(comparison: Comparison) -> Lead | None:
    """Return who reaches the common error first, against the other renderer's first where there is one.

    None where fewer than two families have reached it within what was measured, or where another one, of which it was
    not measured, may be sooner.
    """
    families = comparison.families
    reached, rumoured = [], []
    for number, (family, score) in enumerate(zip(families, comparison.times, strict=True)):
        if score.status == "ok" and score.value is not None:
            reached.append((score.value, number))
        elif comparison.rmse > family.errors[0]:
            rumoured.append(family.seconds[0])
        elif score.value is not None:
            rumoured.append(score.value)
    if len(reached) < 2 or min(reached)[0] > min(rumoured, default=math.inf):
        return None
    order = [number for _, number in sorted(reached)]
    first = families[order[0]]
    others = [n for n in order if families[n].renderer != first.renderer] or order[1:]
    other = families[others[0]]
    speedup = speedup_at_error(other.curve, first.curve, comparison.rmse)
    return Lead(first, other, comparison.times[order[0]], speedup)


def _family(counts: tuple[int, ...], techniques: Sequence[Technique], members: Sequence[Measured]) -> Family:
    rounds = min(len(one.seconds) for one in members)
    seeds = {len(one.errors) for one in members}
    if len(seeds) == 1:
        errors = np.array([one.errors for one in members]).T
    else:
        errors = np.array([[math.sqrt(np.mean(np.square(one.errors)).item()) for one in members]])
    times = np.array([one.seconds[:rounds] for one in members]).T
    enough = len(set(counts)) >= FEWEST_COUNTS
    return Family(
        _name(techniques),
        techniques[0].renderer,
        counts,
        Curve(times, errors),
        fit_slope(counts, errors) if enough else None,
        fit_slope(counts, times, pool="median") if enough else None,
    )


def _without_count(technique: Technique) -> Technique:
    return replace(technique, text="", spp=1, passes=1, ssaa=1)


def _name(techniques: Sequence[Technique]) -> str:
    """Return the text of the last, with N for what differs: the one with most samples names all that is not default."""
    head, _, tail = techniques[-1].text.partition(":")
    parts = [part.strip() for part in tail.split(",")]
    keys = {part.partition("=")[0].strip(): part for part in parts}
    words = []
    for key, part in keys.items():
        varies = key in COUNT_KEYS and len({getattr(t, key) for t in techniques}) > 1
        words.append(f"{key}={'k' if key == 'ssaa' else 'N'}" if varies else part)
    return f"{head}:{','.join(words)}"


def _most_common(
    ranges: Sequence[tuple[float, float]], target: float, others: Sequence[float], rounding: Callable[[float], int]
) -> float:
    """Return which of a target and some other figures lies in most ranges, the nearest to the target of those."""
    candidates = [target, *(_two_digits(other, rounding) for other in others if other > 0.0)]

    def rank(figure: float) -> tuple[int, float]:
        return -sum(low <= figure <= high for low, high in ranges), abs(math.log(figure / target))

    return min(candidates, key=rank)


def _two_digits(value: float, rounding: Callable[[float], int]) -> float:
    exponent = math.floor(math.log10(value)) - 1
    # What has two digits already stays what it is, however its quotient is rounded.
    return float(f"{rounding(round(value / 10.0**exponent, 9))}e{exponent}")
