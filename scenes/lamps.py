"""A square lamp over a floor, with the radiance that lights the floor as asked, whatever the lamp's size and height.

A picture of a light a hundredth as large would be a hundredth as bright; scenes that are to show what the size of a
light does to its shadows need it the other way round.
"""

import math

from aliasbench.scenes.model import Light


def square_lamp(*, size: float, height: float, radiosity: float) -> Light:
    """Return a square light that shines straight down from above the origin.

    Parameters
    ----------
    size : float
        Side in world units.
    height : float
        Of the light above the plane y = 0, where what it lights is.
    radiosity : float
        Radiance of a white diffuse surface (colour 1) at the origin, facing up, when nothing is in between.
    """
    half = size / 2
    corners = ((-half, height, -half), (half, height, -half), (half, height, half), (-half, height, half))
    radiance = radiosity / square_form_factor(half, height)
    return Light(corners, (radiance, radiance, radiance))


def square_form_factor(half: float, height: float) -> float:
    """Return the share of a point's view that a parallel square over it has, weighted by the cosine (Lambert).

    Of a corner of a rectangle a x b at height h, with A = a / h and B = b / h (Howell's catalog, configuration C-4):
    (A atan(B / sqrt(1 + A^2)) / sqrt(1 + A^2) + B atan(A / sqrt(1 + B^2)) / sqrt(1 + B^2)) / 2 pi; the square over the
    point is four of them, with A = B.
    """
    a = half / height
    root = math.sqrt(1 + a * a)
    return 4 * a * math.atan(a / root) / root / math.pi
