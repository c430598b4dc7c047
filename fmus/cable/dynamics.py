"""One macro step of the cable: inner steps of an implicit method, halved where they do not converge."""

from __future__ import annotations

import numpy as np

from fmus.cable import collocation as two_stage
from fmus.cable import generalized_alpha
from fmus.cable.diagnosis import diagnose
from fmus.cable.ports import add_to_means, force_work, move_on, refusal, restart_means, show_step
from fmus.cable.state import LAST_INNER, LAST_MACRO, NOT_CONVERGED, OK
from fmus.kernels.jit import kernel

MAX_HALVINGS = 12


@kernel
def copy(source, target):
    """Write one flat array over another."""
    for i in range(source.size):
        target[i] = source[i]


@kernel
def macro_step(model, collocation, alpha, use_alpha, state, h, longest, newton, ports, shown, out, rows, work):
    """Advance `state` by the macro step `h` with inner steps of at most `longest`, and write all outputs.

    Newton's method ends at an estimated error `newton` of a coordinate (m), for a cable of 200 m; in proportion to the
    length. An inner step that does not converge is repeated at half its length, up to MAX_HALVINGS times.

    Parameters
    ----------
    ports : (N_PORTS, 14), see ports.py; the places S move on by their rates
    shown : (N_PORTS, 25), receives motion, the time means of position and tangent over the macro step, and the work
    out, rows : see `diagnose`

    Returns
    -------
    status : OK; NOT_CONVERGED, the state is then undefined; NOT_FINITE or OFF_CABLE, nothing is changed
    """
    status = refusal(model, ports, h)
    if status != OK:
        return status
    sums, tolerance = state[4 * model.weight.size :], newton * max(1.0, model.s[-1] / 200.0)
    move_on(ports, 0.5 * h)
    restart_means(model, state, ports, h, work)
    inner = h / max(1.0, np.ceil(h / longest - 1e-9))
    lag = alpha.alpha_m - alpha.alpha_f
    if use_alpha:
        generalized_alpha.start(model, state, ports, lag * inner - 0.5 * h, work)
    halvings, elapsed = 0, 0.0
    fresh = elapsed < h  # true; a constant here would be compiled as a type of its own
    while elapsed < h * (1.0 - 1e-12):
        step, offset = min(inner, h - elapsed), elapsed - 0.5 * h
        if h - elapsed - step < 1e-9 * h:
            step = h - elapsed
        copy(state, work.trial)
        if use_alpha:
            status = generalized_alpha.step(model, alpha, work.trial, step, offset, ports, tolerance, fresh, work)
        else:
            ahead = 0.5 * (h - elapsed) if fresh else -1.0
            status = two_stage.step(model, collocation, work.trial, step, offset, ports, tolerance, ahead, work)
        if status != OK:
            halvings += 1
            if halvings > MAX_HALVINGS:
                return NOT_CONVERGED
            inner *= 0.5
            fresh = elapsed < h
            continue
        fresh = abs(step - inner) > 1e-9 * inner
        copy(work.trial, state)
        elapsed += step
        add_to_means(model, state, ports, step, elapsed - 0.5 * h, h, work)
    if use_alpha:
        generalized_alpha.end(model, state, ports, lag * sums[LAST_INNER] + 0.5 * h, work)
    force_work(ports, h, sums, work)
    sums[LAST_MACRO] = h
    diagnose(model, collocation, use_alpha, state, ports, out, rows, work)
    move_on(ports, 0.5 * h)
    show_step(model, state, ports, h, shown, work)
    return OK
