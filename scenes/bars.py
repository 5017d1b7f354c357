"""Parallel bars without end, as triangles or as one period of an image: what grids and window screens are made of.

Both forms have the same edges to the last bit of float64: a bar covers the first share (`duty`) of every period, and an
image of as many texels as the share's denominator repeats once a period. A share is therefore taken as the nearest
fraction of few parts, in both forms alike. All bars of a set are one mesh: a thousand objects would be slow to build.
"""

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from aliasbench.scenes.entries import Parameter
from aliasbench.scenes.model import FloatArray, ImageTexture, Motion, Surface, Vec2, Vec3, read_only
from aliasbench.scenes.shapes import mesh, quad

MOST_PARTS = 32  # of a period, that a share is a multiple of
REACH = 4.5  # world units from the middle that are covered in all directions: the widest picture is 8 x 2
RESERVE_S = 20.0  # seconds of motion for which bars come in from outside
DUTY = Parameter(
    0.5, 1 / MOST_PARTS, 1 - 1 / MOST_PARTS, "float", "bars' share of the pitch, as the nearest fraction of up to 32nds"
)


@dataclass(frozen=True, slots=True)
class Bars:
    """A set of parallel bars in a plane z = const, one to a period along a direction.

    Attributes
    ----------
    pitch : float
        World units from one bar to the next.
    angle_deg : float
        Of the direction in which bars follow each other, counter-clockwise from +x: 0 has upright bars.
    duty : Fraction
        What a bar covers of its period, from the period's beginning on; one begins at the origin.
    z : float
        Height of the plane: greater is nearer to the camera.
    drift : float
        Periods per second that the bars will move in their direction; they go on for that on the side they come from.
    """

    pitch: float
    angle_deg: float
    duty: Fraction
    z: float = 0.0
    drift: float = 0.0

    @property
    def along(self) -> FloatArray:
        """The direction (3,) in which bars follow each other, a unit vector."""
        return _direction(self.angle_deg)

    @property
    def frequency(self) -> Vec2:
        """Periods per world unit, as a vector (x, y)."""
        x, y, _ = (self.along / self.pitch).tolist()
        return (x, y)

    @property
    def periods(self) -> tuple[int, int]:
        """The first period that has a bar, and the first after the last."""
        out = math.ceil(REACH / self.pitch)
        coming = math.ceil(RESERVE_S * abs(self.drift))
        return -out - (coming if self.drift > 0.0 else 0), out + (coming if self.drift < 0.0 else 0)

    def at(self, s: FloatArray, t: FloatArray) -> FloatArray:
        """Return the points (..., 3) at s world units along the bars' direction and t across it, to the left."""
        left = _direction(self.angle_deg + 90.0)
        points: FloatArray = s[..., None] * self.along + t[..., None] * left + np.array([0.0, 0.0, self.z])
        return points


def share_of(duty: float) -> Fraction:
    """Return the nearest fraction of at most `MOST_PARTS` parts, neither 0 nor 1."""
    return Fraction(duty).limit_denominator(MOST_PARTS)


def drift_velocity(bars: Bars) -> Vec3:
    """Return the velocity (world units per second) with which the bars drift."""
    x, y, z = (bars.drift * bars.pitch * bars.along + 0.0).tolist()
    return (x, y, z)


def bars_as_mesh(bars: Bars, *, color: Vec3, motion: Motion | None = None, name: str) -> Surface:
    """Return the bars as two triangles each."""
    first, end = bars.periods
    begins = np.arange(first, end) * bars.pitch
    ends = (np.arange(first, end) + float(bars.duty)) * bars.pitch
    s = np.stack([begins, ends, ends, begins], axis=1).ravel()
    t = np.tile([-REACH, -REACH, REACH, REACH], end - first)
    corners = 4 * np.arange(end - first)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return mesh(bars.at(s, t), corners.reshape(-1, 3), color=color, motion=motion, name=name)


def bars_as_quad(
    bars: Bars, *, texture: str, color: Vec3 = (1.0, 1.0, 1.0), motion: Motion | None = None, name: str
) -> Surface:
    """Return one rectangle over the bars and the gaps between; u counts periods, and so does v."""
    first, end = bars.periods
    u = np.array([first, end, end, first], dtype=np.float64)
    # v beside u: an image that also repeats the other way is a grid
    t = np.array([-REACH, -REACH, REACH, REACH])
    return quad(
        bars.at(u * bars.pitch, t),
        uv=np.stack([u, t / bars.pitch], axis=1),
        texture=texture,
        color=color,
        motion=motion,
        name=name,
    )


def cut_out_period(duty: Fraction) -> ImageTexture:
    """Return one period as an image of one row: white, and absent where there is no bar."""
    texels = np.ones((1, duty.denominator, 4), dtype=np.float32)
    texels[:, duty.numerator :, 3] = 0.0
    return ImageTexture(read_only(texels), alpha_cutoff=0.5, source="")


def crossed_period(duty: Fraction) -> ImageTexture:
    """Return one period of bars that cross at right angles, white on black."""
    parts = duty.denominator
    texels = np.zeros((parts, parts, 4), dtype=np.float32)
    texels[: duty.numerator] = 1.0
    texels[:, : duty.numerator] = 1.0
    texels[..., 3] = 1.0
    return ImageTexture(read_only(texels))


def _direction(angle_deg: float) -> FloatArray:
    """Return the unit vector (3,) at an angle, exact at multiples of 90 degrees."""
    quarters = round(angle_deg / 90.0)
    rest = math.radians(angle_deg - 90.0 * quarters)
    c, s = math.cos(rest), math.sin(rest)
    x, y = ((c, s), (-s, c), (-c, -s), (s, -c))[quarters % 4]
    return np.array([x, y, 0.0])
