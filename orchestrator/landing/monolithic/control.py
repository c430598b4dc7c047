"""Steps of controlled length: each as long as its error allows, and short where a contact changes its regime."""

from __future__ import annotations

import numpy as np

from fmus.kernels.jit import kernel
from orchestrator.landing.monolithic.contacts import longest_step
from orchestrator.landing.monolithic.state import NOT_CONVERGED, OFF_CABLE, OK
from orchestrator.landing.monolithic.step import step

SAFETY, GROW, SHRINK = 0.8, 2.0, 0.2
SHORTEST = 1e-7
"""s; a shorter step means that the equations cannot be solved."""
WANTED, LONGEST, ALLOWED, EVENT, NEWTON, MATRIX, STEPS, ITERATIONS, REJECTED = range(9)
"""Places in the control of `advance`."""


@kernel
def set_control(system, since, h, space):
    """Write the control loads at the stages of a step `h` that begins `since` (s) after the start of `advance`."""
    for j in range(2):
        at = since + system.method.c[j] * h
        for i in range(system.control.shape[1]):
            space.control[j, i] = system.control[0, i] + system.control[1, i] * at


@kernel
def advance(system, state, control, t, end, space, work):
    """Integrate from `t` to `end` with controlled steps; in between the control loads are straight.

    Parameters
    ----------
    control : (9,) step wanted, longest step, allowed error, event step, tolerance of Newton's method, step of the
        matrix (0: none), number of steps, of iterations, of rejected steps; changed

    Returns
    -------
    status : OK, OFF_CABLE, or why no step is short enough: NOT_CONVERGED, CONTACT_FAILED, AXLE_ALONG
    t : time reached
    """
    start = t
    while end - t > 1e-12 * max(1.0, end):
        left = end - t
        longest = min(control[WANTED], control[LONGEST], longest_step(system, state, space))
        h = left / max(1.0, np.ceil(left / longest - 1e-9))
        fresh = abs(h - control[MATRIX]) > 1e-9 * h
        set_control(system, t - start, h, space)
        status, error, iterations = step(
            system, state, h, control[NEWTON], fresh, space, work, control[ALLOWED], control[EVENT]
        )
        control[ITERATIONS] += iterations
        if status == OFF_CABLE:
            return OFF_CABLE, t
        if status != OK or error > control[ALLOWED]:
            factor = SHRINK
            if status == OK:
                factor = max(SHRINK, SAFETY * (control[ALLOWED] / error) ** 0.25)
            control[WANTED] = h * factor
            control[MATRIX] = 0.0
            control[REJECTED] += 1.0
            if control[WANTED] < SHORTEST:
                return status if status != OK else NOT_CONVERGED, t
            continue
        t += h
        control[STEPS] += 1.0
        control[MATRIX] = 0.0 if iterations > 5 else h
        wanted = h * min(GROW, SAFETY * (control[ALLOWED] / max(error, 1e-300)) ** 0.25)
        if wanted > 1.3 * h or wanted < h:  # a step kept is a matrix kept
            control[WANTED] = wanted
    return OK, end
