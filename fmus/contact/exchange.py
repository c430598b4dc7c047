"""The contact over a macro step: the motion inside it, the law along it, the force's mean and slope, the memory.

Where things stand in inputs, state and outputs: places.py. The equations stand in README.md of this folder.
"""

from __future__ import annotations

import math

from fmus.contact import path as columns
from fmus.contact import places as at
from fmus.contact.law import LEFT, OK, SLIP, STEEP, foot, friction, walls
from fmus.contact.path import (
    drift_along,
    drift_work,
    hermite_path,
    motion_at,
    path_work,
    rotation_given,
    straight_path,
    waveform_path,
)
from fmus.contact.sampling import (
    passed_axle,
    point_law,
    project_force,
    sample_law,
    sample_walls,
    silence,
    slip_displacement,
    tangent_work,
)
from fmus.contact.within import DEPTH, FORCE, extremes, groove_depth, travel
from fmus.contact.within import SLIP as FASTEST
from fmus.kernels.jit import kernel

POINT, WAVEFORM, HERMITE = 0, 1, 2
"""What a step assumes of the motion inside it: choices of the parameter `exchange`."""


@kernel
def _same(inputs, state, first, n):
    """Tell whether n inputs from `first` are bit for bit those of the last communication point."""
    same = True
    for i in range(first, first + n):
        same = same and inputs[i] == state[at.LAST + i]
    return same


@kernel
def start_motion(state, start):
    """Write the last communication point's motion, its cable point moved along the cable."""
    for i in range(at.MOTION_SIZE):
        start[i] = state[at.LAST + i]
    shift = state[at.SHIFT]
    for i in range(3):
        curvature = state[at.LAST_CURVATURE + i]
        start[at.POINT + i] += shift * (start[at.TANGENT + i] + 0.5 * shift * curvature)
        start[at.TANGENT + i] += shift * curvature
        start[at.POINT_RATE + i] += shift * start[at.TANGENT_RATE + i]


@kernel
def write_instant(sample, outputs):
    """Write the outputs that belong to one instant: normal force to status, elastic energy."""
    outputs[at.O_NORMAL] = sample[at.NORMAL]
    outputs[at.O_FRICTION] = math.sqrt(sample[at.FRICTION] ** 2 + sample[at.FRICTION + 1] ** 2)
    outputs[at.O_DEEPEST] = sample[at.DEEPEST]
    outputs[at.O_SLIP] = math.sqrt(sample[at.SLIP_VELOCITY] ** 2 + sample[at.SLIP_VELOCITY + 1] ** 2)
    outputs[at.O_LENGTH] = sample[at.CONTACT_LENGTH]
    outputs[at.O_STATUS] = sample[at.STATUS]
    outputs[at.O_STRAIN] = sample[at.WALL_ENERGY] + sample[at.BRISTLE_ENERGY]
    outputs[at.O_RADIAL], outputs[at.O_LATERAL] = sample[at.RADIAL], sample[at.LATERAL]


@kernel
def write_memory(state, outputs):
    """Write the outputs that the state remembers."""
    outputs[at.O_ARC], outputs[at.O_ARC_RATE] = state[at.ARC], state[at.ARC_RATE]
    outputs[at.O_DISSIPATED] = state[at.DISSIPATED]
    outputs[at.O_WORK_CABLE] = state[at.WORK_CABLE]
    outputs[at.O_WORK_WHEEL] = state[at.WORK_WHEEL]
    outputs[at.O_IMPULSE], outputs[at.O_TOUCH_TIME] = state[at.IMPULSE], state[at.TOUCH_TIME]
    # the inputs may be newer than the step
    outputs[at.O_NORMAL_MAX] = max(state[at.NORMAL_MAX], outputs[at.O_NORMAL])
    outputs[at.O_DEEPEST_MAX] = max(state[at.DEEPEST_MAX], outputs[at.O_DEEPEST])
    outputs[at.O_SLIP_MAX] = state[at.SLIP_MAX]


@kernel
def _write_point(sample, outputs):
    """Write forces and moments of one sample, with no slope."""
    for i in range(6):
        outputs[at.O_CABLE + i] = sample[at.CABLE_FORCE + i]
        outputs[at.O_WHEEL + i] = sample[at.WHEEL_FORCE + i]
        outputs[at.O_CABLE + 6 + i] = outputs[at.O_WHEEL + 6 + i] = 0.0


@kernel
def refresh(prm, inputs, state, motions, samples, outputs):
    """Write the outputs at the instant of the inputs; the state stays. Return the status of the law.

    The bristle is led on from the last communication point to the inputs.
    """
    row, end, slip = samples[0], inputs[: at.MOTION_SIZE], samples[1, 0:2]
    if what_is_sent(prm, inputs, state[at.SENT]) != at.MOTION:
        _write_open(row, outputs)
        write_memory(state, outputs)
        return OK
    status = walls(prm, end, row)
    if status != OK and not (status == STEEP and state[at.GONE] != 0.0):
        return status
    _slip_since(inputs, state, motions[0], samples[1, 2:5], slip)
    slip[0] += state[at.BRISTLE]
    slip[1] += state[at.BRISTLE + 1]
    friction(prm, end, slip, row)
    if state[at.GONE] != 0.0:
        silence(row)
    _write_point(row, outputs)
    write_instant(row, outputs)
    write_memory(state, outputs)
    return OK


@kernel
def _slip_since(inputs, state, start, rotation, slip):
    """Write the slip (2,) m from the last communication point to the inputs; `start`, `rotation` are workspace.

    Inputs that have not changed since then have not moved: neither does the new cable point count nor the wheel's
    rotation over the step that is past.
    """
    slip[0] = slip[1] = 0.0
    if state[at.SENT] != at.MOTION:
        return
    start_motion(state, start)
    if _same(inputs, state, 0, at.WHEEL):
        for i in range(at.WHEEL):
            start[i] = state[at.LAST + i]
    turned = not _same(inputs, state, at.WHEEL, at.MOTION_SIZE - at.WHEEL)
    given = rotation_given(inputs)
    for i in range(3):
        both = start[at.TURN_RATE + i] + inputs[at.TURN_RATE + i]
        angle = inputs[at.ROTATION + i] if given else 0.5 * state[at.LAST_STEP] * both
        rotation[i] = angle if turned else 0.0
    slip_displacement(start, inputs[: at.MOTION_SIZE], rotation, slip)


@kernel
def follow(moves, state, outputs, motion):
    """Let the contact point move with the foot of its wheel in the step that begins, where it `moves` in steps.

    Held for the step is the rate at its start, at which (p - w)·t stays zero: of the point p on the cable, at rest on the
    material, and the wheel centre w; `motion` (24,) is work space.
    """
    state[at.ARC_RATE] = 0.0
    if moves and state[at.SENT] == at.MOTION and state[at.GONE] == 0.0:
        start_motion(state, motion)
        along = square = 0.0
        for i in range(3):
            tangent, away = motion[at.TANGENT + i], motion[at.POINT + i] - motion[at.CENTRE + i]
            along += (motion[at.POINT_RATE + i] - motion[at.CENTRE_RATE + i]) * tangent
            along += away * motion[at.TANGENT_RATE + i]
            square += tangent * tangent + away * state[at.LAST_CURVATURE + i]
        if square > 0.0:  # else the wheel is beyond the centre of curvature: there is no foot
            state[at.ARC_RATE] = -along / square
    outputs[at.O_ARC_RATE] = state[at.ARC_RATE]


@kernel
def step(
    prm, method, moves, inputs, t, h, nodes, weights, increments, state, path, motions, samples, grid, way, outputs
):
    """Advance the contact from t over one macro step h; the inputs hold the motion at its end and the means over it.

    Parameters
    ----------
    prm : (18,); method : 0 point, 1 waveform, 2 hermite; inputs : (48,); t, h : s
    moves : whether the contact point moves within the step: the motion of the cable handed in is that of a moving point
    nodes, weights, increments : of `gauss_rule(m)`
    state : (45,), advanced; outputs : (43,), written
    path, motions, samples, grid : (2, 4, 21), (m + 3, 24), (m + 2, 34), (m + 5, 4) work space
    way : (1,) m, receives how far wheel and cable move relative to each other in the step

    Returns
    -------
    int, status of the law
    """
    status = _step(
        prm, method, inputs, t, h, nodes, weights, increments, state, path, motions, samples, grid, way, outputs
    )
    if status == OK:
        follow(moves, state, outputs, motions[0])
    return status


@kernel
def _step(prm, method, inputs, t, h, nodes, weights, increments, state, path, motions, samples, grid, way, outputs):
    """Make a step, see `step`; how the contact point moves in the next is left open."""
    sent = what_is_sent(prm, inputs, state[at.SENT])
    if sent != at.MOTION or state[at.SENT] != at.MOTION:
        return _first_step(prm, inputs, t, h, sent, state, samples[0], outputs)
    if state[at.GONE] != 0.0:
        return _fallen_step(prm, inputs, h, state, samples[0], outputs)
    m = len(nodes)
    start, end, last = motions[m + 1], inputs[: at.MOTION_SIZE], samples[m]
    z, curvature = state[at.BRISTLE : at.BRISTLE + 2], inputs[at.CURVATURE : at.CURVATURE + 3]
    exchanged, inside = path[0], path[1]
    start_motion(state, start)
    _rebuild(method, start, inputs, h, state, exchanged, inside)
    if method == POINT:
        status, dissipated = point_law(prm, exchanged, h, start, end, z, state[at.SLIDES] != 0.0, last)
        if status == OK:
            status = sample_walls(prm, inside, h, nodes, curvature, motions, samples)
    else:
        status, dissipated = sample_law(prm, inside, h, nodes, weights, increments, end, curvature, z, motions, samples)
    if status != OK:
        return status
    free = motions[m + 2]
    way[0], status = travel(prm, inside, h, curvature, motions, m + 1, free, samples[m + 1], grid[0])
    if status != OK:
        return status
    status = _look_back(prm, inside, t, h, nodes, weights, curvature, samples, grid, free, state)
    if status != OK:
        return status
    if method == POINT:
        _write_point(last, outputs)
    else:
        project_force(samples, nodes, weights, h, outputs)
    work_cable = _work_on_cable(method, exchanged, h, nodes, weights, motions, outputs)
    work_wheel = path_work(exchanged, columns.CENTRE, h, outputs, at.O_WHEEL)
    work_wheel += path_work(exchanged, columns.ROTATION, h, outputs, at.O_WHEEL + 3)
    if last[at.STATUS] == LEFT or (way[0] <= groove_depth(prm) and passed_axle(start, end)):
        # what the walls and the bristle had stored is not given back
        state[at.GONE] = 1.0
        silence(last)
        z[0] = z[1] = 0.0
        dissipated = state[at.STORED] - work_cable - work_wheel
    state[at.DISSIPATED] += dissipated
    state[at.WORK_CABLE] += work_cable
    state[at.WORK_WHEEL] += work_wheel
    _remember(state, inputs, last, h)
    write_instant(last, outputs)
    write_memory(state, outputs)
    return OK


@kernel
def what_is_sent(prm, inputs, before):
    """Tell whether the inputs are a motion of cable and wheel: `MOTION`, `NOTHING` or `FAR`; `before` is what was.

    Many engines send zeros until each FMU has made a step: then a tangent or an axle has no length. The cable, told by then
    that it is touched at zero, first shows its end; that the contact point is so far off counts when it is so twice.
    """
    if _is_zero(inputs, at.TANGENT) or _is_zero(inputs, at.AXLE):
        return at.NOTHING
    _length, _u, offset, _d = foot(inputs)
    if before == at.NOTHING and abs(offset) > max(prm[at.MAX_LENGTH], prm[at.WHEEL_RADIUS]):
        return at.FAR
    return at.MOTION


@kernel
def _is_zero(inputs, first):
    """Tell whether three inputs from `first` on are zero."""
    return inputs[first] == 0.0 and inputs[first + 1] == 0.0 and inputs[first + 2] == 0.0


@kernel
def _write_open(row, outputs):
    """Write what a contact shows that is sent no motion: no force, open."""
    for i in range(at.OUT_SIZE):
        row[i] = 0.0
    _write_point(row, outputs)
    write_instant(row, outputs)


@kernel
def _first_step(prm, inputs, t, h, sent, state, row, outputs):
    """Make a step of which the start or the end is no motion: the law at its end, as at the start of a run, or nothing."""
    _write_open(row, outputs)
    if sent == at.MOTION:
        status = walls(prm, inputs[: at.MOTION_SIZE], row)
        if status != OK and not (status == STEEP and state[at.GONE] != 0.0):
            return status
        friction(prm, inputs[: at.MOTION_SIZE], row[at.SCRATCH : at.SCRATCH + 2], row)
    if state[at.GONE] != 0.0:
        silence(row)
    state[at.SENT] = sent
    state[at.BRISTLE], state[at.BRISTLE + 1] = row[at.ELONGATION], row[at.ELONGATION + 1]
    state[at.IMPULSE] = state[at.SLIP_MAX] = 0.0
    state[at.NORMAL_MAX], state[at.DEEPEST_MAX] = row[at.NORMAL], row[at.DEEPEST]
    if state[at.TOUCH_TIME] == at.NOT_YET and row[at.NORMAL] > 0.0:
        state[at.TOUCH_TIME] = t + h
    _remember(state, inputs, row, h)
    _write_point(row, outputs)
    write_instant(row, outputs)
    write_memory(state, outputs)
    return OK


@kernel
def _rebuild(method, start, inputs, h, state, exchanged, inside):
    """Write the path on which work is exchanged, and that along which the law is looked at: for `point` the cubic
    through positions and velocities at both ends, else the same."""
    along, curvature = state[at.ARC_RATE], state[at.LAST_CURVATURE : at.LAST_CURVATURE + 3]
    if method == WAVEFORM:
        waveform_path(start, inputs, inside)
    else:
        hermite_path(start, inputs, h, along, curvature, inside)
    drift_along(inside, h, along, curvature, inputs)
    if method == POINT:
        straight_path(start, inputs, h, exchanged)
        return
    for i in range(exchanged.shape[0]):
        for j in range(exchanged.shape[1]):
            exchanged[i, j] = inside[i, j]


@kernel
def _look_back(prm, path, t, h, nodes, weights, curvature, samples, grid, motion, state):
    """Remember what has happened within the step from t; return the status of the law."""
    best = grid[len(nodes) + 4]
    status, impulse, touch = extremes(prm, path, h, nodes, weights, curvature, samples, grid, motion, best)
    state[at.NORMAL_MAX], state[at.DEEPEST_MAX], state[at.SLIP_MAX] = best[FORCE], best[DEPTH], best[FASTEST]
    state[at.IMPULSE] = impulse
    if state[at.TOUCH_TIME] == at.NOT_YET and touch <= 1.0:
        state[at.TOUCH_TIME] = t + touch * h
    return status


@kernel
def _fallen_step(prm, inputs, h, state, row, outputs):
    """Make a step of a contact that the cable has left: nothing acts."""
    status = walls(prm, inputs[: at.MOTION_SIZE], row)
    if status not in (OK, STEEP):
        return status
    silence(row)
    _write_point(row, outputs)
    state[at.NORMAL_MAX] = state[at.SLIP_MAX] = state[at.IMPULSE] = 0.0
    state[at.DEEPEST_MAX] = row[at.DEEPEST]
    _remember(state, inputs, row, h)
    write_instant(row, outputs)
    write_memory(state, outputs)
    return OK


@kernel
def _work_on_cable(method, path, h, nodes, weights, motions, outputs):
    """Return the work on the cable (J): of the force on its point, and of the moment on its tangent."""
    work = path_work(path, columns.POINT, h, outputs, at.O_CABLE) - drift_work(path, h, outputs, at.O_CABLE)
    if method == POINT:
        motion_at(path, 0.5, h, motions[0])
        return work + tangent_work(motions[0], h, 0.0, outputs, at.O_CABLE)
    for i in range(len(nodes)):
        ds = h * (nodes[i] - 0.5)
        work += tangent_work(motions[i], h * weights[i], ds, outputs, at.O_CABLE)
    return work


@kernel
def _remember(state, inputs, last, h):
    """Renew what the state remembers of the communication point reached; the law's results there are `last`."""
    state[at.STORED] = last[at.WALL_ENERGY] + last[at.BRISTLE_ENERGY]
    state[at.SLIDES] = 1.0 if last[at.STATUS] == SLIP else 0.0
    state[at.SHIFT] = last[at.OFFSET] if state[at.GONE] == 0.0 else 0.0
    for _ in range(2):  # as the cable's port does, to the last bit
        state[at.ARC] += state[at.ARC_RATE] * (0.5 * h)
    state[at.ARC] += state[at.SHIFT]
    state[at.LAST_STEP] = h
    for i in range(at.MOTION_SIZE):
        state[at.LAST + i] = inputs[i]
    for i in range(3):
        state[at.LAST_CURVATURE + i] = inputs[at.CURVATURE + i]
