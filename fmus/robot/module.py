"""The robot module: variable table, checked parameters, initial state, step."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from fmus.kernels.rotations import follow_euler, from_euler, rotate
from fmus.module.variables import (
    NON_NEGATIVE,
    POSITIVE,
    Bounds,
    ModuleError,
    Variable,
    VariableTable,
    check_bounds,
    parameter,
    vector,
)
from fmus.robot import dynamics, rigid_body

ROUND_OFF = 1e-9
"""Relative; a macro step longer than a whole number of inner steps by less than this needs no further one."""


_ENTRY = "of the inertia tensor (minus the product of inertia)"
_BODY = [
    parameter("mass", "kg", 38.0, "mass, wheels included", POSITIVE),
    parameter(
        "inertia.xx",
        "kg.m2",
        5.42,
        "moment of inertia about the centre of mass, wheels included as if fixed",
        POSITIVE,
    ),
    parameter("inertia.yy", "kg.m2", 5.42, "moment of inertia about the centre of mass", POSITIVE),
    parameter("inertia.zz", "kg.m2", 8.5, "moment of inertia about the centre of mass", POSITIVE),
    parameter("inertia.xy", "kg.m2", 0.0, f"entry xy {_ENTRY}"),
    parameter("inertia.xz", "kg.m2", 0.0, f"entry xz {_ENTRY}"),
    parameter("inertia.yz", "kg.m2", 0.0, f"entry yz {_ENTRY}"),
    parameter("gravity", "m/s2", 9.8, "gravitational acceleration, along -Z", NON_NEGATIVE),
    parameter("integration_step", "s", 1e-3, "longest inner step", POSITIVE),
    parameter("initial.roll", "rad", 0.0, "initial angle about x"),
    parameter("initial.pitch", "rad", 0.0, "initial angle about y"),
    parameter("initial.yaw", "rad", 0.0, "initial angle about z"),
    *vector("center_of_mass", "parameter", "m", "centre of mass from b, in B", (0.0, 0.0, -0.1)),
    *vector("initial.position", "parameter", "m", "initial position of b"),
    *vector("initial.velocity", "parameter", "m/s", "initial velocity of b"),
    *vector("initial.angular_velocity", "parameter", "rad/s", "initial angular velocity, inertial"),
]


def _number_of_wheels(n_wheels: int) -> Variable:
    text, bounds = "number of wheels; fixed by the model", Bounds(ge=1, le=rigid_body.MAX_WHEELS)
    return Variable("n_wheels", "parameter", "1", n_wheels, text, kind="integer", bounds=bounds)


def _wheel_parameters(wheel: str) -> list[Variable]:
    return [
        *vector(f"{wheel}.mount", "parameter", "m", "wheel centre from b, in B", (0.0, 0.0, 0.2152)),
        *vector(f"{wheel}.axle_direction", "parameter", "1", "axle in B, of any length", (1.0, 0.0, 0.0)),
        parameter(f"{wheel}.axle_yaw", "rad", 0.0, "misalignment: turn of the axle about z_B from axle_direction"),
        parameter(f"{wheel}.axle_tilt", "rad", 0.0, "misalignment: turn of the axle about y_B, before axle_yaw"),
        Variable(f"{wheel}.braked", "parameter", "1", True, "fixed to the body, not free to spin", kind="boolean"),
        parameter(
            f"{wheel}.inertia",
            "kg.m2",
            5e-3,
            "spin inertia about the axle; used if free, and positive then",
            NON_NEGATIVE,
        ),
    ]


def _wheel_inputs(wheel: str) -> list[Variable]:
    return [
        *vector(f"{wheel}.force", "input", "N", "contact force on the wheel, mean over the macro step"),
        *vector(f"{wheel}.moment", "input", "N.m", "contact moment about the wheel centre, mean"),
        Variable(f"{wheel}.drive_torque", "input", "N.m", 0.0, "torque of the body on the wheel, about the axle"),
        *vector(f"{wheel}.force_rate", "input", "N/s", "slope of the contact force within the macro step"),
        *vector(f"{wheel}.moment_rate", "input", "N.m/s", "slope of the contact moment within the macro step"),
        Variable(
            f"{wheel}.drive_torque_rate", "input", "N.m/s", 0.0, "slope of the drive torque within the macro step"
        ),
    ]


def _wheel_outputs(wheel: str) -> list[Variable]:
    return [
        *vector(f"{wheel}.position", "output", "m", "wheel centre"),
        *vector(f"{wheel}.axle", "output", "1", "axle, unit vector"),
        *vector(f"{wheel}.velocity", "output", "m/s", "velocity of the wheel centre"),
        *vector(f"{wheel}.angular_velocity", "output", "rad/s", "angular velocity of the wheel, spin included"),
        *vector(f"{wheel}.position_mean", "output", "m", "time mean of the position over the last macro step"),
        *vector(f"{wheel}.axle_mean", "output", "1", "time mean of the axle over the last macro step"),
        *vector(f"{wheel}.rotation", "output", "rad", "integral of the angular velocity over the last macro step"),
        *vector(f"{wheel}.rotation_mean", "output", "rad", "time mean of that running integral"),
        Variable(f"{wheel}.work", "output", "J", 0.0, "work done on the robot through this wheel"),
    ]


def _body_outputs() -> list[Variable]:
    return [
        *vector("body.position", "output", "m", "position of b"),
        *vector("body.velocity", "output", "m/s", "velocity of b"),
        Variable("roll", "output", "rad", 0.0, "angle about x, without jumps"),
        Variable("pitch", "output", "rad", 0.0, "angle about y, within a quarter turn"),
        Variable("yaw", "output", "rad", 0.0, "angle about z, without jumps"),
        *vector("body.angular_velocity", "output", "rad/s", "angular velocity of the body, inertial components"),
        Variable("kinetic_energy", "output", "J", 0.0, "kinetic energy, spinning wheels included"),
        Variable("gravitational_energy", "output", "J", 0.0, "m g Z of the centre of mass"),
        Variable("control_work", "output", "J", 0.0, "work done by thrust, control torque and drive torques"),
    ]


@cache
def robot_table(n_wheels: int) -> VariableTable:
    """Return the variable table of a robot with `n_wheels` wheels: parameters, inputs, outputs."""
    if not 1 <= n_wheels <= rigid_body.MAX_WHEELS:
        raise ModuleError(f"n_wheels: {n_wheels} is not possible; choose 1 to {rigid_body.MAX_WHEELS}")
    wheels = [f"wheel[{k}]" for k in range(1, n_wheels + 1)]
    return VariableTable(
        [
            _number_of_wheels(n_wheels),
            *_BODY,
            *(v for wheel in wheels for v in _wheel_parameters(wheel)),
            Variable("thrust", "input", "N", 0.0, "thrust along z_B, acting at b, mean over the macro step"),
            *vector("torque", "input", "N.m", "control torque, components in B, mean over the macro step"),
            Variable("thrust_rate", "input", "N/s", 0.0, "slope of the thrust within the macro step"),
            *vector("torque_rate", "input", "N.m/s", "slope of the control torque within the macro step"),
            *(v for wheel in wheels for v in _wheel_inputs(wheel)),
            *_body_outputs(),
            *(v for wheel in wheels for v in _wheel_outputs(wheel)),
        ]
    )


def _vector(values: np.ndarray, table: VariableTable, name: str) -> np.ndarray:
    return values[table.indices(f"{name}.{axis}" for axis in "xyz")]


def inertia_tensor(values: np.ndarray, table: VariableTable) -> np.ndarray:
    """Return the inertia tensor about G in B (3, 3), kg m²; raise `ModuleError` if no body can have it."""
    xx, yy, zz, xy, xz, yz = (values[table.index[f"inertia.{c}"]] for c in ("xx", "yy", "zz", "xy", "xz", "yz"))
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    smallest, middle, largest = np.linalg.eigvalsh(tensor)
    if smallest <= 0.0:
        raise ModuleError(
            f"inertia: smallest principal moment is {smallest:g} kg.m2, it must be positive; "
            "check the diagonal entries and the signs of xy, xz, yz"
        )
    if largest > (smallest + middle) * (1.0 + ROUND_OFF):
        raise ModuleError(
            f"inertia: principal moments {smallest:g}, {middle:g}, {largest:g} kg.m2 are those of no body, "
            "the largest exceeds the sum of the others; check that they are taken about the centre of mass"
        )
    return tensor


def axle_in_body(values: np.ndarray, table: VariableTable, wheel: str) -> np.ndarray:
    """Return the axle of ``wheel[k]`` in B, a unit vector (3,): its direction, turned by its misalignment."""
    axle = _vector(values, table, f"{wheel}.axle_direction")
    length = float(np.linalg.norm(axle))
    if length == 0.0:
        raise ModuleError(f"{wheel}.axle_direction: has no length; give a direction such as 1, 0, 0")
    turn = np.zeros(4)
    tilt, yaw = (float(values[table.index[f"{wheel}.axle_{name}"]]) for name in ("tilt", "yaw"))
    from_euler(0.0, tilt, yaw, turn)
    return np.array(rotate(turn, *(axle / length)))


def _wheel_row(values: np.ndarray, table: VariableTable, wheel: str) -> np.ndarray:
    """Return the wheel's part of the kernels' parameters (8,)."""
    axle = axle_in_body(values, table, wheel)
    free = not values[table.index[f"{wheel}.braked"]]
    spin_inertia = _spin_inertia(values, table, wheel) if free else 1.0
    mount = _vector(values, table, f"{wheel}.mount") - _vector(values, table, "center_of_mass")
    return np.array([*mount, *axle, spin_inertia, float(free)])


def _spin_inertia(values: np.ndarray, table: VariableTable, wheel: str) -> float:
    value = float(values[table.index[f"{wheel}.inertia"]])
    if value <= 0.0:
        raise ModuleError(f"robot: {wheel}.inertia = {value:g} kg.m2 of a free wheel must be greater than 0")
    return value


def _without_spin(tensor: np.ndarray, wheels: np.ndarray) -> np.ndarray:
    """Return the tensor (3, 3) less the spin inertia of the free among the `wheels` (n, 8): what a body's torque turns."""
    rb = rigid_body
    rest = tensor.copy()
    for row in wheels:
        axle = row[rb.AXLE : rb.AXLE + 3]
        rest -= row[rb.FREE] * row[rb.SPIN_INERTIA] * np.outer(axle, axle)
    if np.linalg.eigvalsh(rest)[0] <= 0.0:
        raise ModuleError(
            "wheel inertia: the free wheels' spin inertia exceeds the whole robot's; "
            "lower wheel[k].inertia, or raise inertia, which includes the wheels"
        )
    return rest


def body_parameters(values: np.ndarray, table: VariableTable) -> np.ndarray:
    """Return the parameters `prm` of the kernels, checked: (56,) float64.

    Parameters
    ----------
    values : (len(table),), the module's flat array
    table : of `robot_table`
    """
    rb = rigid_body
    check_bounds(table, values, "robot")
    n_wheels = int(table["n_wheels"].start)
    if values[table.index["n_wheels"]] != n_wheels:
        raise ModuleError(f"n_wheels: this model has {n_wheels}; take a model of a robot with the wheels wanted")
    tensor = inertia_tensor(values, table)
    wheels = np.array([_wheel_row(values, table, f"wheel[{k + 1}]") for k in range(n_wheels)])
    prm = np.zeros(rb.N_PARAMETERS)
    prm[rb.MASS] = values[table.index["mass"]]
    prm[rb.GRAVITY] = values[table.index["gravity"]]
    prm[rb.N_WHEELS] = n_wheels
    prm[rb.B_FROM_G : rb.B_FROM_G + 3] = -_vector(values, table, "center_of_mass")
    prm[rb.INERTIA : rb.INERTIA + 9] = tensor.ravel()
    prm[rb.COMPLIANCE : rb.COMPLIANCE + 9] = np.linalg.inv(_without_spin(tensor, wheels)).ravel()
    prm[rb.WHEELS : rb.WHEELS + wheels.size] = wheels.ravel()
    return prm


def initial_state(values: np.ndarray, table: VariableTable) -> np.ndarray:
    """Return the rigid-body state (21,) that the parameters `initial.*` describe, wheels at rest."""
    rb = rigid_body
    state = np.zeros(rb.RIGID)
    roll, pitch, yaw = (float(values[table.index[f"initial.{a}"]]) for a in ("roll", "pitch", "yaw"))
    attitude = state[rb.ATTITUDE : rb.VELOCITY]
    from_euler(roll, pitch, yaw, attitude)
    arm = np.array(rotate(attitude, *_vector(values, table, "center_of_mass")))
    w_IB = _vector(values, table, "initial.angular_velocity")
    state[rb.POSITION : rb.POSITION + 3] = _vector(values, table, "initial.position") + arm
    state[rb.VELOCITY : rb.VELOCITY + 3] = _vector(values, table, "initial.velocity") + np.cross(w_IB, arm)
    state[rb.TURN_RATE : rb.TURN_RATE + 3] = w_IB
    return state


class Robot:
    """A rigid robot with wheels; see the README of this folder for equations and variables.

    Parameters
    ----------
    n_wheels : 1 to 4; the table depends on it
    """

    NAME = "robot"
    TITLE = "rigid line robot"

    def __init__(self, n_wheels: int = 1):
        self.n_wheels = n_wheels
        self.table = robot_table(n_wheels)
        self.values = self.table.defaults()
        self.state = np.zeros(dynamics.MEMORY + dynamics.WHEEL_MEMORY * n_wheels)
        self._prm = np.zeros(rigid_body.N_PARAMETERS)
        self._work = np.zeros(dynamics.WORKSPACE)
        self._inner_step = 0.0
        first_input = len(self.table.names("parameter"))
        first_output = first_input + len(self.table.names("input"))
        self._inputs = slice(first_input, first_output)
        self._outputs = slice(first_output, len(self.table))

    def initialize(self, t: float) -> None:
        """Check the parameters and write state and outputs; the motion before `t` counts as rest."""
        rb = rigid_body
        self._prm = body_parameters(self.values, self.table)
        self._inner_step = float(self.values[self.table.index["integration_step"]])
        self.state[:] = 0.0
        self.state[: rb.RIGID] = initial_state(self.values, self.table)
        angles = self.state[dynamics.ANGLES : dynamics.ANGLES + 3]
        angles[:] = self.values[self.table.indices(f"initial.{a}" for a in ("roll", "pitch", "yaw"))]
        follow_euler(self.state[rb.ATTITUDE : rb.VELOCITY], angles)
        motion = np.zeros(12)
        for k in range(self.n_wheels):
            rb.wheel_motion(self._prm, self.state, k, motion)
            means = dynamics.MEMORY + dynamics.WHEEL_MEMORY * k
            self.state[means : means + 6] = motion[:6]
        self.refresh()

    def refresh(self) -> None:
        """Write the outputs from the state; no output depends on an input without a step."""
        dynamics.outputs(self._prm, self.state, self.values[self._outputs])

    def step(self, t: float, h: float) -> None:
        """Advance from `t` to `t + h` with the inputs' means and slopes; a `ModuleError` changes nothing."""
        if not (math.isfinite(h) and h > 0.0):
            raise ModuleError(f"step at {t:g} s: macro step {h:g} s is not positive; choose one above 0")
        n_inner = max(1, math.ceil(h / self._inner_step * (1.0 - ROUND_OFF)))
        inputs = self.values[self._inputs]
        status = dynamics.step(self._prm, inputs, self.state, float(h), n_inner, self._work)
        if status != dynamics.DONE:
            raise ModuleError(self._failure(t, h, n_inner, status))
        self.refresh()

    def _failure(self, t: float, h: float, n_inner: int, status: int) -> str:
        where = f"robot, step from {t:g} s to {t + h:g} s"
        for name in self.table.names("input"):
            if not math.isfinite(self.values[self.table.index[name]]):
                return f"{where}: input {name} is not a finite number; look at what is connected to it"
        if status == dynamics.TURNS_TOO_FAST:
            return (
                f"{where}: the body turns by more than 1 rad in an inner step of {h / n_inner:g} s; "
                "lower integration_step, or look for loads that are too large"
            )
        return f"{where}: the motion is no longer finite; look for loads that are too large"
