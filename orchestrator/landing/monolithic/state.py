"""What the monolithic solver works on: system, state, workspace, and where things stand in their arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.cable.assembly import Model
from fmus.cable.state import state_size
from fmus.contact import places as at
from fmus.kernels.jit import kernel
from fmus.kernels.time_integration import Collocation
from fmus.robot import rigid_body as rb

N_ROBOT = 10
"""Accelerations of the robot: centre of mass 3, angular velocity 3, spin of four wheels."""
TURN, SPIN = 3, 6
"""Places in them."""
ARC, BRISTLE, WALL_LOSS, FRICTION_LOSS, GONE, REGIME, STORED = 0, 1, 3, 4, 5, 6, 9
NORMAL_MAX, DEEPEST_MAX, SLIP_MAX, IMPULSE, TOUCH_TIME, TIME, LOOKS, RADIAL = 10, 11, 12, 13, 14, 15, 16, 24
N_LOOK, N_CONTACT = 4, 27
"""Memory of a contact: arc length, bristle (2), energy dissipated by walls and by friction, left the groove, regime
at the last step's end and at its stages (2), elastic energy of the walls at its end; since the last output time the
largest normal force, penetration and slip, and the impulse; the time of first touch, the time reached; the last two
looks at the contact (time, normal force, penetration, slip each); the wheel's radial direction towards the cable (3)."""
EXCESS = at.SCRATCH
"""Place in the law's results, free there: the bristle's force beyond the Coulomb limit, N."""
OK, NOT_CONVERGED, CONTACT_FAILED, OFF_CABLE, AXLE_ALONG = range(5)
"""Status of the kernels."""


class System(NamedTuple):
    """What does not change: the cable's model, the method, parameters of robot and contacts, control loads.

    Attributes
    ----------
    robot : (56,) of `fmus.robot.rigid_body`
    contacts : (n_wheels, 18) of `fmus.contact.law`
    control : (2, 4 + 7 n_wheels) thrust, torque and drive torques in the places of `rigid_body.resultants`, and their rates;
        at the start of the present call of `advance`
    """

    model: Model
    method: Collocation
    robot: np.ndarray
    contacts: np.ndarray
    control: np.ndarray


class State(NamedTuple):
    """What changes: cable (its module's flat state), robot (21,), accelerations (2, 10), contacts (n_wheels, 27)."""

    cable: np.ndarray
    robot: np.ndarray
    accelerations: np.ndarray
    contacts: np.ndarray
    control_work: np.ndarray  # (1,) J


class Space(NamedTuple):
    """Workspace; m = 6 n_wheels + 10 are the interface's coordinates."""

    stage: np.ndarray  # (2, 21) robot state at the stages
    theta: np.ndarray  # (2, 3)
    b: np.ndarray  # (2, 10) trial accelerations of the robot
    c: np.ndarray  # (2, 10) accelerations from the loads
    slip: np.ndarray  # (2, n_wheels, 2) slip velocities
    trial: np.ndarray  # (n_wheels, 2) trial elongations
    cable_point: np.ndarray  # (n_wheels, 12) p, t, dp, dt
    motion: np.ndarray  # (24,)
    out: np.ndarray  # (2, n_wheels, 34) results of the law
    control: np.ndarray  # (2, 4 + 7 n_wheels) control loads at the stages
    generalized: np.ndarray  # (m,) generalised forces on (p, t) of each wheel, accelerations of the robot
    reference: np.ndarray  # (m,)
    dy: np.ndarray  # (m, m) derivatives by coordinates
    dv: np.ndarray  # (m, m) derivatives by rates
    dslip: np.ndarray  # (n_wheels, 2, m) of the slip velocities by rates
    probe: np.ndarray  # (21,) perturbed robot state
    probe_point: np.ndarray  # (n_wheels, 12)
    loads: np.ndarray
    resultants: np.ndarray  # (10,) force, moment, wheel torques
    quaternions: np.ndarray  # (3, 4)
    shapes: np.ndarray  # (n_wheels, 8)
    offsets: np.ndarray  # (n_wheels,) first coordinate of the element under each wheel
    coupling: np.ndarray  # (n_robot, n) complex: cable columns of the robot's unknowns, solved
    border: np.ndarray  # (n_wheels, 10, 12) complex: robot rows over the element's coordinates
    schur: np.ndarray  # (10, 10) complex, factorised
    pivots: np.ndarray  # (10,)
    robot_mode: np.ndarray  # (10,) complex
    guess: np.ndarray  # (10,) accelerations of the robot predicted for the second stage
    elongation: np.ndarray  # (n_wheels, 2) of the bristles where the matrix is made
    arc: np.ndarray  # (2, n_wheels) arc lengths of the wheels' feet at the stages
    saved: State  # at the start of a step


def make_space(n: int, n_wheels: int) -> Space:
    """Return new workspace for n cable coordinates and a number of wheels."""
    m = 6 * n_wheels + N_ROBOT
    z, c = np.zeros, np.complex128
    return Space(
        stage=z((2, rb.RIGID)),
        theta=z((2, 3)),
        b=z((2, N_ROBOT)),
        c=z((2, N_ROBOT)),
        slip=z((2, n_wheels, 2)),
        trial=z((n_wheels, 2)),
        cable_point=z((n_wheels, at.WHEEL)),
        motion=z(at.MOTION_SIZE),
        out=z((2, n_wheels, at.OUT_SIZE)),
        control=z((2, rb.BODY_LOADS + rb.WHEEL_LOADS * n_wheels)),
        generalized=z(m),
        reference=z(m),
        dy=z((m, m)),
        dv=z((m, m)),
        dslip=z((n_wheels, 2, m)),
        probe=z(rb.RIGID),
        probe_point=z((n_wheels, at.WHEEL)),
        loads=z(rb.BODY_LOADS + rb.WHEEL_LOADS * n_wheels),
        resultants=z(10),
        quaternions=z((3, 4)),
        shapes=z((n_wheels, 8)),
        offsets=z(n_wheels, dtype=np.int64),
        coupling=z((N_ROBOT, n), dtype=c),
        border=z((n_wheels, N_ROBOT, 12), dtype=c),
        schur=z((N_ROBOT, N_ROBOT), dtype=c),
        pivots=z(N_ROBOT, dtype=np.int64),
        robot_mode=z(N_ROBOT, dtype=c),
        guess=z(N_ROBOT),
        elongation=z((n_wheels, 2)),
        arc=z((2, n_wheels)),
        saved=State(z(state_size(n)), z(rb.RIGID), z((2, N_ROBOT)), z((n_wheels, N_CONTACT)), z(1)),
    )


@kernel
def copy(source, target):
    """Write one state over another."""
    for i in range(source.cable.size):
        target.cable[i] = source.cable[i]
    for i in range(source.robot.size):
        target.robot[i] = source.robot[i]
    target.control_work[0] = source.control_work[0]
    for i in range(N_ROBOT):
        target.accelerations[0, i], target.accelerations[1, i] = source.accelerations[0, i], source.accelerations[1, i]
    for k in range(source.contacts.shape[0]):
        for i in range(N_CONTACT):
            target.contacts[k, i] = source.contacts[k, i]
