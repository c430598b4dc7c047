"""The coupling engine: many FMUs, connected and stepped together. It knows no cable, no robot, no scenario file.

    from orchestrator.coupling import Fmu, Graph, simulate

    with Graph({"a": Fmu("a.fmu"), "b": Fmu("b.fmu")}, ["a.x -> b.u", "b.y -> a.f"]) as graph:
        log = simulate(graph, "iqn_ils", start=0.0, stop=1.0, macro_step=0.01)
    log.time, log.signal("a.x"), log.units["a.x"]

*FMUs*: `Fmu` is one instance, `SubStepped` one that makes several steps in each of the master's, `FmuError` its failure.
*Graph*: `Graph` joins them, each output to an input by a `Connection`; `GraphError` says what cannot be.
*Inputs over time*: `Course`, a table of times and values; `read_courses` has those of a CSV file; `Graph(…, inputs=…)`.
*Masters*: `MASTERS` has them all by name; each is a class with its options as keyword arguments. A new one derives from
`Master`, or from `Implicit` with an `Accelerator` of its own; each macro step leaves a `StepReport`.
*Runs*: `simulate` makes a `Log`, of every communication point or of some (`Interval`); `read_table` reads a `Table` from a
file, `signal_errors` holds two of them against each other, `observed_order` is the slope of such errors over the step.

Names are imported when they are first used, so that importing this package costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from orchestrator.coupling.api import *  # noqa: F403

__all__ = [  # noqa: F405 (all in `api`)
    "MASTERS",
    "Accelerator",
    "Aitken",
    "Anderson",
    "Connection",
    "Course",
    "FixedPoint",
    "Fmu",
    "FmuError",
    "GaussSeidel",
    "Graph",
    "GraphError",
    "Implicit",
    "InputError",
    "InterfaceJacobian",
    "Interval",
    "IqnIls",
    "Jacobi",
    "Log",
    "Master",
    "Nepce",
    "ReducedInterface",
    "SemiImplicit",
    "SignalError",
    "StepReport",
    "SubStepped",
    "Table",
    "observed_order",
    "read_courses",
    "read_table",
    "signal_errors",
    "simulate",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from orchestrator.coupling import api

    return getattr(api, name)


def __dir__() -> list[str]:
    return sorted(__all__)
