"""Several variables of one FMU, read or written together through a reused buffer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from orchestrator.coupling.fmu.binding import WARNING, Call, Fmi2
from orchestrator.coupling.fmu.description import Port
from orchestrator.coupling.fmu.failure import NOT_FINITE, FmuError
from orchestrator.coupling.fmu.isolated import Isolated


class Owner(Protocol):
    """What a group needs of the FMU that it belongs to."""

    name: str

    @property
    def fmi(self) -> Fmi2 | Isolated:
        """Its calls."""
        ...

    def port(self, name: str) -> Port:
        """Return the port; `ValueError` if there is none."""
        ...

    def error(self, status: int, doing: str) -> FmuError:
        """Return the error for a call that came back with `status`."""
        ...

    def failure(self, status: int, what: str) -> FmuError:
        """Return the error that says `what` happened."""
        ...


class Block:
    """Variables of one FMI type in a group; `pick` are their places in the group, (n,)."""

    def __init__(self, fmu: Owner, fmi_type: str, ports: list[Port], pick: np.ndarray, values: np.ndarray):
        kind, dtype = fmu.fmi.TYPES[fmi_type]
        firsts = dict.fromkeys((p.vr, p.size) for p in ports)
        starts = np.cumsum([0, *(size for _, size in firsts)])
        place = {vr: int(start) for (vr, _), start in zip(firsts, starts, strict=False)}
        self.vr = np.array([vr for vr, _ in firsts], dtype=np.uint32)
        self.elements = np.array([place[p.vr] + p.element for p in ports], dtype=np.intp)
        self.pick, self.values = pick, values
        direct = dtype is np.float64 and pick.size == values.size == int(starts[-1])
        self.direct = direct and bool(np.all(pick == self.elements))
        self.buffer = values if self.direct else np.zeros(int(starts[-1]), dtype=dtype)
        self.partial = len(set(self.elements.tolist())) < int(starts[-1])
        span = span_of([port.name for port in ports])
        self.get_call: Call = fmu.fmi.accessor("Get", kind, self.vr, self.buffer, f"reading {span}")
        self.set_call: Call = fmu.fmi.accessor("Set", kind, self.vr, self.buffer, f"writing {span}")

    def get(self) -> int:
        status = self.get_call()
        if not self.direct:
            self.values[self.pick] = self.buffer[self.elements]
        return status

    def set(self) -> int:
        if self.partial:  # the other elements of the array stay as they are
            self.get_call()
        if not self.direct:
            self.buffer[self.elements] = self.values[self.pick]
        return self.set_call()


def span_of(names: Sequence[str]) -> str:
    """Return how variables that are read or written together are called."""
    return names[0] if len(names) == 1 else f"{names[0]} … {names[-1]}"


class Group:
    """Several variables of one FMU that are read or written together.

    Attributes
    ----------
    values : (n,) float64; integers and Booleans are cast
    """

    __slots__ = ("_get", "_set", "fmu", "names", "ones", "runs", "values")

    def __init__(self, fmu: Owner, names: Sequence[str], values: np.ndarray | None = None):
        self.fmu, self.names = fmu, tuple(names)
        self.values = np.zeros(len(self.names)) if values is None else values
        if self.values.shape != (len(self.names),) or not self.values.flags.c_contiguous:
            raise ValueError(f"{fmu.name}: the buffer must be contiguous and hold {len(self.names)} numbers")
        self.ones = np.ones(len(self.names))
        ports = [fmu.port(name) for name in names]
        types = dict.fromkeys(p.fmi_type for p in ports)
        picks = {
            kind: np.array([i for i, p in enumerate(ports) if p.fmi_type == kind], dtype=np.intp) for kind in types
        }
        for port in ports:
            if not port.is_number:
                raise ValueError(f"{fmu.name}: {port.name} is a {port.kind} and has no place among numbers")
        self.runs = [Block(fmu, kind, [ports[i] for i in pick], pick, self.values) for kind, pick in picks.items()]

        # one direct run is the common case: its call is used as it is
        direct = len(self.runs) == 1 and self.runs[0].direct
        self._get: Call = self.runs[0].get_call if direct else self._get_runs
        self._set: Call = self.runs[0].set_call if direct else self._set_runs

    def _get_runs(self) -> int:
        return max((run.get() for run in self.runs), default=0)

    def _set_runs(self) -> int:
        return max((run.set() for run in self.runs), default=0)

    def get(self) -> None:
        """Read all from the FMU into `values`."""
        status = self._get()
        if status > WARNING:
            raise self.fmu.error(status, f"reading {self._span()}")

    def set(self) -> None:
        """Write all of `values` to the FMU."""
        status = self._set()
        if status > WARNING:
            raise self.fmu.error(status, f"writing {self._span()}")

    def get_finite(self) -> None:
        """Read all; raise `FmuError` if a value is not finite."""
        status = self._get()
        if status > WARNING:
            raise self.fmu.error(status, f"reading {self._span()}")
        total = self.values.dot(self.ones)
        if not -np.inf < total < np.inf:
            self._name_not_finite()

    def _span(self) -> str:
        return span_of(self.names)

    def _name_not_finite(self) -> None:
        bad = [name for name, value in zip(self.names, self.values, strict=True) if not np.isfinite(value)]
        if bad:
            more = f" and {len(bad) - 1} more" if len(bad) > 1 else ""
            raise self.fmu.failure(NOT_FINITE, f"output {bad[0]}{more} is not a finite number")
