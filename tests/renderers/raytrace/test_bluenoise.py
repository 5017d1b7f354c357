"""Blue noise where it is seen: errors in penumbrae are as large as Sobol's, and a blur of a pixel takes most away."""

import functools

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage
from scipy.signal import fftconvolve

from aliasbench.renderers.catalog import prepare, render
from aliasbench.scenes.catalog import build_scene

SIZE = (112, 112)
SEEDS = 20
FloatArray = NDArray[np.float64]


def blur() -> FloatArray:
    x = np.arange(-4, 5)
    row = np.exp(-(x**2) / 2.0)
    out: FloatArray = np.outer(row, row) / row.sum() ** 2
    return out


@functools.cache
def truth_of(text: str) -> FloatArray:
    out: FloatArray = render(build_scene(text), "reference:", size=SIZE).pixels.mean(axis=-1)
    return out


def errors(text: str, sampler: str, samples: int, truth: FloatArray) -> FloatArray:
    """Errors (seeds, h, w) less their mean over the seeds."""
    with prepare(build_scene(text), f"raytrace:spp={samples},sampler={sampler}", size=SIZE) as prepared:
        found = np.stack([prepared.render(seed=seed).pixels.mean(axis=-1) - truth for seed in range(SEEDS)])
    out: FloatArray = found - found.mean(axis=0)
    return out


@pytest.mark.parametrize("samples", [1, 4, 16])
@pytest.mark.parametrize("text", ["soft-shadow", "soft-shadow:light_size=1,slats=2", "soft-shadow:occluder_height=0.8"])
def test_errors_in_penumbrae_are_blue_and_no_larger_than_sobols(text: str, samples: int) -> None:
    truth = truth_of(text)
    found = {sampler: errors(text, sampler, samples, truth) for sampler in ("sobol", "bluenoise")}
    # Where plain Sobol is noisy and the picture smooth: not at the edges of the slats themselves.
    noisy = found["sobol"].var(axis=0)
    penumbra = (noisy > 0.2 * np.quantile(noisy, 0.9)) & (np.abs(ndimage.laplace(truth)) < 0.12)
    penumbra = ndimage.binary_erosion(penumbra)
    assert penumbra.sum() > 400
    g = blur()
    rmse, blue = {}, {}
    for sampler, e in found.items():
        blurred = np.stack([fftconvolve(one, g, mode="same") for one in e])
        rmse[sampler] = float(np.sqrt((e[:, penumbra] ** 2).mean()))
        blue[sampler] = float((blurred[:, penumbra] ** 2).mean() / ((e[:, penumbra] ** 2).mean() * (g**2).sum()))
    ratio = rmse["bluenoise"] / rmse["sobol"]
    print(f"{text}, {samples}: Q {blue['bluenoise']:.2f}, Sobol's {blue['sobol']:.2f}; RMSE {ratio:.3f} of Sobol's")
    assert 0.88 <= blue["sobol"] <= 1.12
    assert blue["bluenoise"] <= 0.6
    assert 0.95 <= ratio <= 1.05
