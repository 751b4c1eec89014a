"""What rays meet: surfaces of closed form, grids of heights, and crowns, which let some of the light through."""

from __future__ import annotations

import math

import numpy as np

from openecho.compiled import njit

NOWHERE = -1
"""Target of a ray that meets none."""

PLANE, STAIRS, BALL, GRID = range(4)
"""Kinds of surface."""

ELLIPSOID, CONE, CYLINDER = range(3)
"""Shapes of crowns."""

SHELL = 1e-6
"""m: what is nearer is where the ray comes from."""


@njit(nogil=True)
def surface(shapes, heights, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    """First surface of closed form or of a grid that a ray meets.

    Parameters
    ----------
    shapes, heights
        Of a `openecho.scene.geometry.world.World`: arrays one by one, for a tuple's are counted at each call.
    ox, oy, oz, dx, dy, dz : float
        Origin, m, and direction, a unit vector.

    Returns
    -------
    range : float
        m; infinite if there is none.
    cosine : float
        Of the angle with the normal.
    target, object : int
        `NOWHERE` if there is none; of terraces, treads and then risers are numbered from 0.
    """
    best, cosine, target, part = math.inf, 0.0, NOWHERE, 0
    for i in range(len(shapes)):
        kind, step = shapes[i, 0], 0
        if kind == PLANE:
            t, facing = _plane(shapes, i, ox, oy, oz, dx, dy, dz)
        elif kind == GRID:
            t, facing = _grid(shapes, i, heights, ox, oy, oz, dx, dy, dz, best)
        elif kind == STAIRS:
            t, facing, step = _stairs(shapes, i, ox, oy, oz, dx, dy, dz)
        else:
            t, facing = _ball(shapes, i, ox, oy, oz, dx, dy, dz)
        if t < best:
            best, cosine, target, part = t, facing, int(shapes[i, 1]), step
    return best, cosine, target, part


@njit(nogil=True)
def _plane(shapes, i, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    facing = shapes[i, 5] * dx + shapes[i, 6] * dy + shapes[i, 7] * dz
    if facing == 0.0:
        return math.inf, 0.0
    t = (
        shapes[i, 5] * (shapes[i, 2] - ox) + shapes[i, 6] * (shapes[i, 3] - oy) + shapes[i, 7] * (shapes[i, 4] - oz)
    ) / facing
    if not t > SHELL:
        return math.inf, 0.0
    x, y, z = ox + t * dx - shapes[i, 2], oy + t * dy - shapes[i, 3], oz + t * dz - shapes[i, 4]
    if (
        abs(shapes[i, 8] * x + shapes[i, 9] * y + shapes[i, 10] * z) > shapes[i, 14]
        or abs(shapes[i, 11] * x + shapes[i, 12] * y + shapes[i, 13] * z) > shapes[i, 15]
    ):
        return math.inf, 0.0
    return t, abs(facing)


@njit(nogil=True)
def _stairs(shapes, i, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Treads that lie at the height, and risers at the place, where the ray passes them."""
    best, cosine, step = math.inf, 0.0, 0
    climb, aside, steps = shapes[i, 5], shapes[i, 6], int(shapes[i, 7])
    rise, run, half = shapes[i, 8], shapes[i, 9], shapes[i, 10]
    # Along the climb, across it, and up from the foot of the first riser.
    u, v, w = (
        (ox - shapes[i, 2]) * climb + (oy - shapes[i, 3]) * aside,
        (oy - shapes[i, 3]) * climb - (ox - shapes[i, 2]) * aside,
        oz - shapes[i, 4],
    )
    du, dv = dx * climb + dy * aside, dy * climb - dx * aside
    for k in range(steps):
        if dz != 0.0:
            t = ((k + 1) * rise - w) / dz
            along = u + t * du
            if SHELL < t < best and k * run <= along <= (k + 1) * run and abs(v + t * dv) <= half:
                best, cosine, step = t, abs(dz), k
        if du != 0.0:
            t = (k * run - u) / du
            up = w + t * dz
            if SHELL < t < best and k * rise <= up <= (k + 1) * rise and abs(v + t * dv) <= half:
                best, cosine, step = t, abs(du), steps + k
    return best, cosine, step


@njit(nogil=True)
def _ball(shapes, i, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    x, y, z, radius = ox - shapes[i, 2], oy - shapes[i, 3], oz - shapes[i, 4], shapes[i, 5]
    middle = -(x * dx + y * dy + z * dz)
    # From the foot of the perpendicular: the difference of two large squares would lose the digits of a far ball.
    x, y, z = x + middle * dx, y + middle * dy, z + middle * dz
    square = radius * radius - (x * x + y * y + z * z)
    if square < 0.0:
        return math.inf, 0.0
    half = math.sqrt(square)
    t = middle - half
    if t <= SHELL:
        t = middle + half
    if t <= SHELL:
        return math.inf, 0.0
    return t, half / radius


@njit(nogil=True)
def _grid(shapes, i, heights, ox, oy, oz, dx, dy, dz, most):  # type: ignore[no-untyped-def]
    """Cell by cell along the ray, each a bilinear patch, of which the first crossing is the root of a quadratic."""
    first, rows, columns, cell = int(shapes[i, 2]), int(shapes[i, 3]), int(shapes[i, 4]), shapes[i, 7]
    low, high, repeats = shapes[i, 8], shapes[i, 9], shapes[i, 10] != 0.0
    near, far = _slab(oz, dz, low, high, 0.0, most)
    # In cells, from the first height.
    x, y, ex, ey = (ox - shapes[i, 5]) / cell, (oy - shapes[i, 6]) / cell, dx / cell, dy / cell
    if not repeats:
        near, far = _slab(x, ex, 0.0, columns - 1.0, near, far)
        near, far = _slab(y, ey, 0.0, rows - 1.0, near, far)
    if not near <= far:
        return math.inf, 0.0
    column, line = math.floor(x + near * ex), math.floor(y + near * ey)
    if not repeats:
        column, line = min(max(column, 0), columns - 2), min(max(line, 0), rows - 2)
    t = near
    while True:
        # Where the ray leaves the cell.
        over = (column + (1 if ex > 0.0 else 0) - x) / ex if ex != 0.0 else math.inf
        up = (line + (1 if ey > 0.0 else 0) - y) / ey if ey != 0.0 else math.inf
        end = min(over, up, far)
        if repeats:
            at = first + (line % (rows - 1)) * columns + column % (columns - 1)
        else:
            at = first + line * columns + column
        a, b, c, d = heights[at], heights[at + 1], heights[at + columns], heights[at + columns + 1]
        root = _patch(a, b, c, d, x - column, y - line, oz, ex, ey, dz, t, max(end, t))
        if root < math.inf:
            u, v = x + root * ex - column, y + root * ey - line
            sx, sy = _slope(shapes, i, heights, column, line, u, v)
            facing = abs(dz - sx * dx - sy * dy) / math.sqrt(1 + sx * sx + sy * sy)
            return (root, facing) if root > SHELL else (math.inf, 0.0)
        if not end < far:
            return math.inf, 0.0
        t = max(end, t)
        if over <= up:
            column += 1 if ex > 0.0 else -1
        else:
            line += 1 if ey > 0.0 else -1
        if not repeats and (column < 0 or column > columns - 2 or line < 0 or line > rows - 2):
            return math.inf, 0.0


@njit(nogil=True)
def _slope(shapes, i, heights, column, line, u, v):  # type: ignore[no-untyped-def]
    """Slope to east and north within a cell: between those at its corners, without a jump from cell to cell."""
    sx, sy = 0.0, 0.0
    for north in range(2):
        for east in range(2):
            share = (u if east else 1.0 - u) * (v if north else 1.0 - v)
            sx += share * _difference(shapes, i, heights, column + east, line + north, 1, 0)
            sy += share * _difference(shapes, i, heights, column + east, line + north, 0, 1)
    return sx / shapes[i, 7], sy / shapes[i, 7]


@njit(nogil=True)
def _difference(shapes, i, heights, column, line, east, north):  # type: ignore[no-untyped-def]
    """Of heights on both sides of a corner, a cell; on one side where there are none on the other."""
    here = _height(shapes, i, heights, column, line)
    ahead = _height(shapes, i, heights, column + east, line + north) - here
    behind = here - _height(shapes, i, heights, column - east, line - north)
    if math.isnan(ahead):
        return behind
    return ahead if math.isnan(behind) else 0.5 * (ahead + behind)


@njit(nogil=True)
def _height(shapes, i, heights, column, line):  # type: ignore[no-untyped-def]
    """Height at a corner, NaN beyond the edge."""
    rows, columns = int(shapes[i, 3]), int(shapes[i, 4])
    if shapes[i, 10] != 0.0:
        column, line = column % (columns - 1), line % (rows - 1)
    if column < 0 or column >= columns or line < 0 or line >= rows:
        return math.nan
    return heights[int(shapes[i, 2]) + line * columns + column]


@njit(nogil=True, inline="always")
def _slab(start, slope, low, high, near, far):  # type: ignore[no-untyped-def]
    """Part of near to far in which start + t·slope is from low to high; near > far if there is none."""
    if slope == 0.0:
        return (near, far) if low <= start <= high else (1.0, 0.0)
    one, other = (low - start) / slope, (high - start) / slope
    return max(near, min(one, other)), min(far, max(one, other))


@njit(nogil=True)
def _patch(a, b, c, d, x, y, z, ex, ey, ez, begin, end):  # type: ignore[no-untyped-def]
    """First t from begin to end where the ray is as high as the patch with the corners a, b (east), c (north), d."""
    twist = a - b - c + d
    # Height over the patch along the ray, from its own beginning: p t² + q t + r.
    x, y, z = x + begin * ex, y + begin * ey, z + begin * ez
    p = -twist * ex * ey
    q = ez - (b - a) * ex - (c - a) * ey - twist * (x * ey + y * ex)
    r = z - a - (b - a) * x - (c - a) * y - twist * x * y
    length = end - begin
    if abs(p) * length * length <= 1e-12 * (abs(q) * length + abs(r)):
        if q == 0.0:
            return begin if r == 0.0 else math.inf
        t = -r / q
        return begin + t if -1e-9 <= t <= length + 1e-9 else math.inf
    square = q * q - 4 * p * r
    if not square >= 0.0:
        return math.inf
    half = -0.5 * (q + math.copysign(math.sqrt(square), q))
    one, other = half / p, (r / half if half != 0.0 else math.inf)
    least, most = min(one, other), max(one, other)
    if -1e-9 <= least <= length + 1e-9:
        return begin + least
    if -1e-9 <= most <= length + 1e-9:
        return begin + most
    return math.inf


@njit(nogil=True)
def crowns(crown, frame, cells, members, ox, oy, oz, dx, dy, dz, far, stamp, seen, enters, leaves, which):  # type: ignore[no-untyped-def]
    """Crowns that a ray goes through before it meets a surface.

    Parameters
    ----------
    crown, frame, cells, members
        Of a `openecho.scene.geometry.world.World`, its crowns and how they are looked up.
    ox, oy, oz, dx, dy, dz : float
        Origin, m, and direction, a unit vector.
    far : float
        Where it meets a surface, m.
    stamp : int
        Number of this ray.
    seen : int64 (crowns,)
        Of the last ray that was asked of each crown: one lies in several cells.
    enters, leaves, which : float64, float64, int64 (crowns,)
        Filled with where the ray enters and leaves which crown, m.

    Returns
    -------
    int
        How many.
    """
    count = 0
    if not len(members):
        return count
    side, columns, rows = frame[2], cells.shape[1], cells.shape[0] - 1
    near, far = _slab(oz, dz, frame[3], frame[4], 0.0, far)
    x, y, ex, ey = (ox - frame[0]) / side, (oy - frame[1]) / side, dx / side, dy / side
    near, far = _slab(x, ex, 0.0, columns * 1.0, near, far)
    near, far = _slab(y, ey, 0.0, rows * 1.0, near, far)
    if not near <= far:
        return count
    column = min(max(math.floor(x + near * ex), 0), columns - 1)
    row = min(max(math.floor(y + near * ey), 0), rows - 1)
    while 0 <= column < columns and 0 <= row < rows:
        begin = cells[row, column]
        end = cells[row, column + 1] if column + 1 < columns else cells[row + 1, 0]
        for m in range(begin, end):
            i = members[m]
            if seen[i] == stamp:
                continue
            seen[i] = stamp
            enter, leave = _crown(crown, i, ox, oy, oz, dx, dy, dz)
            leave = min(leave, far)
            if leave > enter:
                enters[count], leaves[count], which[count] = enter, leave, i
                count += 1
        over = (column + (1 if ex > 0.0 else 0) - x) / ex if ex != 0.0 else math.inf
        up = (row + (1 if ey > 0.0 else 0) - y) / ey if ey != 0.0 else math.inf
        if not min(over, up) < far:
            break
        if over <= up:
            column += 1 if ex > 0.0 else -1
        else:
            row += 1 if ey > 0.0 else -1
    return count


@njit(nogil=True)
def _crown(crown, i, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Where a ray enters and leaves a crown; enters after it leaves if it does not meet it."""
    base, top, radius = crown[i, 2], crown[i, 3], crown[i, 4]
    enter, leave = _slab(oz, dz, base, top, 0.0, math.inf)
    if not enter <= leave:
        return 1.0, 0.0
    # From a point nearby, so that no digits are lost: the middle of its way through the crown's heights.
    middle = 0.5 * (enter + leave) if leave < math.inf else enter
    x, y, z = ox + middle * dx - crown[i, 0], oy + middle * dy - crown[i, 1], oz + middle * dz
    flat, slant, out = dx * dx + dy * dy, x * dx + y * dy, x * x + y * y
    if crown[i, 5] == CYLINDER:
        a, b, c = flat, slant, out - radius * radius
    elif crown[i, 5] == CONE:  # its top at `top`
        slope = (radius / (top - base)) ** 2
        down = top - z
        a, b, c = flat - slope * dz * dz, slant + slope * down * dz, out - slope * down * down
    else:  # an ellipsoid
        half = 0.5 * (top - base)
        slope = (radius / half) ** 2
        up = z - 0.5 * (base + top)
        a, b, c = flat + slope * dz * dz, slant + slope * up * dz, out + slope * up * up - radius * radius
    if a == 0.0 and b == 0.0:
        return (enter, leave) if c <= 0.0 else (1.0, 0.0)
    square = b * b - a * c
    if square < 0.0:
        return (1.0, 0.0) if a >= 0.0 else (enter, leave)
    if a == 0.0:
        root = -c / (2 * b)
        one, other = (root, math.inf) if b < 0.0 else (-math.inf, root)
    else:
        root = math.sqrt(square)
        one, other = (-b - root) / a, (-b + root) / a
        if a < 0.0:  # steeper than the cone: within it below where the ray passes the lower of its two halves
            one, other = (max(one, other), math.inf) if dz < 0.0 else (-math.inf, min(one, other))
    return max(enter, middle + one), min(leave, middle + other)


@njit(nogil=True)
def below(shapes, heights, x, y, high):  # type: ignore[no-untyped-def]
    """Height of the first surface below each of some places (n,) at the height `high`; 0 where there is none."""
    z = np.zeros(len(x))
    for i in range(len(x)):
        down = surface(shapes, heights, x[i], y[i], high, 0.0, 0.0, -1.0)[0]
        if down < math.inf:
            z[i] = high - down
    return z
