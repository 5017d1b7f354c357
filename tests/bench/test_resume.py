"""A run that is killed, again and again, ends as if nothing had happened."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

from aliasbench.bench import store
from aliasbench.bench.export import load_run

# A program of its own, because SIGKILL must hit a whole process; its renders cost little and are written to a log.
PROGRAM = """
import sys, time, zlib
import numpy as np
from aliasbench.bench import cli, machine
from aliasbench.renderers import catalog
from aliasbench.renderers.frame import Frame
from aliasbench.scenes import files
from aliasbench.scenes.model import Camera, Scene

class Prepared:
    def __init__(self, scene, technique, size):
        self.scene, self.text, self.size = scene, catalog.resolve_technique(technique).text, size
    def __enter__(self):
        return self
    def __exit__(self, *_):
        pass
    def render(self, frame=0, seed=0):
        log.write(f"{self.scene.name} {self.text} {frame}\\n")
        log.flush()
        time.sleep(0.003)
        number = zlib.crc32(repr((self.scene.name, self.text, frame, seed)).encode())
        pixels = np.random.default_rng(number).random((self.size[1], self.size[0], 3))
        bound = 1e-9 if self.text.startswith("reference") else None
        return Frame(pixels if bound else pixels.astype(np.float32), 0.003, 0.0, 1, uncertainty=bound)

log = open(sys.argv[1], "a")
catalog.prepare = lambda scene, technique, *, size: Prepared(scene, technique, size)
files.load_scene = lambda text: Scene(text, Camera("orthographic", height=2.0))
machine.describe_engines = lambda: {}
machine.project_version = lambda: "0.0"
sys.exit(cli.main(sys.argv[2:]))
"""
SUITE = """
schema = 1
size = [16, 16]
frames = 2
rounds = 6
scenes = ["a", "b", "c", "d", "e"]
techniques = ["raytrace:", "raytrace:spp=4", "raster:", "raster:passes=4"]
metrics = ["rmse", "shimmer"]
"""


def _start(folder: Path, log: str, *arguments: str) -> "subprocess.Popen[bytes]":
    command = [sys.executable, str(folder / "program.py"), str(folder / log), "run", str(folder / "suite.toml")]
    quiet = subprocess.DEVNULL
    return subprocess.Popen([*command, *arguments], stdout=quiet, stderr=quiet, cwd=folder)


def test_killed_at_random_moments_and_resumed_gives_the_undisturbed_run(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    (tmp_path / "suite.toml").write_text(SUITE)
    assert _start(tmp_path, "whole.log", "-o", str(tmp_path / "whole")).wait(60) == 0
    whole = load_run(tmp_path / "whole")
    assert len(whole["records"]) == 20

    generator = random.Random(20)
    run_dir, log = tmp_path / "run", tmp_path / "parts.log"
    log.touch()
    renders = len((tmp_path / "whole.log").read_text().splitlines())
    kills, kept = 0, set[str]()
    while True:
        before = log.read_text().splitlines()
        process = _start(tmp_path, "parts.log", "-o", str(run_dir), "--resume")
        target = len(before) + generator.randrange(1, renders // 3)
        while process.poll() is None and len(log.read_text().splitlines()) < target:
            time.sleep(0.002)
        time.sleep(generator.random() * 0.01)
        if process.poll() is None:
            os.kill(process.pid, signal.SIGKILL)
        killed = process.wait() == -signal.SIGKILL
        repeated = {line.rpartition(" ")[0] for line in log.read_text().splitlines()[len(before) :]}
        assert not repeated & kept, "a finished case was rendered again"
        if not killed:
            assert process.returncode == 0
            break
        kills += 1
        for case in store.read_cases(run_dir):
            if case.is_finished:
                kept.add(f"{case.spec['scene']} {case.spec['technique']}")
            for picture in (case.outcome or {}).get("images", {}).values():
                assert (run_dir / picture).read_bytes() == (tmp_path / "whole" / picture).read_bytes()
    assert kills >= 3
    assert 0 < len(kept) < 20

    parts = load_run(run_dir)
    assert parts["unfinished"] == 0
    assert [{**r, "seconds": len(r["seconds"])} for r in parts["records"]] == [
        {**r, "seconds": len(r["seconds"])} for r in whole["records"]
    ]
    for folder in ("frames", "references"):
        expected = {p.name: p.read_bytes() for p in (tmp_path / "whole" / folder).iterdir()}
        assert {p.name: p.read_bytes() for p in (run_dir / folder).iterdir()} == expected
        assert expected
