"""What a run of an engine gives back."""

from __future__ import annotations

from dataclasses import dataclass

from orchestrator.coupling.run.results import Table


@dataclass(frozen=True)
class Run:
    """A run, or why there is none.

    Attributes
    ----------
    engine, master, macro_step : who ran, by which algorithm, and its step, s
    table : ``time`` and the case's signals at the points that are compared; empty if it did not come to its end
    solves : steps of the expensive component, those that were taken back included
    cpu : s of CPU of the loop over the macro steps, without loading, compiling and initialising
    unconverged : macro steps that did not reach the master's tolerance
    why : why there is no result
    """

    engine: str
    master: str
    macro_step: float
    table: Table
    solves: int = 0
    cpu: float = 0.0
    unconverged: int = 0
    why: str = ""
