"""The compiled landing without a browser: the module in `wasmtime`, fed with a packed block."""

from __future__ import annotations

import ctypes
import math
from functools import cache
from pathlib import Path

import numpy as np
import wasmtime

from orchestrator.landing.monolithic.block import WORD, Block
from orchestrator.landing.monolithic.entry import DAMPING, FRICTION, MASS, SPEED

PAGE = 1 << 16
ALIGNED = 64
MATHS = {
    name: getattr(math, name) for name in ("pow", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log")
} | {"hypot": lambda a, b: math.sqrt(a * a + b * b)}
WISHES = {"mass": MASS, "damping": DAMPING, "friction": FRICTION, "speed": SPEED}


@cache
def translated(module: Path, written: int) -> tuple[wasmtime.Engine, wasmtime.Module]:
    """The machine code of a module that was `written` at a time, ns; made once for all landings."""
    engine = wasmtime.Engine()
    return engine, wasmtime.Module.from_file(engine, str(module))


class Compiled:
    """A landing in the compiled module.

    Parameters
    ----------
    module : file
    """

    def __init__(self, module: Path):
        engine, self.module = translated(module, module.stat().st_mtime_ns)
        self.store = wasmtime.Store(engine)
        number = wasmtime.ValType.f64()
        functions = []
        for wanted in self.module.imports:
            assert isinstance(wanted.type, wasmtime.FuncType) and wanted.name is not None
            assert [*wanted.type.params, *wanted.type.results] == [number] * (len(wanted.type.params) + 1)
            functions.append(wasmtime.Func(self.store, wanted.type, MATHS[wanted.name]))
        self.exports = wasmtime.Instance(self.store, self.module, functions).exports(self.store)

    def load(self, block: Block, **wishes: float) -> float:
        """Put a block into memory, with wishes in the place of its own; return the status of its beginning."""
        memory, self.block = self.exports["memory"], block
        self.base = -(-self.exports["__heap_base"].value(self.store) // ALIGNED) * ALIGNED
        missing = self.base + WORD * block.words - memory.data_len(self.store)
        if missing > 0:
            memory.grow(self.store, -(-missing // PAGE))
        self.words[:] = block.memory()
        for name, value in wishes.items():
            block.view(self.words, "start.wishes")[WISHES[name]] = value
        return self.exports["begin"](self.store, self.base)

    @property
    def words(self) -> np.ndarray:
        """The block's memory (words,), in place."""
        memory = self.exports["memory"]
        address = ctypes.addressof(memory.data_ptr(self.store).contents)
        whole = (ctypes.c_double * self.block.words).from_address(address + self.base)
        return np.frombuffer(whole, np.float64)

    def solve(self, times: np.ndarray, signals: dict[str, int]) -> dict[str, np.ndarray]:
        """Return signals at the output times (n,) s."""
        found = np.zeros((len(times), len(signals)))
        places = list(signals.values())
        for i, t in enumerate(times.tolist()):
            if i:
                reached = self.exports["advance"](self.store, self.base, float(times[i - 1]), t)
                assert reached >= 0.0, f"status {-1.0 - reached} before {t} s"
            self.exports["show"](self.store, self.base)
            found[i] = self.words[places]
        return dict(zip(signals, found.T, strict=True))
