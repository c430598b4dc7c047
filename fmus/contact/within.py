"""What happens within a macro step: largest force, penetration and slip, impulse, first touch; and how far it may go.

The law is looked at along the path: at its Gauss points, at both ends, and where a parabola through the largest of
them and its neighbours has its top.
"""

from __future__ import annotations

import math

from fmus.contact import places as at
from fmus.contact.law import LEFT, OK, TOO_FAR, foot, walls
from fmus.contact.path import motion_at
from fmus.contact.sampling import bend
from fmus.kernels.jit import kernel

SIGMA, FORCE, DEPTH, SLIP = range(4)
"""Columns of a grid of looks (m + 2, 4): place in the step, normal force, penetration, slip velocity while touching."""
N_LOOKS = 4
TOP_LOOKS, TOUCH_LOOKS = 4, 40
"""Looks for one top; it moves by less than a thousandth of its bracket then. Most looks for a touch."""
FINEST = 1e-12
"""Place of a touch in the step, and least distance of looks."""
MOST_PLACES = 2000


@kernel
def note(sigma, row, look):
    """Write what the law's results `row` say at `sigma` to `look` (4,)."""
    look[SIGMA], look[FORCE], look[DEPTH] = sigma, row[at.NORMAL], row[at.DEEPEST]
    slip = math.sqrt(row[at.SLIP_VELOCITY] ** 2 + row[at.SLIP_VELOCITY + 1] ** 2)
    look[SLIP] = slip if row[at.DEEPEST] > 0.0 else 0.0


@kernel
def _look(prm, path, sigma, h, curvature, motion, row, look):
    """Evaluate the walls at `sigma` of the path; return the status of the law."""
    motion_at(path, sigma, h, motion)
    bend(motion, curvature)
    status = walls(prm, motion, row)
    note(sigma, row, look)
    return status


@kernel
def _raise(look, best):
    """Keep the larger of what has been seen in `best` (4,)."""
    for column in range(FORCE, N_LOOKS):
        best[column] = max(best[column], look[column])


@kernel
def _vertex(a, b, c, fa, fb, fc):
    """Return where the parabola through three points has its top; b where it has none."""
    left, right = (b - a) * (fb - fc), (b - c) * (fb - fa)
    if left == right:
        return b
    return b - 0.5 * ((b - a) * left - (b - c) * right) / (left - right)


@kernel
def _top(prm, path, h, curvature, grid, column, motion, row, look, best):
    """Look for the top of one column between the neighbours of its largest entry; return the status of the law.

    Where that is an end of the step, the parabola through the three entries there says whether it rises to an end.
    """
    i, n = 0, grid.shape[0]
    for j in range(1, n):
        if grid[j, column] > grid[i, column]:
            i = j
    i = min(max(i, 1), n - 2)
    a, b, c = grid[i - 1, SIGMA], grid[i, SIGMA], grid[i + 1, SIGMA]
    fa, fb, fc = grid[i - 1, column], grid[i, column], grid[i + 1, column]
    for _ in range(TOP_LOOKS):
        x = _vertex(a, b, c, fa, fb, fc)
        if not a < x < c or abs(x - b) < 1e-3 * (c - a):
            return OK
        status = _look(prm, path, x, h, curvature, motion, row, look)
        if status != OK:
            return status
        _raise(look, best)
        f = look[column]
        if f > fb:
            if x < b:
                c, fc = b, fb
            else:
                a, fa = b, fb
            b, fb = x, f
        elif x < b:
            a, fa = x, f
        else:
            c, fc = x, f
    return OK


@kernel
def _touch(prm, path, h, curvature, a, b, motion, row, look, best):
    """Return where between `a`, not touching, and `b`, touching, both (4,), cable and wheel come to touch."""
    x0, x1, f0, f1 = a[SIGMA], b[SIGMA], a[DEPTH], b[DEPTH]
    kept = 0
    for _ in range(TOUCH_LOOKS):
        if x1 - x0 <= FINEST or f1 <= 0.0:
            break
        x = x1 - f1 * (x1 - x0) / (f1 - f0)
        if not x0 < x or not x < x1:
            break
        if _look(prm, path, x, h, curvature, motion, row, look) != OK:
            break
        _raise(look, best)
        if look[DEPTH] > 0.0:
            x1, f1 = x, look[DEPTH]
            f0 *= 0.5 if kept == 1 else 1.0  # Illinois
            kept = 1
        else:
            x0, f0 = x, look[DEPTH]
            f1 *= 0.5 if kept == -1 else 1.0
            kept = -1
    return x1


@kernel
def extremes(prm, path, h, nodes, weights, curvature, samples, grid, motion, best):
    """Write what happens along a path: largest force, penetration and slip to `best` (4,).

    Parameters
    ----------
    samples : (m + 2, 34) the law's results at the Gauss points and the end of the step; the last row is work space
    grid : (m + 4, 4) work space
    motion : (24,) work space

    Returns
    -------
    status of the law; impulse, N s; place of the first touch in the step, 2 where there is none
    """
    m = len(nodes)
    row, look, looks = samples[m + 1], grid[m + 2], grid[: m + 2]
    status = _look(prm, path, 0.0, h, curvature, motion, row, looks[0])
    if status != OK:
        return status, 0.0, 2.0
    impulse, jump = 0.0, 0.0
    for i in range(m + 1):
        note(nodes[i] if i < m else 1.0, samples[i], looks[i + 1])
        jump = max(jump, abs(looks[i + 1, DEPTH] - looks[i, DEPTH]))
        if i < m:
            impulse += h * weights[i] * samples[i, at.NORMAL]
    best[DEPTH] = -math.inf
    best[FORCE] = best[SLIP] = 0.0
    for i in range(m + 2):
        _raise(looks[i], best)
    if best[DEPTH] < -jump:  # too far apart to touch between two looks
        return OK, impulse, 2.0
    for column in (DEPTH, FORCE, SLIP):
        if column == DEPTH or best[DEPTH] > 0.0:
            status = _top(prm, path, h, curvature, looks, column, motion, row, look, best)
            if status != OK:
                return status, 0.0, 2.0
    return OK, impulse, _first_touch(prm, path, h, curvature, looks, motion, row, look, grid[m + 3], best)


@kernel
def _first_touch(prm, path, h, curvature, looks, motion, row, look, deepest, best):
    """Return the place of the first touch in the step: 0 where it touches at the start, 2 where it does not at all."""
    first, top = looks.shape[0], 0
    for i in range(looks.shape[0]):
        if looks[i, DEPTH] > 0.0 and first == looks.shape[0]:
            first = i
        if looks[i, DEPTH] > looks[top, DEPTH]:
            top = i
    if first == 0:
        return 0.0
    if first < looks.shape[0]:
        return _touch(prm, path, h, curvature, looks[first - 1], looks[first], motion, row, look, best)
    if not best[DEPTH] > 0.0:
        return 2.0
    # between two looks alone: the top of a parabola has found it, and finds it again
    low = max(top - 1, 0)
    a, c = looks[low, SIGMA], looks[min(top + 1, looks.shape[0] - 1), SIGMA]
    for i in range(1, MOST_PLACES):
        x = a + (c - a) * i / MOST_PLACES
        if _look(prm, path, x, h, curvature, motion, row, deepest) != OK:
            return x
        if deepest[DEPTH] > 0.0:
            return _touch(prm, path, h, curvature, looks[low], deepest, motion, row, look, best)
    return looks[top, SIGMA]


@kernel
def travel(prm, path, h, curvature, motions, n, motion, row, look):
    """Return how far wheel and cable move relative to each other in the step (m), and whether that is too far.

    Too far is farther than the groove is deep in a step in which they touch: the law would then see the contact at a few
    places that chance selects, or pass over it.

    Parameters
    ----------
    motions : (n or more, 24) along the path, in any order
    motion, row, look : work space
    """
    way = 0.0
    motion_at(path, 0.0, h, motion)
    _length, _u, _offset, d0 = foot(motion)
    for i in range(n):
        _length, _u, _offset, d = foot(motions[i])
        way = max(way, math.sqrt((d[0] - d0[0]) ** 2 + (d[1] - d0[1]) ** 2 + (d[2] - d0[2]) ** 2))
    depth = groove_depth(prm)
    if not way > depth or not math.isfinite(way):
        return way, OK
    places = min(MOST_PLACES, int(4.0 * way / depth) + 1)
    for i in range(places + 1):
        status = _look(prm, path, i / places, h, curvature, motion, row, look)
        if status != OK or look[DEPTH] > 0.0 or row[at.STATUS] == LEFT:
            return way, TOO_FAR
    return way, OK


@kernel
def groove_depth(prm):
    """Return the depth of the groove, m."""
    return prm[at.WHEEL_RADIUS] - prm[at.APEX]
