"""What the coupled run costs beside the monolithic one, at the same error: the landing 20 m from the tower, 5 s.

    python -m benchmarks.coupled_cost [ROUNDS]

Coupled runs over macro steps and monolithic runs over tolerances take turns in one process; the best of ROUNDS (3) counts,
so that what else the machine does hits both. Errors of Z are relative to its peak-to-peak, against a monolithic solution
of tolerance 1e-11, at the communication points. The costs at an error of 1e-5 are interpolated in the logarithms; both
write their outputs at the communication points of the same macro step.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import numpy as np

from orchestrator.landing import build as landing
from orchestrator.landing.monolithic.solve import TOLERANCE, integrate
from orchestrator.runs.coupled import run_coupled
from orchestrator.scenario.read import load
from orchestrator.scenario.types import Scenario

SCENARIO = Path(__file__).parents[1] / "scenarios" / "landing_200m_point9.toml"
SIGNAL = "robot.body.position.z"
STOP, WANTED = 5.0, 1e-5
MACRO_STEPS = (0.04, 0.025, 0.02, 0.0125, 0.01, 0.005)
MASTERS = ("interface_jacobian", "iqn_ils")
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, TOLERANCE)
OUTPUT = 0.02
"""s, between the outputs of the monolithic runs: the coupled run that is that accurate has about this macro step."""
Cost = tuple[float, float]
"""Relative error of the signal, and wall time over simulated time."""


def reference(scenario: Scenario) -> dict[float, float]:
    """Return the signal at all communication points of all runs, by time in whole 0.1 ms."""
    ticks = sorted({round(i * step * 1e4) for step in (*MACRO_STEPS, OUTPUT) for i in range(round(STOP / step) + 1)})
    found = integrate(partial(landing.problem, scenario), np.array(ticks) / 1e4, 1e-11)
    return dict(zip(ticks, found.signals[SIGNAL].tolist(), strict=True))


def error(true: dict[float, float], time: np.ndarray, values: np.ndarray) -> float:
    """Return the largest error over the peak-to-peak of the true signal."""
    exact = np.array([true[round(t * 1e4)] for t in time])
    return float(np.max(np.abs(values - exact)) / np.ptp(list(true.values())))


def coupled(scenario: Scenario, true: dict[float, float], master: str, step: float) -> Cost:
    """Run coupled."""
    run = run_coupled(scenario.changed(master=master, macro_step=step))
    return error(true, run.table["time"], run.table[SIGNAL]), run.log.wall / STOP


def monolithic(scenario: Scenario, true: dict[float, float], tolerance: float) -> Cost:
    """Solve as one system."""
    time = np.arange(round(STOP / OUTPUT) + 1) * OUTPUT
    run = integrate(partial(landing.problem, scenario), time, tolerance)
    return error(true, run.time, run.signals[SIGNAL]), run.wall_s / STOP


def at_wanted(costs: list[Cost]) -> float:
    """Return the cost at the error wanted, on the lines between the measured points in the logarithms; NaN outside."""
    errors, walls = np.log(np.array(sorted(costs)).T)
    return float(np.exp(np.interp(np.log(WANTED), errors, walls, left=np.nan, right=np.nan)))


def main() -> None:
    """Print errors, costs and the ratio at equal error."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    scenario = load(SCENARIO).changed(stop_time=STOP)
    true = reference(scenario)
    runs = {f"monolithic {tol:g}": partial(monolithic, scenario, true, tol) for tol in TOLERANCES}
    runs |= {
        f"{master} {1e3 * step:g} ms": partial(coupled, scenario, true, master, step)
        for master in MASTERS
        for step in MACRO_STEPS
    }
    best: dict[str, Cost] = {}
    for _ in range(rounds):
        for name, run in runs.items():
            found = run()
            best[name] = min(found, best.get(name, found), key=lambda cost: cost[1])
    for name, (err, wall) in best.items():
        print(f"{name:32s} error of z {err:8.1e}   {1e3 * wall:6.1f} ms a simulated second")
    costs = {kind: [c for n, c in best.items() if n.startswith(kind)] for kind in ("monolithic", *MASTERS)}
    base = at_wanted(costs["monolithic"])
    print(f"at {WANTED:g}: monolithic {1e3 * base:.1f} ms; as the reference of `compare` is solved:", end=" ")
    print(f"{1e3 * best[f'monolithic {TOLERANCE:g}'][1]:.1f} ms")
    for master in MASTERS:
        wall = at_wanted(costs[master])
        ratio = wall / best[f"monolithic {TOLERANCE:g}"][1]
        print(f"{master}: {1e3 * wall:.1f} ms, {wall / base:.2f} of the monolithic one, {ratio:.2f} of the reference")


if __name__ == "__main__":
    main()
