"""What a robot answers to known loads, one at a time, and the rigid body that its answers are those of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from orchestrator.landing.trial.bench import Bench, Loads, Motion, named
from orchestrator.landing.trial.body import Body, Wrench

FORCE, MOMENT = 10.0, 1.0
"""N and N m; small enough that what follows from a turn within a step is of higher order."""
SIZES = {"force": FORCE, "moment": MOMENT}
NOTHING = 1e-9
"""Share of a usual answer below which there is none."""
LoadName = tuple[int, str, int]
"""Wheel (from 0), ``force`` or ``moment``, axis."""


@dataclass(frozen=True)
class Answer:
    """Accelerations per N or N m; rows as in `Body.response`.

    Attributes
    ----------
    rate : (2 n_wheels + 2, 3), over one macro step
    estimate : (2 n_wheels + 2, 3), how far other steps are from it
    """

    rate: np.ndarray
    estimate: np.ndarray


def wheels(bench: Bench) -> int:
    """Return how many wheels a robot shows."""
    n = 0
    while bench.has(f"wheel[{n + 1}].position.x"):
        n += 1
    return n


def places(n_wheels: int) -> list[str]:
    """Return the points of a robot whose motion is looked at: the wheels, then the body's."""
    return [*(f"wheel[{k + 1}]" for k in range(n_wheels)), "body"]


def velocities(motion: Motion, n_wheels: int) -> np.ndarray:
    """Return the velocities over time (n + 1, 2 n_wheels + 2, 3), rows as in `Body.response`."""
    names = [f"{place}.{what}" for what in ("velocity", "angular_velocity") for place in places(n_wheels)]
    return named(motion, names).reshape(len(motion.time), -1, 3)


def load_names(n_wheels: int) -> list[LoadName]:
    """Return all single loads at the wheels."""
    return list(product(range(n_wheels), SIZES, range(3)))


def input_of(load: LoadName) -> str:
    """Return the input that carries a single load: ``wheel[1].force.x``."""
    k, what, axis = load
    return f"wheel[{k + 1}].{what}.{'xyz'[axis]}"


class Asked:
    """What a robot answers, measured from its start with nothing else applied.

    Attributes
    ----------
    n_wheels : number of its wheels
    answers : by single load
    """

    def __init__(self, bench: Bench):
        self.bench, self.n_wheels = bench, wheels(bench)
        self.longer = (bench.H, 2) if bench.divides else (2.0 * bench.H, 2)
        self.rest = [self._speeds({}, bench.H, 1), self._speeds({}, *self.longer)]
        self.answers = {load: self.ask({input_of(load): SIZES[load[1]]}) for load in load_names(self.n_wheels)}

    def _speeds(self, loads: Loads, duration: float, n: int) -> np.ndarray:
        motion = self.bench.run(loads, duration, n)
        return velocities(motion, self.n_wheels)[1:] / motion.time[1:, None, None]

    def ask(self, loads: Loads) -> Answer:
        """Return the answer to `loads`, for one unit of the first of them."""
        size = next(iter(loads.values()))
        rate = (self._speeds(loads, self.bench.H, 1) - self.rest[0])[0] / size
        others = (self._speeds(loads, *self.longer) - self.rest[1]) / size
        return Answer(rate, np.max(np.abs(others - rate), axis=0))

    @property
    def mobility(self) -> np.ndarray:
        """Accelerations of all wheels by the loads on them, (6 n_wheels, 6 n_wheels): by wheel, three of each kind."""
        n = self.n_wheels
        columns = [self.answers[load].rate for load in load_names(n)]
        return np.array([np.hstack([a[:n], a[n + 1 : 2 * n + 1]]).ravel() for a in columns]).T


# -- the body that the answers are those of -------------------------------------------------------------------


@dataclass(frozen=True)
class Stance:
    """How a robot stands at the start.

    Attributes
    ----------
    points : (n_wheels + 1, 3), m, wheels' centres and b
    axles : (n_wheels, 3)
    R : (3, 3), from the body's frame to the inertial one, by roll, pitch and yaw
    """

    points: np.ndarray
    axles: np.ndarray
    R: np.ndarray


def attitude(angles: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return Rz(yaw) Ry(pitch) Rx(roll) (3, 3) of roll, pitch and yaw, rad."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles), np.cos(angles)
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])  # fmt: skip


def stance(motion: Motion, n_wheels: int, at: int = 0) -> Stance:
    """Return how a robot stands after step `at`."""
    points = np.array([motion[f"{place}.position"][at] for place in places(n_wheels)])
    axles = np.array([motion[f"wheel[{k + 1}].axle"][at] for k in range(n_wheels)])
    return Stance(points, axles, attitude([motion[name][at] for name in ("roll", "pitch", "yaw")]))


def body_shown(bench: Bench, stands: Stance) -> Body | None:
    """Return the body that a robot's own parameters describe; None if it shows too few."""
    diagonal = [bench.shown(f"inertia.{i}{i}") for i in "xyz"]
    centre = [bench.shown(f"center_of_mass.{i}") for i in "xyz"]
    mass = bench.shown("mass")
    if mass is None or None in diagonal or None in centre:
        return None
    xy, xz, yz = (bench.shown(f"inertia.{i}") or 0.0 for i in ("xy", "xz", "yz"))
    xx, yy, zz = diagonal
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float)
    to_G = stands.R @ np.array(centre, dtype=float)
    spins = [_spin_shown(bench, k + 1) for k in range(len(stands.axles))]
    if None in spins:
        return None
    arms = stands.points - stands.points[-1] - to_G
    return Body(mass, stands.R @ J @ stands.R.T, arms, stands.axles, np.array(spins, dtype=float))


def _spin_shown(bench: Bench, k: int) -> float | None:
    """Return the spin inertia of wheel `k`: 0 if it is fixed to the body, None if the robot does not say enough."""
    if bench.shown(f"wheel[{k}].braked") == 0.0:
        return bench.shown(f"wheel[{k}].inertia")
    return 0.0


def body_found(asked: Asked, stands: Stance) -> Body | None:
    """Return the rigid body whose answers are the nearest; None where they are those of none.

    What does not act at all, or the wrong way round, is left out: a body is found all the same, and shows it.
    """
    rates = {load: answer.rate for load, answer in asked.answers.items()}
    n, points = asked.n_wheels, stands.points - stands.points[-1]
    spins = np.array([_spin_found(rates, k, n, stands.axles[k]) for k in range(n)])
    inverse_mass, to_b = _translation(rates, points)
    if inverse_mass <= 0.0:
        return None
    arms = points + to_b
    moments = {load: _moment(load, arms, stands.axles, spins) for load in rates}
    compliance = _compliance({load: rate[-1] for load, rate in rates.items()}, moments)
    if compliance is None:
        return None
    inertia = np.linalg.inv(compliance) + (stands.axles.T * spins) @ stands.axles
    return Body(1.0 / inverse_mass, inertia, arms, stands.axles, spins)


def _spin_found(rates: Mapping[LoadName, np.ndarray], k: int, n: int, axle: np.ndarray) -> float:
    """Return the spin inertia of wheel `k` by its answer to the moment that is most along its axle; 0 if it is fixed."""
    axis = int(np.argmax(np.abs(axle)))
    rate = rates[k, "moment", axis]
    spin = float(rate[n + 1 + k] @ axle)  # of the wheel in the inertial frame: that of the body included
    relative = spin - float(rate[-1] @ axle)
    return float(axle[axis]) / spin if abs(relative) > 1e-3 * abs(spin) > 0.0 else 0.0


def _translation(rates: Mapping[LoadName, np.ndarray], points: np.ndarray) -> tuple[float, np.ndarray]:
    """Return 1/mass and the vector from the centre of mass to b, (3,), from dv = F / mass + dw x arm of all points.

    Each axis has a mass of its own in the equations; the middle one counts.
    """
    rows, right = [], []
    for (_, what, axis), rate in rates.items():
        dw = rate[-1]
        for point, dv in zip(points, rate[: len(points)], strict=True):
            force = np.diag([float(what == "force" and i == axis) for i in range(3)])
            rows.append(np.hstack([force, _cross(dw)]))
            right.append(dv - np.cross(dw, point))
    found = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=1e-9)[0]
    return float(np.median(np.abs(found[:3]))), found[3:]


def _cross(w: np.ndarray) -> np.ndarray:
    """Return the matrix (3, 3) of the product w x …."""
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def _moment(load: LoadName, arms: np.ndarray, axles: np.ndarray, spins: np.ndarray) -> np.ndarray:
    """Return the moment (3,) of a unit load that turns the body."""
    k, what, axis = load
    unit = np.eye(3)[axis]
    if what == "force":
        return np.cross(arms[k], unit)
    return unit - (unit @ axles[k]) * axles[k] if spins[k] > 0.0 else unit


def _compliance(turns: Mapping[LoadName, np.ndarray], moments: Mapping[LoadName, np.ndarray]) -> np.ndarray | None:
    """Return the symmetric C (3, 3) of dw = C M, by the moments at the wheels, and by the forces where those are not enough."""
    usual = max((float(np.linalg.norm(w)) for w in turns.values()), default=0.0)
    acting = [load for load, w in turns.items() if float(w @ moments[load]) > NOTHING * usual > 0.0]
    by_moments = [load for load in acting if load[1] == "moment"]
    for loads in (by_moments, acting):
        M = np.array([moments[load] for load in loads]).reshape(-1, 3)
        if np.linalg.matrix_rank(M, tol=1e-6) == 3:
            C = np.linalg.lstsq(M, np.array([turns[load] for load in loads]), rcond=None)[0]
            C = (C + C.T) / 2
            return C if np.linalg.eigvalsh(C)[0] > 0.0 else None
    return None


def wrench_of(load: LoadName, n_wheels: int, size: float = 1.0) -> Wrench:
    """Return a single load."""
    k, what, axis = load
    loads = {name: np.zeros((n_wheels, 3)) for name in SIZES}
    loads[what][k, axis] = size
    return Wrench(**loads)
