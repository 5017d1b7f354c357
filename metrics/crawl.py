"""The crawl of stairsteps: how fast the stairs of a moving edge seem to run along it.

A stair is where the edge crosses a pixel row. When the edge moves, the crossings run along it, at a speed that grows
without bound as the edge nears the rows' direction. What is seen is a pattern of equal stairs at two instants: moved by
half a stair or more they are taken for their neighbours, and seem to run the other way, or to stand still.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy import fft, optimize

from aliasbench.scenes.model import FloatArray

if TYPE_CHECKING:
    from aliasbench.metrics.jaggies import Locator

ComplexArray = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]

STILL_ROWS = 1e-9  # that an edge moves in a frame
LEAST_STAIRS = 2.0  # that the columns must show for stairs to have a phase
LEAST_PX = 1e-4  # of a first harmonic; single precision leaves some 1e-7
SIGNIFICANT = 8.0  # of white noise fewer than 1 in 100 000 pairs of frames have that much of their mean power
STEADY_ROWS = 1e-2  # by which a steady motion's steps may differ
UNDIRECTED = 1e-2  # stairs from half a stair a frame, where both directions look alike
STANDING = 1e-4  # stairs a frame that are none
PADDING = 16


def stairs_phasor(locator: "Locator") -> complex:
    """Return the first harmonic of the stairs, in pixels, against the same phase m (x + 1/2) in all frames.

    Stairs are a function of m (x + 1/2) + b: the phasor turns with the intercept b. Hann's window keeps its image at
    the opposite frequency out.
    """
    window = locator.window
    r = np.mean(locator.displacement, axis=0)
    weight = np.sin(np.pi * (np.arange(r.size) + 0.5) / r.size) ** 2
    weight /= np.sum(weight)
    wave = np.exp(-2j * np.pi * window.slope * (window.columns + 0.5))
    return complex(np.sum(weight * (r - weight @ r) * wave))


def turn_per_frame(phasors: ComplexArray) -> float:
    """Return the frequency in [-1/2, 1/2) of the strongest line among phasors of consecutive frames, in cycles.

    Of two frames this is the phase between them. On slopes of small whole numbers p/q the (q - 1)th harmonic falls on
    the first one's image and turns too, at another rate, which more frames tell apart.
    """
    size = PADDING * phasors.size
    start = float(fft.fftfreq(size)[np.argmax(np.abs(fft.fft(phasors, size)))])
    frame = np.arange(phasors.size)

    def missed(turn: float) -> float:
        return -float(np.abs(phasors @ np.exp(-2j * np.pi * turn * frame)))

    found = optimize.minimize_scalar(
        missed, bounds=(start - 1.0 / size, start + 1.0 / size), method="bounded", options={"xatol": 1e-9}
    )
    return float((found.x + 0.5) % 1.0 - 0.5)


def crawl_of_edges(locators: list["Locator"], floor: float) -> list[dict[str, object]]:
    """Return the crawl of each moving edge: speeds in pixels along it per frame, towards larger x (transposed: y).

    Parameters
    ----------
    locators : list of Locator
        Of all edges and frames.
    floor : float
        Displacement in pixels that the reference's uncertainty may cause.

    Returns
    -------
    list of dict
        For each edge that moves and does not turn: `edge`; `px_per_frame`, at which the stairs seem to run, or None
        where there are none that could be followed; `direction`, its sign, or None where both directions look alike
        (the speed is then positive); `true_px_per_frame`, at which the edge crosses the rows; `aliased`, whether it
        moves by half a row or more a frame; `stair_px`, the stairs' length; `harmonic_px`, their first harmonic.
    """
    out = []
    for edge in sorted({x.edge for x in locators}):
        crawl = _crawl([x for x in locators if x.edge == edge], floor)
        if crawl is not None:
            out.append({"edge": edge, **crawl})
    return out


def _crawl(own: list["Locator"], floor: float) -> dict[str, object] | None:
    slopes = np.array([x.window.slope for x in own])
    frames = np.array([x.frame for x in own])
    turned = len({x.window.transposed for x in own}) > 1 or np.ptp(slopes) * own[0].window.columns.size > STEADY_ROWS
    if len(own) < 2 or turned:
        return None
    intercepts = np.array([x.window.intercept for x in own])
    steps = np.diff(intercepts) / np.diff(frames)
    step, slope = float(np.mean(steps)), float(slopes[0])
    if abs(step) < STILL_ROWS or abs(slope) < STILL_ROWS:
        return None
    stair = float(np.hypot(1.0, slope)) / abs(slope)
    phasors = np.zeros(frames[-1] - frames[0] + 1, dtype=np.complex128)
    phasors[frames - frames[0]] = [stairs_phasor(x) for x in own]
    power = float(np.mean(np.abs(phasors[frames - frames[0]]) ** 2))
    found = {
        "px_per_frame": None,
        "direction": None,
        "true_px_per_frame": -step * stair * np.sign(slope),
        "aliased": abs(step) >= 0.5 - STILL_ROWS,
        "stair_px": stair,
        "harmonic_px": power**0.5,
    }
    if np.ptp(steps) > STEADY_ROWS or not _can_be_followed(own, power, floor):
        return found
    turn = turn_per_frame(phasors)
    speed = -turn * stair * float(np.sign(slope))
    if 0.5 - abs(turn) < UNDIRECTED:
        return {**found, "px_per_frame": abs(speed)}
    return {**found, "px_per_frame": speed, "direction": int(np.sign(speed)) if abs(turn) > STANDING else 0}


def _can_be_followed(own: list["Locator"], power: float, floor: float) -> bool:
    """Return whether there are stairs, more of them than noise has, and not of two or one pixels' length.

    The first harmonic of slopes 1/2 and 1 is its own image, and has no direction.
    """
    columns = min(x.window.columns.size for x in own)
    slope = own[0].window.slope
    distinct = min(abs(k * slope - round(k * slope)) for k in (1, 2)) * columns
    # Of white noise of variance s2, Hann's window leaves 3/2 s2 / columns in the phasor's power.
    noise = 1.5 * float(np.mean([np.mean(_centered(x) ** 2) for x in own])) / columns
    return distinct >= LEAST_STAIRS and power > max(LEAST_PX, floor) ** 2 and power > SIGNIFICANT * noise


def _centered(locator: "Locator") -> FloatArray:
    r: FloatArray = np.mean(locator.displacement, axis=0)
    return r - np.mean(r)
