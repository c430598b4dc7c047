"""Where the microseconds of a macro step go: the landing 20 m from the tower, `interface_jacobian`.

    python -m benchmarks.macro_step [MACRO_STEP [MASTER [STOP]]]

Plain runs and runs with a clock (of CPU time, about 0.6 µs a call, booked with the call) around every call to an FMU take
turns. What is left is the master: least squares, linear models, prediction, residuals, books, records.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from benchmarks.clock import Loop, ratio, turns
from orchestrator.coupling.fmu.group import Group
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.systems import System, resolve
from orchestrator.scenario.read import load

SCENARIO = Path(__file__).parents[1] / "scenarios" / "landing_200m_point9.toml"
CALLS = {Group: ("set", "get", "get_finite"), Fmu: ("step", "save", "restore", "release")}
ROUNDS = 3
Spent = defaultdict[tuple[str, str], list[float]]
"""Component and call → seconds, number."""


def clocked(function: Callable[..., Any], call: str, booked: Spent) -> Callable[..., Any]:
    """Return `function`, a method of `Fmu` or `Group`, with a clock around it."""

    def timed(self: Fmu | Group, *arguments: Any) -> Any:
        start = process_time()
        try:
            return function(self, *arguments)
        finally:
            entry = booked[self.fmu.name if isinstance(self, Group) else self.name, call]
            entry[0] += process_time() - start
            entry[1] += 1

    return timed


@contextmanager
def clocks(booked: Spent) -> Iterator[None]:
    """Put clocks around the calls, and take them away again."""
    plain = {(kind, call): getattr(kind, call) for kind, calls in CALLS.items() for call in calls}
    for (kind, call), function in plain.items():
        setattr(kind, call, clocked(function, call.removesuffix("_finite"), booked))
    try:
        yield
    finally:
        for (kind, call), function in plain.items():
            setattr(kind, call, function)


def run(system: System, booked: Spent | None = None) -> float:
    """Run coupled, with clocks that book into `booked`; return the CPU time of the loop, s."""
    loop = Loop()
    if booked is None:
        run_coupled(system, loop)
        return loop.spent()
    with clocks(booked):
        run_coupled(system, loop)
        return loop.spent()


def main(step: float = 0.005, master: str = "interface_jacobian", stop: float = 5.0) -> None:
    """Print the table."""
    system = resolve(load(SCENARIO).changed(stop_time=stop, macro_step=step, master=master))
    booked: Spent = defaultdict(lambda: [0.0, 0.0])
    times = turns({"plain": lambda: run(system), "clocked": lambda: run(system, booked)}, ROUNDS)
    n = ROUNDS * round(stop / step)
    plain, whole = (1e6 * np.median(times[name]) / (n / ROUNDS) for name in ("plain", "clocked"))
    print(f"{master}, {1e3 * step:g} ms: {plain:.0f} µs of CPU a macro step", end=" ")
    print(f"({whole:.0f} with clocks, a ratio of {ratio(times, 'clocked', 'plain'):.2f})")
    print("| component | call | µs a macro step | calls | µs a call |\n|---|---|---|---|---|")
    for (name, call), (seconds, number) in sorted(booked.items(), key=lambda item: -item[1][0]):
        print(f"| {name} | {call} | {1e6 * seconds / n:.0f} | {number / n:.1f} | {1e6 * seconds / number:.1f} |")
    inside = 1e6 * sum(seconds for seconds, _ in booked.values()) / n
    print(f"| master | all else | {whole - inside:.0f} | | |")
    print(f"the master beside the FMUs: {(whole - inside) / inside:.2f}")


if __name__ == "__main__":
    main(*(kind(text) for kind, text in zip((float, str, float), sys.argv[1:], strict=False)))
