"""Land power-line robots on a flexible cable: FMUs coupled, and held against a monolithic solver.

    import orchestrator

    run = orchestrator.run("landing_200m_point9", set={"robot.parameters.mass": 40.0}, stop=2.0)
    print(run.verdict, run["robot.roll"].values.max())

What is named here is imported when it is first used, so that ``import orchestrator`` takes no time.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from orchestrator.api import (
        Comparison,
        InputError,
        Run,
        RunError,
        Signal,
        compare,
        load_comparison,
        load_run,
        load_scenario,
        load_unfinished,
        run,
        sweep,
    )

__all__ = [
    "Comparison",
    "InputError",
    "Run",
    "RunError",
    "Signal",
    "compare",
    "load_comparison",
    "load_run",
    "load_scenario",
    "load_unfinished",
    "run",
    "sweep",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version  # 20 ms that `--help` need not wait for

        try:
            return version("line-landing")
        except PackageNotFoundError:  # a source tree that was never installed
            return "0+unknown"
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("orchestrator.api"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
