"""Small exact pieces of arithmetic for lines inside a cell: doubled precision, crossings and sorting."""

from aliasbench.renderers.kernel_parts import called
from aliasbench.scenes.model import FloatArray


@called
def _two_difference(a: float, b: float) -> tuple[float, float]:
    """Return a - b rounded, and what the rounding lost (Knuth)."""
    s = a - b
    t = s - a
    return s, (a - (s - t)) - (b + t)


@called
def _two_product(a: float, b: float) -> tuple[float, float]:
    """Return a b rounded, and what the rounding lost (Dekker's splitting; fine below 1e150)."""
    p = a * b
    t = 134217729.0 * a
    ah = t - (t - a)
    al = a - ah
    t = 134217729.0 * b
    bh = t - (t - b)
    bl = b - bh
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@called
def local_line(x0: float, y0: float, x1: float, y1: float, X: float, Y: float) -> tuple[float, float]:
    """Return (c, m) of the line x = c + m y through two points, both relative to the corner (X, Y); y0 < y1.

    c is the cross product of the moved points over the difference of their heights. Both are taken in doubled
    precision: rounding the moved points alone would cost the digits between the cell's size and its place.
    """
    ax, axe = _two_difference(x0, X)
    ay, aye = _two_difference(y0, Y)
    bx, bxe = _two_difference(x1, X)
    by, bye = _two_difference(y1, Y)
    p, pe = _two_product(ax, by)
    q, qe = _two_product(bx, ay)
    cross, lost = _two_difference(p, q)
    lost += pe - qe + (ax * bye + axe * by) - (bx * aye + bxe * ay)
    dy, dye = _two_difference(y1, y0)
    dx, dxe = _two_difference(x1, x0)
    c = (cross + lost) / dy
    r, re = _two_product(c, dy)
    c += (((cross - r) - re) + lost - c * dye) / dy
    m = dx / dy
    r, re = _two_product(m, dy)
    m += (((dx - r) - re) + dxe - m * dye) / dy
    return c, m


@called
def cross_lines(line: FloatArray, n: int, size: float, events: FloatArray, count: int) -> int:
    """Append the heights in (0, size) where lines end, meet the cell's sides or each other; return the new count."""
    for i in range(n):
        c, m, low, high = line[i]
        low, high = max(low, 0.0), min(high, size)
        for y in (low, high):
            if 0.0 < y < size:
                events[count] = y
                count += 1
        if m != 0.0:
            for x in (0.0, size):
                y = (x - c) / m
                if low < y < high:
                    events[count] = y
                    count += 1
        for j in range(i):
            if line[j, 1] != m:
                y = (line[j, 0] - c) / (m - line[j, 1])
                if max(low, line[j, 2]) < y < min(high, line[j, 3]):
                    events[count] = y
                    count += 1
    return count


@called
def sort_prefix(values: FloatArray, n: int) -> None:
    """Sort the first n values in place (Shell's way: plain insertion for a few)."""
    gap = 1
    while gap * 4 < n:
        gap = gap * 9 // 4 + 1
    while gap > 0:
        for i in range(gap, n):
            v = values[i]
            j = i - gap
            while j >= 0 and values[j] > v:
                values[j + gap] = values[j]
                j -= gap
            values[j + gap] = v
        gap = gap * 4 // 9
