"""Error control inside a macro step: step doubling by rollback, a PI controller, sub-steps of H/2^k."""

from __future__ import annotations

import numpy as np

from orchestrator.coupling.exchange import EXCHANGES, is_motion, is_of_step, vectors
from orchestrator.coupling.graph.graph import Graph, Node
from orchestrator.coupling.stepping.loop import Loop
from orchestrator.coupling.stepping.report import StepReport
from orchestrator.coupling.stepping.scale import Scale

ORDER = EXCHANGES["waveform"].order  # a local error of one order more
SAFETY = 0.5  # the controller aims at this share of the tolerance
PROPORTIONAL, INTEGRAL = 0.4 / (ORDER + 1), 0.7 / (ORDER + 1)  # Hairer & Wanner 1996, IV.2, eq. (2.43c)
SHORTEST, LONGEST = 0.2, 5.0  # change of the length from one sub-step to the next
SMALLEST = 1e-4  # an error below this share of what is aimed at says no more; nor one so much above it


class StepControl:
    """Advances a macro step in sub-steps whose local error is below a tolerance.

    Sub-steps are made in pairs, h and h, then as one of 2h for the sake of its outputs; the difference of the motions over
    2^p - 1, p = 4, estimates the local error of the pair. The step of 2h begins at the loads that the pair found, in the
    mean, and need not be solved to the end: about a fifth of the pair's solves. Solved to the end, it tells the local error
    within a factor of three in nine pairs of ten; differences to a prediction, and jumps of the load, do not
    (docs/reference/masters.md). An error above the tolerance, or an iteration that does not converge: all is rolled back and h
    shortened. Otherwise a PI controller changes the length that is wanted by (S tol/e)^a (e before/S tol)^b, with e taken
    from h to that length by its fifth power.

    Communication with whoever records stays at the fixed macro steps; they are the longest pairs too, so a large macro
    step and a tolerance make the steps adaptive. What is wanted is rounded down to H/2^k, because Jacobians and columns
    serve one length each. The shortest pair is accepted whatever its error, which the report then shows.

    Parameters
    ----------
    tolerance : local error of an output, relative to the range it has gone through (x, y, z of a vector
        together)
    absolute : smallest such range, in the output's unit
    deepest : h is at least H/2^deepest
    """

    def __init__(self, master: Loop, tolerance: float, absolute: float, deepest: int):
        self.master, self.tolerance, self.deepest = master, tolerance, max(deepest, 1)
        self.range = Range(master.graph, absolute)

    def start(self) -> None:
        """Begin with whole macro steps."""
        self.wanted, self.last = np.inf, 1.0  # s, and e / (S tol) of the last pair
        self.range.start()

    def advance(self, t: float, H: float, report: StepReport) -> None:
        """Advance by the macro step `H`."""
        done, whole, worst, pairs = 0, 2 ** (self.deepest - 1), 0.0, 0
        while done < whole:
            length = self._length(done, whole, H)
            h = H * length / whole
            error = self._attempt(t + H * done / whole, h / 2, report, last=length == 1)
            if error > self.tolerance and length > 1:
                self.wanted = h * self._shortened(error)
                report.rejected += 1
                continue
            self.wanted = self._controlled(min(self.wanted, H), h, error)
            worst, done, pairs = max(worst, error), done + length, pairs + 1
        report.subdivisions += 2 * pairs - 1
        report.estimate = worst

    def _length(self, done: int, whole: int, H: float) -> int:
        """Return the longest H/2^k within what is wanted that begins where one of its length would, in the shortest."""
        length = whole
        while length > 1 and (done % length or H * length / whole > self.wanted * (1.0 + 1e-9)):
            length //= 2
        return length

    def _shortened(self, error: float) -> float:
        """Return by what factor a pair rejected for its `error` is shortened; by half if it did not converge."""
        if not np.isfinite(error):
            return 0.5
        return float(np.clip((error / (SAFETY * self.tolerance)) ** (-1.0 / (ORDER + 1)), SHORTEST, 0.5))

    def _controlled(self, wanted: float, h: float, error: float) -> float:
        """Return the length wanted next, s, after a pair of length `h` has been accepted with `error`."""
        ratio = error / (SAFETY * self.tolerance) * (wanted / h) ** (ORDER + 1)
        ratio = min(max(ratio, SMALLEST), 1.0 / SMALLEST)
        factor = ratio**-INTEGRAL * self.last**PROPORTIONAL
        self.last = ratio
        return wanted * float(np.clip(factor, SHORTEST, LONGEST))

    def _attempt(self, t: float, h: float, report: StepReport, *, last: bool) -> float:
        """Make two steps of length `h`; return their error. If it is too large, and not the `last` resort, all is as
        before."""
        master = self.master
        before = master.snapshot()
        try:
            error = self._pair(t, h, before, report, last=last)
            if error > self.tolerance and not last:
                master.revert(before)
            else:
                self.range.update()
        finally:
            master.graph.release(before[0])
        return error

    def _pair(self, t: float, h: float, before: tuple, report: StepReport, *, last: bool) -> float:
        """Make two steps of length `h`, then one of 2h; return the error, and leave all at the end of the two."""
        master = self.master
        if not master.attempt(t, h, report, last=last):
            return np.inf
        first = master.x
        if not master.attempt(t + h, h, report, last=last):
            return np.inf
        after, fine = master.snapshot(), master.graph.y.copy()

        def error() -> float:
            return self.range.norm(master.graph.y - fine) / (2**ORDER - 1)

        try:
            master.revert(before)
            guess, tolerance = joined(master.scale, first, master.x, h), max(master.tolerance, self.tolerance)
            made = master.trial(t, 2 * h, guess, tolerance, lambda: error() <= SAFETY * self.tolerance, report)
            found = error() if made else np.inf
            master.revert(after)
        finally:
            master.graph.release(after[0])
        return found


def joined(scale: Scale, first: np.ndarray, second: np.ndarray, h: float) -> np.ndarray:
    """Return the unknowns (n,) to start a step of length 2h from, given those of its halves: loads in the mean.

    With f = F1 + F1' (tau + h/2) before the middle and F2 + F2' (tau - h/2) after it, the projection on linear functions
    has the mean (F1 + F2)/2 and the slope 3 (F2 - F1)/(4h) + (F1' + F2')/8. Others take their last values.
    """
    rate = np.flatnonzero(scale.load != np.arange(scale.load.size))
    load, x = scale.load[rate], second.copy()
    x[load] = 0.5 * (first[load] + second[load])
    x[rate] = 0.75 / h * (second[load] - first[load]) + 0.125 * (first[rate] + second[rate])
    return x


class Range:
    """Peak-to-peak of the motions, by which their errors are measured.

    A motion is an output, with a mean as its companion, of a component whose inputs are all torn; if there is
    none, any output at an instant. Means over the step and rotations within it belong to one length of step
    and are left out.
    """

    def __init__(self, graph: Graph, absolute: float):
        self.graph, self.absolute = graph, absolute
        pairs = [(node, name) for node in graph.nodes for name in node.outputs.names]
        instants = [i for i, (_, name) in enumerate(pairs) if not is_of_step(name)]
        motions = [i for i in instants if _is_motion(graph, *pairs[i])]
        self.places = np.array(motions or instants, dtype=np.intp)
        self.vector = vectors([f"{pairs[i][0].name}.{pairs[i][1]}" for i in self.places])
        self.start()

    def start(self) -> None:
        """Begin at the present values."""
        self.low = self.graph.y[self.places]
        self.high = self.low.copy()

    def update(self) -> None:
        """Take the present values into account."""
        np.minimum(self.low, self.graph.y[self.places], out=self.low)
        np.maximum(self.high, self.graph.y[self.places], out=self.high)

    def norm(self, difference: np.ndarray) -> float:
        """Return the largest of `difference` (n_y,), relative to the range of its vector."""
        largest = np.zeros(int(self.vector.max(initial=-1)) + 1)
        np.maximum.at(largest, self.vector, self.high - self.low)
        scale = largest[self.vector] + self.absolute
        return float(np.max(np.abs(difference[self.places]) / scale, initial=0.0))


def _is_motion(graph: Graph, node: Node, name: str) -> bool:
    port = node.fmu.ports[name]
    moved = set(node.discrete_inputs.names) & (graph.feedthrough[node.name].get(port.variable) or frozenset())
    return not node.forward.size and not moved and is_motion(name, node.fmu.vocabulary)
