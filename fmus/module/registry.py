"""The registry: one row a module; FMUs, scenarios, energy audit and documentation find it there.

A module of one's own stands beside ours after `register`, or wherever its package is installed, by an entry point::

    [project.entry-points."line_landing.modules"]
    brake = "my_models:BRAKE"        # a ModuleEntry
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Literal

from fmus.module.recipe import FmuRecipe, make_module
from fmus.module.variables import ModuleError, Value, VariableTable

Contract = Literal["cable", "robot", "contact", "controller"]

ENTRY_POINTS = "line_landing.modules"
"""Group of entry points in which other packages name their modules."""


@dataclass(frozen=True)
class ModuleEntry:
    """A module, as the registry knows it.

    Attributes
    ----------
    key : name of the model in scenarios, and of the FMU
    factory : where the module is made, ``package.module:Class``; a README.md in that folder goes into the FMU
    description : one line for people
    contract : whose part in a landing it can play; None for none
    energy : outputs that its energy is made of, in J; what ends in ``_work`` is put in from outside, and is taken off
    """

    key: str
    factory: str
    description: str
    contract: Contract | None = None
    energy: tuple[str, ...] = ()

    def recipe(
        self,
        name: str | None = None,
        description: str | None = None,
        arguments: Mapping[str, Value] | None = None,
        start: Mapping[str, Value] | None = None,
    ) -> FmuRecipe:
        """Return the recipe of an FMU: of the module as it is, or under another name with other start values."""
        text = self.description if description is None else description
        return FmuRecipe(name or self.key, self.factory, text, arguments or {}, start or {})

    def table(self, **arguments: Value) -> VariableTable:
        """Return the variable table; `arguments` are those of the factory, on which it may depend."""
        return make_module(self.factory, arguments, {}).table


_ENTRIES = (
    ModuleEntry(
        "cable",
        "fmus.cable.module:Cable",
        "ANCF cable between two supports",
        "cable",
        ("kinetic_energy", "strain_energy", "gravitational_energy", "dissipated_energy"),
    ),
    ModuleEntry(
        "contact",
        "fmus.contact.module:Contact",
        "Contact between a grooved wheel and a cable",
        "contact",
        ("strain_energy", "dissipated_energy"),
    ),
    ModuleEntry(
        "robot",
        "fmus.robot.module:Robot",
        "Rigid robot with one wheel",
        "robot",
        ("kinetic_energy", "gravitational_energy", "control_work"),
    ),
    ModuleEntry("setdown", "fmus.controller.module:Setdown", "Controller that sets a robot down", "controller"),
    ModuleEntry("oscillator", "fmus.oscillator.module:Oscillator", "Mass between springs"),
)
MODULES: dict[str, ModuleEntry] = {entry.key: entry for entry in _ENTRIES}
"""Our modules by key, and what has been registered besides."""
OURS = tuple(MODULES)
"""Keys of our own, those of a landing first, by how long their kernels take to compile."""


def register(entry: ModuleEntry) -> ModuleEntry:
    """Make a module known in this process; raise `ModuleError` if its key belongs to another one."""
    if MODULES.setdefault(entry.key, entry) != entry:
        raise ModuleError(f"module {entry.key!r} is {MODULES[entry.key].factory} already; choose another key")
    return entry


def find(key: str) -> ModuleEntry:
    """Return the module `key`: ours, a registered one, or one of an installed package; else raise `ModuleError`."""
    if key not in MODULES and key in _entry_points():
        register(_loaded(key, _entry_points()[key]))
    if key not in MODULES:
        raise ModuleError(f"no module {key!r}; there are {', '.join(names())}")
    return MODULES[key]


def names() -> list[str]:
    """Return the keys of all modules that can be found."""
    return list(dict.fromkeys([*MODULES, *_entry_points()]))


def of_contract(contract: Contract) -> ModuleEntry:
    """Return our module that plays the part of `contract` in a landing."""
    return next(entry for entry in _ENTRIES if entry.contract == contract)


@cache
def _entry_points() -> dict[str, EntryPoint]:
    """Return the entry points of installed packages by name; nothing of them is imported yet."""
    return {point.name: point for point in entry_points(group=ENTRY_POINTS)}


def _loaded(key: str, point: EntryPoint) -> ModuleEntry:
    where = f"module {key!r} (entry point {point.value} of {ENTRY_POINTS})"
    try:
        entry = point.load()
    except Exception as error:  # whatever that package does at its import
        raise ModuleError(f"{where} cannot be imported: {error}; mend that package or remove it") from error
    if not isinstance(entry, ModuleEntry) or entry.key != key:
        raise ModuleError(f"{where} is no ModuleEntry with the key {key!r}; mend it")
    return entry
