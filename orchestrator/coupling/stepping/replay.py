"""Whether components come back bit for bit: masters that repeat steps rely on it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable

import numpy as np

from orchestrator.coupling.errors import FORWARD
from orchestrator.coupling.fmu.binding import ERROR
from orchestrator.coupling.fmu.description import Port
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.group import Group
from orchestrator.coupling.graph.graph import Node

REPLAY = 1e-12  # relative difference of the outcomes of the same step from the same state


def check_replay(nodes: Iterable[Node], t: float, H: float) -> None:
    """Step every component twice from the same state; `FmuError` if the outputs differ."""
    for node in nodes:
        outputs = node.fmu.group([p.name for p in node.fmu.ports.values() if _is_real_output(p)])
        state, outcomes = node.fmu.save(), []
        for _ in range(2):
            # what fails here fails again in the step, and is dealt with there
            with contextlib.suppress(FmuError):
                node.inputs.set()
                node.fmu.step(t, H)
                outputs.get_finite()
                outcomes.append(outputs.values.copy())
            node.fmu.restore(state)
        node.fmu.release(state)
        if len(outcomes) == 2:
            _compare(outputs, t, outcomes[0], outcomes[1])


def _is_real_output(port: Port) -> bool:
    return port.causality == "output" and port.kind == "real"


def _compare(outputs: Group, t: float, first: np.ndarray, second: np.ndarray) -> None:
    """Raise `FmuError` if the two outcomes of the same step (n,) are not the same."""
    difference = np.abs(first - second) - REPLAY * (np.abs(first) + np.abs(second))
    if not np.any(difference > 0.0):
        return
    worst = int(np.argmax(difference))
    raise FmuError(
        outputs.fmu.name,
        t,
        ERROR,
        f"the same step from the same saved state gives {outputs.names[worst]} = {first[worst]:.9g}, then "
        f"{second[worst]:.9g}: its state is not saved completely; {FORWARD}",
    )
