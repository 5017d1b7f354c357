"""The project as it is installed: the namespace, its packages, what a wheel carries, and which way imports run."""

import ast
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LAYERS = {"scenes": 0, "renderers": 1, "metrics": 1, "bench": 2, "reports": 3}
# Only the command line imports everything.
ABOVE_ALL = {"bench/cli.py"}


def modules() -> Iterator[Path]:
    for layer in LAYERS:
        yield from sorted((ROOT / layer).rglob("*.py"))


def test_the_package_list_names_every_folder_with_modules() -> None:
    listed = set(tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["packages"])
    found = {"aliasbench." + ".".join(p.parent.relative_to(ROOT).parts) for p in modules()}
    assert listed == found


def imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (name.name for name in node.names)


@pytest.mark.parametrize("path", list(modules()), ids=lambda p: p.relative_to(ROOT).as_posix())
def test_imports_run_one_way(path: Path) -> None:
    name = path.relative_to(ROOT).as_posix()
    if name in ABOVE_ALL:
        return
    own = path.relative_to(ROOT).parts[0]
    for module in imported(path):
        if module.startswith("aliasbench."):
            other = module.split(".")[1]
            assert other == own or LAYERS[other] < LAYERS[own], f"{name} imports {module}"


@pytest.mark.parametrize("path", list(modules()), ids=lambda p: p.relative_to(ROOT).as_posix())
def test_a_module_says_why_it_exists_and_only_the_command_line_prints_or_exits(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert ast.get_docstring(tree), f"{path.name} opens without saying why it exists"
    if path.relative_to(ROOT).as_posix() == "bench/cli.py":
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            assert ast.unparse(node.func) not in ("print", "exit", "quit", "sys.exit", "os._exit"), path


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the working tree."""
    out = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(out), str(ROOT)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    (path,) = out.glob("*.whl")
    return path


def test_a_wheel_carries_every_module_and_data_file(wheel: Path) -> None:
    inside = set(zipfile.ZipFile(wheel).namelist())
    wanted = {f"aliasbench/{p.relative_to(ROOT).as_posix()}" for p in modules()}
    for layer in LAYERS:
        for kind in ("*.glsl", "*.j2", "*.css", "*.js", "*.toml", "*.glb"):
            wanted |= {f"aliasbench/{p.relative_to(ROOT).as_posix()}" for p in (ROOT / layer).rglob(kind)}
    assert wanted <= inside
    assert not [name for name in inside if name.startswith(("tests/", "aliasbench/tests"))]


def test_a_wheel_works_where_the_sources_are_not(wheel: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    program = (
        "import sys; sys.path.insert(0, sys.argv[1]); sys.meta_path[:] = "
        "[f for f in sys.meta_path if 'editable' not in getattr(f, '__module__', '') + repr(f)]\n"
        "import aliasbench.bench.cli as cli\n"
        "assert cli.__file__.startswith(sys.argv[1]), cli.__file__\n"
        "raise SystemExit(cli.main(['list', 'scenes']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "site")],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert "near-horizontal-edge" in done.stdout
