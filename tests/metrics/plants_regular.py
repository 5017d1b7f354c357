"""Planted signals without chance, each with what it puts into every metric."""

import math

import numpy as np
from planted import DUTY, HIGHEST_VISIBLE, LEVEL, WINDOW_ROWS, Expected, FloatArray, Plant, Stage
from planted_rotors import orders_of, rotor_figures, wave_orders

# The pan moves 4 / frames pixels a frame: temporal bins from 3 on are beyond what it could show.
FIRST_FOLDED_BIN = 3


def offset(stage: Stage, a: float) -> Plant:
    """All pixels too bright by the same."""
    expected = {
        "jaggies_rms": Expected(WINDOW_ROWS * a),
        "jaggies_bias": Expected(WINDOW_ROWS * a),
        "bias": Expected(a),
    }
    return Plant("offset", stage.scene(), stage.clean(), stage.everywhere(a), expected)


def stairs_picture(stage: Stage, size: float, lowered: int = 0) -> FloatArray:
    """(side, side): along each edge, in the row that it is in, size times (1/2 - how far it is through that row)."""
    picture = np.zeros((stage.side, stage.side))
    for b in stage.intercepts:
        for x in range(stage.side):
            row, step = divmod(x + lowered, stage.q)
            picture[int(b) + row, x] = size * (0.5 - (step + 0.5) / stage.q)
    return picture


def stairs_size(stage: Stage, a: float) -> float:
    """Of stairs that have the RMS a: a column's mean square is size^2 (1 - 1 / q^2) / 12."""
    return a / math.sqrt((1 - 1 / stage.q**2) / 12 * len(stage.intercepts) / stage.side)


def static_stairs(stage: Stage, a: float) -> Plant:
    """Stairsteps of the declared edges, standing still."""
    size = stairs_size(stage, a)
    picture = stairs_picture(stage, size)
    jaggies = size * math.sqrt((1 - 1 / stage.q**2) / 12)
    expected = {
        "jaggies": Expected(jaggies),
        "jaggies_rms": Expected(jaggies),
        **stairs_structure(stage, size),
        **stage.moire(picture[None]),
        **rotor_figures(stage, np.repeat(orders_of(stage, picture)[None], stage.frames, axis=0)),
    }
    return Plant("stairs", stage.scene(), stage.clean(), stage.everywhere(picture), expected)


def stairs_structure(stage: Stage, size: float) -> dict[str, Expected]:
    """J_str: a sawtooth of q equal steps has the harmonics k < q, |c_k| = size / (2 q sin(pi k / q)); up to 8 count."""
    k = np.arange(1, stage.q)
    # Harmonics k and q - k are one vector: of more than 8 those from 9 to q - 9 are left out.
    counted = (k <= 8) | (k >= stage.q - 8)
    square = float(np.sum(size**2 / (2 * stage.q * np.sin(np.pi * k[counted] / stage.q)) ** 2))
    return {"jaggies_str": Expected(math.sqrt(square))}


def phase_sequences(q: int, frames: int, size: float) -> FloatArray:
    """Errors (q columns, rows, frames) of a point-like sample of an edge that sinks by 1/q pixel a frame.

    In column j the edge is (j + 1/2) / q + t / q rows below the first: in the row that it is in, the error is size
    times (1/2 - how far it is through it).
    """
    out = np.zeros((q, 2 + (frames + q) // q, frames))
    for j in range(q):
        for t in range(frames):
            row, step = divmod(j + t, q)
            out[j, row, t] = size * (0.5 - (step + 0.5) / q)
    return out


def time_spectrum(sequences: FloatArray) -> FloatArray:
    """|F_k|^2 of sequences (..., frames), k = 0 .. frames - 1, by direct sums."""
    n = sequences.shape[-1]
    wave = np.exp(-2j * np.pi * np.outer(np.arange(n), np.arange(n)) / n)
    out: FloatArray = np.abs(sequences @ wave.T / n) ** 2
    return out


def moving_stairs(stage: Stage, a: float) -> Plant:
    """The same stairsteps on edges that sink by 1 / q pixel a frame."""
    size = stairs_size(stage, a)
    pictures = np.array([stairs_picture(stage, size, t) for t in range(stage.frames)])
    jaggies = size * math.sqrt((1 - 1 / stage.q**2) / 12)
    # One column of each phase, all the rows that its edge comes through; the rest of the picture has no error.
    own = phase_sequences(stage.q, stage.frames, size)
    scale = len(stage.intercepts) / (stage.q * stage.side)
    power = np.sum(time_spectrum(own), axis=(0, 1)) * scale
    shimmer = float(np.sum(power[1:]))
    steps = float(np.sum((np.roll(own, -1, axis=2) - own) ** 2)) / stage.frames * scale
    expected = {
        "jaggies": Expected(jaggies),
        "jaggies_rms": Expected(jaggies),
        **stairs_structure(stage, size),
        "shimmer": Expected(math.sqrt(shimmer)),
        "shimmer_abs": Expected(math.sqrt(float(np.sum(power[FIRST_FOLDED_BIN : 1 - FIRST_FOLDED_BIN])))),
        "buzz": Expected(steps / (2 * shimmer)),
        **stage.moire(pictures),
        **rotor_figures(stage, orders_of(stage, pictures)),
    }
    scene = stage.scene(edge_px_per_frame=1 / stage.q)
    return Plant("moving stairs", scene, stage.clean(), stage.everywhere(pictures), expected)


def alternation(stage: Stage, a: float) -> Plant:
    """The whole picture too bright and too dark in turn."""
    error = a * (-1.0) ** np.arange(stage.frames)
    expected = {
        "jaggies_rms": Expected(WINDOW_ROWS * a),
        "shimmer": Expected(a),
        "shimmer_abs": Expected(a),
        "buzz": Expected(2.0),
        "flux_flicker": Expected(a / LEVEL),
    }
    return Plant("alternation", stage.scene(), stage.clean(), stage.everywhere(error[:, None, None]), expected)


def wave(
    stage: Stage, a: float, name: str, cycles: tuple[int, int], drift: int = 0, *, on_stairs: bool = False
) -> Plant:
    """A false sinusoid, `cycles` in the picture each way, that goes on by `drift` of its periods in the loop."""
    n, f = stage.side, stage.frames
    amplitude = a * math.sqrt(2)
    nu = (cycles[0] / n, cycles[1] / n)
    phase = 0.4 - 2 * np.pi * drift * np.arange(f) / f
    middle = np.arange(n) + 0.5 - n / 2
    turn = 2 * np.pi * (nu[0] * middle + nu[1] * middle[:, None])
    error = amplitude * np.cos(turn + phase[:, None, None])
    visible = 0 < math.hypot(*nu) <= HIGHEST_VISIBLE
    folded = FIRST_FOLDED_BIN <= drift % f <= f - FIRST_FOLDED_BIN
    expected = {
        "shimmer": Expected(a if drift % f else 0.0),
        "shimmer_abs": Expected(a if folded else 0.0),
        "buzz": Expected(1 - math.cos(2 * np.pi * drift / f) if drift % f else None),
        "moire": Expected(a if visible else 0.0),
        "moire_peak": Expected(amplitude if visible else 0.0),
        **rotor_figures(stage, wave_orders(stage, nu, phase, amplitude)),
    }
    if cycles[1] == 0:
        # Down a window's rows it is the same.
        expected |= {
            "jaggies": Expected(WINDOW_ROWS * a),
            "jaggies_rms": Expected(WINDOW_ROWS * a),
            "jaggies_str": Expected(WINDOW_ROWS * a if on_stairs else 0.0, 1e-6),
        }
    else:
        expected |= displacement_figures(stage, error)
    return Plant(name, stage.scene(), stage.clean(), stage.everywhere(error), expected)


def displacement_figures(stage: Stage, error: FloatArray) -> dict[str, Expected]:
    """The figures of the displacement that an error (frames, h, w) has: sums down the windows' four rows.

    The window begins at the row of the edge less one and half of what it falls in a column.
    """
    stds, squares, means, strs = [], [], [], []
    x = np.arange(stage.side)
    fall = 1 / stage.q
    for b in stage.intercepts:
        first = np.floor((x + 0.5) * fall + b - 1 - fall / 2).astype(int)
        for picture in error:
            r = np.sum([picture[first + k, x] for k in range(WINDOW_ROWS)], axis=0)
            stds.append(np.var(r))
            squares.append(np.mean(r**2))
            means.append(np.mean(r))
            # Harmonics up to 8 span all that repeats every q <= 17 columns: the mean of each of the q phases.
            strs.append(np.var(r.reshape(-1, stage.q).mean(axis=0)))
    return {
        "jaggies": Expected(math.sqrt(float(np.mean(stds)))),
        "jaggies_rms": Expected(math.sqrt(float(np.mean(squares)))),
        "jaggies_bias": Expected(float(np.mean(means))),
        "jaggies_str": Expected(math.sqrt(float(np.mean(strs))), 1e-6),
    }


def false_line(stage: Stage, a: float) -> Plant:
    """A false sinusoid in the visible band, standing still."""
    return wave(stage, a, "false line", (5, 0))


def false_line_on_stairs(stage: Stage, a: float) -> Plant:
    """One that has the period of the edges' stairs."""
    return wave(stage, a, "line on stairs", (stage.side // stage.q, 0), on_stairs=True)


def drifting_line(stage: Stage, a: float) -> Plant:
    """A false sinusoid that drifts faster than anything the declared pan could show."""
    return wave(stage, a, "racing line", (5, 0), 5)


def slow_line(stage: Stage, a: float) -> Plant:
    """A false sinusoid that drifts as slowly as the true picture may."""
    return wave(stage, a, "slow line", (3, 4), 2)


def fine_line(stage: Stage, a: float) -> Plant:
    """An oblique line outside of the visible band, though both of its components are within it."""
    fifth = round(0.21 * stage.side)
    return wave(stage, a, "fine line", (fifth, fifth))


def frozen_rotor(stage: Stage, a: float) -> Plant:
    """Sharp blades that stand still at 30 turns a second, where in truth an open shutter blurs them to an even grey."""
    turn = stage.angle / (2 * np.pi) * 3 + 0.05
    pattern = np.where(np.mod(turn, 1.0) < DUTY, 1.0, -1.0)
    reference = np.full((stage.frames, stage.side, stage.side), LEVEL)
    error = a * pattern
    # a = 1/2 would be the pattern itself. Of a sharp edge on a lattice of pixels an order is known to some
    # 1 / (2 pi 60 px)^(3/2) of the whole.
    measured = rotor_figures(stage, np.repeat(orders_of(stage, error)[None], stage.frames, axis=0), rotor=False)
    strobing = 2 * a
    assert measured["strobing_err"].value is not None
    assert abs(measured["strobing_err"].value - strobing) < 0.01 * strobing
    expected = {
        "strobing": Expected(strobing, 0.01 * strobing),
        "strobing_err": measured["strobing_err"],
        "apparent_rate": Expected(0.0, 1e-9),
        **stage.moire(error[None]),
        **displacement_figures(stage, error[None]),
        "bias": Expected(float(np.mean(error))),
    }
    return Plant("frozen rotor", stage.scene(rate=30.0), reference, stage.everywhere(error), expected)
