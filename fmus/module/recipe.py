"""The recipe of an FMU: which module, with which start values, under which name."""

from __future__ import annotations

import importlib
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

import numpy as np

from fmus.module.variables import ModuleError, Value, VariableTable


class Module(Protocol):
    """What every face of a module relies on (see docs/reference/kernels.md)."""

    NAME: str
    TITLE: str
    table: VariableTable
    values: np.ndarray
    state: np.ndarray

    def initialize(self, t: float) -> None:
        """From parameters and inputs to state and outputs at `t`; raises `ModuleError`."""
        ...

    def refresh(self) -> None:
        """Write the outputs that inputs and state have at a fixed time."""
        ...

    def step(self, t: float, h: float) -> None:
        """Advance from `t` to `t + h` and write the outputs; a `ModuleError` changes nothing that counts."""
        ...


@dataclass(frozen=True)
class FmuRecipe:
    """What an FMU is made of.

    Attributes
    ----------
    name : model name and file name, a C identifier
    factory : where the module is made, ``package.module:Class``
    description : one line for people
    arguments : keyword arguments of the factory
    start : start values that differ from the module's table
    step_size, stop_time : s, default experiment
    """

    name: str
    factory: str
    description: str = ""
    arguments: Mapping[str, Value] = field(default_factory=dict)
    start: Mapping[str, Value] = field(default_factory=dict)
    step_size: float = 5e-3
    stop_time: float = 1.0

    def __post_init__(self):
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", self.name):
            raise ModuleError(f"FMU name {self.name!r}: use letters, digits and underscores, a letter first")
        if not re.fullmatch(r"\w+(\.\w+)+:\w+", self.factory):
            raise ModuleError(f"{self.name}: factory {self.factory!r} is not of the form package.module:Class")

    @property
    def packages(self) -> tuple[str, ...]:
        """Names of the top-level packages whose sources the FMU needs."""
        return tuple(sorted({"fmus", self.factory.split(".")[0]}))

    def as_dict(self) -> dict[str, Any]:
        """Return the recipe as plain data."""
        return asdict(self)

    def make_module(self) -> Module:
        """Return a new module with the recipe's start values."""
        return make_module(self.factory, self.arguments, self.start)


def make_module(factory: str, arguments: Mapping[str, Value], start: Mapping[str, Value]) -> Module:
    """Import ``package.module:Class``, call it with `arguments` and write the start values `start`."""
    path, _, name = factory.partition(":")
    module = getattr(importlib.import_module(path), name)(**arguments)
    module.table.assign(module.values, start)
    return module
