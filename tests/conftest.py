"""What all tests share: property tests draw the same examples every time, so that a red run can be repeated.

HYPOTHESIS_PROFILE=explore draws new ones, many more of them.

The rest is about time. Thousands of tests and what numba knows are never garbage, and looking through them for some
was a tenth of compiling. Runs are written to memory where there is plenty: waiting for a disk proves nothing here. With
several processes the long files come first, so that none is begun when all else is done, and Mesa draws on one thread
in each: waking others for pictures this small costs more than they take over, and what is drawn does not depend on it.
"""

import gc
import os
import shutil
import sys
from pathlib import Path

import pytest
from hypothesis import settings

sys.path.append(str(Path(__file__).parent))  # for modules beside the tests: `random_pictures`, `picture_bounds`

settings.register_profile("steady", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))

_MEMORY, _ROOM = Path("/dev/shm"), 2**31  # bytes that must be free; all tests together write some 200 MB

_LONG = [
    "bench/hard/test_shapes.py",
    "bench/hard/test_edges.py",
    "bench/hard/test_values.py",
    "bench/hard/test_scale.py",
    "bench/hard/test_sizes.py",
    "test_random_pictures.py",
    "test_artifacts.py",
    "test_catalog_agreement.py",
    "test_main_job.py",
    "renderers/raster/test_filters.py",
    "renderers/reference/test_reference.py",
    "renderers/reference/test_converged.py",
    "renderers/reference/test_trials_scenes.py",
    "renderers/reference/test_trials_oracle.py",
    "renderers/reference/test_shutter.py",
    "renderers/reference/test_averaged.py",
    "renderers/reference/test_cutouts.py",
    "renderers/reference/test_whirl.py",
    "renderers/reference/test_textured.py",
    "renderers/reference/test_figures_motion.py",
    "renderers/raytrace/test_filter_convergence.py",
    "renderers/raytrace/test_shutter.py",
    "renderers/raytrace/test_lens.py",
    "renderers/raytrace/test_paths.py",
    "renderers/raytrace/test_adaptive.py",
    "renderers/raytrace/test_lights.py",
    "renderers/raytrace/test_scattering.py",
    "renderers/raytrace/test_convergence.py",
    "renderers/raster/test_lights.py",
    "renderers/raster/test_gloss.py",
    "renderers/sampling/test_bluenoise.py",
    "renderers/sampling/test_patterns.py",
    "reports/test_page_browser.py",
    "bench/test_run.py",
    "bench/test_resume.py",
]


def pytest_configure(config: pytest.Config) -> None:
    config.option.loadscopereorder = False  # files of many tests are not those that take long
    gc.set_threshold(50_000, 10, 10)
    if "PYTEST_XDIST_WORKER" in os.environ:
        os.environ.setdefault("LP_NUM_THREADS", "1")
    if _MEMORY.is_dir() and os.access(_MEMORY, os.W_OK) and shutil.disk_usage(_MEMORY).free > _ROOM:
        os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(_MEMORY))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    folder = Path(__file__).parent
    ranks = {folder / name: rank for rank, name in enumerate(_LONG)}
    items.sort(key=lambda item: ranks.get(item.path, len(ranks)))  # the rest as before


def pytest_collection_finish() -> None:
    gc.collect()
    gc.freeze()


def pytest_unconfigure() -> None:
    gc.unfreeze()  # libraries report at the end what is still there
