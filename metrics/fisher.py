"""Is the strongest line of a spectrum more than noise? Fisher's exact test, for as many ordinates as pictures have.

Of n independent exponential ordinates (the powers of white noise) let g be the largest over the sum. Then
P(g > x) = sum_j (-1)^(j-1) C(n, j) (1 - j x)^(n-1) over all j < 1 / x (Fisher 1929). The terms alternate and, for n in
the thousands, are as large as e^t, t being the first one, so that in float64 nothing would be left of the sum. Two
facts make it exact all the same:

- t_j <= t^j / j!, as C(n, j) <= n^j / j! and 1 - j x <= (1 - x)^j. So some 3 t + 60 terms are enough for float64, and
  for t <= 40 none is above e^40 < 1e18: 60 decimal digits lose 18 and leave 42.
- For t > 40 it is 1: the shares of the ordinates are negatively associated (Joag-Dev and Proschan 1983), hence
  P(g <= x) <= (1 - (1 - x)^(n-1))^n <= e^-t < 5e-18, less than half a unit in the last place of 1.
"""

import math
from decimal import Context, Decimal, localcontext

LARGEST_FIRST_TERM = 40.0
DIGITS = 60


def fisher_p_value(g: float, ordinates: int) -> float:
    """Return the probability that of `ordinates` independent powers of white noise the largest has a share above g.

    Parameters
    ----------
    g : float
        Largest power over the sum of all; in [0, 1].
    ordinates : int
        How many there are, at least 1.

    Returns
    -------
    float
        In [0, 1], to float64's precision; 0 where it is below 1e-308.

    Raises
    ------
    ValueError
        For arguments outside their ranges.
    """
    if not (ordinates >= 1 and 0.0 <= g <= 1.0):
        raise ValueError(f"g = {g} of {ordinates} ordinates: g must be in [0, 1], of at least one")
    if g * ordinates <= 1.0:
        return 1.0
    if g == 1.0:
        return 0.0
    if math.log(ordinates) + (ordinates - 1) * math.log1p(-g) > math.log(LARGEST_FIRST_TERM):
        return 1.0
    with localcontext(Context(prec=DIGITS)):
        share, total, ways, first = Decimal(g), Decimal(0), Decimal(1), Decimal(0)
        for j in range(1, ordinates + 1):
            rest = 1 - j * share
            if rest <= 0:
                break
            ways = ways * (ordinates - j + 1) / j
            term = ways * rest ** (ordinates - 1)
            first = first or term
            total += term if j % 2 else -term
            # From j = 2 t on each term is less than half of the one before: what is left is less than this one.
            if j > 2 * first and term < Decimal("1e-20") * total:
                break
        return min(1.0, max(0.0, float(total)))
