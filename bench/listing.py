"""What there is to name on the command line and in suites, with a line on each: read from the registries."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, is_dataclass

from aliasbench.bench.suite_file import SUITES

Rows = list[dict[str, object]]


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
    from aliasbench.metrics.score import Metric

    def summary(m: Metric) -> str:
        return (
            f"{m.label} ({m.unit}; better: {m.better}{'; only where a suite names it' if m.name in OPTIONAL else ''})"
        )

    return [
        {"name": m.name, "summary": summary(m), "unit": m.unit, "better": m.better}
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


def _plain(parameter: object) -> object:
    if is_dataclass(parameter) and not isinstance(parameter, type):
        return asdict(parameter)
    return parameter


def describe(section: str, rows: Rows, *, whole: bool = False) -> list[str]:
    """Return a section as lines for people, one for each name; with `whole`, scenes with their parameters."""
    width = max((len(str(row["name"])) for row in rows), default=0)
    lines = [f"{section}:"]
    for row in rows:
        lines.append(f"  {row['name']!s:<{width}}  {row['summary']}".rstrip())
        parameters = row.get("parameters")
        for name, p in parameters.items() if whole and isinstance(parameters, dict) else ():
            allowed = " or ".join(p["names"]) if "names" in p else f"{p['low']:.10g} to {p['high']:.10g}"
            lines.append(f"    {name}={p['default']}: {p['meaning']} ({allowed})")
    if section == "scenes" and not whole:
        lines.append("  (parameters: aliasbench list scenes NAME)")
    return lines
