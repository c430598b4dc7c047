"""The FMI calls of one instance, the same for FMI 2.0 and FMI 3.0.

FMPy loads the library and knows the signatures; the calls that are made in every macro step go past it, with
addresses converted once. Every call here returns the FMI status (0 ok, 1 warning, 2 discard, 3 error, 4
fatal).
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from ctypes import CFUNCTYPE, byref, c_bool, c_char, c_double, c_int, c_size_t, c_uint, c_void_p
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from fmpy import calloc, free
from fmpy.fmi1 import (
    FMICallException,
    FMU1Slave,
    fmi1CallbackAllocateMemoryTYPE,
    fmi1CallbackFreeMemoryTYPE,
    fmi1CallbackFunctions,
    fmi1CallbackLoggerTYPE,
)
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave
from fmpy.model_description import ModelDescription

from orchestrator.coupling.fmu.printf import logger

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
LABELS = ("ok", "warning", "discard", "error", "fatal", "pending")

TERMINATED = 3
"""Kind of status of FMI 2.0: whether the FMU wants the simulation to end."""
ROUNDING = 16 * np.finfo(float).eps
"""Relative distance of two times that are meant to be one."""
PYTHONFMU = "PythonFMU"
"""How the generation tool of FMUs is called whose messages are no formats."""
Call = Callable[[], int]
Sink = Callable[[int, str], None]
SavedState = c_void_p
"""Handle on the complete state of an instance."""


LOST = 1 << 32
"""In the place of a status, which has 32 bits: the process of the FMU has ended, or does not answer."""


class Identity(NamedTuple):
    """What of a description calls need: the `version` of FMI, the FMU's `identifier`, `guid` and the `tool` that made it."""

    version: str
    identifier: str
    guid: str
    tool: str

    @classmethod
    def of(cls, description: ModelDescription) -> Identity:
        """Return that of an FMU for co-simulation."""
        interface: Any = description.coSimulation
        words = (description.fmiVersion, interface.modelIdentifier, description.guid, description.generationTool)
        return cls(*(str(word or "") for word in words))


def _text(message: bytes | None) -> str:
    return (message or b"").decode("utf-8", "replace").strip()


class Fmi2:
    """One FMI 2.0 co-simulation instance.

    Parameters
    ----------
    identity : of the FMU
    folder : where the FMU is unzipped
    name : instance name
    sink : receives status and text of every message the FMU logs
    """

    TYPES: ClassVar[dict[str, tuple[str, type]]] = {
        "Real": ("Real", np.float64),
        "Integer": ("Integer", np.int32),
        "Enumeration": ("Integer", np.int32),
        "Boolean": ("Boolean", np.int32),
    }
    PREFIX, STATE, DERIVATIVE = "fmi2", "FMUstate", "fmi2GetDirectionalDerivative"

    def __init__(self, identity: Identity, folder: Path, name: str, sink: Sink):
        self.slave: Any = self._load(
            guid=identity.guid,
            modelIdentifier=identity.identifier,
            unzipDirectory=str(folder),
            instanceName=name,
        )
        self.sink = sink
        self.python = PYTHONFMU in identity.tool
        self._logger = logger(sink, final=self.python)  # kept as long as the FMU
        self._instantiate()
        self.component = self.slave.component
        self._do_step = self._raw(f"{self.PREFIX}DoStep", c_double, c_double, c_int)
        self._boolean_status = self._raw(f"{self.PREFIX}GetBooleanStatus", c_int, c_void_p)
        self._get_state = self._raw(f"{self.PREFIX}Get{self.STATE}", c_void_p)
        self._set_state = self._raw(f"{self.PREFIX}Set{self.STATE}", c_void_p)
        self._free_state = self._raw(f"{self.PREFIX}Free{self.STATE}", c_void_p)

    @staticmethod
    def _load(**arguments: Any) -> Any:
        return FMU2Slave(**arguments)

    def _instantiate(self) -> None:
        callbacks = fmi2CallbackFunctions()
        # FMPy's own logger goes through printf, which crashes on a stray '%'
        callbacks.logger = ctypes.cast(self._logger, fmi2CallbackLoggerTYPE)
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self.slave.instantiate(callbacks=callbacks, loggingOn=True)

    def _raw(self, function: str, *arguments: Any) -> Callable[..., int]:
        """Return a function of the library with its instance filled in; what is missing there answers with an error."""
        if not hasattr(self.slave.dll, function):
            return lambda *_: self._missing(function)
        prototype = CFUNCTYPE(c_uint, c_void_p, *arguments)  # a negative status is none
        return partial(prototype((function, self.slave.dll)), self.component)

    def _missing(self, function: str) -> int:
        self.sink(ERROR, f"the library has no {function}")
        return ERROR

    def accessor(self, verb: str, kind: str, vr: np.ndarray, values: np.ndarray, doing: str = "") -> Call:
        """Return the call that gets or sets (`verb`) all of `vr` (n,) from or into `values` (m,); both are
        kept. `doing` is for those who find an error later."""
        sizes = (c_size_t,) if self.PREFIX == "fmi2" else (c_size_t, c_void_p, c_size_t)
        arguments = (c_void_p, c_size_t, c_void_p) if len(sizes) == 1 else (c_void_p, *sizes)
        function = self._raw(f"{self.PREFIX}{verb}{kind}", *arguments)
        tail = () if len(sizes) == 1 else (values.size,)
        return partial(function, vr.ctypes.data, vr.size, values.ctypes.data, *tail)

    def directional_derivative(self, unknown: np.ndarray, known: np.ndarray, seed: np.ndarray, out: np.ndarray) -> int:
        """Write d(unknown)/d(known)·seed into `out`; value references are uint32."""
        if self.PREFIX == "fmi2":
            call = self._raw(self.DERIVATIVE, c_void_p, c_size_t, c_void_p, c_size_t, c_void_p, c_void_p)
            tail = (seed.ctypes.data, out.ctypes.data)
        else:
            types = (c_void_p, c_size_t, c_void_p, c_size_t, c_void_p, c_size_t, c_void_p, c_size_t)
            call = self._raw(self.DERIVATIVE, *types)
            tail = (seed.ctypes.data, seed.size, out.ctypes.data, out.size)
        return call(unknown.ctypes.data, unknown.size, known.ctypes.data, known.size, *tail)

    def begin_step(self, t: float, h: float, none_before: bool) -> None:
        """Do nothing: `do_step` makes the step."""

    @property
    def took(self) -> float:
        """Wall time of the last step, s: not measured here."""
        return 0.0

    def do_step(self, t: float, h: float, none_before: bool) -> int:
        """Advance from `t` to `t + h`; `none_before`: no state from before `t` will be restored any more."""
        return self._do_step(t, h, none_before)

    def asks_for_the_end(self, t: float) -> bool:
        """Return whether a step from `t` that was discarded says that the simulation shall end there."""
        if self.python:  # each of its discards says so
            return False
        value = c_int(0)
        return self._boolean_status(TERMINATED, byref(value)) <= WARNING and bool(value.value)

    @property
    def ends(self) -> bool:
        """Whether the step that has just been made shall be the last."""
        return False

    def get_state(self, state: SavedState) -> int:
        """Save the FMU's state in `state`."""
        return self._get_state(byref(state))

    def set_state(self, state: SavedState) -> int:
        """Take the state back."""
        return self._set_state(state)

    def free_state(self, state: SavedState) -> int:
        """Free a saved state."""
        return self._free_state(byref(state))

    def configure(self, values: Sequence[tuple[str, int, int]]) -> int:
        """Set structural parameters, type, reference and value of each, in configuration mode."""
        self.sink(ERROR, "structural parameters are those of FMI 3.0")
        return ERROR

    def enter_initialization(self, start: float, stop: float | None) -> int:
        """Set up the experiment and enter initialisation."""
        return self._checked(
            lambda: self.slave.setupExperiment(startTime=start, stopTime=stop),
            self.slave.enterInitializationMode,
        )

    def exit_initialization(self) -> int:
        """Leave initialisation."""
        return self._checked(self.slave.exitInitializationMode)

    @staticmethod
    def _checked(*calls: Callable[[], Any]) -> int:
        """Make FMPy's calls; its exception becomes a status again."""
        try:
            for call in calls:
                call()
        except FMICallException as error:
            return error.status
        return OK

    def set_string(self, vr: int, text: str) -> int:
        """Set one string."""
        return self._checked(lambda: self.slave.setString([vr], [text]))

    def get_string(self, vr: int) -> tuple[int, str]:
        """Return the status, and one string."""
        found: list[Any] = [""]
        status = self._checked(lambda: found.extend(self.slave.getString([vr])))
        return status, found[-1].decode() if isinstance(found[-1], bytes) else str(found[-1])

    def terminate(self) -> int:
        """Let the FMU end its run: some write their files only now."""
        return self._checked(self.slave.terminate)

    def free(self) -> int:
        """Free the instance; the library stays loaded (other instances use it)."""
        getattr(self.slave, f"{self.PREFIX}FreeInstance")(self.component)
        return OK


class Fmi3(Fmi2):
    """One FMI 3.0 co-simulation instance (no event mode, no early return)."""

    TYPES: ClassVar[dict[str, tuple[str, type]]] = {
        "Float64": ("Float64", np.float64),
        "Float32": ("Float32", np.float32),
        "Boolean": ("Boolean", np.bool_),
        "Enumeration": ("Int64", np.int64),
        **{f"Int{n}": (f"Int{n}", getattr(np, f"int{n}")) for n in (8, 16, 32, 64)},
        **{f"UInt{n}": (f"UInt{n}", getattr(np, f"uint{n}")) for n in (8, 16, 32, 64)},
    }
    PREFIX, STATE, DERIVATIVE = "fmi3", "FMUState", "fmi3GetDirectionalDerivative"

    @staticmethod
    def _load(**arguments: Any) -> Any:
        return FMU3Slave(**arguments)

    def _instantiate(self) -> None:
        self.slave.instantiate(logMessage=lambda _e, status, _c, text: self.sink(status, _text(text)), loggingOn=True)

    def __init__(self, identity: Identity, folder: Path, name: str, sink: Sink):
        super().__init__(identity, folder, name, sink)
        pointer = ctypes.c_void_p
        self._do_step = self._raw("fmi3DoStep", c_double, c_double, c_bool, pointer, pointer, pointer, pointer)
        self.flags = np.zeros(3, dtype=np.bool_)  # event handling needed, terminate, early return
        self.reached = np.zeros(1)
        base = self.flags.ctypes.data
        self._out = (base, base + 1, base + 2, self.reached.ctypes.data)

    def do_step(self, t: float, h: float, none_before: bool) -> int:
        """Advance from `t` to `t + h`; a step cut short counts as discard."""
        self.flags[:], self.reached[0] = False, t + h
        status = self._do_step(t, h, none_before, *self._out)
        if status <= WARNING and self._cut_short(t + h):
            self.sink(DISCARD, f"the FMU stopped at {self.reached[0]:g} s")
            return DISCARD
        return status

    def _cut_short(self, end: float) -> bool:
        """Return whether the step did not come to its `end`."""
        early = self.flags[2] or (self.flags[1] and self.reached[0] < end - ROUNDING * abs(end))
        return bool(early)

    def asks_for_the_end(self, t: float) -> bool:
        """Return whether a step from `t` that was discarded says that the simulation shall end there."""
        return bool(self.flags[1])

    @property
    def ends(self) -> bool:
        """Whether the step that has just been made shall be the last."""
        return bool(self.flags[1])

    def configure(self, values: Sequence[tuple[str, int, int]]) -> int:
        """Set structural parameters, type, reference and value of each, in configuration mode."""
        sets = [partial(getattr(self.slave, f"set{kind}"), [vr], [value]) for kind, vr, value in values]
        return self._checked(self.slave.enterConfigurationMode, *sets, self.slave.exitConfigurationMode)

    def enter_initialization(self, start: float, stop: float | None) -> int:
        """Enter initialisation."""
        return self._checked(lambda: self.slave.enterInitializationMode(startTime=start, stopTime=stop))


class Fmi1(Fmi2):
    """One FMI 1.0 co-simulation instance: no saved states, no initialisation mode, no derivatives.

    It is initialised with its start values, as the standard has it, and given its inputs afterwards.
    """

    TYPES: ClassVar[dict[str, tuple[str, type]]] = Fmi2.TYPES | {"Boolean": ("Boolean", np.int8)}

    def __init__(self, identity: Identity, folder: Path, name: str, sink: Sink):
        self._prefix = f"{identity.identifier}_"
        super().__init__(identity, folder, name, sink)
        self._do_step = self._raw("fmi2DoStep", c_double, c_double, c_char)

    @staticmethod
    def _load(**arguments: Any) -> Any:
        return FMU1Slave(**arguments)

    def _instantiate(self) -> None:
        self._callbacks = fmi1CallbackFunctions()
        self._callbacks.logger = ctypes.cast(self._logger, fmi1CallbackLoggerTYPE)
        self._callbacks.allocateMemory = fmi1CallbackAllocateMemoryTYPE(calloc)
        self._callbacks.freeMemory = fmi1CallbackFreeMemoryTYPE(free)
        self.slave.instantiate(functions=self._callbacks, loggingOn=True)

    def _raw(self, function: str, *arguments: Any) -> Callable[..., int]:
        """Return a function of the library, whose name begins with that of the model."""
        return super()._raw(self._prefix + function.replace("fmi2", "fmi"), *arguments)

    def do_step(self, t: float, h: float, none_before: bool) -> int:
        """Advance from `t` to `t + h`; the last step is never repeated."""
        return self._do_step(t, h, b"\x01")

    def asks_for_the_end(self, t: float) -> bool:
        """Return False: the standard knows no such wish."""
        return False

    def enter_initialization(self, start: float, stop: float | None) -> int:
        """Initialise."""
        return self._checked(lambda: self.slave.initialize(start, stop))

    def exit_initialization(self) -> int:
        """Do nothing: it is initialised."""
        return OK

    def free(self) -> int:
        """Free the instance; the library stays loaded (other instances use it)."""
        self.slave.fmi1FreeSlaveInstance(self.component)
        return OK


def binding_of(version: str) -> type[Fmi2]:
    """Return the calls of a version of FMI."""
    return {"1": Fmi1, "3": Fmi3}.get(version[:1], Fmi2)


def finalize_python(library: Any) -> None:
    """End the interpreter that a pythonfmu library keeps; without it the process may abort on its way out."""
    function = getattr(library, "finalizePythonInterpreter", None)
    if function is not None:
        function()
