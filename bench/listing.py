"""What there is to name on the command line and in suites, with a line on each: read from the registries."""

import textwrap
from collections.abc import Callable, Mapping
from dataclasses import asdict, is_dataclass

from aliasbench.bench.suite_file import SUITES

Rows = list[dict[str, object]]
WIDTH = 100  # characters of a line of running text


def _scenes() -> Rows:
    from aliasbench.scenes.catalog import SCENES

    return [
        {"name": name, "summary": entry.summary, "parameters": {k: _plain(p) for k, p in entry.parameters.items()}}
        for name, entry in SCENES.items()
    ]


def _techniques() -> Rows:
    from aliasbench.renderers.catalog import TECHNIQUES

    return [{"name": name, "summary": text} for name, text in TECHNIQUES.items()]


def _samplers() -> Rows:
    from aliasbench.renderers.technique import SAMPLER_SUMMARIES

    return [{"name": name, "summary": summary} for name, summary in SAMPLER_SUMMARIES.items()]


def _filters() -> Rows:
    from aliasbench.renderers.technique import FILTER_RADII

    return [
        {"name": name, "summary": f"radius {radius:g} pixels", "radius": radius}
        for name, radius in FILTER_RADII.items()
    ]


def _metrics() -> Rows:
    from aliasbench.metrics.catalog import METRICS, OPTIONAL
    from aliasbench.metrics.guide import GUIDE
    from aliasbench.metrics.score import NEEDS, Metric

    def summary(m: Metric) -> str:
        return (
            f"{m.label} ({m.unit}; better: {m.better}{'; only where a suite names it' if m.name in OPTIONAL else ''})"
        )

    return [
        {
            "name": m.name,
            "summary": summary(m),
            "unit": m.unit,
            "better": m.better,
            "guide": {**asdict(GUIDE[m.name]), "needs": "; ".join(NEEDS[need] for need in m.needs), "source": m.source},
        }
        for m in (*METRICS.values(), *OPTIONAL.values())
    ]


def _suites() -> Rows:
    return [{"name": name, "summary": entry.summary} for name, entry in SUITES.items()]


SECTIONS: Mapping[str, Callable[[], Rows]] = {
    "scenes": _scenes,
    "techniques": _techniques,
    "samplers": _samplers,
    "filters": _filters,
    "metrics": _metrics,
    "suites": _suites,
}

MORE: Mapping[str, str] = {
    "scenes": "parameters: aliasbench list scenes NAME",
    "metrics": "what one means: aliasbench list metrics NAME; all with pictures: aliasbench list metrics -o DIR",
}


def _plain(parameter: object) -> object:
    if is_dataclass(parameter) and not isinstance(parameter, type):
        return asdict(parameter)
    return parameter


def describe(section: str, rows: Rows, *, whole: bool = False) -> list[str]:
    """Return a section as lines for people, one for each name; with `whole`, all there is to know of each."""
    width = max((len(str(row["name"])) for row in rows), default=0)
    lines = [f"{section}:"]
    for row in rows:
        lines.append(f"  {row['name']!s:<{width}}  {row['summary']}".rstrip())
        parameters = row.get("parameters")
        for name, p in parameters.items() if whole and isinstance(parameters, dict) else ():
            allowed = " or ".join(p["names"]) if "names" in p else f"{p['low']:.10g} to {p['high']:.10g}"
            lines.append(f"    {name}={p['default']}: {p['meaning']} ({allowed})")
        guide = row.get("guide")
        if whole and isinstance(guide, dict):
            lines += _guide_lines(guide)
    if section in MORE and not whole:
        lines.append(f"  ({MORE[section]})")
    return lines


def _guide_lines(guide: Mapping[str, object]) -> list[str]:
    """Return what is to know of a metric: headings on the left, wrapped texts beside them."""
    heads = {key: f"    {key.replace('_', ' ')}:" for key in guide}
    width = max(map(len, heads.values())) + 2
    lines = []
    for key, text in guide.items():
        lines += textwrap.wrap(
            str(text),
            WIDTH,
            initial_indent=heads[key].ljust(width),
            subsequent_indent=" " * width,
            break_long_words=False,
            break_on_hyphens=False,
        )
    return lines
