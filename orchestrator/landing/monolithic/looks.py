"""What the contacts did since the last output time: largest values, also between two looks, and the first touch."""

from __future__ import annotations

import numpy as np

from fmus.contact import places as at
from fmus.kernels.jit import kernel
from orchestrator.landing.monolithic.state import GONE, IMPULSE, LOOKS, N_LOOK, NORMAL_MAX, TOUCH_TIME

TIME, FORCE, DEPTH, SLIP = range(4)
"""Places in a look; the largest of the last three stand in the memory from `NORMAL_MAX` on."""


@kernel
def begin(memory, out, t):
    """Start the memory of a contact at the time `t` (s)."""
    for first in (LOOKS, LOOKS + N_LOOK):
        for i in range(N_LOOK):
            memory[first + i] = _value(memory, out, t, i)
    memory[TOUCH_TIME] = t if out[at.NORMAL] > 0.0 else at.NOT_YET
    restart(memory)


@kernel
def restart(memory):
    """Begin a new interval between output times: its largest values are those of now, as yet."""
    for i in range(FORCE, N_LOOK):
        memory[NORMAL_MAX + i - FORCE] = memory[LOOKS + N_LOOK + i]
    memory[IMPULSE] = 0.0


@kernel
def see(memory, out, t):
    """Take the law's results at the time `t` (s) into account.

    Three looks of which the middle one is largest make a parabola, whose top counts too.
    """
    a, b = LOOKS, LOOKS + N_LOOK
    if memory[TOUCH_TIME] == at.NOT_YET and out[at.DEEPEST] > 0.0:
        gap = memory[b + DEPTH]
        memory[TOUCH_TIME] = memory[b + TIME] - gap * (t - memory[b + TIME]) / (out[at.DEEPEST] - gap)
    for i in range(FORCE, N_LOOK):
        value = _value(memory, out, t, i)
        top = _top(memory[a + TIME], memory[b + TIME], t, memory[a + i], memory[b + i], value)
        memory[NORMAL_MAX + i - FORCE] = max(memory[NORMAL_MAX + i - FORCE], top, value)
    for i in range(N_LOOK):
        memory[a + i] = memory[b + i]
        memory[b + i] = _value(memory, out, t, i)


@kernel
def _value(memory, out, t, i):
    """Return place `i` of a look at the law's results `out` at the time `t` (s)."""
    if i == TIME:
        return t
    if i == DEPTH:
        return out[at.DEEPEST]
    if memory[GONE] > 0.0 or not out[at.DEEPEST] > 0.0:
        return 0.0
    return out[at.NORMAL] if i == FORCE else np.sqrt(out[at.SLIP_VELOCITY] ** 2 + out[at.SLIP_VELOCITY + 1] ** 2)


@kernel
def _top(t0, t1, t2, f0, f1, f2):
    """Return the top of the parabola through three looks if the middle one is largest, else the middle one."""
    if not (t0 < t1 and t1 < t2 and f1 >= f0 and f1 >= f2) or (f1 == f0 and f1 == f2):
        return f1
    rise, fall = (f1 - f0) / (t1 - t0), (f2 - f1) / (t2 - t1)
    bend = (fall - rise) / (t2 - t0)
    slope = rise + bend * (t1 - t0)
    return f1 - 0.25 * slope * slope / bend
