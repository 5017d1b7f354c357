"""ColorVideoVDP, a model of the whole of early vision, flicker included, fitted to what observers said.

It tells whether the measures of this package order techniques as viewers would. It needs torch, some gigabytes, and so
is an extra: it is imported where it is asked for, and without it the score says how to install it. It runs on the CPU
and on one thread, which makes its figures the same everywhere, and faster where other work goes on.
"""

import contextlib
import logging
import sys
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aliasbench.metrics.gate import Signals
from aliasbench.metrics.perceptual import BRIGHTER_THAN_WHITE, DISPLAY, Display, clamped_counts, scaled
from aliasbench.metrics.score import Score, rms

INSTALL = 'pip install "aliasbench[perceptual]"'
# A second at the usual 30 frames per second, four times what the model remembers; it takes about a second a frame of
# 512 x 512.
MOST_FRAMES = 30
SMALLEST = 8
# Share of an error that must vary over the pictures: the model sees contrasts within them and no level.
LEAST_VARIATION = 1e-3


def compute_cvvdp(signals: Signals, *, display: Display = DISPLAY) -> Score:
    """Return ColorVideoVDP's quality in JOD: 10 is identical, one less is worse to three viewers in four.

    Of the first seed, as one viewer sees one video, and of the first 30 frames at most; a single frame is a still
    picture. Shown on `display` in linear steps, white being the contrast, or the brightest of the reference where that
    is more than 1.5 times it. Pixels beyond black and white are clamped and counted.

    The model compares contrasts within pictures: an error that is one colour everywhere and in all frames scores 10,
    even white for black, and is `undefined_uniform_error` here. Extras hold the mean error. Mantiuk, Hanji, Ashraf,
    Asano, Chapiro 2024.
    """
    try:
        pycvvdp, torch = _load()
    except ImportError as missing:
        return Score(None, "not_installed", {"install": INSTALL, "reason": str(missing)})
    height, width = signals.error.shape[-2:]
    if min(height, width) < SMALLEST:
        return Score(None, "undefined_too_small", {"size": [width, height], "smallest": SMALLEST})
    count = min(signals.frames, MOST_FRAMES)
    contrast = signals.scene.contrast
    test, reference = (scaled(p[:count], contrast) for p in (signals.test_rgb[0], signals.reference_rgb))
    brightest = float(np.max(reference))
    white = brightest if brightest > BRIGHTER_THAN_WHITE else 1.0
    counts = {"test": clamped_counts(test, white), "reference": clamped_counts(reference, white)}
    extras = {
        "frames": [signals.frame_start, signals.frame_start + count - 1],
        "video": count > 1,
        "fps": signals.scene.animation.fps,
        "white": white * contrast,
        "pixels_per_degree": display.pixels_per_degree,
        "peak_cd_m2": display.peak_cd_m2,
        "display_contrast": display.contrast,
        "ambient_lux": display.ambient_lux,
        "reflectivity": display.reflectivity,
        "negative_pixels": counts["test"][0],
        "pixels_above_white": counts["test"][1],
        "reference_negative_pixels": counts["reference"][0],
        "reference_pixels_above_white": counts["reference"][1],
    }
    error = rms(signals.error[0, :count])
    if error < signals.floor:
        return Score(None, "below_reference_floor", {**extras, "rmse_floor": signals.floor, "measured_rmse": error})
    shown = [np.clip(p / white, 0.0, 1.0).astype(np.float32) for p in (test, reference)]
    difference = np.subtract(*shown, dtype=np.float64)
    offset = difference.mean(axis=(0, 1, 2))
    extras["mean_error"] = list(offset)
    if offset.any() and rms(difference - offset) <= LEAST_VARIATION * rms(offset):
        return Score(None, "undefined_uniform_error", extras)
    quality = _predict(pycvvdp, torch, shown[0], shown[1], fps=signals.scene.animation.fps, display=display)
    return Score(quality, "ok", extras)


@contextlib.contextmanager
def _unheard() -> Iterator[None]:
    """Keep warnings and log lines of the libraries, which concern their authors, from ours."""
    level = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(level)


def _load() -> tuple[Any, Any]:
    """Import pycvvdp and torch; the former appends its folder, with a `utils` in it, to the path, which is undone."""
    path = list(sys.path)
    try:
        with _unheard():
            import pycvvdp
            import torch
    finally:
        sys.path[:] = path
    return pycvvdp, torch


def _predict(
    pycvvdp: Any,
    torch: Any,
    test: NDArray[np.float32],
    reference: NDArray[np.float32],
    *,
    fps: float,
    display: Display,
) -> float:
    """Return the quality in JOD of display values (frames, h, w, 3) in [0, 1]."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with _unheard(), torch.inference_mode():
            photometry = pycvvdp.vvdp_display_photo_eotf(
                display.peak_cd_m2,
                contrast=display.contrast,
                source_colorspace="BT.709",
                EOTF="1",  # a power: black lifts what is shown, where "linear" would clip it
                E_ambient=display.ambient_lux,
                k_refl=display.reflectivity,
            )
            size = (test.shape[2], test.shape[1])
            model = pycvvdp.cvvdp(
                display_photometry=photometry,
                display_geometry=pycvvdp.vvdp_display_geometry(size, ppd=display.pixels_per_degree),
                quiet=True,
                device=torch.device("cpu"),
            )
            quality, _ = model.predict(test, reference, dim_order="FHWC", frames_per_second=fps if len(test) > 1 else 0)
        return float(quality)
    finally:
        torch.set_num_threads(threads)
