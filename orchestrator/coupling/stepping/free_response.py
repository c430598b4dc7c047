"""What a component will show at the end of a step, foretold from its motion and from its last loads.

The outputs at the end of step n are taken as

    y(x) = K y₀ + e + Σ_j G_j x_{n-j} + J x,        j = 1 … L

with x the step's own unknowns (loads) and y₀ what the component shows at its start:

- K: what positions and their time means do at constant velocity;
- J, G_j: the response to a load in the step itself, and j steps later, of what K does not explain;
- e: the rest, that neither explains, extrapolated from the last steps by a polynomial.

The free motion of a flexible line is slow where its loads are not: e is smooth where x is rough.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from orchestrator.coupling.exchange import MEAN, base_of, is_from_start, rate_of
from orchestrator.coupling.fmu.binding import SavedState
from orchestrator.coupling.graph.graph import Node
from orchestrator.coupling.stepping.interpolation import Between, step_node

ORDER = 4
"""Degree of the polynomial; with 3 the landing needs 1.8 solves in the place of 1.4 (first 4 s, 5 ms)."""
MOST = 10
"""Steps that a load is remembered at most: each costs a solve for every unknown, once."""
_WEIGHTS = [np.array([(-1.0) ** i * comb(k, i + 1) for i in range(k)]) for k in range(1, ORDER + 2)]
"""Of the last k values, the newest first: the polynomial through them, one step further."""


@dataclass(frozen=True)
class Past:
    """One step of the past.

    Attributes
    ----------
    start, end : what was read at its start (n_read,), and the outputs at its end (n_y,)
    x : (m,) unknowns that acted
    rest : (n_y,) of the outputs at its end, what constant velocity does not explain
    """

    start: np.ndarray
    end: np.ndarray
    x: np.ndarray
    rest: np.ndarray


class FreeResponse:
    """Foretells the outputs of one component that answers nearly linearly to its unknowns.

    Parameters
    ----------
    node : the component; all its inputs are unknowns
    memory : s, how long a load is remembered once pulses have been made

    Attributes
    ----------
    pulses : length of step → G_1 … G_L side by side, (n_y, L m)
    past : length of step → its last steps, the newest first
    coasting : length of step → K, (n_y, n_read)
    start : (n_read,) what was read at the start of the step
    """

    def __init__(self, node: Node, memory: float):
        self.node, self.memory = node, memory
        names, ports = node.outputs.names, node.fmu.ports
        moved = [base_of(name, MEAN) or name for name in names]
        read = [*names, *(n for n in moved if not is_from_start(n)), *map(rate_of, moved)]
        self.read = node.fmu.group([n for n in dict.fromkeys(read) if n in ports and n in node.fmu.vocabulary])
        self.still, self.moving = _kinematics(names, self.read.names)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.pulses: dict[float, np.ndarray] = {}
        self.past: dict[float, tuple[Past, ...]] = {}
        self.coasting: dict[float, np.ndarray] = {}

    def begin(self) -> None:
        """Read what is needed at the start of a step."""
        self.read.get_finite()
        self.start = self.read.values.copy()

    def lags(self, H: float) -> int:
        """Return L, the number of steps of length `H` that a load is remembered."""
        return min(round(self.memory / H), MOST)

    def known(self, H: float) -> int:
        """Return by how many steps of this length the rest is known."""
        return max(len(self.past.get(H, ())) - (self.lags(H) if H in self.pulses else 0), 0)

    def seen(self, H: float, start: np.ndarray, end: np.ndarray, x: np.ndarray) -> Past:
        """Return what there is to remember of a step of length `H`: read at `start` (n_read,), shown at `end` (n_y,)."""
        return Past(start, end, x, end - self._coasted(start, H))

    def append(self, H: float, past: Past) -> None:
        """Remember a step of length `H` that was accepted."""
        self.past[H] = (past, *self.past.get(H, ()))[: ORDER + 1 + self.lags(H)]

    def foretold(self, H: float, jacobian: np.ndarray) -> np.ndarray:
        """Return the outputs at the end of the step that begins now, without its own loads, (n_y,); J is (n_y, m)."""
        past, lags, m = self.past[H], self.lags(H) if H in self.pulses else 0, jacobian.shape[1]
        weights = _WEIGHTS[min(ORDER + 1, self.known(H)) - 1]
        k, x = weights.size, np.concatenate([step.x for step in past])
        # what is extrapolated: the rests, less what these loads and the ones before them have done to them
        loads = weights @ np.array([x[i * m : (i + 1 + lags) * m] for i in range(k)])
        foretold = (
            self._coasted(self.start, H) + weights @ np.array([step.rest for step in past[:k]]) - jacobian @ loads[:m]
        )
        return foretold + self.pulses[H] @ (x[: lags * m] - loads[m:]) if lags else foretold

    def measure(
        self, t: float, H: float, x: np.ndarray, steps: np.ndarray, state: SavedState, between: Between
    ) -> np.ndarray:
        """Let the component answer to a pulse of each unknown; return J, (n_y, m), and leave it where it was.

        Parameters
        ----------
        x, steps : (m,) unknowns that act all the time, and heights of the pulses
        state : of the component at `t`
        """
        base = self._answer(t, H, x, np.zeros_like(x), state, between)
        each = [self._answer(t, H, x, pulse, state, between) - base for pulse in np.diag(steps)]
        self.node.fmu.restore(state)
        between.begin()
        responses = np.stack(each, axis=2) / steps
        self.pulses[H] = np.concatenate(list(responses[1:]), axis=1)
        return responses[0]

    def _answer(
        self, t: float, H: float, x: np.ndarray, pulse: np.ndarray, state: SavedState, between: Between
    ) -> np.ndarray:
        """Return what the kinematics do not explain of this and the next steps, (L + 1, n_y), `pulse` acting in this one."""
        node, start, rows = self.node, self.start, []
        own = slice(node.first, node.first + x.size)
        node.fmu.restore(state)
        between.begin()
        for j in range(self.lags(H) + 1):
            node.inputs.values[:] = x if j else x + pulse
            ends = node.inputs.values.copy()
            step_node(between, node, t + j * H, H)
            rows.append(node.outputs.values - self._coasted(start, H))
            between.start_values[own] = ends
            self.read.get_finite()
            start = self.read.values.copy()
        return np.array(rows)

    def joined(self, H: float, first: Past, second: Past, x: np.ndarray) -> Past:
        """Return two equal steps that follow each other as one of length `H`, with the unknowns `x` (m,) for both."""
        end, place = second.end.copy(), {name: i for i, name in enumerate(self.node.outputs.names)}
        for name, i in place.items():
            base = base_of(name, MEAN)
            if is_from_start(name):
                end[i] = first.end[i] + second.end[i]
            elif base is not None:
                before = first.end[place[base]] if is_from_start(base) and base in place else 0.0
                end[i] = 0.5 * (first.end[i] + before + second.end[i])
        return self.seen(H, first.start, end, x)

    def _coasted(self, start: np.ndarray, H: float) -> np.ndarray:
        """Return the outputs after `H` at constant velocity, (n_y,)."""
        if H not in self.coasting:
            self.coasting[H] = self.still + H * self.moving
        return self.coasting[H] @ start


def _kinematics(names: tuple[str, ...], read: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return what outputs are of what was read at the start, (n_y, n_read) each: as it was, and for each second."""
    place = {name: i for i, name in enumerate(read)}
    still, moving = np.zeros((len(names), len(read))), np.zeros((len(names), len(read)))
    for i, name in enumerate(names):
        base = base_of(name, MEAN) or name
        rate = place.get(rate_of(base))
        if rate is not None:
            moving[i, rate] = 1.0 if base == name else 0.5
        if not is_from_start(base):
            still[i, place.get(base, place[name])] = 1.0
    return still, moving
