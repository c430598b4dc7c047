"""The energy that a coupling makes, and how much of it a master lets pass.

The load x that acts in a step and the load S(x) that its giver has computed differ by the residual r. Across the interface
the difference does the work -r·Δ, with Δ the motion (and for slopes its moment about the middle of the step): energy that
nobody has given. It is known exactly as soon as the step has been made, of either sign, and small with the residual
(`Work.residual`). A step is accepted if its residual is below the tolerance *and* the sum of what was made stays within a
budget T; else it is corrected once more. So a passive giver and passive receivers make a passive whole at any tolerance:

    energy of the whole ≤ what it was at the start + T,        T = 0, or what the givers have dissipated by then

with the second the whole is passive as well: what it makes, its own contacts have taken out.
"""

from __future__ import annotations

import numpy as np

from orchestrator.coupling.fmu.group import Group
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.stepping.work import Work

BUDGETS = ("dissipated", "none")
DISSIPATED = "dissipated_energy"
"""Output by which a component that gives loads shows what it has dissipated, J."""


class EnergyAccount:
    """What the interfaces of a graph have made, and may make.

    Parameters
    ----------
    work : books the work; what has no giver that is told the motion is not in the account
    budget : ``dissipated``: as much as the components that give the loads have dissipated; a number: so much, J; ``none``: no
        limit
    """

    def __init__(self, graph: Graph, work: Work, budget: str | float):
        if budget not in BUDGETS and not _is_energy(budget):
            raise ValueError(f"energy_budget {budget!r}: choose {', '.join(BUDGETS)} or a number of joules, 0 or more")
        self.fixed = 0.0 if isinstance(budget, str) else float(budget)
        self.work, self.limited = work, budget != "none" and bool(work.givers)
        givers = work.givers if budget == "dissipated" else []
        self.shown: list[Group] = [
            graph.components[name].group([DISSIPATED]) for name in givers if DISSIPATED in graph.components[name].ports
        ]

    def allows(self, H: float) -> bool:
        """Return whether the step of length `H` that has just been made, not yet accepted, keeps to the budget."""
        if not self.limited:
            return True
        made = self.work.tried(H)
        allowed = made <= 0.0 or made <= self._budget()
        if not allowed:
            self.work.forget()
        return allowed

    def _budget(self) -> float:
        """Return the energy that may have been made by now, J."""
        for group in self.shown:
            group.get()
        return self.fixed + float(np.sum([group.values[0] for group in self.shown]))


def _is_energy(budget: object) -> bool:
    return isinstance(budget, int | float) and not isinstance(budget, bool) and 0.0 <= budget < np.inf
