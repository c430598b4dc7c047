"""What the coupled run costs beside the monolithic one, at the same error: the landing 20 m from the tower.

    python -m benchmarks.coupled_cost [ROUNDS [STOP]]

Coupled runs over macro steps and monolithic runs over tolerances take turns in one process, ROUNDS (3) times, over STOP
(5) s. Errors of Z are relative to its peak-to-peak, against a monolithic solution of tolerance 1e-11, at the communication
points. The costs at an error of 1e-5 are interpolated in the logarithms, round by round; both write their outputs at the
communication points of the same macro step.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.clock import Loop, Times, turns
from orchestrator.landing import build as landing
from orchestrator.landing.monolithic.solve import TOLERANCE, integrate
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.systems import System, resolve
from orchestrator.scenario.read import load

SCENARIO = Path(__file__).parents[1] / "scenarios" / "landing_200m_point9.toml"
SIGNAL = "robot.body.position.z"
WANTED = 1e-5
MACRO_STEPS = (0.04, 0.025, 0.02, 0.0125, 0.01, 0.005)
MASTERS = ("interface_jacobian", "iqn_ils")
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, TOLERANCE)
OUTPUT = 0.02
"""s, between the outputs of the monolithic runs: the coupled run that is that accurate has about this macro step."""


class Benchmark:
    """All runs, and the error of each.

    Attributes
    ----------
    true : the signal by time in whole 0.1 ms
    errors : contestant → largest error of the signal over its peak-to-peak
    """

    def __init__(self, stop: float):
        self.stop = stop
        self.system: System = resolve(load(SCENARIO).changed(stop_time=stop))
        self.make = partial(landing.problem, self.system.landing)  # type: ignore[attr-defined]
        steps = (*MACRO_STEPS, OUTPUT)
        ticks = sorted({round(i * step * 1e4) for step in steps for i in range(round(stop / step) + 1)})
        found = integrate(self.make, np.array(ticks) / 1e4, 1e-11)
        self.true = dict(zip(ticks, found.signals[SIGNAL].tolist(), strict=True))
        self.errors: dict[str, float] = {}

    def contestants(self) -> dict[str, Callable[[], float]]:
        """Return all runs; each returns its CPU time per simulated second."""
        found = {f"monolithic {tol:g}": partial(self.monolithic, tol) for tol in TOLERANCES}
        pairs = [(master, step) for master in MASTERS for step in MACRO_STEPS]
        return found | {f"{master} {1e3 * step:g} ms": partial(self.coupled, master, step) for master, step in pairs}

    def coupled(self, master: str, step: float) -> float:
        """Run coupled."""
        loop = Loop()
        run = run_coupled(self.system.changed({}, master=master, macro_step=step), loop)
        cost = loop.spent() / (self.stop - step)
        self._note(f"{master} {1e3 * step:g} ms", run.table["time"], run.table[SIGNAL])
        return cost

    def monolithic(self, tolerance: float) -> float:
        """Solve as one system."""
        loop, time = Loop(), np.arange(round(self.stop / OUTPUT) + 1) * OUTPUT
        run = integrate(self.make, time, tolerance, loop)
        cost = loop.spent() / (self.stop - OUTPUT)
        self._note(f"monolithic {tolerance:g}", run.time, run.signals[SIGNAL])
        return cost

    def _note(self, name: str, time: np.ndarray, values: np.ndarray) -> None:
        exact = np.array([self.true[round(t * 1e4)] for t in time])
        self.errors[name] = float(np.max(np.abs(values - exact)) / np.ptp(list(self.true.values())))

    def at_wanted(self, kind: str, times: Times) -> np.ndarray:
        """Return the cost at the error wanted in each round, on the lines between the points in the logarithms."""
        names = sorted((name for name in times if name.startswith(kind)), key=self.errors.__getitem__)
        errors = np.log([self.errors[name] for name in names])
        costs = np.log([times[name] for name in names])
        return np.array([np.exp(np.interp(np.log(WANTED), errors, row, left=np.nan, right=np.nan)) for row in costs.T])


def main(rounds: int = 3, stop: float = 5.0) -> None:
    """Print errors, costs and the ratios at equal error."""
    benchmark = Benchmark(stop)
    times = turns(benchmark.contestants(), rounds)
    for name, values in times.items():
        cost = 1e3 * np.median(values)
        print(f"{name:32s} error of z {benchmark.errors[name]:8.1e}   {cost:6.1f} ms of CPU a simulated second")
    base, reference = benchmark.at_wanted("monolithic", times), times[f"monolithic {TOLERANCE:g}"]
    print(f"at {WANTED:g}: monolithic {1e3 * np.median(base):.1f} ms", end="; ")
    print(f"as the reference of `compare` is solved {1e3 * np.median(reference):.1f} ms")
    for master in MASTERS:
        cost = benchmark.at_wanted(master, times)
        by, of = np.median(cost / base), np.median(cost / reference)
        print(f"{master}: {1e3 * np.median(cost):.1f} ms, {by:.2f} of the monolithic one, {of:.2f} of the reference")


if __name__ == "__main__":
    main(*(kind(text) for kind, text in zip((int, float), sys.argv[1:], strict=False)))
