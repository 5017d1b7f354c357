"""Strobing: a rotor that seems to turn at another rate, backwards, or not at all: the wagon wheel.

A blade pattern is a sum of angular orders; order m turns past a fixed point m times a revolution, and is aliased in
time when that is half the frame rate or more. STROBE_abs is the share of the pattern that is still visible and aliased:
a property of the shutter, which a perfect renderer does not score 0 on. STROBE_err compares with the same shutter
rendered exactly. After Watson, Ahumada and Farrell 1986 (the window of visibility). Gratings that a pan moves are
patterns of the same kind (see `translation`).
"""

from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np

from aliasbench.metrics.gate import Signals
from aliasbench.metrics.orders import Orders, is_aliased, measure_orders, noise_power, sharp_power
from aliasbench.metrics.rotors import stays
from aliasbench.metrics.score import Score, rms, settle
from aliasbench.metrics.sharpness import sharpness
from aliasbench.metrics.translation import grating_errors, grating_shares
from aliasbench.scenes.model import FloatArray

# Below this share of the duty an order is not there, and has no rate.
NO_MODULATION = 1e-6
HUGE = 1e100
AT_NYQUIST = 1e-6
NOISE_DEVIATIONS = 5.0
SERIES_TERMS = 100_000


def strobe_share(orders: Orders, fps: float) -> tuple[float, dict[str, object]]:
    """Return the visible aliased share (a square) of a rotor and what it was made from.

    The orders that the annulus resolves are measured, less the noise's share. The rest of the pattern's power is known
    in closed form, and is taken to be attenuated as the last octave of the measured ones is.
    """
    rotor = orders.rotor
    largest = float(np.max(np.abs(orders.coefficients)))
    if largest > HUGE:  # whose square overflows: the share is cut at 1 long before
        orders = replace(orders, coefficients=orders.coefficients * (HUGE / largest))
    k = orders.harmonics
    noise = noise_power(orders)
    power = np.mean(np.abs(orders.blade_coefficients) ** 2, axis=(0, 1)) - noise
    sharp = sharp_power(rotor, k)
    aliased = is_aliased(rotor, fps, k)
    total = rotor.duty * (1.0 - rotor.duty)
    kept = min(last_octave(power, sharp, total), 1.0)
    series = np.arange(1.0, SERIES_TERMS + 1.0)
    unmeasured = is_aliased(rotor, fps, series) & (series > k.size)
    # The terms left out of the series average half of 1 / (pi k)^2, on both sides of 0.
    beyond = 1.0 / (np.pi**2 * SERIES_TERMS) if rotor.rev_per_s else 0.0
    tail = 2.0 * float(np.sum(sharp_power(rotor, series[unmeasured]))) + beyond
    measured = 2.0 * float(np.sum(power[aliased]))
    share = float(np.clip((measured + kept * tail) / total, 0.0, 1.0))
    # All orders alike, aliased or not: what is left of the pattern at all.
    left = 2.0 * float(np.sum(power)) + kept * (total - 2.0 * float(np.sum(sharp)))
    extras: dict[str, object] = {
        "highest_order": int(k.size) * rotor.blades,
        "measured_share": measured / total,
        "tail_share": tail / total,
        "tail_kept": kept,
        "noise_power": noise,
        "modulation_kept": float(np.clip(left / total, 0.0, 1.0)),
    }
    return share, extras


def last_octave(power: FloatArray, sharp: FloatArray, total: float) -> float:
    """Return the measured power (K,) of the upper half of the harmonics per sharp pattern's: what is left beyond them.

    Where the pattern has next to nothing there, of all harmonics.
    """
    octave = np.arange(1, power.size + 1) > power.size / 2
    if float(np.sum(sharp[octave])) < NO_MODULATION * total:
        octave[:] = True
    return max(float(np.sum(power[octave]) / np.sum(sharp[octave])), 0.0)


def rotor_error(orders: Orders) -> float:
    """Return the RMS of all orders of an error but 0.

    The blades' orders that are not resolved are taken to be off like the last octave of those that are, as far as these
    stand out from the orders between them: an error that has nothing to do with blades has no such tail.
    """
    scale = float(np.max(np.abs(orders.coefficients)))
    if scale == 0.0:
        return 0.0
    rotor = orders.rotor
    total = rotor.duty * (1.0 - rotor.duty)
    sharp = sharp_power(rotor, orders.harmonics)
    power = np.mean(np.abs(orders.coefficients / scale) ** 2, axis=(0, 1))
    order = np.arange(1, power.size + 1)
    between = power[(order % rotor.blades != 0) & (order > power.size / 2)]
    own = power[rotor.blades - 1 :: rotor.blades] - (float(np.mean(between)) if between.size else 0.0)
    tail = last_octave(own, sharp, total) * max(total - 2.0 * float(np.sum(sharp)), 0.0)
    return scale * float(np.sqrt(2.0 * float(np.sum(power)) + tail))


def _all_orders(signals: Signals, which: Literal["test", "error"]) -> list[Orders] | Score:
    pictures = {"test": signals.test, "error": signals.error}
    if all(stays(rotor, signals.scene) for rotor in signals.scene.facts.rotors):
        return signals.once(f"orders of {which}", lambda: _measure_all(signals, pictures[which]))
    # Then finding each frame's annulus costs more than reading two pictures in it.
    both = signals.once("orders of both", lambda: _measure_all(signals, np.concatenate(list(pictures.values()))))
    if isinstance(both, Score):
        return both
    own = slice(None, signals.seeds) if which == "test" else slice(signals.seeds, None)
    return [replace(orders, coefficients=orders.coefficients[own]) for orders in both]


def _measure_all(signals: Signals, picture: FloatArray) -> list[Orders] | Score:
    out = []
    for number, rotor in enumerate(signals.scene.facts.rotors):
        orders = measure_orders(signals, picture, rotor)
        if isinstance(orders, str):
            return Score(None, orders, {"rotor": number})
        out.append(orders)
    return out


def compute_strobing(signals: Signals) -> Score:
    """Return STROBE_abs in [0, 1]: the root of the visible aliased share; quadratic mean over rotors and gratings.

    Extras: the sharpness, with the share of the sharp patterns' power that is left (the mean over them).
    """
    rotors = _all_orders(signals, "test")
    if isinstance(rotors, Score):
        return rotors
    gratings = grating_shares(signals)
    if isinstance(gratings, Score):
        if not rotors:
            return gratings
        gratings = []
    turning = [strobe_share(o, signals.scene.animation.fps) for o in rotors]
    extras = {"rotors": [e for _, e in turning], "gratings": [e for _, e in gratings]}
    shown: dict[str, object] = {name: given for name, given in extras.items() if given}
    kept = {**sharpness(signals), "modulation_kept": np.mean([e["modulation_kept"] for _, e in (*turning, *gratings)])}
    shares = np.array([share for share, _ in (*turning, *gratings)])
    return Score(rms(np.sqrt(shares)), "ok", {**shown, "sharpness": kept})


def compute_strobing_err(signals: Signals) -> Score:
    """Return STROBE_err: the RMS difference of all orders and lines from the reference's, per sharp pattern's RMS.

    Orders of a rotor that the annulus does not resolve are estimated (see `rotor_error`).
    """
    rotors = _all_orders(signals, "error")
    if isinstance(rotors, Score):
        return rotors
    gratings = grating_errors(signals)
    if isinstance(gratings, Score):
        if not rotors:
            return gratings
        gratings = []
    values, totals = [], []
    for orders in rotors:
        totals.append(float(np.sqrt(orders.rotor.duty * (1.0 - orders.rotor.duty))))
        values.append(rotor_error(orders) / totals[-1])
    extras: dict[str, object] = {"highest_order": [o.coefficients.shape[-1] for o in rotors], "rotors": list(values)}
    if gratings:
        extras["gratings"] = [value for value, _ in gratings]
    values += [value for value, _ in gratings]
    totals += [total for _, total in gratings]
    return settle(rms(np.array(values)), extras, floor=signals.floor / min(totals))


@dataclass(frozen=True, slots=True)
class OrderRate:
    """How one angular order seems to turn.

    Attributes
    ----------
    m : int
    size : float
        |c_m|, in units of the contrast.
    aliased : bool
    above_noise : bool
        Whether there is more of it than noise of the strength of the other orders would leave.
    rev_per_s : float or None
        In [-fps / 2m, fps / 2m); None for an order that is not there.
    sign : int or None
        -1, 0 or 1; None at the ends of the range, where there is no direction (the rate is then -fps / 2m).
    """

    m: int
    size: float
    aliased: bool
    above_noise: bool
    rev_per_s: float | None = None
    sign: int | None = None


def apparent_rates(orders: Orders, fps: float) -> list[OrderRate]:
    """Return the apparent rate of every resolved multiple of the blade count.

    Of what noise leaves in an order the rate is a number too, but any number; whether there is more than noise is said
    beside it: the mean of n powers of noise is spread by 1 / sqrt n of itself, of which five are a bound.
    """
    out = []
    rotor = orders.rotor
    pictures = orders.coefficients.shape[0] * orders.coefficients.shape[1]
    noise = np.sqrt(noise_power(orders) * (1.0 + NOISE_DEVIATIONS / np.sqrt(pictures)))
    for k, c in zip(orders.harmonics, np.moveaxis(orders.blade_coefficients, -1, 0), strict=True):
        m = int(k) * rotor.blades
        size = rms(np.abs(c))
        aliased = bool(is_aliased(rotor, fps, np.array([k]))[0])
        above_noise = size > noise
        if not NO_MODULATION * rotor.duty <= size < np.inf:
            out.append(OrderRate(m, size, aliased, above_noise))
            continue
        phasor = c / size
        turn = -float(np.angle(np.sum(phasor[:, 1:] * np.conj(phasor[:, :-1])))) / (2.0 * np.pi)
        if 0.5 - abs(turn) < AT_NYQUIST:
            out.append(OrderRate(m, size, aliased, above_noise, -0.5 * fps / m))
            continue
        sign = 0 if abs(turn) < AT_NYQUIST else int(np.sign(turn))
        out.append(OrderRate(m, size, aliased, above_noise, turn * fps / m, sign))
    return out


def power_shares(rates: list[OrderRate]) -> list[tuple[float, OrderRate]]:
    """Return the orders that have a rate, each with its share of their power."""
    shown = [r for r in rates if r.rev_per_s is not None]
    if not shown:
        return []
    relative = np.square(np.array([r.size for r in shown]) / max(r.size for r in shown))
    return list(zip((relative / np.sum(relative)).tolist(), shown, strict=True))


def backward_fraction(rates: list[OrderRate], rate: float) -> float | None:
    """Return the share of the orders' power that does not seem to turn as `rate` does (undirected ones count half)."""
    shares = power_shares(rates)
    if rate == 0.0 or not shares:
        return None
    return min(sum(share * (0.5 if r.sign is None else float(r.sign != np.sign(rate))) for share, r in shares), 1.0)


def speed_error(rates: list[OrderRate], rate: float) -> float | None:
    """Return the mean of |apparent - true rate| in rev/s, weighted with the orders' power."""
    shares = power_shares(rates)
    return sum(share * abs(r.rev_per_s - rate) for share, r in shares if r.rev_per_s is not None) if shares else None


def compute_apparent_rate(signals: Signals) -> Score:
    """Return the rate in rev/s at which order m = blades seems to turn, right-handed about the rotor's axis.

    Of several rotors the first; extras hold all orders of all of them, the share that seems to turn backwards and the
    mean speed error.
    """
    rotors = _all_orders(signals, "test")
    if isinstance(rotors, Score):
        return rotors
    extras = []
    first: OrderRate | None = None
    for orders in rotors:
        true = orders.rotor.rev_per_s
        rates = apparent_rates(orders, signals.scene.animation.fps)
        first = first or rates[0]
        extras.append(
            {
                "true_rev_per_s": true,
                "backward_fraction": backward_fraction(rates, true),
                "speed_error_rev_per_s": speed_error(rates, true),
                "orders": [asdict(r) for r in rates],
            }
        )
    if first is None or first.rev_per_s is None:
        return Score(None, "undefined_no_modulation", {"rotors": extras})
    return Score(first.rev_per_s, "ok", {"rotors": extras, "sign": first.sign})
