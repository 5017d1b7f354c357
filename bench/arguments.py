"""The command line's grammar: commands, options and how their texts are read.

argparse's own complaints become `InputError` like all others, so that every wrong call ends in one sentence and exit
code 2; unknown commands and options name the nearest one.
"""

import argparse
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from aliasbench.bench.wording import shortened, shown
from aliasbench.scenes.errors import InputError, NotAvailableError, unknown_name

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

MAX_SIDE = 65536
MAX_WHOLE = 2**31 - 1

COMMANDS = {
    "doctor": "whether this machine can render, and if not, what helps",
    "list": "the names of scenes, techniques, samplers, filters, metrics and suites",
    "render": "one picture of a scene by a technique",
    "run": "a suite into a run directory: pictures, metrics and times",
    "report": "one offline HTML page from run directories",
    "export": "the records of a run as JSON",
    "compare": "what changed between two runs (not available yet)",
    "history": "how results changed over many runs (not available yet)",
    "merge": "the shards of a run as one (not available yet)",
    "scenes": "scene files: export one to start from, check yours, a contact sheet of all",
}
NOT_YET = ("compare", "history", "merge")
SCENE_ACTIONS = {
    "export": "a scene as a scene file (TOML) that loads as an equal scene",
    "check": "all that is wrong with scene files, with lines; or what they hold and who can draw them",
    "sheet": "every scene, point sampled beside its reference, as pictures and a page",
}
EXECUTORS = ("local", "dask")


class Parser(argparse.ArgumentParser):
    """A parser whose complaints are errors of this project."""

    def print_help(self, file: "SupportsWrite[str] | None" = None) -> None:
        """Write the help; an error of the output is the caller's to see (argparse says nothing of it)."""
        (file or sys.stdout).write(self.format_help())

    def error(self, message: str) -> NoReturn:
        option = re.fullmatch(r"argument (?:-\w/)?(--\w+): expected one argument", message)
        if option is not None:
            what = re.search(rf"{option[1]} ([^\s,\]]+)", self.format_help())
            message = f"{option[1]} needs a value" + (f", {option[1]} {what[1]}" if what else "")
        raise InputError(f"{message} (see {self.prog} --help)")


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the parsed command line; `.command` is the command's name.

    Raises
    ------
    InputError
        For anything wrong with it.
    NotAvailableError
        For a command that this version does not have yet.
    SystemExit
        After printing help or the version.
    """
    parser, commands = _build()
    arguments = _joined(arguments)
    words = [word for word in arguments if not word.startswith("-")]
    wants_help = any(word in ("-h", "--help") for word in arguments)
    if not arguments or (not words and not wants_help and "--version" not in arguments):
        if arguments:
            raise unknown_name("option of aliasbench", shortened(arguments[0]), ("--help", "--version"))
        raise InputError(f"no command given; known: {', '.join(COMMANDS)} (see aliasbench --help)")
    if words and words[0] not in COMMANDS:
        raise unknown_name("command", shortened(words[0]), COMMANDS)
    if words and words[0] == "scenes" and not wants_help:
        known_actions = ", ".join(SCENE_ACTIONS)
        if len(words) < 2:
            raise InputError(f"scenes: no action given; known: {known_actions} (see aliasbench scenes --help)")
        if words[1] not in SCENE_ACTIONS:
            raise unknown_name("action of scenes", shortened(words[1]), SCENE_ACTIONS)
    if words and words[0] in NOT_YET and not wants_help:
        there = ", ".join(name for name in COMMANDS if name not in NOT_YET)
        raise NotAvailableError(f"the command {words[0]} is not available yet; available: {there}")
    known, left_over = parser.parse_known_args(arguments)
    if left_over:
        action = getattr(known, "action", None)
        raise _unexpected(left_over[0], commands[f"{known.command} {action}" if action else known.command])
    return known


def _joined(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with `--size -4x4` as `--size=-4x4`: argparse takes -4x4 for an option and not for wrong."""
    joined: list[str] = []
    for word in arguments:
        if joined and re.fullmatch(r"--[a-z]+", joined[-1]) and re.match(r"-[0-9]", word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def _unexpected(word: str, parser: argparse.ArgumentParser) -> InputError:
    if not word.startswith("-"):
        return InputError(f"{parser.prog}: unexpected {shown(word)} (see {parser.prog} --help)")
    option = word.partition("=")[0]
    return unknown_name(f"option of {parser.prog}", shortened(option), _options(parser))


def _options(parser: argparse.ArgumentParser) -> list[str]:
    usage = parser.format_help()
    return sorted(set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", usage)))


def _build() -> tuple[Parser, dict[str, Parser]]:
    parser = Parser(
        prog="aliasbench",
        description="How much antialiasing quality each millisecond buys, in a rasterizer and in a ray tracer.",
        epilog="Exit codes: 0 ok, 1 failed cases or a machine that cannot render, 2 bad usage or input.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="store_true", help="print the version")
    found = parser.add_subparsers(dest="command", metavar="COMMAND")
    commands = {
        name: found.add_parser(name, help=summary, description=summary, allow_abbrev=False)
        for name, summary in COMMANDS.items()
    }
    _add_json(commands["doctor"])
    section = commands["list"]
    section.add_argument("section", nargs="?", metavar="SECTION", help="only this one")
    section.add_argument("name", nargs="?", metavar="NAME", help="all there is to know of this one")
    page = "of metrics: a page of what they mean, with pictures, goes here"
    section.add_argument("-o", "--output", type=read_path, metavar="DIR", help=page)
    _add_json(section)
    _add_render(commands["render"])
    _add_run(commands["run"])
    report = commands["report"]
    report.add_argument("run_dirs", nargs="+", type=read_path, metavar="RUN_DIR")
    report.add_argument("-o", "--output", type=read_path, required=True, metavar="DIR", help="where the page goes")
    _add_json(report)
    export = commands["export"]
    export.add_argument("run_dir", type=read_path, metavar="RUN_DIR")
    export.add_argument("--format", default="json", metavar="FORMAT", help="json")
    export.add_argument("--json", dest="format", action="store_const", const="json", help="the same as --format json")
    export.add_argument("-o", "--output", type=read_path, metavar="FILE", help="default: standard output")
    return parser, commands | _add_scenes(commands["scenes"])


def _add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print JSON")


def _add_render(render: argparse.ArgumentParser) -> None:
    render.add_argument("scene", metavar="SCENE", help="a scene's name, as in propeller:blades=5, or a file")
    render.add_argument("technique", metavar="TECHNIQUE", help="a technique's name, or text as in raytrace:spp=4")
    render.add_argument("-o", "--output", type=read_path, required=True, metavar="OUT", help="a file, .exr or .png")
    render.add_argument("--size", type=_read(read_size), default=(512, 512), metavar="WxH", help="default 512x512")
    render.add_argument("--frame", type=_read(whole(0)), default=0, metavar="N", help="frame number, default 0")
    render.add_argument("--seed", type=_read(whole(0)), default=0, metavar="N", help="default 0")
    _add_json(render)


def _add_scenes(scenes: argparse.ArgumentParser) -> dict[str, Parser]:
    found = scenes.add_subparsers(dest="action", metavar="ACTION", parser_class=Parser)
    actions = {
        name: found.add_parser(name, help=summary, description=summary, allow_abbrev=False)
        for name, summary in SCENE_ACTIONS.items()
    }
    export, check, sheet = actions["export"], actions["check"], actions["sheet"]
    export.add_argument("scene", metavar="SCENE", help="a scene's name, as in propeller:blades=5, or a file")
    out = "a folder, or a path ending in .toml; images go beside the file (default: all to standard output)"
    export.add_argument("-o", "--output", type=read_path, metavar="DIR", help=out)
    check.add_argument("files", nargs="+", type=read_path, metavar="FILE", help="scene files, or models")
    sheet.add_argument("scene", nargs="*", metavar="SCENE", help="names or files; default: the whole catalog")
    sheet.add_argument("-o", "--output", type=read_path, required=True, metavar="DIR", help="where the pictures go")
    sheet.add_argument("--size", type=_read(read_size), default=(256, 256), metavar="WxH", help="default 256x256")
    sheet.add_argument("--frame", type=_read(whole(0)), default=0, metavar="N", help="frame number, default 0")
    for action in actions.values():
        _add_json(action)
    return {f"scenes {name}": action for name, action in actions.items()}


def _add_run(run: argparse.ArgumentParser) -> None:
    run.add_argument("suite", nargs="?", metavar="SUITE", help="a suite's name or file; without, give --scene")
    run.add_argument("-o", "--output", type=read_path, required=True, metavar="RUN_DIR", help="the run directory")
    run.add_argument("--scene", action="append", default=[], metavar="S", help="only this scene; repeatable")
    run.add_argument("--technique", action="append", default=[], metavar="T", help="only this technique; repeatable")
    run.add_argument("--size", type=_read(read_size), metavar="WxH", help="instead of the suite's")
    run.add_argument("--frames", type=_read(whole(1)), metavar="N", help="instead of the suite's")
    run.add_argument("--seeds", type=_read(whole(1, 4096)), metavar="N", help="how many, instead of the suite's")
    run.add_argument("--rounds", type=_read(whole(1, 100_000)), metavar="N", help="timed renders of each case")
    run.add_argument("--resume", action="store_true", help="go on with the run in RUN_DIR")
    run.add_argument("--fresh", "--overwrite", action="store_true", help="replace the run in RUN_DIR")
    run.add_argument(
        "--shard", type=_read(read_shard), default=(1, 1), metavar="i/n", help="every n-th case, from the i-th"
    )
    run.add_argument("--executor", type=_read(read_executor), default="local", metavar="E", help="local")
    run.add_argument("--workers", type=_read(whole(1)), metavar="N", help="for --executor dask (not available yet)")
    _add_json(run)


def _read(reader: Callable[[str], object]) -> Callable[[str], object]:
    """Return a reader whose sentence argparse keeps (of other errors it keeps only the value)."""

    def read(text: str) -> object:
        try:
            return reader(text)
        except InputError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return read


def whole(low: int, high: int = MAX_WHOLE) -> Callable[[str], int]:
    """Return a reader of whole numbers of a range."""

    def read(text: str) -> int:
        # Python converts no more than some thousand digits; nothing allowed has twenty.
        if not re.fullmatch(r"[+-]?[0-9]{1,20}", text) or not low <= int(text) <= high:
            raise InputError(f"{shown(text)} must be a whole number from {low} to {high}")
        return int(text)

    return read


def read_path(text: str) -> Path:
    """Return a path; a text without a character would be the current folder."""
    if not text:
        raise argparse.ArgumentTypeError("a path is needed")
    return Path(text)


def read_size(text: str) -> tuple[int, int]:
    """Return (width, height) of a text like 512x512."""
    match = re.fullmatch(r"([0-9]+)x([0-9]+)", text)
    if match is None:
        raise InputError(f"{shown(text)} must be WIDTHxHEIGHT, as in 512x512")
    for name, side in zip(("width", "height"), match.groups(), strict=True):
        if len(side) > 20 or not 1 <= int(side) <= MAX_SIDE:
            raise InputError(f"{shown(text)}: {name} must be from 1 to {MAX_SIDE}")
    return int(match[1]), int(match[2])


def read_shard(text: str) -> tuple[int, int]:
    """Return (i, n) of a text like 2/4, i from 1 to n."""
    match = re.fullmatch(r"([0-9]{1,20})/([0-9]{1,20})", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise InputError(f"{shown(text)} must be i/n with i from 1 to n, as in 2/4")
    return int(match[1]), int(match[2])


def read_executor(text: str) -> str:
    """Return the executor's name, where it is there."""
    if text not in EXECUTORS:
        raise unknown_name("executor", shortened(text), EXECUTORS)
    if text != "local":
        raise InputError(f"executor {text} is not available yet; available: local")
    return text
