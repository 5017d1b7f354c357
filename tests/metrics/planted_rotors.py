"""What planted signals put into the orders of a rotor's annulus, and what the definitions make of such orders."""

import math

import numpy as np
from numpy.typing import NDArray
from planted import BLADES, DEVIATIONS, DUTY, FPS, SWING, Expected, FloatArray, Stage
from scipy import integrate, special


def plane_wave_orders(cycles_per_px: float, inner: float, outer: float, orders: NDArray[np.int64]) -> FloatArray:
    """The mean of J_m(2 pi nu rho) over the annulus: the angular orders of exp(2 pi i nu x) are i^m times that."""

    def weight(rho: float) -> float:
        return float(np.sin(np.pi * (rho - inner) / (outer - inner)) ** 4 * rho)

    total = integrate.quad(weight, inner, outer)[0]
    # 200 nodes: the argument goes through some 2 pi nu (outer - inner) / 2 pi < 20 oscillations.
    nodes, weights = np.polynomial.legendre.leggauss(200)
    rho = (inner + outer) / 2 + (outer - inner) / 2 * nodes
    shape = np.sin(np.pi * (rho - inner) / (outer - inner)) ** 4 * rho
    bessel = special.jv(orders[:, None], 2 * np.pi * cycles_per_px * rho)
    out: FloatArray = (outer - inner) / 2 * np.sum(weights * shape * bessel, axis=1) / total
    return out


def orders_of(stage: Stage, picture: FloatArray) -> NDArray[np.complex128]:
    """The annulus' orders 1 .. `highest` of pictures (..., h, w), by direct sums."""
    inside = stage.weight > 0.0
    waves = stage.weight[inside] * np.exp(-1j * stage.orders[:, None] * stage.angle[inside])
    out: NDArray[np.complex128] = picture[..., inside] @ waves.T
    return out


def rotor_figures(stage: Stage, orders: NDArray[np.complex128], *, rotor: bool = True) -> dict[str, Expected]:
    """What orders (frames, M) of an error say of strobing, with the smooth rotor or without it.

    The definitions: aliased are orders that go half a cycle a frame or further; a third of a cycle's orders are the
    blades', the others show the noise (median / ln 2); beyond order M what is left is as in the last octave.
    """
    picture = orders.astype(np.complex128)
    if rotor:
        picture = picture.copy()
        turn = 2 * np.pi * np.arange(stage.frames) / stage.frames
        picture[:, BLADES - 1] += SWING / 2 * np.exp(-1j * turn)
    k = np.arange(1, stage.highest // BLADES + 1)
    own = np.abs(picture[:, BLADES - 1 :: BLADES]) ** 2
    others = np.abs(picture[:, stage.orders % BLADES != 0]) ** 2
    power = np.mean(own, axis=0) - np.mean(np.median(others, axis=1)) / math.log(2)
    sharp = np.where(k % 2, 1 / (np.pi * k) ** 2, 0.0)
    octave = k > k.size / 2
    kept = min(max(float(np.sum(power[octave]) / np.sum(sharp[octave])), 0.0), 1.0)
    tail = DUTY * (1 - DUTY) - 2 * float(np.sum(sharp))
    share = (2 * float(np.sum(power[2 * k >= stage.frames])) + kept * tail) / (DUTY * (1 - DUTY))
    off = np.mean(np.abs(orders) ** 2, axis=0)
    between = float(np.mean(off[(stage.orders % BLADES != 0) & (stage.orders > off.size / 2)]))
    beyond = float(np.sum(off[BLADES - 1 :: BLADES][octave] - between) / np.sum(sharp[octave]))
    error = (2 * float(np.sum(off)) + max(beyond, 0.0) * tail) / (DUTY * (1 - DUTY))
    first = picture[:, BLADES - 1]
    turned = -float(np.angle(np.sum(first[1:] * np.conj(first[:-1])))) * FPS / (2 * np.pi * BLADES)
    # A closed form is an integral over the annulus, and so is the noise's: sums over its pixels are within 1e-5.
    return {
        "strobing": Expected(math.sqrt(min(max(share, 0.0), 1.0)), 1e-5),
        "strobing_err": Expected(math.sqrt(error), 1e-5),
        "apparent_rate": Expected(turned, 1e-6),
    }


def wave_orders(
    stage: Stage, cycles_per_px: tuple[float, float], phase: FloatArray, amplitude: float
) -> NDArray[np.complex128]:
    """Orders (frames, M) of amplitude cos(2 pi nu (x, y from the middle) + phase), in closed form."""
    size = math.hypot(*cycles_per_px)
    towards = math.atan2(-cycles_per_px[1], cycles_per_px[0])
    bessel = plane_wave_orders(size, stage.inner, stage.outer, stage.orders)
    m = stage.orders
    out: NDArray[np.complex128] = (
        amplitude * bessel * np.exp(-1j * m * towards) * np.cos(phase[:, None] + m * np.pi / 2)
    )
    return out


def noise_power(stage: Stage, variance: FloatArray | float) -> float:
    """What white noise of a variance (a number, or (h, w)) leaves of |c|^2 in every order."""
    return float(np.sum(stage.weight**2 * variance))


def noisy_rotor_figures(stage: Stage, power: float, pictures: int) -> dict[str, Expected]:
    """What noise that leaves `power` in every order says of strobing, in so many independent pictures."""
    total = DUTY * (1 - DUTY)
    k = np.arange(1, stage.highest // BLADES + 1)
    sharp = np.where(k % 2, 1 / (np.pi * k) ** 2, 0.0)
    octave = k > k.size / 2
    tail = total - 2 * float(np.sum(sharp))
    # Each order's mean power is spread by 1 / sqrt(pictures) of itself, and the estimate that is taken off all of
    # them, a median over two thirds of M, by 1 / ln 2 of what that leaves.
    one = power / math.sqrt(pictures)
    median = one / math.log(2) / math.sqrt(2 / 3 * stage.highest)
    count = np.count_nonzero(2 * k >= stage.frames) + tail / 2 * np.count_nonzero(octave) / float(np.sum(sharp[octave]))
    spread = math.hypot(one * math.sqrt(count * 2), median * count) * 2 / total
    error = 2 * stage.highest * power / total
    # What the last octave's orders of the blades have above the others by chance stands for a tail.
    chance = tail / total * one * math.sqrt(1.5 * np.count_nonzero(octave)) / float(np.sum(sharp[octave]))
    return {
        "strobing": Expected(0.0, math.sqrt(DEVIATIONS * spread)),
        "strobing_err": Expected(
            math.sqrt(error),
            DEVIATIONS
            * (math.sqrt(error) / (2 * math.sqrt(stage.highest * pictures)) + chance / (2 * math.sqrt(error))),
        ),
        # Phases of the first and the last picture alone are in the sum of all their differences.
        "apparent_rate": Expected(
            stage.rate,
            DEVIATIONS * math.sqrt(power) / (SWING / 2) / (stage.frames - 1) * FPS / (2 * np.pi * BLADES)
            # the weights of the differences are not equal where pictures differ in size
            + 1e-3 * stage.rate,
        ),
    }
