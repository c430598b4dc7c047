"""The contacts of the system: the law at an instant, what it does to cable and robot, and what it remembers."""

from __future__ import annotations

import numpy as np

from fmus.cable.assembly import interpolate
from fmus.contact import law
from fmus.contact import places as at
from fmus.contact.sampling import silence
from fmus.contact.within import groove_depth
from fmus.kernels.jit import kernel
from fmus.robot import rigid_body as rb
from orchestrator.landing.monolithic.looks import see
from orchestrator.landing.monolithic.state import (
    ARC,
    AXLE_ALONG,
    BRISTLE,
    CONTACT_FAILED,
    EXCESS,
    FRICTION_LOSS,
    GONE,
    IMPULSE,
    OFF_CABLE,
    OK,
    RADIAL,
    REGIME,
    STORED,
    TIME,
    WALL_LOSS,
)

FOOT_ITERATIONS = 2
"""From the last iterate; each shrinks the error by the cable's curvature times the wheel's distance, 1e-2 or less."""


@kernel
def walls(system, robot, points, contacts, outs, space):
    """Evaluate the walls of all contacts at one instant; return OK, CONTACT_FAILED or AXLE_ALONG."""
    motion = space.motion
    for k in range(system.contacts.shape[0]):
        for i in range(at.WHEEL):
            motion[i] = points[k, i]
        rb.wheel_motion(system.robot, robot, k, motion[at.WHEEL :])
        status = law.walls(system.contacts[k], motion, outs[k])
        if status == law.STEEP:
            if contacts[k, GONE] == 0.0:
                return AXLE_ALONG
        elif status != law.OK:
            return CONTACT_FAILED
    return OK


@kernel
def loads(system, control, robot, points, slips, contacts, outs, generalized, space):
    """Add friction, and write the generalised forces on the cable points and the robot's accelerations.

    `control` are the control loads at this instant.

    A contact that has left the groove acts no more.
    """
    n_wheels = system.contacts.shape[0]
    motion = space.motion
    for i in range(space.loads.size):
        space.loads[i] = control[i]
    for k in range(n_wheels):
        for i in range(at.WHEEL):
            motion[i] = points[k, i]
        rb.wheel_motion(system.robot, robot, k, motion[at.WHEEL :])
        prm, out = system.contacts[k], outs[k]
        law.friction(prm, motion, slips[k], out)
        pull = prm[at.TANGENTIAL_STIFFNESS] * np.hypot(slips[k, 0], slips[k, 1])
        out[EXCESS] = pull - prm[at.FRICTION_COEFFICIENT] * out[at.NORMAL]
        if contacts[k, GONE] > 0.0:
            silence(out)
        _on_cable_point(motion, out, generalized[6 * k : 6 * k + 6])
        first = rb.BODY_LOADS + rb.WHEEL_LOADS * k
        for i in range(6):
            space.loads[first + i] += out[at.WHEEL_FORCE + i]
    force, moment, torque = space.resultants[0:3], space.resultants[3:6], space.resultants[6:10]
    rb.resultants(system.robot, robot, space.loads, force, moment, torque)
    rb.accelerations(system.robot, robot, force, moment, torque, generalized[6 * n_wheels :])


@kernel
def _on_cable_point(motion, out, generalized):
    """Write the generalised force on cable point and tangent g: the force, and M × g / |g|² (see `add_load`)."""
    g = motion[at.TANGENT : at.TANGENT + 3]
    moment = out[at.CABLE_MOMENT : at.CABLE_MOMENT + 3]
    square = g[0] * g[0] + g[1] * g[1] + g[2] * g[2]
    for i in range(3):
        generalized[i] = out[at.CABLE_FORCE + i]
    generalized[3] = (moment[1] * g[2] - moment[2] * g[1]) / square
    generalized[4] = (moment[2] * g[0] - moment[0] * g[2]) / square
    generalized[5] = (moment[0] * g[1] - moment[1] * g[0]) / square


@kernel
def cable_points(system, q, v, arcs, points, shape):
    """Write p, t, dp, dt of every contact, at the arc lengths `arcs`, to `points` (n_wheels, 12)."""
    for k in range(arcs.size):
        interpolate(system.model, q, arcs[k], shape, points[k, at.POINT : at.POINT_RATE])
        interpolate(system.model, v, arcs[k], shape, points[k, at.POINT_RATE : at.WHEEL])


@kernel
def follow(system, q, robot, arcs, space, shape):
    """Move every arc length in `arcs` (n_wheels,) to the foot of its wheel on the cable; return OK or OFF_CABLE.

    The law takes the cable for a straight line. At the foot itself that costs nothing; at a distance x from it, it
    would be wrong by curvature x²/2, which in every step would add that times the contact force to the energy.
    """
    motion, status = space.motion, OK
    for k in range(arcs.size):
        rb.wheel_motion(system.robot, robot, k, motion[at.WHEEL :])
        for _ in range(FOOT_ITERATIONS):
            interpolate(system.model, q, arcs[k], shape, motion[at.POINT : at.POINT_RATE])
            along = square = 0.0
            for i in range(3):
                tangent = motion[at.TANGENT + i]
                along += (motion[at.CENTRE + i] - motion[at.POINT + i]) * tangent
                square += tangent * tangent
            foot = arcs[k] + along / square
            if not 0.0 <= foot <= system.model.s[-1]:
                status = OFF_CABLE
            arcs[k] = min(max(foot, 0.0), system.model.s[-1])
    return status


@kernel
def settle(system, state, move, space, work):
    """Evaluate the contacts at the present state; with `move` also limit their bristles and follow the wheels.

    The results stay in ``space.out[0]``.
    """
    n = system.model.weight.size
    q, v, arcs = state.cable[:n], state.cable[n : 2 * n], space.arc[0]
    for k in range(arcs.size):
        arcs[k] = state.contacts[k, ARC]
        space.trial[k, 0], space.trial[k, 1] = state.contacts[k, BRISTLE], state.contacts[k, BRISTLE + 1]
    status = follow(system, q, state.robot, arcs, space, work.shape) if move else OK
    cable_points(system, q, v, arcs, space.cable_point, work.shape)
    found = walls(system, state.robot, space.cable_point, state.contacts, space.out[0], space)
    if found != OK:
        return found
    control, out = space.control[1], space.out[0]
    loads(system, control, state.robot, space.cable_point, space.trial, state.contacts, out, space.generalized, space)
    if move:
        for k in range(arcs.size):
            state.contacts[k, REGIME] = _regime(system.contacts[k], space.out[0, k])
            passed = face(system, state, k, space)
            _remember(state.contacts[k], space.out[0, k], arcs[k], passed)
            see(state.contacts[k], space.out[0, k], state.contacts[k, TIME])
    return status


@kernel
def face(system, state, k, space):
    """Remember in which direction wheel k has the cable; return whether that has turned round since it was last seen.

    The wheel has then gone through the cable.
    """
    motion = space.motion
    for i in range(at.WHEEL):
        motion[i] = space.cable_point[k, i]
    rb.wheel_motion(system.robot, state.robot, k, motion[at.WHEEL :])
    _length, _u, _offset, d = law.foot(motion)
    a = law.axle(motion)
    y = d[0] * a[0] + d[1] * a[1] + d[2] * a[2]
    across = 0.0
    for i in range(3):
        radial = d[i] - y * a[i]
        across += radial * state.contacts[k, RADIAL + i]
        state.contacts[k, RADIAL + i] = radial
    return across < 0.0


@kernel
def _regime(prm, out):
    """Return the piece of the contact law at work: its status, and whether bristle and damper are at their limit.

    Where it changes the friction has a kink. A step across one would be less accurate than its error estimate says.
    """
    limit = prm[at.FRICTION_COEFFICIENT] * out[at.NORMAL]
    if limit > 0.0 and out[at.FRICTION] ** 2 + out[at.FRICTION + 1] ** 2 >= limit * limit * (1.0 - 1e-9):
        return out[at.STATUS] + 10.0
    return out[at.STATUS]


@kernel
def _remember(memory, out, arc, passed):
    """Renew the memory of a contact from the law's results at the end of a step; whether it `passed` through the cable.

    What the walls had stored when the cable left the groove is not given back.
    """
    memory[BRISTLE], memory[BRISTLE + 1] = out[at.ELONGATION], out[at.ELONGATION + 1]
    memory[FRICTION_LOSS] -= out[at.BRISTLE_ENERGY]
    if memory[GONE] > 0.0:
        return
    if out[at.STATUS] == law.LEFT or passed:
        memory[GONE] = 1.0
        memory[WALL_LOSS] += memory[STORED]
    memory[STORED] = out[at.WALL_ENERGY]
    memory[ARC] = arc


@kernel
def end(system, state, h, space, work):
    """Move the contacts' memory to the end of the step: bristle, energies, arc length; write the loads there."""
    method = system.method
    for k in range(system.contacts.shape[0]):
        memory = state.contacts[k]
        stiffness = system.contacts[k, at.TANGENTIAL_STIFFNESS]
        memory[FRICTION_LOSS] += 0.5 * stiffness * (memory[BRISTLE] ** 2 + memory[BRISTLE + 1] ** 2)
        for j in range(2):
            out, weight = space.out[j, k], h * method.b[j]
            memory[REGIME + 1 + j] = _regime(system.contacts[k], out)
            memory[WALL_LOSS] += weight * out[at.WALL_POWER]
            memory[IMPULSE] += weight * out[at.NORMAL]
            see(memory, out, memory[TIME] + method.c[j] * h)
            along = out[at.FRICTION] * out[at.SLIP_VELOCITY]
            memory[FRICTION_LOSS] -= weight * (along + out[at.FRICTION + 1] * out[at.SLIP_VELOCITY + 1])
            memory[BRISTLE] += weight * space.slip[j, k, 0]
            memory[BRISTLE + 1] += weight * space.slip[j, k, 1]
        memory[TIME] += h
    return settle(system, state, True, space, work)


@kernel
def changed(state, space):
    """Return whether a contact's regime has changed in a step just made: at its end, at a stage, or in between.

    The last shows in the bristle's excess over its limit, which grows as long as the contact slides.
    """
    for k in range(state.contacts.shape[0]):
        for i in range(REGIME, REGIME + 3):
            if state.contacts[k, i] != space.saved.contacts[k, REGIME]:
                return True
        if space.out[0, k, at.STATUS] == law.SLIP and space.out[0, k, EXCESS] < space.out[1, k, EXCESS]:
            return True
    return False


@kernel
def longest_step(system, state, space):
    """Return in which time (s) no wheel moves farther from its cable point, or nearer to it, than half its groove's
    depth."""
    longest, motion = np.inf, space.motion
    for k in range(system.contacts.shape[0]):
        rb.wheel_motion(system.robot, state.robot, k, motion[at.WHEEL :])
        square = 0.0
        for i in range(3):
            square += (motion[at.CENTRE_RATE + i] - space.cable_point[k, at.POINT_RATE + i]) ** 2
        if square > 0.0:
            longest = min(longest, 0.5 * groove_depth(system.contacts[k]) / np.sqrt(square))
    return longest
