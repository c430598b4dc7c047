"""One instance of an FMU behind fast buffers.

Loading goes through FMPy; what happens in every macro step (get, set, step, save, restore) goes through
reused buffers: 12 real values cost 2 µs to 3 µs. Failures of any kind leave as `FmuError`.
"""

from __future__ import annotations

import atexit
import contextlib
import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any, Self

import fmpy
import numpy as np

from orchestrator.coupling.cache import remove
from orchestrator.coupling.course import Course
from orchestrator.coupling.errors import FORWARD, digits, nearest
from orchestrator.coupling.exchange import PARAMETER
from orchestrator.coupling.fmu.binding import (
    DISCARD,
    ERROR,
    FATAL,
    LABELS,
    LOST,
    ROUNDING,
    WARNING,
    Fmi2,
    Identity,
    SavedState,
    binding_of,
    finalize_python,
)
from orchestrator.coupling.fmu.description import (
    NO_STRUCTURE,
    STRUCTURAL,
    Port,
    Structure,
    Value,
    capabilities_of,
    ports_of,
    read_description,
    structure_of,
)
from orchestrator.coupling.fmu.driven import Driven
from orchestrator.coupling.fmu.failure import CRASHED, NOT_FINITE, FmuEnd, FmuError
from orchestrator.coupling.fmu.group import Group
from orchestrator.coupling.fmu.isolated import Isolated, Limits
from orchestrator.coupling.fmu.messages import Messages, gist
from orchestrator.coupling.fmu.nursery import POSSIBLE
from orchestrator.coupling.fmu.python_modules import is_python, own_modules
from orchestrator.coupling.fmu.saved_states import SavedStates
from orchestrator.coupling.fmu.unzipped import RESOURCES, own_copy, unzip
from orchestrator.coupling.fmu.vocabulary import vocabulary_of

logging.getLogger("fmus").addHandler(logging.NullHandler())  # what our FMUs say comes through FMI, like that of others

SHORTER = "; a smaller macro step may help"
FIXED = "; it cannot vary its step (canHandleVariableCommunicationStepSize is false), take the macro step that it is made for"
CURES = {DISCARD: SHORTER, NOT_FINITE: SHORTER}


class Fmu:
    """One instance of a co-simulation FMU (FMI 1.0, 2.0 or 3.0); a context manager that frees it at its end.

    Parameters
    ----------
    path : the ``.fmu`` file
    name : instance name; the model's name if none is given
    continuous : real variables that it declares discrete, and are not
    isolate : whether it lives in a process of its own (docs/reference/fmus.md), and within which limits
    structure : values of structural parameters (FMI 3.0), on which the lengths of arrays hang

    Attributes
    ----------
    folder : where it is unzipped
    ports : the variables by name
    vocabulary : the names among them that mean what they say (`orchestrator.coupling.exchange`): ``X_rate`` is there if its
        unit is that of X per second, or if it is declared to be the slope of X
    log : its messages
    parameters : what `set_parameters` was given
    driven : the inputs that follow courses over time, if any
    solves, wall : steps made and the seconds spent in them
    time, stop : s, start of the last step; where the run ends, nan where nobody says it
    busy_since : clock at which the running call began, 0 when none runs
    worst : highest FMI status that a call came back with, beyond warning
    abandoned : a call of this run was given up and may still return: nothing of it may be touched any more
    limits : of its own process; None where it lives in ours
    fate : status and words of the end of that process, once it has ended
    """

    def __init__(
        self,
        path: str | Path,
        name: str | None = None,
        continuous: Iterable[str] = (),
        isolate: bool | Limits = False,
        structure: Structure = NO_STRUCTURE,
    ):
        self.path = Path(path)
        self.description, self.sha256 = read_description(self.path)
        self.name = name or str(self.description.modelName)
        self.structure = _known_structure(self, structure)
        self.ports = {p.name: p for v in self.description.modelVariables for p in ports_of(v, self.structure)}
        self.continuous = tuple(continuous)
        self.ports |= {name: _continuous(self, name) for name in self.continuous}
        self.vocabulary = vocabulary_of(self.description, self.ports)
        self.capabilities = capabilities_of(self.description)
        self.log = Messages()
        self.parameters: dict[str, Value] = {}
        self.driven: Driven | None = None
        self._states = SavedStates()
        self.solves, self.wall, self.time, self.busy_since = 0, 0.0, 0.0, 0.0
        self._begun: tuple[float, float, bool] | None = None
        self.stop = np.nan
        self.worst, self.initialized = 0, False
        self.abandoned = False
        self.fate: tuple[int, str] | None = None
        self._own: Path | None = None
        self.limits = isolate if isinstance(isolate, Limits) else Limits() if isolate else None
        if self.limits and not POSSIBLE:
            self.limits = None
            self.log.add(WARNING, "there are no processes for FMUs on this system: it lives in ours")
        _require_possible(self)
        try:
            self.folder = self._own_folder(unzip(self.path, self.sha256))
            self.fmi = self._loaded()
        except FmuError:
            self._remove_own()
            raise
        except Exception as error:
            self._remove_own()
            hint = f" ({self.log.cause})" if self.log.cause else ""
            raise ValueError(f"{self.path}: the FMU cannot be loaded: {error}{hint}") from error
        _instances.append(self)
        if self.structure:
            self._configure()

    def _own_folder(self, unzipped: Path) -> Path:
        """Return where this instance finds its files: its own copy if it can write them, and no other shares its process.

        FMUs in Python that share ours share their scripts, too: a module of one name is loaded once.
        """
        alone = self.limits is not None or not is_python(unzipped)
        self._own = own_copy(unzipped) if alone and (unzipped / RESOURCES).is_dir() else None
        return self._own or unzipped

    def _remove_own(self) -> None:
        """Remove the copy of this instance alone, if there is one."""
        if self._own is not None:
            remove(self._own)

    def _configure(self) -> None:
        """Set the structural parameters; the instance is freed where that fails."""
        ports = [(self.ports[name], value) for name, value in self.structure.items()]
        values = [(port.fmi_type, port.vr, value) for port, value in ports]
        try:
            self._call("setting structural parameters", self.fmi.configure, values)
        except BaseException:
            self.close()
            raise

    def _loaded(self) -> Fmi2 | Isolated:
        """Load the library and make the instance, here or in a process of its own."""
        identity = Identity.of(self.description)
        if self.limits is not None:
            return Isolated(identity, self.folder, self.name, self, 8 * len(self.ports), self.limits)
        others = [other.folder for other in _instances if other.limits is None]
        # FMPy stays in the library's folder if that cannot be loaded
        with own_modules(self.folder, others), contextlib.chdir("."):
            return binding_of(identity.version)(identity, self.folder, self.name, self.log.add)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def error(self, status: int, doing: str, cure: str = "") -> FmuError:
        """Return the error for a call that came back with `status`."""
        if status >= LOST:
            return self._lost(doing)
        label = LABELS[status] if 0 <= status < len(LABELS) else f"unknown status {status}"
        self.worst = max(self.worst, status)
        known = status if DISCARD <= status <= FATAL else ERROR
        return self.failure(known, f"{doing} came back with {label}", cure)

    def state_error(self, status: int, doing: str) -> FmuError:
        """Return the error for a state that cannot be saved or taken back."""
        return self.error(max(status, ERROR), doing, f"; {FORWARD}")

    def _lost(self, doing: str) -> FmuError:
        """Return the error for a call during which the FMU's process came to its end."""
        self.worst = FATAL
        status, what = self.fate or (CRASHED, "it has been closed")
        said = f"; its last words: {gist(self.log.last)}" if self.log.last else ""
        return FmuError(self.name, self.time, status, f"{doing}: {what}{said}")

    def failure(self, status: int, what: str, cure: str = "") -> FmuError:
        """Return the error that says `what` happened, with the FMU's own last words and a cure."""
        said = f"; the FMU says: {self.log.cause}" if self.log.cause else ""
        return FmuError(self.name, self.time, status, what + said + (cure or self._cure(status)))

    def _cure(self, status: int) -> str:
        """Return what may help: a smaller step where one has failed, and the FMU can make others."""
        return CURES.get(status, "") if self.solves and self.capabilities.variable_step else ""

    @property
    def closed(self) -> bool:
        """Whether the instance has been freed."""
        return self not in _instances

    def _require_open(self) -> None:
        if self.closed:  # a call would end the process
            raise ValueError(f"{self.name}: has been closed; load the FMU once more")

    def port(self, name: str) -> Port:
        """Return the port; `ValueError` names the nearest one."""
        self._require_open()
        if name not in self.ports:
            raise ValueError(f"{self.name}: no variable {name}{nearest(name, self.ports)}")
        return self.ports[name]

    def limit(self, timeout: float) -> None:
        """Let a call take no longer than `timeout` (s) from now on; only in a process of its own can that be made true."""
        if isinstance(self.fmi, Isolated):
            self.fmi.limit(timeout)

    def declare(self, names: Iterable[str]) -> None:
        """Take `names` for what they say, whatever their units: ``force_rate`` for the slope of ``force``."""
        self.vocabulary |= {self.port(name).name for name in names}

    def set_parameters(self, values: Mapping[str, Value]) -> None:
        """Set parameters (and start values of inputs) before initialisation.

        Parameters
        ----------
        values : name → value; a Boolean for a Boolean, a word for a string, a number for the rest
        """
        for name, value in values.items():
            port = self.port(name)
            if port.causality == STRUCTURAL:
                self._require_set(name, value)
                continue
            if port.causality not in ("parameter", "input"):
                raise ValueError(f"{self.name}.{name} is no parameter: its causality is {port.causality}")
            self._set_one(port, value)
        self.parameters |= values

    def _require_set(self, name: str, value: Value) -> None:
        """Raise `ValueError` if a structural parameter has another value than the instance was made with."""
        known = self.structure.get(name, int(self.ports[name].start or 0))
        if value != known:
            raise ValueError(
                f"{self.name}.{name} is a structural parameter, on which arrays hang: give structure = {{{name!r}: {value}}} "
                "when the instance is made"
            )

    def follow(self, courses: Mapping[str, Course], taken: Iterable[str] = ()) -> None:
        """Let inputs follow `courses` over time: each step is given their means, and slopes where there are inputs for them.

        Parameters
        ----------
        courses : input → its course
        taken : other inputs that are set from elsewhere, by a connection for instance
        """
        self.driven = Driven(self, courses, {*self.parameters, *taken}) if courses else None

    @property
    def own_step(self) -> float | None:
        """The step size of its default experiment, s; None where it names none."""
        default = self.description.defaultExperiment
        return float(default.stepSize) if default is not None and default.stepSize else None

    @property
    def exchange(self) -> str:
        """What the FMU assumes of the motion inside a step (`held`, `point`, …), empty if it has no such parameter."""
        port = self.ports.get(PARAMETER)
        return "" if port is None else str(self.parameters.get(PARAMETER, port.start or ""))

    def twin(self) -> Fmu:
        """Return a second instance with the same parameters, not initialised."""
        twin = Fmu(self.path, self.name, self.continuous, self.limits or False, self.structure)
        twin.set_parameters(self.parameters)
        if self.driven is not None:
            twin.follow(self.driven.courses, self.driven.taken)
        return twin

    def _set_one(self, port: Port, value: Value) -> None:
        if (port.kind == "string") != isinstance(value, str):
            raise ValueError(f"{self.name}.{port.name} is of type {port.kind}; {value!r} does not fit")
        if isinstance(value, str):
            status = self.fmi.set_string(port.vr, value)
            if status > WARNING:
                raise self.error(status, f"setting {port.name}")
            return
        if not self._fits(port, value):
            raise ValueError(f"{self.name}.{port.name} is of type {port.fmi_type}; {value!r} does not fit")
        group = self.group([port.name])
        group.values[0] = float(value)
        group.set()

    def _fits(self, port: Port, value: Value) -> bool:
        """Return whether a number can be given to `port` as it is."""
        if port.kind == "real":
            return True
        number = int(value)
        limits = (0, 1) if port.kind == "boolean" else np.iinfo(self.fmi.TYPES[port.fmi_type][1])
        low, high = limits if isinstance(limits, tuple) else (limits.min, limits.max)
        return number == value == float(number) and low <= number <= high

    def write(self, name: str, value: Value) -> None:
        """Set one variable, of any type (slow)."""
        self._set_one(self.port(name), value)

    def read(self, name: str) -> Value:
        """Return one variable, of any type (slow)."""
        port = self.port(name)
        if port.kind == "string":
            status, text = self.fmi.get_string(port.vr)
            if status > WARNING:
                raise self.error(status, f"reading {name}")
            return text
        group = self.group([name])
        group.get()
        number = float(group.values[0])
        return {"real": number, "integer": int(number), "boolean": bool(number)}[port.kind]

    def group(self, names: Sequence[str], values: np.ndarray | None = None) -> Group:
        """Return a handle on several variables; `values` (n,) is the buffer to use, if there is one
        already."""
        return Group(self, names, values)

    def enter_initialization(self, start: float, stop: float | None = None) -> None:
        """Set up the experiment and enter initialisation mode."""
        self._require_open()
        self.time, self.stop = start, np.nan if stop is None else stop
        self._call("initialisation", self.fmi.enter_initialization, start, stop)
        if self.driven is not None:
            self.driven.set_instant(start)

    def exit_initialization(self) -> None:
        """Leave initialisation mode."""
        self._call("end of initialisation", self.fmi.exit_initialization)
        self.initialized = True

    def _call(self, doing: str, function: Any, *arguments: Any) -> None:
        self.log.begin()
        self.busy_since = perf_counter()
        try:
            status = function(*arguments)
        finally:
            self.busy_since = 0.0
        if status > WARNING:
            raise self.error(status, doing)

    def begin(self, t: float, h: float) -> None:
        """Start the step from `t` to `t + h` (s), where that can go on by itself; `step` then waits for its end."""
        self._begin(t, h)

    def _begin(self, t: float, h: float) -> None:
        if t + h != self.stop and abs(self.stop - t - h) <= ROUNDING * abs(self.stop):
            h = self.stop - t
        self.time = t
        self.solves += 1
        if self.driven is not None:
            self.driven.set_step(t, h)
        self.log.begin()
        made = t, h, self._states.none_before(t)
        self.fmi.begin_step(*made)
        self._begun = made

    def step(self, t: float, h: float) -> None:
        """Advance from `t` to `t + h` (s) with the inputs set before; a step that ends at the stop time ends there exactly."""
        if self._begun is None:
            self._begin(t, h)
        assert self._begun is not None
        (t, h, none_before), self._begun = self._begun, None
        self.busy_since = perf_counter()
        try:
            status = self.fmi.do_step(t, h, none_before)
        finally:
            self.wall += self.fmi.took if self.limits else perf_counter() - self.busy_since
            self.busy_since = 0.0
        if status == DISCARD and self.fmi.asks_for_the_end(t):
            raise FmuEnd(self.name, t)
        if status > WARNING:
            raise self.error(status, f"the step of {digits(h)} s", "" if self.capabilities.variable_step else FIXED)
        self._states.stepped(t + h)
        if self.driven is not None and self.driven.shown:
            self.driven.set_instant(t + h)

    def allows(self, h: float, H: float) -> bool:
        """Return whether steps `h` can be made where the master's own are `H`, s."""
        internal = self.capabilities.internal_step
        return self.capabilities.variable_step and not (internal and abs(h / internal - round(h / internal)) > 1e-6)

    def save(self) -> SavedState:
        """Return a handle on the complete state; to be given to `release` in the end."""
        state = SavedState()
        status = self.fmi.get_state(state)
        if status > WARNING:
            raise self.state_error(status, "saving the state")
        self._states.saved(state)
        return state

    def restore(self, state: SavedState) -> None:
        """Go back to a saved state (inputs too)."""
        status = self.fmi.set_state(state)
        if status > WARNING:
            raise self.state_error(status, "restoring the state")
        self._states.restored(state)

    def release(self, state: SavedState) -> None:
        """Free a saved state."""
        self._states.released(state)
        self.fmi.free_state(state)

    def close(self) -> None:
        """End and free the instance, as far as FMI allows it; does nothing the second time."""
        if self.closed or self.busy_since:  # a call that hangs in there would not let this one through
            return
        _instances.remove(self)
        if self.initialized and self.worst < ERROR:
            self._bid("the end of the run", self.fmi.terminate)
        if self.worst < FATAL:
            self._bid("freeing it", self.fmi.free)
        if isinstance(self.fmi, Isolated):
            self.fmi.dismiss()
        else:
            _libraries.append(self.fmi.slave.dll)
        self._remove_own()

    def _bid(self, doing: str, call: Callable[[], int]) -> None:
        """Make one of the last calls; the results are there, so that its failure is said in the log alone."""
        try:
            status = call()
        except FmuError as error:
            self.log.add(ERROR, error.message)
        else:
            if status > WARNING:
                self.log.add(ERROR, self.error(status, doing).message)


def _known_structure(fmu: Fmu, structure: Structure) -> Structure:
    """Return values of structural parameters; `ValueError` where one is none, or arrays become too large."""
    found = structure_of(fmu.description, structure)
    unknown = next((name for name in structure if name not in found), None)
    if unknown is not None:
        raise ValueError(f"{fmu.name}: {unknown} is no structural parameter with a whole number, of {fmu.path.name}")
    return found


def _continuous(fmu: Fmu, name: str) -> Port:
    """Return a real variable as a continuous one; `ValueError` where there is none."""
    if name not in fmu.ports:
        raise ValueError(f"{fmu.name}: continuous: no variable {name}{nearest(name, fmu.ports)}")
    if fmu.ports[name].kind != "real":
        raise ValueError(f"{fmu.name}: continuous: {name} is of type {fmu.ports[name].fmi_type}; only reals can be")
    return replace(fmu.ports[name], variability="continuous")


def _require_possible(fmu: Fmu) -> None:
    """Raise `ValueError` if the FMU cannot run here, or not once more."""
    here = fmpy.platform_tuple if str(fmu.description.fmiVersion).startswith("3") else fmpy.platform
    there = fmpy.supported_platforms(str(fmu.path))
    if fmpy.platform not in there:
        has = f"it has {', '.join(there)}" if there else "it has none at all"
        raise ValueError(f"{fmu.path}: the FMU has no binary for {here} ({has}); export it for this platform")
    interface: Any = fmu.description.coSimulation
    here_too = any(other.sha256 == fmu.sha256 for other in _instances if other.limits is None)
    if interface.canBeInstantiatedOnlyOncePerProcess and fmu.limits is None and here_too:
        raise ValueError(
            f"{fmu.path}: can be instantiated only once per process, {fmu.name} would be the second, and a copy of the file "
            "is the same FMU; give each a process of its own (isolate = true), or export the model once more under another "
            "name (another modelIdentifier)"
        )


_instances: list[Fmu] = []
_libraries: list[Any] = []


def any_abandoned() -> bool:
    """Return whether a call of any FMU was given up."""
    return any(fmu.abandoned for fmu in _instances)


@atexit.register
def _close_all() -> None:
    """Free what is left and end the interpreters that the libraries keep."""
    if any_abandoned() or any(fmu.busy_since for fmu in _instances):
        return  # a call still hangs in there: touching it would hang the exit too
    for fmu in list(_instances):
        fmu.close()
    for library in {library._handle: library for library in _libraries}.values():
        finalize_python(library)
