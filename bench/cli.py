"""The command line: the one place that prints and decides exit codes.

Results go to standard output, progress and complaints to standard error. 0: ok; 1: failed cases, or a machine that
cannot render; 2: bad usage or input, in one sentence. Heavy modules are imported by the commands that need them, so
that help is there at once.
"""

import argparse
import json
import shlex
import sqlite3
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from aliasbench.bench.arguments import parse
from aliasbench.bench.streams import discard_output, open_streams, writing_output
from aliasbench.bench.wording import certainty, duration, printable, sentence
from aliasbench.scenes.errors import InputError, UnsupportedScene, unknown_name

if TYPE_CHECKING:
    from aliasbench.bench.export import Run

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
NOWHERE = "cannot print: standard output is closed"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return the exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; default: those of the process.
    """
    can_print = open_streams()
    try:
        code = _run_command(sys.argv[1:] if arguments is None else list(arguments), can_print)
    except BrokenPipeError:
        # Whoever read the output has seen enough; what is still buffered must not complain at exit.
        discard_output()
        return OK
    except UnsupportedScene as error:
        return _complain(f"unsupported: {error}", BAD_INPUT)
    except InputError as error:
        return _complain(str(error), BAD_INPUT)
    except OSError as error:
        where = f" ({str(error.filename)!r})" if error.filename else ""
        return _complain(f"cannot go on: {error.strerror or error}{where}", BAD_INPUT)
    except sqlite3.Error as error:
        return _complain(f"cannot go on: {error}", BAD_INPUT)
    except MemoryError:
        return _complain("not enough memory for this; choose a smaller size", BAD_INPUT)
    except KeyboardInterrupt:
        return _complain("interrupted", INTERRUPTED)
    return code


def _say(text: str) -> None:
    with writing_output():
        print(text)


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _complain(text: str, code: int) -> int:
    print(f"aliasbench: {sentence(text)}", file=sys.stderr)
    return code


def _run_command(arguments: Sequence[str], can_print: bool) -> int:
    try:
        with writing_output():
            options = parse(arguments)
    except SystemExit as done:
        if not can_print:
            raise InputError(NOWHERE) from None
        with writing_output():
            return int(done.code or 0)
    # Files are worth making without it; what is only printed is not.
    if not can_print and (getattr(options, "output", None) is None or getattr(options, "json", False)):
        raise InputError(NOWHERE)
    if options.version:
        from aliasbench.bench.machine import project_version

        _say(f"aliasbench {project_version()}")
        return OK
    return _COMMANDS[options.command](options)


def _print_json(value: object) -> None:
    _say(json.dumps(value, indent=2, allow_nan=False))


def _doctor(options: argparse.Namespace) -> int:
    from aliasbench.bench.doctor import describe, diagnose

    diagnosis = diagnose()
    if options.json:
        _print_json(diagnosis)
    else:
        _say("\n".join(describe(diagnosis)))
    return OK if diagnosis["ok"] else FAILED


def _list(options: argparse.Namespace) -> int:
    from aliasbench.bench.listing import SECTIONS, describe

    if options.section is not None and options.section not in SECTIONS:
        raise unknown_name("section", options.section, SECTIONS)
    chosen = [options.section] if options.section else list(SECTIONS)
    rows = {section: SECTIONS[section]() for section in chosen}
    if options.name is not None:
        by_name = {str(row["name"]): row for row in rows[options.section]}
        if options.name not in by_name:
            raise unknown_name(f"name of {options.section}", options.name, by_name)
        rows = {options.section: [by_name[options.name]]}
    if options.output is not None:
        return _list_as_page(options)
    if options.json:
        _print_json(rows)
    else:
        _say(
            "\n\n".join(
                "\n".join(describe(section, found, whole=options.name is not None)) for section, found in rows.items()
            )
        )
    return OK


def _list_as_page(options: argparse.Namespace) -> int:
    if options.section != "metrics":
        raise InputError("list -o: only metrics have a page; of scenes: aliasbench scenes sheet -o DIR")
    from aliasbench.reports.guide_page import write_guide

    names = [options.name] if options.name else []
    page, sections = write_guide(options.output, names, on_step=lambda line: _tell(printable(line)))
    if options.json:
        scores = {s.metric.name: [shot.as_data() for shot in s.shots] for s in sections}
        _print_json({"page": str(page), "metrics": scores})
    else:
        _say(printable(str(page)))
    return OK


def _render(options: argparse.Namespace) -> int:
    from aliasbench.bench.display import waiting
    from aliasbench.bench.frames import check_output, write_image
    from aliasbench.renderers import catalog
    from aliasbench.scenes.files import load_scene

    check_output(options.output)
    technique = catalog.resolve_technique(options.technique)
    scene = load_scene(options.scene)
    with waiting(f"{scene.name} by {technique.text}", _tell) as progress:
        frame = catalog.render(
            scene, technique, size=options.size, frame=options.frame, seed=options.seed, progress=progress
        )
    write_image(options.output, frame.pixels)
    facts = {
        "scene": scene.name,
        "technique": technique.text,
        "size": list(options.size),
        "frame": options.frame,
        "seed": options.seed,
        "output": str(options.output),
        "seconds": frame.seconds,
        "setup_seconds": frame.setup_seconds,
        "samples": frame.samples,
        "uncertainty": frame.uncertainty,
        "uncertainty_kind": frame.uncertainty_kind,
    }
    if options.json:
        _print_json(facts)
    else:
        known = "" if frame.uncertainty is None else f", {certainty(frame.uncertainty, frame.uncertainty_kind)}"
        _say(printable(f"{options.output}: {scene.name} by {technique.text}, {duration(frame.seconds)}{known}"))
    return OK


def _run(options: argparse.Namespace) -> int:
    from aliasbench.bench.display import progress
    from aliasbench.bench.export import load_run
    from aliasbench.bench.run import start_run
    from aliasbench.bench.suite import Request

    if options.workers is not None:
        raise InputError("--workers is for --executor dask, which is not available yet")
    request = Request(
        options.suite,
        tuple(options.scene),
        tuple(options.technique),
        options.size,
        options.frames,
        options.seeds,
        options.rounds,
        options.shard,
    )
    try:
        with progress(_tell) as on_step:
            start_run(request, options.output, resume=options.resume, fresh=options.fresh, on_step=on_step)
    except KeyboardInterrupt:
        again = f"aliasbench run -o {shlex.quote(str(options.output))} --resume"
        return _complain(f"interrupted; what is done is kept, and goes on with: {again}", INTERRUPTED)
    run = load_run(options.output)
    if options.json:
        _print_json(run)
    else:
        _print_table(run, options.output)
    return FAILED if any(record["status"] == "failed" for record in run["records"]) else OK


def _print_table(run: "Run", run_dir: Path) -> None:
    from rich.console import Console

    from aliasbench.bench.table import failure_lines, legend_lines, record_tables, total_line

    width = None if sys.stdout.isatty() else 140
    console = Console(width=width, highlight=False)
    with console.capture() as tables:
        for table in record_tables(run, console.width):
            console.print(table)
    lines = [*legend_lines(run, console.width), *failure_lines(run), f"{printable(str(run_dir))}: {total_line(run)}"]
    _say(tables.get() + "\n".join(lines))


def _report(options: argparse.Namespace) -> int:
    from aliasbench.reports.page import write_report

    page = write_report(options.run_dirs, options.output)
    if options.json:
        _print_json({"report": str(page)})
    else:
        _say(printable(str(page)))
    return OK


def _export(options: argparse.Namespace) -> int:
    from aliasbench.bench.export import load_run

    if options.format != "json":
        raise unknown_name("format", options.format, ["json"])
    text = json.dumps(load_run(options.run_dir), indent=2, allow_nan=False)
    if options.output is None:
        _say(text)
        return OK
    try:
        options.output.write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write {str(options.output)!r}: {error.strerror or error}") from None
    return OK


def _scenes(options: argparse.Namespace) -> int:
    return {"export": _scenes_export, "check": _scenes_check, "sheet": _scenes_sheet}[options.action](options)


def _scenes_export(options: argparse.Namespace) -> int:
    from aliasbench.bench.scene_files import export_files, export_text

    if options.output is None:
        text = export_text(options.scene)
        _print_json({"scene": options.scene, "text": text}) if options.json else _say(text.removesuffix("\n"))
        return OK
    paths = [str(path) for path in export_files(options.scene, options.output)]
    _print_json({"scene": options.scene, "files": paths}) if options.json else _say("\n".join(map(printable, paths)))
    return OK


def _scenes_check(options: argparse.Namespace) -> int:
    from aliasbench.bench.scene_files import check_files, checked_lines, checked_row

    checked, unreadable = check_files(options.files)
    wrong = [c for c in checked if c.scene is None]
    if options.json:
        _print_json({"files": [checked_row(c) for c in checked], "unreadable": unreadable})
    elif checked:
        _say("\n".join(printable(line) for c in checked for line in checked_lines(c)))
    if not wrong and not unreadable:
        return OK
    found = ", ".join(f"{len(c.findings)} in {c.file}" for c in wrong)
    for text in [*unreadable, *([f"problems: {found}"] if found else [])]:
        _complain(text, BAD_INPUT)
    return BAD_INPUT


def _scenes_sheet(options: argparse.Namespace) -> int:
    from aliasbench.bench.sheet import make_sheet

    sheet = make_sheet(
        options.scene,
        options.output,
        size=options.size,
        frame=options.frame,
        on_step=lambda line: _tell(printable(line)),
    )
    if options.json:
        _print_json(sheet.as_data())
    else:
        _say("\n".join(printable(str(path)) for path in (sheet.index, sheet.overview, *sheet.images)))
    return OK


_COMMANDS: Mapping[str, Callable[[argparse.Namespace], int]] = {
    "doctor": _doctor,
    "list": _list,
    "render": _render,
    "run": _run,
    "report": _report,
    "export": _export,
    "scenes": _scenes,
}
