"""What a solution is made of, kernel by kernel: begin, advance over an interval, show. Python and WebAssembly call the same.

What a solution starts from stands in a `Start`, what it shows at a time in a `Shown`: flat arrays, so that a landing can be
packed into one block of memory (`block.py`), changed in the places that `Start.wishes` names, and solved anew.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.cable import ports
from fmus.cable.diagnosis import diagnose
from fmus.cable.state import N_PORTS
from fmus.contact import places as at
from fmus.contact.law import IMPACT, LEFT
from fmus.kernels.jit import kernel
from fmus.kernels.rotations import follow_euler
from fmus.robot import dynamics
from fmus.robot import rigid_body as rb
from orchestrator.landing.monolithic import control as steps
from orchestrator.landing.monolithic import looks
from orchestrator.landing.monolithic.contacts import face, settle
from orchestrator.landing.monolithic.state import (
    ARC,
    AXLE_ALONG,
    FRICTION_LOSS,
    GONE,
    NORMAL_MAX,
    OK,
    TIME,
    TOUCH_TIME,
    WALL_LOSS,
)

NO_BODY = AXLE_ALONG + 1
"""Status of `begin`: the free wheels alone would be heavier to turn than the whole robot."""
MASS, DAMPING, FRICTION, SPEED = range(4)
"""Places in the wishes: kg, damping of the contact (s/m, or N s/m by the law), coefficient, m/s downwards."""
INERTIA_STAYS, TURNING, LONGEST, REFINEMENT = range(4)
"""Places in the options of a `Start`."""
FROM, UNTIL, LOADS = 0, 1, 2
"""Places in a segment of the control loads: times, then the loads at its start, then their rates."""
CONTACT = (
    "normal_force", "friction_force", "penetration", "slip_velocity", "contact_length", "status", "dissipated_energy",
    "strain_energy", "cable.s", "radial_force", "lateral_force", "normal_force_max", "penetration_max",
    "slip_velocity_max", "impulse", "touch_time",
)  # fmt: skip
"""Signals of a contact, in the order of their places."""
WHEEL_FORCE, N_CONTACT_ROW = len(CONTACT), len(CONTACT) + 3
"""Behind them the force on the wheel (3), N."""
N_CABLE = 16
"""What `diagnose` shows."""


class Start(NamedTuple):
    """What a solution starts from, beside system and state.

    Attributes
    ----------
    wishes : (4,) mass, damping, friction, speed
    options : (4,) 1 where the inertia does not go with the mass, the part of the speed upwards that turning gives G (m/s),
        longest step (s), and into a multiple of how many steps an interval is divided
    segments : (k, 2 + 2 m) times within which the control loads are straight, the loads, their rates
    """

    wishes: np.ndarray
    options: np.ndarray
    segments: np.ndarray


class Shown(NamedTuple):
    """What is shown at a time.

    Attributes
    ----------
    loads : (4, 13) at the cable's ports
    ports : (4, 22), cable : (16,), shape : (41, 4) outputs of the cable, in the order of its table
    memory : (25 + 13 n,) state of the robot as its module keeps it
    robot : (15 + 25 n,) its outputs
    contacts : (n, 19) signals of `CONTACT`, force on the wheel
    """

    loads: np.ndarray
    ports: np.ndarray
    cable: np.ndarray
    shape: np.ndarray
    memory: np.ndarray
    robot: np.ndarray
    contacts: np.ndarray


def make_shown(memory: np.ndarray, n_wheels: int, n_shape: int) -> Shown:
    """Return new room for what is shown; `memory` is the robot's state at the start, whose angles are followed."""
    return Shown(
        loads=np.zeros((N_PORTS, ports.N_INPUTS)),
        ports=np.zeros((N_PORTS, ports.N_SHOWN)),
        cable=np.zeros(N_CABLE),
        shape=np.zeros((n_shape, 4)),
        memory=memory.copy(),
        robot=np.zeros(dynamics.BODY_OUTPUTS + dynamics.WHEEL_OUTPUTS * n_wheels),
        contacts=np.zeros((n_wheels, N_CONTACT_ROW)),
    )


# -- begin ----------------------------------------------------------------------------------------------------


@kernel
def grant(system, state, start):
    """Give the landing what is wished, as the scenario's keys would; return OK or NO_BODY."""
    wishes, prm = start.wishes, system.robot
    ratio = wishes[MASS] / prm[rb.MASS]
    prm[rb.MASS] = wishes[MASS]
    for k in range(system.contacts.shape[0]):
        contact = system.contacts[k]
        contact[at.FRICTION_COEFFICIENT] = wishes[FRICTION]
        contact[at.DAMPING_COEFFICIENT if contact[at.DAMPING_LAW] == IMPACT else at.DAMPING] = wishes[DAMPING]
    state.robot[rb.VELOCITY + 2] = start.options[TURNING] - wishes[SPEED]
    if ratio == 1.0 or start.options[INERTIA_STAYS] > 0.0:
        return OK
    for i in range(9):
        prm[rb.INERTIA + i] *= ratio
    return _invert_without_spin(prm)


@kernel
def _invert_without_spin(prm):
    """Write the inverse of the inertia less the free wheels' spin inertia; return OK or NO_BODY."""
    a, c = prm[rb.INERTIA : rb.INERTIA + 9], prm[rb.COMPLIANCE : rb.COMPLIANCE + 9]
    for i in range(9):
        c[i] = a[i]
    for k in range(int(prm[rb.N_WHEELS])):
        wheel = rb.WHEELS + rb.WHEEL_STRIDE * k
        spin = prm[wheel + rb.FREE] * prm[wheel + rb.SPIN_INERTIA]
        for i in range(3):
            for j in range(3):
                c[3 * i + j] -= spin * prm[wheel + rb.AXLE + i] * prm[wheel + rb.AXLE + j]
    xx, xy, xz, yy, yz, zz = c[0], c[1], c[2], c[4], c[5], c[8]
    minor = xx * yy - xy * xy
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    if not (xx > 0.0 and minor > 0.0 and determinant > 0.0):
        return NO_BODY
    c[0] = (yy * zz - yz * yz) / determinant
    c[4] = (xx * zz - xz * xz) / determinant
    c[8] = minor / determinant
    c[1] = c[3] = (xz * yz - xy * zz) / determinant
    c[2] = c[6] = (xy * yz - xz * yy) / determinant
    c[5] = c[7] = (xy * xz - xx * yz) / determinant
    return OK


@kernel
def begin(system, state, t, space, work):
    """Start the contacts' memory at the time `t` (s); return OK or why the law fails there."""
    status = settle(system, state, False, space, work)
    if status != OK:
        return status
    for k in range(state.contacts.shape[0]):
        looks.begin(state.contacts[k], space.out[0, k], t)
        state.contacts[k, TIME] = t
        face(system, state, k, space)
    return OK


# -- advance --------------------------------------------------------------------------------------------------


@kernel
def advance_straight(system, state, control, options, t, end, space, work):
    """Integrate from `t` to `end` while the control loads are straight; return status and time reached, as `advance`."""
    refinement = options[REFINEMENT]
    parts = refinement * max(1.0, np.ceil((end - t) / (refinement * options[LONGEST]) - 1e-9))
    control[steps.LONGEST] = (end - t) / parts
    return steps.advance(system, state, control, t, end, space, work)


@kernel
def advance_interval(system, state, control, start, t, end, space, work):
    """Integrate from `t` to `end`, by parts where the control loads have a kink; return status and time reached."""
    loads = system.control.shape[1]
    for i in range(start.segments.shape[0]):
        segment = start.segments[i]
        first, last = max(t, segment[FROM]), min(end, segment[UNTIL])
        if not first < last:
            continue
        for j in range(loads):
            rate = segment[LOADS + loads + j]
            system.control[0, j] = segment[LOADS + j] + rate * (first - segment[FROM])
            system.control[1, j] = rate
        status, reached = advance_straight(system, state, control, start.options, first, last, space, work)
        if status != OK:
            return status, reached
    return OK, end


# -- show -----------------------------------------------------------------------------------------------------


@kernel
def show(system, state, shown, space, work):
    """Write what is shown at the present state, and begin a new interval of the contacts' largest values."""
    settle(system, state, False, space, work)
    out = space.out[0]
    for k in range(state.contacts.shape[0]):
        memory, load = state.contacts[k], shown.loads[k]
        load[ports.S] = memory[ARC]
        for i in range(6):
            load[ports.FORCE + i] = 0.0 if memory[GONE] > 0.0 else out[k, at.CABLE_FORCE + i]
        _show_contact(out[k], memory, shown.contacts[k])
        looks.restart(memory)
    ports.show_ports(system.model, state.cable, shown.loads, shown.ports, work)
    diagnose(system.model, system.method, False, state.cable, shown.loads, shown.cable, shown.shape, work)
    memory = shown.memory
    for i in range(rb.RIGID):
        memory[i] = state.robot[i]
    memory[dynamics.CONTROL_WORK] = state.control_work[0]
    follow_euler(state.robot[rb.ATTITUDE : rb.VELOCITY], memory[dynamics.ANGLES : dynamics.CONTROL_WORK])
    dynamics.outputs(system.robot, memory, shown.robot)


@kernel
def _show_contact(out, memory, row):
    """Write the signals of a contact, and the force on its wheel, from the law's results and its memory."""
    gone = memory[GONE] > 0.0
    row[0] = out[at.NORMAL]
    row[1] = np.sqrt(out[at.FRICTION] ** 2 + out[at.FRICTION + 1] ** 2)
    row[2] = out[at.DEEPEST]
    row[3] = np.sqrt(out[at.SLIP_VELOCITY] ** 2 + out[at.SLIP_VELOCITY + 1] ** 2)
    row[4] = out[at.CONTACT_LENGTH]
    row[5] = LEFT if gone else out[at.STATUS]
    row[6] = memory[WALL_LOSS] + memory[FRICTION_LOSS]
    row[7] = out[at.WALL_ENERGY] + out[at.BRISTLE_ENERGY]
    row[8] = memory[ARC]
    row[9] = 0.0 if gone else out[at.RADIAL]
    row[10] = 0.0 if gone else out[at.LATERAL]
    for i in range(TOUCH_TIME + 1 - NORMAL_MAX):
        row[11 + i] = memory[NORMAL_MAX + i]
    for i in range(3):
        row[WHEEL_FORCE + i] = out[at.WHEEL_FORCE + i]
