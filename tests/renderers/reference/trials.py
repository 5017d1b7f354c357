"""One random case rendered, and a few of its pixels judged by the oracle; and whole campaigns of them.

``python trials.py --kind lens --count 1000 --minutes 10`` (kinds: `random_scenes.CLASSES`) prints a row of the table
and every violation; see `judge` for what one is.
"""

import time
from dataclasses import dataclass

import numpy as np
from oracle import Stage, sample_points
from oracle_filters import Kernel
from oracle_rows import sample_lines
from oracle_rules import integrate_lines, integrate_times
from random_scenes import CLASSES, Case, make_case

from aliasbench.renderers.catalog import render
from aliasbench.scenes.errors import NotAvailableError, UnsupportedScene
from aliasbench.scenes.model import ImageTexture

SPREADS = 5.0  # standard errors
SLOW = 60.0  # seconds worth telling of
EXACT = 1e-11  # what the oracle's own rounding and ties may amount to, relative to the largest colour


@dataclass(frozen=True)
class Verdict:
    """What became of a case.

    Attributes
    ----------
    status : "ok", "refused", "nonfinite" or "outside"
    kind : "bound", "confidence" or ""
    uncertainty, seconds : float
        As the reference stated, and as it took.
    pixels : int
        Judged.
    worst : float
        The largest distance from the oracle.
    bar : float
        The oracle's largest error bar (`SPREADS` standard errors).
    text : str
        Where and how far outside, or why refused.
    """

    status: str
    kind: str = ""
    uncertainty: float = 0.0
    seconds: float = 0.0
    pixels: int = 0
    worst: float = 0.0
    bar: float = 0.0
    text: str = ""


def judge(case: Case, pixels: int = 3, quick: int = 0, sharp: bool = False) -> Verdict:
    """Return the verdict on a case: outside if a pixel is farther from the oracle than both error bars together.

    Parameters
    ----------
    case : Case
    pixels : int
        How many to look at: half of them where the picture changes most.
    quick : int
        How many powers of two fewer samples than usual.
    sharp : bool
        Whether flat colours over an open shutter are integrated by adaptive rules, which takes seconds a pixel.
    """
    start = time.perf_counter()
    try:
        frame = render(case.scene, case.text, size=case.size, frame=case.frame)
    except (NotAvailableError, UnsupportedScene) as error:
        return Verdict("refused", text=str(error))
    seconds = time.perf_counter() - start
    stated, kind = float(frame.uncertainty), frame.uncertainty_kind
    if not np.isfinite(frame.pixels).all() or not np.isfinite(stated) or kind not in ("bound", "confidence"):
        return Verdict("nonfinite", str(kind), stated, seconds)
    worst, bar, notes = 0.0, 0.0, []
    for place in _places(case, frame.pixels, pixels):
        value = frame.pixels[place]
        mean, error = ask_oracle(case, place, quick=quick, sharp=sharp)
        if (np.abs(value - mean) > stated + 0.8 * error).any():
            mean, error = ask_oracle(case, place, quick=quick - 3, seed=1, sharp=True)
        off = np.abs(value - mean)
        worst, bar = max(worst, float(off.max())), max(bar, float(error.max()))
        if (off > stated + error).any():
            notes.append(f"pixel {place}: reference {value.tolist()} oracle {mean.tolist()} +- {error.tolist()}")
    status = "outside" if notes else "ok"
    return Verdict(
        status, str(kind), stated, seconds, min(pixels, case.size[0] * case.size[1]), worst, bar, "; ".join(notes)
    )


def ask_oracle(
    case: Case, place: tuple[int, int], *, quick: int = 0, seed: int = 0, sharp: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Return a pixel's value by the sharpest oracle that takes the case, and `SPREADS` of its standard errors."""
    scene = case.scene
    stage = Stage(scene, case.size, case.frame, linear=case.linear, matrix=case.matrix)
    kernel = Kernel(case.filter, case.radius, case.sigma)
    begin, end = case.shutter
    colors = [scene.background, *(o.color for o in scene.objects), *(q.radiance for q in scene.lights)]
    largest = float(np.abs(np.array(colors)).max())
    curved = case.linear and any(isinstance(t, ImageTexture) and t.alpha_cutoff for t in scene.textures.values())
    if not scene.lights and not curved:
        if begin == end and not scene.camera.lens_radius:
            try:
                mean, error = integrate_lines(stage, kernel, place, begin)
                if error.max() < 1e-6:
                    return mean, error + EXACT * max(1.0, largest)
            except OverflowError:
                pass
        if begin < end and not scene.camera.lens_radius and not scene.textures and sharp:
            try:
                mean, error = integrate_times(stage, kernel, place, (begin, end))
                if np.isfinite(error).all():
                    return mean, error * max(1.0, largest)
            except OverflowError:
                pass
        try:
            log2 = 8 - quick
            mean, error = sample_lines(stage, kernel, place, (begin, end), log2=log2, seed=seed)
            return mean, SPREADS * error + largest * 10.0 / (32 * 2**log2) / 4
        except OverflowError:
            pass
    log2 = 11 - quick
    mean, error = sample_points(stage, kernel, place, (begin, end), log2=log2, seed=seed)
    return mean, SPREADS * error + largest * 10.0 / (32 * 2**log2)


def _places(case: Case, picture: np.ndarray, count: int) -> list[tuple[int, int]]:
    """Return pixels: some by chance, some where neighbours differ."""
    rng = np.random.default_rng([7, case.seed])
    h, w = picture.shape[:2]
    change = np.zeros((h, w))
    for axis in (0, 1):
        if picture.shape[axis] > 1:
            change += np.abs(np.gradient(picture, axis=axis)).sum(axis=2)
    odds = change.ravel() / change.sum() if change.sum() > 0 else np.full(h * w, 1 / (h * w))
    odds = 0.7 * odds + 0.3 / (h * w)
    chosen = rng.choice(h * w, min(count, h * w), replace=False, p=odds / odds.sum())
    return [(int(k) // w, int(k) % w) for k in chosen]


def campaign(
    kind: str, seeds: range, minutes: float, pixels: int = 3, quick: int = 0, sharp=False
) -> list[tuple[int, Verdict]]:
    """Return the verdicts on cases of a class until the time is up, telling of those outside as they come."""
    end, out, told = time.monotonic() + 60 * minutes, [], set()
    for seed in seeds:
        if time.monotonic() > end:
            break
        try:
            verdict = judge(make_case(kind, seed), pixels, quick, sharp)
        except Exception as error:  # noqa: BLE001 - a campaign goes on and reports
            verdict = Verdict("error", text=f"{type(error).__name__}: {error}")
        out.append((seed, verdict))
        if verdict.seconds > SLOW:
            print(f"{kind} {seed}: {verdict.seconds:.0f} s", flush=True)
        if verdict.status not in ("ok", "refused") and not (verdict.status == "error" and verdict.text in told):
            told.add(verdict.text)
            print(f"{kind} {seed}: {verdict}", flush=True)
    return out


def summary(kind: str, verdicts: list[tuple[int, Verdict]]) -> str:
    """Return a row of the table: counts, the stated uncertainties, the worst time."""
    done = [v for _, v in verdicts if v.status in ("ok", "outside")]
    row = f"{kind:24s} trials {len(verdicts):5d}"
    row += "".join(
        f" {s} {sum(v.status == s for _, v in verdicts)}" for s in ("refused", "nonfinite", "error", "outside")
    )
    for name in ("bound", "confidence"):
        some = [v for v in done if v.kind == name]
        if some:
            stated = [v.uncertainty for v in some]
            row += (
                f" | {name} {len(some)}: outside {sum(v.status == 'outside' for v in some)},"
                f" stated median {np.median(stated):.1e} largest {max(stated):.1e},"
                f" off by median {np.median([v.worst for v in some]):.1e},"
                f" oracle +- {np.median([v.bar for v in some]):.1e},"
                f" seconds {np.median([v.seconds for v in some]):.2f} worst {max(v.seconds for v in some):.1f}"
            )
    return row


if __name__ == "__main__":
    import argparse

    parser = argparse.ArgumentParser()
    parser.add_argument("--kind", default=",".join(CLASSES))
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--quick", type=int, default=0)
    parser.add_argument("--pixels", type=int, default=3)
    parser.add_argument("--sharp", action="store_true")
    given = parser.parse_args()
    for which in given.kind.split(","):
        rows = campaign(
            which, range(given.first, given.first + given.count), given.minutes, given.pixels, given.quick, given.sharp
        )
        print(summary(which, rows), flush=True)
