"""A robot under all loads at once: its motion is that of a rigid body, and the loads' work is its energy."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.landing.trial.answers import places, stance, velocities
from orchestrator.landing.trial.bench import Bench, Loads, Motion, named
from orchestrator.landing.trial.body import Wrench
from orchestrator.landing.trial.falling import gravity_shown
from orchestrator.landing.trial.loads import Judge
from orchestrator.landing.trial.means import Pair, rate_of
from orchestrator.landing.trial.row import Row, deviation, judged, untestable

DURATION = 0.3
"""s; in which a robot turns by a third of a turn or so."""
STEP = 5e-3
"""s; of the reference: of order 4, and at some rad/s exact to 1e-8."""


def kinematics(bench: Bench, two: Pair | None, loads: Loads, n: int) -> Iterator[Row]:
    """Yield whether velocities are rates, and whether wheels and angles turn as one body."""
    positions, rates = ([f"{p}.{what}" for p in places(n)] for what in ("position", "velocity"))
    yield rate_of(two, positions, rates, "velocity is the rate of position")
    yield _axles_turn(two, n)
    motion = bench.run(loads, DURATION, _steps(bench))
    yield _rigid(motion, n)
    yield _angles(motion, n)


def _steps(bench: Bench) -> int:
    return max(2, round(DURATION / bench.H))


def _axles_turn(two: Pair | None, n: int) -> Row:
    """Return whether axles turn with the body's angular velocity."""
    name = "angular velocity is the rate of turning"
    if two is None:
        return untestable(name, "it makes no steps finer than its own")
    omega = two.fine["body.angular_velocity"]
    axles = [two.fine[f"wheel[{k + 1}].axle"] for k in range(n)]
    integral, error = two.integral(np.hstack([np.cross(omega, axle) for axle in axles]))
    inside = two.samples(np.hstack(axles))
    held = deviation(inside[-1] - inside[0], integral, error, at=1.0)
    return judged(
        name, "axles change by the integral of w x axle", "kinematics", held.words(), held.good, "axles turn otherwise"
    )


def _rigid(motion: Motion, n: int) -> Row:
    """Return whether all points move as those of one rigid body."""
    omega, at_b = motion["body.angular_velocity"], motion["body.velocity"]
    deviations = []
    for k in range(n):
        arm = motion[f"wheel[{k + 1}].position"] - motion["body.position"]
        moved = motion[f"wheel[{k + 1}].velocity"]
        deviations.append(deviation(moved, at_b + np.cross(omega, arm), at=100.0))
    held = max(deviations, key=lambda d: d.size)
    expected = "v_wheel = v_b + w x (p_wheel - p_b)"
    return judged(
        "one rigid body", expected, "kinematics", held.words(), held.good, "wheels move otherwise than the body"
    )


def _angles(motion: Motion, n: int) -> Row:
    """Return whether roll, pitch and yaw turn the wheels about b as they are."""
    first, last = stance(motion, n), stance(motion, n, -1)
    turn = last.R @ first.R.T
    expected = np.vstack([(first.points[:-1] - first.points[-1]) @ turn.T, first.axles @ turn.T])
    found = np.vstack([last.points[:-1] - last.points[-1], last.axles])
    before = np.vstack([first.points[:-1] - first.points[-1], first.axles])
    held = deviation(found, expected, scale=float(np.max(np.abs(found - before))), at=100.0)
    words = "wheels and axles turn by Rz(yaw) Ry(pitch) Rx(roll)"
    return judged(
        "roll, pitch, yaw",
        words,
        "the contract",
        held.words(),
        held.good,
        "another convention, or other signs or units",
    )


def work(bench: Bench, two: Pair | None, loads: Loads, n: int) -> Row:
    """Return whether kinetic and gravitational energy change by the work of the loads."""
    name, energies = "work is energy", ("kinetic_energy", "gravitational_energy")
    if not bench.has(*energies):
        return untestable(name, "it shows no energies; velocity as the rate of position stands for it")
    if two is None:
        return untestable(name, "it makes no steps finer than its own")
    force, moment = (
        np.array([[loads[f"wheel[{k + 1}].{what}.{axis}"] for axis in "xyz"] for k in range(n)])
        for what in ("force", "moment")
    )
    v, w = (
        named(two.fine, [f"wheel[{k + 1}].{what}" for k in range(n)]).reshape(-1, n, 3)
        for what in ("velocity", "angular_velocity")
    )
    power = np.sum(force * v + moment * w, axis=(1, 2))
    done, error = two.integral(power)
    energy = two.fine["kinetic_energy"] + two.fine["gravitational_energy"]
    inside = two.samples(energy)
    scale = float(np.ptp(two.fine["kinetic_energy"])) + abs(float(done))
    held = deviation(inside[-1] - inside[0], np.asarray(done), error, scale=scale, at=float(np.max(np.abs(inside))))
    found = f"{inside[-1] - inside[0]:.5g} J, work {float(done):.5g} J"
    expected = "kinetic + gravitational energy changes by the work of force and moment"
    return judged(name, expected, INTEGRAL_OF_POWER, found, held.good, "energy is lost or made")


INTEGRAL_OF_POWER = "integral of F·v + M·w over fine steps"


def ride(bench: Bench, judge: Judge, wrench: Wrench, loads: Loads) -> Row:
    """Return whether the robot goes where Newton and Euler go, turning and all, under steady loads."""
    assert judge.body is not None
    n, steps = judge.asked.n_wheels, _steps(bench)
    duration = steps * bench.H
    found = [_state(bench.run(loads, duration, steps * m), n) for m in ((1, 2) if bench.divides else (1,))]
    expected = judge.body.ride(wrench, gravity_shown(bench), duration, max(1, round(duration / STEP)))
    weights = np.concatenate([np.ones(n + 1), np.full(n + 1, judge.lever), np.full(n + 1, 1.0 / duration)])[:, None]
    estimate = float(np.max(np.abs(weights * (found[-1] - found[0]))))
    held = deviation(weights * found[0], weights * expected, estimate)
    name = f"all loads over {DURATION:g} s"
    words = f"velocities and places of a rigid body that turns by {_turn(bench, loads, duration, steps, n):.2f} rad"
    why = "loads in the body's frame, gyroscopic moments missing, or another integration"
    return judged(name, words, judge.source, held.words(), held.good, why)


def _state(motion: Motion, n: int) -> np.ndarray:
    """Return velocities at the end, and displacements of the points, (3 n + 3, 3)."""
    first, last = stance(motion, n), stance(motion, n, -1)
    return np.vstack([velocities(motion, n)[-1], last.points - first.points])


def _turn(bench: Bench, loads: Loads, duration: float, steps: int, n: int) -> float:
    """Return by how much the robot turns, rad."""
    motion = bench.run(loads, duration, steps)
    turn = stance(motion, n, -1).R @ stance(motion, n).R.T
    return float(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1.0, 1.0)))
