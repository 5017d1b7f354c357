"""How much of the error is another filter than the reference's, and how much is aliasing and noise.

A renderer that blurs a little more than it should is off by a convolution of the truth; what no small convolution
explains was not in the truth. The convolution is the 5 x 5 kernel that fits best, and h - delta of it is told apart
from the rest. It means something where the picture has many frequencies: a lone grating's alias has the frequency that
its own residue in the reference has, and then looks like sharpening.

The normal equations need the products of the reference with its shifts. Shifts by rows of the same two columns share
them, so that of 325 sums over the picture 75 are left, and what differs is a few rows at the border.
"""

from dataclasses import dataclass

import numpy as np

from aliasbench.scenes.model import FloatArray

TAPS = 5
REACH = TAPS // 2
RIDGE = 1e-6
SMALLEST = 16  # pixels a side: with fewer, 25 taps would fit anything


@dataclass(frozen=True, slots=True, eq=False)
class BlurSplit:
    """A convolution and what it leaves: MSE = blur^2 + residual^2 + offset^2 inside the border, but for the ridge.

    Attributes
    ----------
    kernel : (5, 5) float64
        h, as in (h * R)(p) = sum over k of h[k + 2] R(p - k), k = (row, column).
    blur : float
        RMS of (h - delta) * R about its mean: what another filter explains.
    residual : float
        RMS of T - h * R about its mean: aliasing and noise.
    offset : float
        Mean of T - R.
    """

    kernel: FloatArray
    blur: float
    residual: float
    offset: float


def split_blur(test: FloatArray, reference: FloatArray) -> BlurSplit | None:
    """Return the least-squares convolution from reference to test, (n, h, w) both, one for all n pictures.

    It minimises mean (T - h * R - c)^2 + 1e-6 |h - delta|^2: the constant c makes it invariant to a constant added to
    both pictures, and the ridge draws towards no blur, so that equal pictures are told to be equal whatever they show.
    None for pictures of less than 16 pixels a side, or sums that are not finite.
    """
    count, height, width = reference.shape
    if min(height, width) < SMALLEST:
        return None
    rows, columns = height - TAPS + 1, width - TAPS + 1
    gram = np.zeros((TAPS, TAPS, TAPS, TAPS))
    product, mean = np.zeros((2, TAPS, TAPS))
    error_mean = error_square = 0.0
    level = float(np.mean(reference))
    for own_test, own in zip(test, reference, strict=True):
        # (row, offset along x, column): the picture and its four shifts
        shifted = np.stack([own[:, i : i + columns] for i in range(TAPS)], axis=1) - level
        error = (own_test - own)[REACH : height - REACH, REACH : width - REACH]
        for apart in range(TAPS):
            products = shifted[: height - apart] @ shifted[apart:].transpose(0, 2, 1)
            for j in range(TAPS - apart):
                gram[j, :, j + apart] += np.sum(products[j : j + rows], axis=0)
        for j in range(TAPS):
            product[j] += np.sum(shifted[j : j + rows] @ error[:, :, None], axis=(0, 2))
            mean[j] += np.sum(shifted[j : j + rows], axis=(0, 2))
        error_mean += float(np.sum(error))
        error_square += float(np.sum(error**2))
    for j in range(TAPS):
        for k in range(j):
            gram[j, :, k] = gram[k, :, j].T
    pixels = count * rows * columns
    m, offset = mean.ravel() / pixels, error_mean / pixels
    normal = gram.reshape(TAPS**2, TAPS**2) / pixels - np.outer(m, m)
    right = product.ravel() / pixels - m * offset
    if not (np.isfinite(normal).all() and np.isfinite(right).all()):
        return None
    change = np.linalg.solve(normal + RIDGE * np.eye(TAPS**2), right)
    blur_square = float(change @ normal @ change)
    residual_square = error_square / pixels - offset * offset - 2.0 * float(change @ right) + blur_square
    # An offset of the window is one of the kernel the other way round.
    kernel = change.reshape(TAPS, TAPS)[::-1, ::-1].copy()
    kernel[REACH, REACH] += 1.0
    return BlurSplit(kernel, max(blur_square, 0.0) ** 0.5, max(residual_square, 0.0) ** 0.5, offset)
