"""Whether shimmer orders techniques as a model of human vision does: against ColorVideoVDP, on scenes that shimmer.

Needs the extra `perceptual`; `python -m pytest tests/metrics/test_perceptual_order.py -s` prints the table.

Within a scene they agree: rank correlations of -0.85 to -0.95, with 111 of 117 pairs of techniques that shimmer unlike
in the same order. All six exceptions set trilinear filtering against passes or rays of several samples: its error is
mostly blur, which counts less in the model. At equal shimmer passes score below rays, probably since they share one
pattern, so that neighbours err alike, at frequencies that are seen, where patterns of each pixel leave fine noise.
Confetti has the weakest rank correlation since four of the techniques make nearly one picture there, and ranks among
equals are chance.

Between scenes shimmer says less (-0.67, where FLIP has -0.97): it is linear in radiance and an average over the
picture, so that a dark ground (confetti: the same error is a greater contrast) and a small object (distant-triangle)
set it off. It is a figure for comparing techniques on one scene.
"""

import importlib.util
from collections.abc import Mapping

import numpy as np
import pytest
from scipy.stats import spearmanr

from aliasbench.metrics.catalog import measure_all
from aliasbench.renderers.catalog import prepare
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Scene

SIZE, FRAMES = (192, 192), 15
SCENES = ("brick-floor", "checker-floor", "confetti", "distant-triangle")
TECHNIQUES = (
    "raytrace:",
    "raytrace:spp=4,sampler=jittered",
    "raytrace:spp=16,sampler=jittered",
    "raytrace:texture=trilinear",
    "raster:",
    "raster:msaa=4",
    "raster:texture=trilinear",
    "raster:passes=4,sampler=jittered",
    "raster:passes=16,sampler=jittered",
)
MEASURES = ("shimmer", "rmse", "flip", "ssim")
# Nearer than this, two techniques shimmer alike: some make the same picture, where a scene has no textures.
ALIKE = 0.1

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("pycvvdp") is None, reason="needs the extra: pip install 'aliasbench[perceptual]'"
    ),
]
Row = Mapping[str, float]


def render_frames(scene: Scene, technique: str) -> tuple[np.ndarray, float]:
    """Pictures (frames, h, w, 3) and the largest uncertainty of any."""
    with prepare(scene, technique, size=SIZE) as prepared:
        frames = [prepared.render(frame=k) for k in range(FRAMES)]
    return np.stack([f.pixels for f in frames]), max(f.uncertainty or 0.0 for f in frames)


@pytest.fixture(scope="module")
def table() -> dict[str, dict[str, Row]]:
    """Every measure by technique, by scene."""
    out: dict[str, dict[str, Row]] = {}
    for name in SCENES:
        scene = load_scene(name)
        truth, uncertainty = render_frames(scene, "reference:")
        out[name] = {}
        print(f"\n{name:<38}" + "".join(f"{m:>10}" for m in (*MEASURES, "JOD")))
        for technique in TECHNIQUES:
            test, _ = render_frames(scene, technique)
            scores = measure_all((*MEASURES, "cvvdp"), test, truth, scene=scene, reference_uncertainty=uncertainty)
            row = {k: s.value for k, s in scores.items() if s.value is not None}
            assert len(row) == len(scores), scores
            out[name][technique] = row
            print(f"  {technique:<36}" + "".join(f"{row[m]:10.4f}" for m in (*MEASURES, "cvvdp")))
    return out


def correlation(rows: list[Row], measure: str) -> float:
    """Spearman's rank correlation of a measure with the quality in JOD."""
    return float(spearmanr([r[measure] for r in rows], [r["cvvdp"] for r in rows]).statistic)


def agreement(rows: list[Row]) -> tuple[int, int]:
    """How many of the pairs that shimmer unlike are in the opposite order in JOD, and how many there are."""
    pairs = [(a, b) for a in rows for b in rows if a["shimmer"] > (1.0 + ALIKE) * b["shimmer"]]
    return sum(a["cvvdp"] < b["cvvdp"] for a, b in pairs), len(pairs)


def test_more_shimmer_is_less_quality_within_a_scene(table):
    for name, by_technique in table.items():
        rows = list(by_technique.values())
        agreeing, pairs = agreement(rows)
        print(
            f"{name}: Spearman's rho with JOD "
            + ", ".join(f"{m} {correlation(rows, m):+.2f}" for m in MEASURES)
            + f"; {agreeing} of {pairs} pairs that differ by {ALIKE:.0%} in shimmer are ordered alike"
        )
        # Nine ranks without any relation are below -0.6 in one of twenty draws, below -0.78 in one of a hundred.
        assert correlation(rows, "shimmer") < -0.78
        assert pairs > 20
        assert agreeing >= 0.9 * pairs


def test_between_scenes_shimmer_says_less(table):
    rows = [row for by_technique in table.values() for row in by_technique.values()]
    for measure in MEASURES:
        print(f"all scenes: {measure} {correlation(rows, measure):+.2f}")
    # 36 ranks without any relation are below -0.39 in one of a hundred draws.
    assert correlation(rows, "shimmer") < -0.39
