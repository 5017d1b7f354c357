"""The command line: the one place that prints and decides exit codes.

Results go to standard output, progress and complaints to standard error. 0: ok; 1: failed cases, or a machine that
cannot render; 2: bad usage or input, in one sentence. Heavy modules are imported by the commands that need them, so
that help is there at once.
"""

import argparse
import io
import json
import os
import sqlite3
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from aliasbench.bench.arguments import parse
from aliasbench.scenes.errors import InputError, UnsupportedScene, unknown_name

if TYPE_CHECKING:
    from aliasbench.bench.run import Step

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return the exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; default: those of the process.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        code = _run_command(sys.argv[1:] if arguments is None else list(arguments))
        sys.stdout.flush()
    except BrokenPipeError:
        # Whoever read the output has seen enough; what is still buffered must not complain at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except UnsupportedScene as error:
        return _complain(f"unsupported: {error}", BAD_INPUT)
    except InputError as error:
        return _complain(str(error), BAD_INPUT)
    except (OSError, sqlite3.Error) as error:
        return _complain(f"cannot go on: {error}", BAD_INPUT)
    except MemoryError:
        return _complain("not enough memory for this; choose a smaller size", BAD_INPUT)
    except KeyboardInterrupt:
        return _complain("interrupted", INTERRUPTED)
    return code


def _complain(text: str, code: int) -> int:
    print(f"aliasbench: {' '.join(text.split())}", file=sys.stderr)
    return code


def _run_command(arguments: Sequence[str]) -> int:
    try:
        options = parse(arguments)
    except SystemExit as done:
        return int(done.code or 0)
    if options.version:
        from aliasbench.bench.machine import project_version

        print(f"aliasbench {project_version()}")
        return OK
    return _COMMANDS[options.command](options)


def _print_json(value: object) -> None:
    print(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False))


def _doctor(options: argparse.Namespace) -> int:
    from aliasbench.bench.doctor import describe, diagnose

    diagnosis = diagnose()
    if options.json:
        _print_json(diagnosis)
    else:
        print("\n".join(describe(diagnosis)))
    return OK if diagnosis["ok"] else FAILED


def _list(options: argparse.Namespace) -> int:
    from aliasbench.bench.listing import SECTIONS, describe

    if options.section is not None and options.section not in SECTIONS:
        raise unknown_name("section", options.section, SECTIONS)
    chosen = [options.section] if options.section else list(SECTIONS)
    rows = {section: SECTIONS[section]() for section in chosen}
    if options.json:
        _print_json(rows)
    else:
        print("\n\n".join("\n".join(describe(section, found)) for section, found in rows.items()))
    return OK


def _render(options: argparse.Namespace) -> int:
    from aliasbench.bench.frames import check_output, write_image
    from aliasbench.renderers import catalog
    from aliasbench.scenes.files import load_scene

    check_output(options.output)
    technique = catalog.resolve_technique(options.technique)
    scene = load_scene(options.scene)
    frame = catalog.render(scene, technique, size=options.size, frame=options.frame, seed=options.seed)
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
        print(f"{options.output}: {scene.name} by {technique.text}, {frame.seconds * 1e3:.3g} ms")
    return OK


def _run(options: argparse.Namespace) -> int:
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
        with _progress() as on_step:
            start_run(request, options.output, resume=options.resume, fresh=options.fresh, on_step=on_step)
    except KeyboardInterrupt:
        again = f"aliasbench run -o {options.output} --resume"
        return _complain(f"interrupted; what is done is kept, and goes on with: {again}", INTERRUPTED)
    run = load_run(options.output)
    if options.json:
        _print_json(run)
    else:
        _print_table(options.output)
    return FAILED if any(record["status"] == "failed" for record in run["records"]) else OK


def _print_table(run_dir: Path) -> None:
    from rich.console import Console

    from aliasbench.bench.export import load_run
    from aliasbench.bench.table import failure_lines, record_tables

    run = load_run(run_dir)
    width = None if sys.stdout.isatty() else 140
    console = Console(width=width, highlight=False)
    for table in record_tables(run, console.width):
        console.print(table)
    for line in failure_lines(run):
        print(line)
    counts = {s: sum(r["status"] == s for r in run["records"]) for s in ("ok", "failed", "unsupported")}
    print(f"{run_dir}: " + ", ".join(f"{count} {status}" for status, count in counts.items()))


@contextmanager
def _progress() -> "Iterator[Callable[[Step], None]]":
    """Yield a listener that shows how far the run is: a bar with the time left, or a line for each thing begun."""
    if not sys.stderr.isatty():
        said: list[str] = []

        def say(step: "Step") -> None:
            if step.doing not in said[-1:]:
                said.append(step.doing)
                print(f"[{step.done}/{step.total}] {step.doing}", file=sys.stderr, flush=True)

        yield say
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=None)

        def show(step: "Step") -> None:
            bar.update(task, completed=step.done, total=step.total, description=step.doing)

        yield show


def _report(options: argparse.Namespace) -> int:
    from aliasbench.reports.page import write_report

    page = write_report(options.run_dirs, options.output)
    if options.json:
        _print_json({"report": str(page)})
    else:
        print(page)
    return OK


def _export(options: argparse.Namespace) -> int:
    from aliasbench.bench.export import load_run

    if options.format != "json":
        raise unknown_name("format", options.format, ["json"])
    text = json.dumps(load_run(options.run_dir), indent=2, ensure_ascii=False, allow_nan=False)
    if options.output is None:
        print(text)
        return OK
    try:
        options.output.write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write {str(options.output)!r}: {error.strerror or error}") from None
    return OK


_COMMANDS: Mapping[str, Callable[[argparse.Namespace], int]] = {
    "doctor": _doctor,
    "list": _list,
    "render": _render,
    "run": _run,
    "report": _report,
    "export": _export,
}
