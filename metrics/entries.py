"""The table of all metrics: a metric is one function and one entry here.

`needs` says which fact of the scene it relies on; without it the metric is not applicable, never zero.
"""

from collections.abc import Mapping

from aliasbench.metrics import (
    bias,
    error,
    gaps,
    jaggies,
    moire,
    mtf,
    perceptual,
    separation,
    sharpness,
    shimmer,
    strobing,
    structure,
    translation,
    video_quality,
)
from aliasbench.metrics.score import Metric

_WANG = "Wang, Bovik, Sheikh, Simoncelli 2004"
_BURNS = "area locator of a known edge; after Burns 2006, ISO/IEC 24790"
_ANDERSSON = "Andersson et al. 2020, for bright scenes 2021; OpenImageIO"
_ESFR = "slanted edge of known angle; after ISO 12233"
_WATSON = "angular harmonics; after Watson, Ahumada, Farrell 1986"
_CENTER = "definition; the technique and its reference at the shutter's middle"
_SPLIT = "unbiased split over seeds; after Durand 2011, Subr and Kautz 2013"

METRICS: Mapping[str, Metric] = {
    m.name: m
    for m in (
        Metric("rmse", "RMS error", "contrast", "lower", ("reference",), error.compute_rmse, "definition"),
        Metric("psnr", "PSNR", "dB", "higher", ("reference",), error.compute_psnr, "-20 log10(rmse), peak = contrast"),
        Metric("relmse", "relative MSE", "1", "lower", ("reference",), error.compute_relmse, "Rousselle et al. 2011"),
        Metric(
            "max_error", "largest error", "contrast", "lower", ("reference",), error.compute_max_error, "definition"
        ),
        Metric("ssim", "SSIM", "1", "higher", ("reference",), error.compute_ssim, _WANG),
        Metric("flip", "FLIP", "1", "lower", ("reference",), perceptual.compute_flip, _ANDERSSON),
        Metric("jaggies", "jaggies (J_std)", "px", "lower", ("reference", "edges"), jaggies.compute_jaggies, _BURNS),
        Metric(
            "jaggies_rms",
            "edge displacement",
            "px",
            "lower",
            ("reference", "edges"),
            jaggies.compute_jaggies_rms,
            _BURNS,
        ),
        Metric(
            "jaggies_bias", "edge shift", "px", "zero", ("reference", "edges"), jaggies.compute_jaggies_bias, _BURNS
        ),
        Metric(
            "jaggies_str", "stairstepping", "px", "lower", ("reference", "edges"), jaggies.compute_jaggies_str, _BURNS
        ),
        Metric(
            "shimmer",
            "shimmer (SH_err)",
            "contrast",
            "lower",
            ("reference", "frames"),
            shimmer.compute_shimmer,
            "variance in time of the error",
        ),
        Metric(
            "shimmer_abs",
            "false flicker under a pan",
            "contrast",
            "lower",
            ("frames", "pans"),
            shimmer.compute_shimmer_abs,
            "folded temporal frequencies",
        ),
        Metric(
            "buzz",
            "buzz",
            "1",
            "zero",
            ("reference", "frames"),
            shimmer.compute_buzz,
            "von Neumann's ratio of the error in time",
        ),
        Metric(
            "flux_flicker",
            "flux flicker",
            "1",
            "lower",
            ("frames",),
            shimmer.compute_flux_flicker,
            "relative deviation of the total light",
        ),
        Metric(
            "moire",
            "moire (M)",
            "contrast",
            "lower",
            ("reference",),
            moire.compute_moire,
            "error energy up to 0.25 cycles/px",
        ),
        Metric(
            "moire_peak",
            "strongest false line",
            "contrast",
            "lower",
            ("reference",),
            moire.compute_moire_peak,
            "Fisher 1929",
        ),
        Metric("gaps", "gaps", "px", "lower", ("reference",), gaps.compute_gaps, "definition"),
        Metric("strobing", "strobing (STROBE_abs)", "1", "lower", ("patterns",), strobing.compute_strobing, _WATSON),
        Metric(
            "strobing_err",
            "strobing error",
            "1",
            "lower",
            ("reference", "patterns"),
            strobing.compute_strobing_err,
            _WATSON,
        ),
        Metric(
            "apparent_rate",
            "apparent rate",
            "rev/s",
            "truth",
            ("frames", "rotors"),
            strobing.compute_apparent_rate,
            _WATSON,
        ),
        Metric(
            "apparent_velocity",
            "apparent velocity",
            "px/frame",
            "truth",
            ("frames", "gratings", "pans"),
            translation.compute_apparent_velocity,
            "lines in space and time; after Watson, Ahumada, Farrell 1986",
        ),
        Metric("noise", "noise", "contrast", "lower", ("reference", "seeds"), structure.compute_noise, _SPLIT),
        Metric(
            "structure",
            "structured error",
            "contrast",
            "lower",
            ("reference", "seeds"),
            structure.compute_structure,
            _SPLIT,
        ),
        Metric("mtf50", "MTF50", "cycles/px", "higher", ("edges",), mtf.compute_mtf50, _ESFR),
        Metric("edge_width", "edge width (10-90 %)", "px", "lower", ("edges",), sharpness.compute_edge_width, _ESFR),
        Metric(
            "spatial",
            "error in space",
            "contrast",
            "lower",
            ("reference", "centers"),
            separation.compute_spatial,
            _CENTER,
        ),
        Metric(
            "temporal",
            "error in time",
            "contrast²",
            "zero",
            ("reference", "centers"),
            separation.compute_temporal,
            _CENTER,
        ),
        Metric(
            "shutter",
            "off a full shutter",
            "contrast",
            "lower",
            ("centers",),
            separation.compute_shutter,
            "definition; the reference and one with a full-frame shutter",
        ),
        Metric("bias", "bias", "contrast", "zero", ("reference", "seeds"), bias.compute_bias, "Kirk and Arvo 1991"),
    )
}

# Measured only where they are named: they need an extra to be installed, and minutes where the others need seconds.
OPTIONAL: Mapping[str, Metric] = {
    m.name: m
    for m in (
        Metric(
            "cvvdp",
            "ColorVideoVDP",
            "JOD",
            "higher",
            ("reference",),
            video_quality.compute_cvvdp,
            "Mantiuk, Hanji, Ashraf, Asano, Chapiro 2024; cvvdp",
        ),
    )
}
