"""Where the microseconds of a macro step go: the landing 20 m from the tower, `interface_jacobian`, 5 s.

    python -m benchmarks.macro_step [MACRO_STEP [MASTER]]

A clock around every call to an FMU (about 0.3 µs a call itself, booked with the call). What is left is the master: least
squares, linear models, prediction, residuals, books, records.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

from orchestrator.coupling.fmu.group import Group
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.runs.coupled import run_coupled
from orchestrator.scenario.read import load

SCENARIO = Path(__file__).parents[1] / "scenarios" / "landing_200m_point9.toml"
CALLS = {Group: ("set", "get", "get_finite"), Fmu: ("step", "save", "restore", "release")}
SPENT: defaultdict[tuple[str, str], list[float]] = defaultdict(lambda: [0.0, 0.0])
"""Component and call → seconds, number."""


def clocked(function: Callable[..., Any], call: str) -> Callable[..., Any]:
    """Return `function`, a method of `Fmu` or `Group`, with a clock around it."""

    def timed(self: Fmu | Group, *arguments: Any) -> Any:
        start = perf_counter()
        try:
            return function(self, *arguments)
        finally:
            entry = SPENT[self.fmu.name if isinstance(self, Group) else self.name, call]
            entry[0] += perf_counter() - start
            entry[1] += 1

    return timed


def main() -> None:
    """Run once to warm up, once plain and once with the clocks; print the table."""
    step = float(sys.argv[1]) if len(sys.argv) > 1 else 0.005
    master = sys.argv[2] if len(sys.argv) > 2 else "interface_jacobian"
    scenario = load(SCENARIO).changed(stop_time=5.0, macro_step=step, master=master)
    run_coupled(scenario)
    plain = run_coupled(scenario).log
    for kind, calls in CALLS.items():
        for call in calls:
            setattr(kind, call, clocked(getattr(kind, call), call.removesuffix("_finite")))
    SPENT.clear()
    log = run_coupled(scenario).log
    n, unit = len(log.steps), 1e6 / len(log.steps)
    print(f"{master}, {1e3 * step:g} ms: {plain.wall * unit:.0f} µs a macro step ({log.wall * unit:.0f} with clocks), ")
    print("| component | call | µs a macro step | calls | µs a call |\n|---|---|---|---|---|")
    for (name, call), (spent, number) in sorted(SPENT.items(), key=lambda item: -item[1][0]):
        print(f"| {name} | {call} | {spent * unit:.0f} | {number / n:.1f} | {1e6 * spent / number:.1f} |")
    rest = log.wall - sum(spent for spent, _ in SPENT.values())
    print(f"| master | all else | {rest * unit:.0f} | | |")


if __name__ == "__main__":
    main()
