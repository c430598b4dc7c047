"""Partial derivatives that an FMU gives itself (FMI's directional derivatives).

They hold at a communication point: in Initialization Mode for the initial unknowns as functions of the inputs, later for
outputs and state derivatives as functions of inputs and continuous states at that instant (FMI 2.0.5, 2.1.9, 2.2.8 and
4.3.1; FMI 3.0, 2.2.12 and 2.4.8). The response of an output over a step is another thing: see
`orchestrator.masters.jacobian`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orchestrator.coupling.fmu.binding import FATAL, WARNING
from orchestrator.coupling.fmu.instance import Fmu


class Partials:
    """The matrix d(unknowns)/d(knowns) of one FMU where it stands; one call of the FMU a column.

    Parameters
    ----------
    unknowns, knowns : names of real variables; elements of arrays (FMI 3.0) as ``name[1]``
    """

    def __init__(self, fmu: Fmu, unknowns: Sequence[str], knowns: Sequence[str]):
        self.fmu = fmu
        self.unknowns, self.knowns = _Serial(fmu, unknowns), _Serial(fmu, knowns)

    def __call__(self) -> np.ndarray | None:
        """Return the matrix (n_unknowns, n_knowns); None if the FMU does not answer, or not with numbers."""
        matrix = np.empty((self.unknowns.places.size, self.knowns.places.size))
        seed, sensitivity = self.knowns.values, self.unknowns.values
        for j, place in enumerate(self.knowns.places):
            seed[:], seed[place] = 0.0, 1.0
            call = self.fmu.fmi.directional_derivative
            status = call(self.unknowns.vr, self.knowns.vr, seed, sensitivity)
            if status >= FATAL:
                raise self.fmu.error(status, "the directional derivative")
            if status > WARNING:
                return None
            matrix[:, j] = sensitivity[self.unknowns.places]
        return matrix if np.all(np.isfinite(matrix)) else None


class _Serial:
    """Variables as the calls want them: references `vr`, all elements in `values`, and the `places` of those named."""

    def __init__(self, fmu: Fmu, names: Sequence[str]):
        runs = fmu.group(names).runs
        starts = np.cumsum([0, *(run.buffer.size for run in runs)])
        self.vr = np.concatenate([np.zeros(0, np.uint32), *(run.vr for run in runs)])
        self.values = np.zeros(int(starts[-1]))
        self.places = np.zeros(len(names), dtype=np.intp)
        for run, start in zip(runs, starts, strict=False):
            self.places[run.pick] = start + run.elements


def states(fmu: Fmu) -> tuple[list[str], list[str]]:
    """Return the names of the continuous states that an FMU shows and of their time derivatives, element by element."""
    shown = [u.variable for u in fmu.description.derivatives if u.variable is not None]
    pairs = [(v.derivative, v) for v in shown if v.derivative is not None]
    names: tuple[list[str], list[str]] = ([], [])
    for pair in pairs:
        for found, variable in zip(names, pair, strict=True):
            found += [name for name, port in fmu.ports.items() if port.variable == variable.name]
    return names
