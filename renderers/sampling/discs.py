"""From the unit square to the unit disc: points of lenses and lobes."""

from numba import njit

from aliasbench.renderers.sampling.trig import cos_turns, sin_turns


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def disc_point(u: float, v: float) -> tuple[float, float]:
    """Return the point of the unit disc that belongs to one of the unit square (Shirley & Chiu 1997).

    Squares about the middle become circles of the same half-width and areas are multiplied by pi everywhere: points as
    well spread as in the square. Neighbours stay neighbours, across the middle too.
    """
    a, b = 2.0 * u - 1.0, 2.0 * v - 1.0
    is_wide = abs(a) > abs(b)
    radius, other = (a, b) if is_wide else (b, a)
    turns = 0.125 * other / (radius if radius != 0.0 else 1.0)
    along, across = radius * cos_turns(turns), radius * sin_turns(turns)
    return (along, across) if is_wide else (across, along)
