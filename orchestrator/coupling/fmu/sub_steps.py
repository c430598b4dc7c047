"""Multi-rate coupling: an FMU that makes several steps of its own in each step of the master."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from orchestrator.coupling.errors import digits
from orchestrator.coupling.exchange import MEAN, RATE, is_from_start, is_load, is_motion, suffixed
from orchestrator.coupling.fmu.binding import ERROR, SavedState
from orchestrator.coupling.fmu.description import NO_STRUCTURE, Port, Structure
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.group import Group
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.isolated import Limits

WHOLE = 1e-6  # how far a number of steps may be from a whole one


def instance(
    path: str | Path,
    name: str,
    steps: int = 1,
    continuous: Iterable[str] = (),
    isolate: bool | Limits = False,
    structure: Structure = NO_STRUCTURE,
) -> Fmu:
    """Return an instance of an FMU that makes `steps` steps in each of the master's; the others as for `Fmu`."""
    if steps == 1:
        return Fmu(path, name, continuous, isolate, structure)
    return SubStepped(path, name, steps, continuous, isolate, structure)


class SubStepped(Fmu):
    """An FMU that makes `steps` equal communication steps in each step of the master, for whom it looks like any other.

    *Inputs* within the step follow from their names, as everywhere (docs/methods/exchange.md). A load with a slope is
    F + Ḟ (tau - t - H/2), and is given as mean and slope over each sub-step. So that any real input has one, it gets
    an input ``_rate`` here if the FMU has none: masters then set it as they do for other FMUs, by their own rule of
    extrapolation or interpolation. A motion with a mean is the quadratic through start, end and mean; an FMU that
    takes such means takes all its other inputs at the ends, and they are linear between them. Discrete inputs are held.

    *Outputs* are those of the last sub-step; those that speak of the whole step are put together: means of a motion,
    the angle turned through and its mean, mean and slope of a load (the linear function nearest to the pieces in L²,
    so that the work of the load along a quadratic is that of the pieces).

    An FMU that cannot vary its step keeps its own, H/`steps` of the first step, whatever the master makes of H.

    Attributes
    ----------
    steps : sub-steps of a whole step
    held : (n + k,) the continuous inputs as set by the master, then the rates made up here
    ended : (n,) the inputs at the end of the last step
    given : (m,) outputs over the whole step
    """

    def __init__(
        self,
        path: str | Path,
        name: str | None,
        steps: int,
        continuous: Iterable[str] = (),
        isolate: bool | Limits = False,
        structure: Structure = NO_STRUCTURE,
    ):
        super().__init__(path, name, continuous, isolate, structure)
        if steps < 1:
            raise ValueError(f"{self.name}: steps = {steps}; at least one is made")
        self.steps, self.length, self.stepped = steps, 0.0, False
        self.capabilities = replace(self.capabilities, directional_derivatives=False)  # theirs know no sub-steps
        self._name_inputs()
        self._name_outputs()
        self.kept: dict[int | None, tuple[np.ndarray, np.ndarray]] = {}

    # -- what is what ---------------------------------------------------------------------------------------

    def _name_inputs(self) -> None:
        ports = self.ports
        names = [n for n, p in ports.items() if _is_continuous(p, "input")]
        known = self.vocabulary.intersection(names)
        motions = [n for n in names if is_motion(n, known)]
        means = [suffixed(n, MEAN) for n in motions]
        rates = [suffixed(n, RATE) for n in names if is_load(n, known)]
        alone = [n for n in names if n not in {*motions, *means, *rates}]
        wanted = [suffixed(n, RATE) for n in alone]
        self.made_up = [] if means else [rate for rate in wanted if rate not in ports]
        ports.update({rate: _rate_port(rate) for rate in self.made_up})
        self.declare(self.made_up)
        self.place = {n: i for i, n in enumerate([*names, *self.made_up])}
        loads = [n for n, rate in zip(alone, wanted, strict=True) if rate in self.place]
        self.load, self.slope = self._places(loads), self._places([suffixed(n, RATE) for n in loads])
        self.motion, self.mean = self._places(motions), self._places(means)
        self.from_start = np.array([is_from_start(n) for n in motions], dtype=bool)
        self.end = self._places([n for n in alone if means and n not in loads])
        self.inputs = Group(self, names)
        self.held = np.zeros(len(self.place))
        self.ended = np.zeros(len(names))

    def _places(self, names: Sequence[str]) -> np.ndarray:
        return np.array([self.place[n] for n in names], dtype=np.intp)

    def _name_outputs(self) -> None:
        names = [n for n, p in self.ports.items() if _is_continuous(p, "output")]
        known = self.vocabulary.intersection(names)
        motions = [n for n in names if is_motion(n, known)]
        turned = [n for n in motions if is_from_start(n)]
        plain = [suffixed(n, MEAN) for n in motions if n not in turned]
        loads = [n for n in names if is_load(n, known)]
        parts = [plain, turned, [suffixed(n, MEAN) for n in turned], loads, [suffixed(n, RATE) for n in loads]]
        stops = np.cumsum([0, *(len(part) for part in parts)])
        self.parts = [slice(a, b) for a, b in pairwise(stops.tolist())]
        self.outputs = Group(self, [n for part in parts for n in part])
        self.given = np.zeros(len(self.outputs.names))

    # -- like any other FMU ---------------------------------------------------------------------------------

    def group(self, names: Sequence[str], values: np.ndarray | None = None) -> Group:
        """Return a handle on several variables, those made up and those of the whole step among them."""
        return _Seen(self, names, values)

    def twin(self) -> Fmu:
        """Return a second instance with the same parameters, not initialised."""
        twin = SubStepped(self.path, self.name, self.steps, self.continuous, self.limits or False, self.structure)
        twin.set_parameters(self.parameters)
        if self.driven is not None:
            twin.follow(self.driven.courses, self.driven.taken)
        return twin

    def exit_initialization(self) -> None:
        """Leave initialisation mode."""
        super().exit_initialization()
        self.inputs.get()
        self.held[: self.ended.size] = self.ended = self.inputs.values.copy()
        self.outputs.get()
        self.given[:] = self.outputs.values

    def save(self) -> SavedState:
        """Return a handle on the complete state; to be given to `release` in the end."""
        state = super().save()
        self.kept[state.value] = self.ended, self.given.copy()
        return state

    def restore(self, state: SavedState) -> None:
        """Go back to a saved state (inputs too)."""
        super().restore(state)
        self.ended, given = self.kept[state.value]
        self.given[:] = given

    def release(self, state: SavedState) -> None:
        """Free a saved state."""
        del self.kept[state.value]
        super().release(state)

    def allows(self, h: float, H: float) -> bool:
        """Return whether steps `h` can be made where the master's own are `H`, s."""
        if self.capabilities.variable_step:
            return super().allows(h / self.steps, H)
        return _is_whole(h * self.steps / H)

    def begin(self, t: float, h: float) -> None:
        """Do nothing: its sub-steps are made one by one."""

    # -- a step ---------------------------------------------------------------------------------------------

    def step(self, t: float, h: float) -> None:
        """Advance from `t` to `t + h` (s) in sub-steps."""
        n = self._number(t, h)
        total = np.zeros_like(self.given)
        for i in range(n):
            self._enter(i / n, (i + 1) / n, h)
            super().step(t + i * h / n, h / n)
            if total.size:
                self.outputs.get()
                self._add(total, (i + 0.5) / n - 0.5, n, h)
        self.ended = self.held[: self.ended.size].copy()
        self.given, self.stepped = total, True

    def _number(self, t: float, h: float) -> int:
        if self.capabilities.variable_step:
            return self.steps
        self.length = self.length or h / self.steps
        if not _is_whole(h / self.length):
            raise FmuError(
                self.name,
                t,
                ERROR,
                f"a step of {digits(h)} s is no multiple of its own of {digits(self.length)} s, which it cannot vary "
                "(canHandleVariableCommunicationStepSize is false)",
            )
        return round(h / self.length)

    def _enter(self, a: float, b: float, h: float) -> None:
        """Set the inputs of the sub-step from a to b, in shares of the step `h`."""
        held, now, n = self.held, self.inputs.values, self.ended.size
        now[:] = held[:n]
        now[self.load] = held[self.load] + held[self.slope] * (h * ((a + b) / 2 - 0.5))
        now[self.end] = self.ended[self.end] + (held[self.end] - self.ended[self.end]) * b
        if self.motion.size:
            x1, mean = held[self.motion], held[self.mean]
            x0 = np.where(self.from_start, 0.0, self.ended[self.motion])
            curve = 6.0 * ((x0 + x1) / 2 - mean)
            rise = x1 - x0 - curve
            past = np.where(self.from_start, x0 + rise * a + curve * a**2, 0.0)
            now[self.motion] = x0 + rise * b + curve * b**2 - past
            now[self.mean] = x0 + rise * (a + b) / 2 + curve * (a**2 + a * b + b**2) / 3 - past
        if n:
            self.inputs.set()

    def _add(self, total: np.ndarray, centre: float, n: int, h: float) -> None:
        """Add what the sub-step around `centre` (-1/2 … 1/2 of the step) says to the outputs of the whole."""
        seen = self.outputs.values
        means, turned, turned_means, loads, slopes = self.parts
        total[means] += seen[means] / n
        total[turned_means] += (total[turned] + seen[turned_means]) / n
        total[turned] += seen[turned]
        total[loads] += seen[loads] / n
        total[slopes] += 12.0 * centre / (n * h) * seen[loads] + seen[slopes] / n**3


class _Seen(Group):
    """Variables of a sub-stepped FMU as its master sees them."""

    __slots__ = ("_inner_get", "_inner_set", "_made_up", "_put", "_real", "_whole", "buffer", "whole")

    def __init__(self, fmu: SubStepped, names: Sequence[str], values: np.ndarray | None):
        real = [i for i, name in enumerate(names) if name not in fmu.made_up]
        super().__init__(fmu, [names[i] for i in real])
        self.whole = fmu
        self.buffer, self._real = self.values, np.array(real, dtype=np.intp)
        self._inner_get, self._inner_set = self._get, self._set
        self._get, self._set = self._read, self._write
        self.names, self.ones = tuple(names), np.ones(len(names))
        self.values = np.zeros(len(names)) if values is None else values
        outputs = {name: i for i, name in enumerate(fmu.outputs.names)}
        self._put = _pairs(names, fmu.place)
        self._made_up = _pairs(names, {name: fmu.place[name] for name in fmu.made_up})
        self._whole = _pairs(names, outputs)

    def _read(self) -> int:
        status = self._inner_get()
        self.values[self._real] = self.buffer
        self.values[self._made_up[0]] = self.whole.held[self._made_up[1]]
        if self.whole.stepped:
            self.values[self._whole[0]] = self.whole.given[self._whole[1]]
        return status

    def _write(self) -> int:
        self.buffer[:] = self.values[self._real]
        self.whole.held[self._put[1]] = self.values[self._put[0]]
        return self._inner_set()


def _pairs(names: Sequence[str], places: Mapping[str, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return where names that have a place are among `names`, and those places, (m,) int each."""
    found = [(i, places[name]) for i, name in enumerate(names) if name in places]
    here, there = np.array(found, dtype=np.intp).reshape(-1, 2).T
    return here, there


def _is_continuous(port: Port, causality: str) -> bool:
    return port.causality == causality and port.kind == "real" and port.variability != "discrete"


def _rate_port(name: str) -> Port:
    return Port(name, -1, "", "real", "input", "continuous", None, "", name)


def _is_whole(number: float) -> bool:
    return round(number) >= 1 and abs(number - round(number)) <= WHOLE


def check_steps(components: Mapping[str, Fmu], H: float) -> None:
    """Raise `ValueError` if an FMU with a fixed internal step cannot be stepped at the macro step `H` (s)."""
    for name, fmu in components.items():
        steps = fmu.steps if isinstance(fmu, SubStepped) else 1
        internal = fmu.capabilities.internal_step
        if internal and not _is_whole(H / steps / internal):
            raise ValueError(
                f"{name}: its communication step of {digits(H / steps)} s (macro step {digits(H)} s, steps = {steps}) is no "
                f"multiple of its fixed internal step of {digits(internal)} s; change macro_step or steps"
            )
