"""The FMU face of a module: a pythonfmu slave around its table, values, state and three methods.

What pythonfmu leaves to us, and where it is done here:

* No exception may leave a method unprepared: pythonfmu then releases class, instance and log queue once too
  often and crashes when the instance is freed. `_fatal` takes those references in advance, so that the
  master gets status *fatal* with the message instead of a crash.
* A step that fails is discarded and leaves the FMU as it was before the step.
* Saved states are copies of the two arrays, complete and a few microseconds each.

Status a master sees: a failed step is *discard*; a failed initialisation, a parameter set after it, a wrong
value reference are *fatal*; outputs that cannot be calculated are NaN, with a message.
"""

from __future__ import annotations

import _thread
import contextlib
import ctypes
import hashlib
import logging
import math
import os
import struct
import sys
import traceback
from collections.abc import Iterable
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from fmus.module.recipe import Module
from fmus.module.variables import Kind, ModuleError, Value, VariableTable

LOGGER = logging.getLogger("fmus")
"""Repeats the messages of FMUs: masters often leave the FMU's own logging off."""

HEADER = struct.Struct("<8s16sBBdqqq")
MAGIC = b"LLSTATE1"


class FmuError(Exception):
    """Leaves the FMU on purpose: the master gets status *fatal* with this message."""


class Phase(IntEnum):
    """Where the instance is in the life FMI prescribes."""

    INSTANTIATED = 0
    INITIALIZING = 1
    STEPPING = 2


class SavedState(NamedTuple):
    """Everything that changes in an FMU.

    Attributes
    ----------
    signature : 16 bytes, names the variables
    phase, dirty : of the slave
    start_time : s
    parameters : (n,) float64 as bytes, what the last initialisation was made with; empty before it
    values, state : the module's arrays
    """

    signature: bytes
    phase: Phase
    dirty: bool
    start_time: float
    parameters: bytes
    values: np.ndarray
    state: np.ndarray


def encode_state(saved: SavedState) -> bytes:
    """Return `saved` as bytes."""
    sizes = (len(saved.parameters), saved.values.size, saved.state.size)
    head = HEADER.pack(MAGIC, saved.signature, saved.phase, saved.dirty, saved.start_time, *sizes)
    return b"".join((head, saved.parameters, saved.values.tobytes(), saved.state.tobytes()))


def decode_state(data: bytes, signature: bytes, n_values: int) -> SavedState:
    """Return the state that `encode_state` wrote; raise `ModuleError` if it is not one of this FMU."""
    if len(data) < HEADER.size or not data.startswith(MAGIC):
        raise ModuleError("serialised state: the bytes are not a state of this kind of FMU")
    _, owner, phase, dirty, start_time, n_parameters, n_found, n_state = HEADER.unpack_from(data)
    if owner != signature or n_found != n_values:
        raise ModuleError("serialised state: it was written by an FMU with other variables; use the same FMU")
    if len(data) != HEADER.size + n_parameters + 8 * (n_found + n_state) or n_parameters % 8:
        raise ModuleError("serialised state: bytes are missing; pass all that fmi2SerializeFMUstate wrote")
    split = HEADER.size + n_parameters
    numbers = np.frombuffer(data, dtype=np.float64, offset=split)
    parameters = data[HEADER.size : split]
    values, state = numbers[:n_values], numbers[n_values:]
    return SavedState(owner, Phase(phase), bool(dirty), start_time, parameters, values, state)


def table_signature(table: VariableTable) -> bytes:
    """Return 16 bytes that name the variables of `table` in their order."""
    return hashlib.sha256("\n".join(v.name for v in table.variables).encode()).digest()[:16]


def _take_references(objects: Iterable[object]) -> None:
    """Add a reference to each object that is never given back."""
    try:
        for item in objects:
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(item))
    except (AttributeError, OSError):  # a host that hides the interpreter's symbols
        LOGGER.debug("the interpreter's symbols are hidden; freeing this instance may crash")


def _drop_interpreter_guard(resources: str | None) -> None:
    """Let the FMU's library forget that it watches over the interpreter.

    Its guard is destroyed twice when the process ends (by a static destructor and by the library's own),
    which aborts a finished run. Where Python itself is the host the guard has nothing to do, and
    `finalizePythonInterpreter` removes it.
    """
    if not sys.orig_argv or not sys.platform.startswith("linux") or resources is None:
        return
    for path in Path(resources).parent.glob("binaries/linux64/*.so"):
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(str(path), mode=os.RTLD_NOLOAD | os.RTLD_LAZY).finalizePythonInterpreter()


class ModuleSlave(Fmi2Slave):
    """A module as an FMI 2.0 co-simulation slave.

    Parameters
    ----------
    module : cable, robot, contact or anything with their methods; its start values are already set
    instance_name, resources, … : what pythonfmu passes
    """

    def __init__(self, module: Module, **kwargs: Any):
        super().__init__(**kwargs)
        _drop_interpreter_guard(self.resources)
        self._module = module
        self._table = module.table
        self._view: Any = memoryview(module.values)  # type: ignore[arg-type]
        self._signature = table_signature(module.table)
        self._parameters = module.table.indices(module.table.names("parameter"))
        self._outputs = module.table.indices(module.table.names("output"))
        self._output_set = frozenset(self._outputs.tolist())
        self._readable = {kind: self._references(kind) for kind in ("real", "integer", "boolean", "string")}
        self._initialized_with = b""
        self._start_time = 0.0
        self._dirty = False
        self._reported = ""
        self._enter(Phase.INSTANTIATED)

    # --- life cycle -------------------------------------------------------------------------------------

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        self._start_time = start_time

    def enter_initialization_mode(self) -> None:
        self._dirty = True
        self._enter(Phase.INITIALIZING)

    def exit_initialization_mode(self) -> None:
        try:
            if self._dirty or not self._initialized_with:
                self._initialize()
        except Exception as error:
            raise self._fatal("initialisation", error) from None
        self._dirty = False
        self._enter(Phase.STEPPING)

    def do_step(self, current_time: float, step_size: float) -> bool:
        before = self._get_fmu_state()
        try:
            self._step(current_time, step_size)
        except KeyboardInterrupt:  # must not cross the FMI boundary; the master's thread receives it instead
            self._restore(before)
            _thread.interrupt_main()
            return False
        except Exception as error:
            self._restore(before)
            self._report(f"step from t = {current_time:.9g} s by {step_size:.3g} s", error, Fmi2Status.discard)
            return False
        self._dirty = False
        return True

    def _enter(self, phase: Phase) -> None:
        self._phase = phase
        allowed = ("input",) if phase is Phase.STEPPING else ("input", "parameter")
        self._settable = {kind: self._references(kind, allowed) for kind in self._readable}

    def _references(self, kind: str, causalities: tuple[str, ...] | None = None) -> frozenset[int]:
        return frozenset(
            i
            for i, v in enumerate(self._table.variables)
            if v.kind == kind and (causalities is None or v.causality in causalities)
        )

    def _initialize(self) -> None:
        self._initialized_with = b""
        self._require_finite("set a finite value", self._table.names("parameter") + self._table.names("input"))
        self._module.initialize(self._start_time)
        self._view = memoryview(self._module.values)  # type: ignore[arg-type]
        self._require_finite("check the parameters", self._table.names("output"))
        self._initialized_with = self._module.values[self._parameters].tobytes()

    def _step(self, t: float, h: float) -> None:
        if self._phase is not Phase.STEPPING:
            raise ModuleError("the initialisation is not finished; call fmi2ExitInitializationMode first")
        if not (math.isfinite(t) and 0.0 < h < math.inf):
            raise ModuleError("the step must be positive and finite")
        self._module.step(t, h)
        if not math.isfinite(self._module.values.sum()):
            self._require_finite("take a smaller step or check the inputs", self._table.index)

    def _require_finite(self, cure: str, names: Iterable[str]) -> None:
        """Raise `ModuleError` naming those of `names` whose value is not a number."""
        bad = [name for name in names if not math.isfinite(self._view[self._table.index[name]])]
        if bad:
            more = f" and {len(bad) - 3} more" if len(bad) > 3 else ""
            raise ModuleError(f"{', '.join(bad[:3])}{more}: not a finite number; {cure}")

    def _refresh(self) -> None:
        """Bring the outputs up to date; NaN, and a message, where that fails."""
        self._dirty = False
        try:
            if self._phase is Phase.INITIALIZING:
                self._initialize()
            elif self._phase is Phase.STEPPING:
                self._module.refresh()
        except Exception as error:
            self._module.values[self._outputs] = np.nan
            self._report("outputs", error, Fmi2Status.error)

    # --- messages ---------------------------------------------------------------------------------------

    def _describe(self, place: str, error: Exception) -> str:
        cause = str(error) if isinstance(error, ModuleError) else f"{type(error).__name__}: {error}"
        return f"{self.instance_name}, {place}: {cause}"

    def _report(self, place: str, error: Exception, status: Fmi2Status) -> None:
        """Log what went wrong; the log text is a printf format."""
        message = self._describe(place, error)
        if message != self._reported:  # a master may ask again and again
            LOGGER.error(message)
        self._reported = message
        if not isinstance(error, ModuleError):
            message += "\n" + "".join(traceback.format_exception(error))
        self.log(message.replace("%", "%%"), status)

    def _fatal(self, place: str, error: Exception) -> FmuError:
        """Return the exception to raise; the queue is emptied: pythonfmu would flush it with an error set."""
        message = self._describe(place, error)
        LOGGER.error(message, exc_info=None if isinstance(error, ModuleError) else error)
        pending = [item.msg for item in self.log_queue]
        self.log_queue.clear()
        _take_references((type(self), self, self.log_queue))
        return FmuError("; ".join([message.replace("%", "%%"), *pending]))

    # --- values -----------------------------------------------------------------------------------------

    def _get(self, kind: Kind, vrs: list[int]) -> list[float]:
        if self._dirty and not self._output_set.isdisjoint(vrs):
            self._refresh()
        if not self._readable[kind].issuperset(vrs):
            raise self._fatal(f"get {kind}", ModuleError(f"value references {vrs}: not all of them are {kind}"))
        view = self._view
        return [view[i] for i in vrs]

    def _set(self, kind: Kind, vrs: list[int], numbers: Iterable[float]) -> None:
        if not self._settable[kind].issuperset(vrs):
            raise self._fatal(f"set {kind}", self._refusal(kind, vrs))
        self._dirty = True
        view = self._view
        for i, number in zip(vrs, numbers, strict=True):
            view[i] = number

    def _refusal(self, kind: Kind, vrs: list[int]) -> ModuleError:
        bad = next(i for i in vrs if i not in self._settable[kind])
        if bad not in self._readable[kind]:
            return ModuleError(f"value reference {bad}: no {kind} variable")
        variable = self._table.variables[bad]
        if variable.causality == "parameter":
            return ModuleError(f"{variable.name}: parameters are fixed once the initialisation is finished")
        return ModuleError(f"{variable.name}: an {variable.causality} cannot be set")

    def _decoded(self, kind: Kind, vrs: list[int]) -> list[Any]:
        numbers = self._get(kind, vrs)
        try:
            return [self._table.variables[i].decode(x) for i, x in zip(vrs, numbers, strict=True)]
        except (ValueError, OverflowError, IndexError) as error:
            raise self._fatal(f"get {kind}", error) from None

    def _encoded(self, kind: Kind, vrs: list[int], values: list[Value]) -> None:
        try:
            numbers = [self._table.variables[i].encode(x) for i, x in zip(vrs, values, strict=True)]
        except (ModuleError, IndexError) as error:
            raise self._fatal(f"set {kind}", error) from None
        self._set(kind, vrs, numbers)

    def get_real(self, vrs: list[int]) -> list[float]:
        return self._get("real", vrs)

    def get_integer(self, vrs: list[int]) -> list[int]:
        return self._decoded("integer", vrs)

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        return self._decoded("boolean", vrs)

    def get_string(self, vrs: list[int]) -> list[str]:
        return self._decoded("string", vrs)

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        self._set("real", vrs, values)

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._set("integer", vrs, values)

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self._set("boolean", vrs, values)

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        self._encoded("string", vrs, values)  # type: ignore[arg-type]

    # --- state ------------------------------------------------------------------------------------------

    def _get_fmu_state(self) -> SavedState:  # type: ignore[override]
        return SavedState(
            self._signature,
            self._phase,
            self._dirty,
            self._start_time,
            self._initialized_with,
            self._module.values.copy(),
            self._module.state.copy(),
        )

    def _set_fmu_state(self, state: SavedState | bytes) -> None:  # type: ignore[override]
        try:
            if isinstance(state, bytes):
                state = decode_state(state, self._signature, self._module.values.size)
            self._restore(state)
        except Exception as error:
            raise self._fatal("set FMU state", error) from None

    def _restore(self, saved: SavedState) -> None:
        if saved.parameters and saved.parameters != self._initialized_with:
            self._module.values[:] = saved.values
            self._module.values[self._parameters] = np.frombuffer(saved.parameters)
            self._module.initialize(saved.start_time)  # rebuilds what depends on the parameters alone
        self._module.values[:] = saved.values
        if self._module.state.size == saved.state.size:
            self._module.state[:] = saved.state
        else:
            self._module.state = saved.state.copy()
        self._view = memoryview(self._module.values)  # type: ignore[arg-type]
        self._initialized_with = saved.parameters
        self._start_time, self._dirty = saved.start_time, saved.dirty
        if saved.phase is not self._phase:
            self._enter(saved.phase)

    @staticmethod
    def _fmu_state_to_bytes(state: SavedState | bytes) -> bytes:  # type: ignore[override]
        return state if isinstance(state, bytes) else encode_state(state)

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> bytes:  # type: ignore[override]
        return state  # examined when it is set: an exception raised here, without an instance, would crash
