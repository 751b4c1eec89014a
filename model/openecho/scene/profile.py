"""Light that comes back over range: rays of a footprint laid into a fine profile, and that folded with the pulse."""

from __future__ import annotations

import math

import numpy as np

from openecho.compiled import njit
from openecho.scene.geometry.trace import CYLINDER, NOWHERE, crowns, surface
from openecho.scene.physics.pulse import STEPS
from openecho.scene.physics.reflection import backscatter

PIECE = 0.5
"""Bins, of a ray's way through leaves that are laid down as one."""

LEAFY, WALLED = -2, -3
"""Target of a probe with leaves before it; of a crown with upright walls, which begin at once."""

SPREAD = 6.0
"""Deviations to which a smooth footprint is laid down."""


@njit(nogil=True)
def fan(begin, end, direction, radius, turn, points, aim):  # type: ignore[no-untyped-def]
    """Directions of a beam's rays.

    Parameters
    ----------
    begin, end : int
        Beams.
    direction : float64 (n, 3)
        Of each beam, a unit vector.
    radius : float64 (n,)
        Of its footprint, rad.
    turn : float64 (n,)
        By which the pattern is turned about it, rad, so that no two beams share what the pattern misses.
    points : float64 (k, 2)
        Of the pattern, in radii.
    aim : float64 (n, k, 3)
        Filled.
    """
    for i in range(begin, end):
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        # Two vectors across the beam: T. Duff et al., J. Computer Graphics Techniques 6, 1 (2017).
        sign = math.copysign(1.0, dz)
        a = -1.0 / (sign + dz)
        b = dx * dy * a
        sine, cosine = math.sin(turn[i]), math.cos(turn[i])
        for j in range(len(points)):
            x = radius[i] * (points[j, 0] * cosine - points[j, 1] * sine)
            y = radius[i] * (points[j, 0] * sine + points[j, 1] * cosine)
            ax = dx + x * (1.0 + sign * dx * dx * a) + y * b
            ay = dy + x * sign * b + y * (sign + dy * dy * a)
            az = dz - x * sign * dx - y * dy
            length = math.sqrt(ax * ax + ay * ay + az * az)
            aim[i, j, 0], aim[i, j, 1], aim[i, j, 2] = ax / length, ay / length, az / length


@njit(nogil=True)
def probe(begin, end, world, origin, aim, triangles, ranges, cosines, light, owner, first):  # type: ignore[no-untyped-def]
    """What a few rays of each beam meet first.

    Parameters
    ----------
    begin, end : int
        Beams.
    world : World
    origin : float64 (n, 3)
        m.
    aim : float64 (n, k, 3)
        Of the rays.
    triangles : tuple of arrays (n, k)
        Range, cosine, target and object of the triangle that each meets.
    ranges, cosines : float64 (n, k)
        Filled with those of the surface behind all leaves.
    light : float64 (n, k)
        Filled with what it sends back, 1/sr; 0 where there is none.
    owner : int64 (n, k, 2)
        Filled with its target and object; target `LEAFY` or `WALLED` where leaves are before it.
    first : float64 (n,)
        Filled with where the nearest ray meets anything, m; infinite if none does.
    """
    # One by one: an array within a tuple is counted at each use, and two threads then wait for each other.
    reflectance, shapes, heights, crown, frame, cells, members = world
    met_range, met_cosine, met_target, met_object = triangles
    trees = len(crown)
    seen, which = np.full(trees, -1), np.empty(trees, np.int64)
    enters, leaves = np.empty(trees), np.empty(trees)
    stamp = 0
    for i in range(begin, end):
        first[i] = math.inf
        for j in range(aim.shape[1]):
            ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
            dx, dy, dz = aim[i, j, 0], aim[i, j, 1], aim[i, j, 2]
            far, cosine, target, part = surface(shapes, heights, ox, oy, oz, dx, dy, dz)
            if met_range[i, j] < far:
                far, cosine, target, part = met_range[i, j], met_cosine[i, j], met_target[i, j], met_object[i, j]
            stamp += 1
            count = crowns(
                crown, frame, cells, members, ox, oy, oz, dx, dy, dz, far, stamp, seen, enters, leaves, which
            )
            ranges[i, j], cosines[i, j], owner[i, j, 0], owner[i, j, 1] = far, cosine, target, part
            light[i, j] = 0.0
            if target != NOWHERE:
                light[i, j] = _back(reflectance, target, cosine)
            first[i] = min(first[i], far)
            for k in range(count):
                walled = owner[i, j, 0] == WALLED or crown[which[k], 5] == CYLINDER
                owner[i, j, 0] = WALLED if walled else LEAFY
                first[i] = min(first[i], enters[k])


@njit(nogil=True, inline="always")
def _back(reflectance, target, cosine):  # type: ignore[no-untyped-def]
    return backscatter(reflectance[target, 0], reflectance[target, 1], reflectance[target, 2], cosine)


@njit(nogil=True)
def lay(begin, end, rows, world, origin, aim, triangles, start, step, profile, owners, sums, full):  # type: ignore[no-untyped-def]
    """Lay the light of rays into the profiles of their beams, and add up what each object sends back.

    A surface sends its part back from one range. Leaves dim a ray by exp(-k·way), and what they take they send back
    towards the lidar, which sees each leaf that its light has met: there is no second dimming on the way home, W.
    Ni-Meister, D. L. B. Jupp & R. Dubayah, IEEE Trans. Geosci. Remote Sens. 39, 1943 (2001).

    Parameters
    ----------
    begin, end : int
        Of `rows`.
    rows : int64 (k,)
        Beams.
    world, origin, aim, triangles
        As of `probe`; of these beams alone, so that row i of `aim` is that of beam rows[i].
    start : float64 (n,)
        Range of the first step of each beam's profile, m.
    step : float
        m.
    profile : float64 (n, steps)
        Added to: 1/sr for a ray.
    owners : int64 (n, most, 3)
        Target, object, and 1 for leaves, of what each beam met.
    sums : float64 (n, most, 4)
        Added to: what it sends back, 1/sr; that times range, range squared, and angle with the normal.
    full : bool (n,)
        Set where a beam met more than `most`.
    """
    # One by one: an array within a tuple is counted at each use, and two threads then wait for each other.
    reflectance, shapes, heights, crown, frame, cells, members = world
    met_range, met_cosine, met_target, met_object = triangles
    trees = len(crown)
    seen, which = np.full(trees, -1), np.empty(trees, np.int64)
    enters, leaves = np.empty(trees), np.empty(trees)
    edges, active = np.empty(2 * trees), np.empty(trees, np.bool_)
    stamp = 0
    for r in range(begin, end):
        i = rows[r]
        ox, oy, oz = origin[r, 0], origin[r, 1], origin[r, 2]
        for j in range(aim.shape[1]):
            dx, dy, dz = aim[r, j, 0], aim[r, j, 1], aim[r, j, 2]
            far, cosine, target, part = surface(shapes, heights, ox, oy, oz, dx, dy, dz)
            if met_range[r, j] < far:
                far, cosine, target, part = met_range[r, j], met_cosine[r, j], met_target[r, j], met_object[r, j]
            stamp += 1
            count = crowns(
                crown, frame, cells, members, ox, oy, oz, dx, dy, dz, far, stamp, seen, enters, leaves, which
            )
            light = 1.0
            if count:
                light = _through(
                    reflectance,
                    crown,
                    count,
                    enters,
                    leaves,
                    which,
                    edges,
                    active,
                    i,
                    start,
                    step,
                    profile,
                    owners,
                    sums,
                    full,
                )
            if target != NOWHERE:
                back = light * _back(reflectance, target, cosine)
                _put(profile, i, (far - start[i]) / step, back)
                at, angle = far - start[i], math.acos(min(cosine, 1.0))
                _note(owners, sums, full, i, target, part, 0, back, back * at, back * at * at, back * angle)


@njit(nogil=True)
def _through(  # type: ignore[no-untyped-def]
    reflectance, crown, count, enters, leaves, which, edges, active, i, start, step, profile, owners, sums, full
):
    """Light that is left behind the leaves."""
    for k in range(count):
        edges[2 * k], edges[2 * k + 1] = enters[k], leaves[k]
    borders = edges[: 2 * count]
    borders.sort()
    light = 1.0
    for e in range(2 * count - 1):
        near, far = borders[e], borders[e + 1]
        if not far > near:
            continue
        dim, back = 0.0, 0.0
        for k in range(count):
            active[k] = enters[k] <= near and leaves[k] >= far
            if active[k]:
                own = crown[which[k], 6]
                dim += own
                back += own * reflectance[int(crown[which[k], 7]), 3]
        if dim == 0.0:
            continue
        back /= dim
        pieces = math.ceil((far - near) / (PIECE * STEPS * step))
        length = (far - near) / pieces
        taken = -math.expm1(-dim * length)
        # Of light that dims by exp(-dim·x), the middle lies a little before that of the piece.
        middle = 0.5 * length - dim * length * length / 12
        total, mean, square = 0.0, 0.0, 0.0
        for k in range(pieces):
            at = near + k * length + middle - start[i]
            energy = light * taken
            light -= energy
            _put(profile, i, at / step, energy * back)
            total += energy
            mean += energy * at
            square += energy * (at * at + length * length / 12)
        for k in range(count):
            if active[k]:
                tree = which[k]
                target = int(crown[tree, 7])
                share = crown[tree, 6] / dim * reflectance[target, 3]
                own = int(crown[tree, 8])
                _note(owners, sums, full, i, target, own, 1, share * total, share * mean, share * square, 0.0)
    return light


@njit(nogil=True, inline="always")
def _put(profile, i, at, back):  # type: ignore[no-untyped-def]
    """Share something out between two steps, so that its mean is where it is."""
    if 0.0 <= at < profile.shape[1] - 1.0:
        step = int(at)
        rest = at - step
        profile[i, step] += back * (1.0 - rest)
        profile[i, step + 1] += back * rest


@njit(nogil=True)
def _note(owners, sums, full, i, target, part, leafy, back, mean, square, angle):  # type: ignore[no-untyped-def]
    """Add to what an object sends back, and to its first two moments of range and its angle, all weighted with it."""
    most = owners.shape[1]
    k = 0
    while k < most and owners[i, k, 0] != NOWHERE:
        if owners[i, k, 0] == target and owners[i, k, 1] == part:
            break
        k += 1
    if k == most:
        full[i] = True
        return
    owners[i, k, 0], owners[i, k, 1], owners[i, k, 2] = target, part, leafy
    sums[i, k, 0] += back
    sums[i, k, 1] += mean
    sums[i, k, 2] += square
    sums[i, k, 3] += angle


@njit(nogil=True)
def smear(begin, end, rows, mean, deviation, back, angle, start, shape, grain, waveform, sums):  # type: ignore[no-untyped-def]
    """Waveforms of footprints that lie on one smooth surface: their light is spread normally over range.

    Parameters
    ----------
    begin, end : int
        Of `rows`.
    rows : int64 (k,)
        Beams.
    mean, deviation : float64 (n,)
        Of the range over the footprint, m.
    back : float64 (n,)
        What it sends back, 1/sr.
    angle : float64 (n,)
        With the normal, rad.
    start, shape, grain, waveform
        As of `fold`.
    sums : float64 (n, most, 4)
        As of `lay`; the first of each beam is filled.
    """
    step = shape[0]
    most = 0.0
    for r in range(begin, end):
        most = max(most, deviation[rows[r]])
    row = np.empty(2 * math.ceil(SPREAD * most / step) + 5)
    for r in range(begin, end):
        i = rows[r]
        at, width = (mean[i] - start[i]) / step, deviation[i] / step
        reach = math.ceil(SPREAD * width) + 1
        first = math.floor(at + 0.5) - reach
        row[: 2 * reach + 1] = 0.0
        if width < 1.0:
            # Three steps that have the mean and the variance: a normal curve at so few has neither.
            off = at - first - reach
            square = width * width + off * off
            row[reach - 1] = back[i] * 0.5 * (square - off)
            row[reach] = back[i] * (1.0 - square)
            row[reach + 1] = back[i] * 0.5 * (square + off)
        else:
            scale = back[i] / (width * math.sqrt(2 * math.pi))
            for k in range(2 * reach + 1):
                z = (first + k - at) / width
                row[k] = scale * math.exp(-0.5 * z * z)
        _fold(row[: 2 * reach + 1], first, start[i], shape, grain[i], waveform[i])
        far = mean[i] - start[i]
        sums[i, 0, 0], sums[i, 0, 1] = back[i], back[i] * far
        sums[i, 0, 2], sums[i, 0, 3] = back[i] * (far * far + deviation[i] * deviation[i]), back[i] * angle[i]


@njit(nogil=True)
def fold(begin, end, rows, profile, start, shape, grain, waveform):  # type: ignore[no-untyped-def]
    """Waveforms: profiles under the range law, each step in the shape of the pulse.

    Parameters
    ----------
    begin, end, rows, profile, start
        As of `lay`.
    shape : tuple
        Of a step in range, m; extinction one way, 1/m; the pulse, 1/s (STEPS, k): at steps of a bin, a row for each
        part of a bin by which it may be late; bins before its maximum; bins of the profile before the first sample;
        and steps of a grain.
    grain : float64 (n, grains)
        Factors of speckle, from the first step that is lit.
    waveform : float64 (n, m)
        Filled: 1/(sr m² s), what a joule sent out makes.
    """
    for r in range(begin, end):
        i = rows[r]
        waveform[i] = 0.0
        _fold(profile[i], 0, start[i], shape, grain[i], waveform[i])


@njit(nogil=True)
def _fold(profile, offset, start, shape, grain, waveform):  # type: ignore[no-untyped-def]
    """Add steps to a waveform, the first of which is the one with the number `offset`."""
    step, extinction, pulse, peak, before, size = shape
    parts, length = pulse.shape
    lit = -1
    for f in range(len(profile)):
        if profile[f] == 0.0:
            continue
        if lit < 0:
            lit = f
        away = start + (offset + f) * step
        if not away > 0.0:
            continue
        back = profile[f] * math.exp(-2.0 * extinction * away) / (away * away)
        back *= grain[min((f - lit) // size, len(grain) - 1)]
        first = (offset + f) // parts - before - peak
        late = pulse[(offset + f) % parts]
        for k in range(max(-first, 0), min(length, len(waveform) - first)):
            waveform[first + k] += back * late[k]


@njit(nogil=True)
def settle(begin, end, rows, before, now, counts, variance, least, share, settled):  # type: ignore[no-untyped-def]
    """Whether twice as many rays have left waveforms as they were.

    Parameters
    ----------
    begin, end, rows
        As of `lay`.
    before, now : float64 (n, m)
        Sums over half of the rays, and over all.
    counts : float
        What makes counts of `now`.
    variance : (float, float)
        Of the noise, counts²: without light, and for a count of light.
    least, share : float
        Tolerance, counts, and as a share of the noise's deviation; the greater holds.
    settled : bool (n,)
        Filled.
    """
    for r in range(begin, end):
        i = rows[r]
        settled[i] = True
        for k in range(now.shape[1]):
            off = abs(2.0 * before[i, k] - now[i, k]) * counts
            if off > least and off > share * math.sqrt(variance[0] + variance[1] * now[i, k] * counts):
                settled[i] = False
                break
