"""The options of every master, from its signature."""

from __future__ import annotations

from inspect import signature
from typing import Any


def master_options() -> dict[str, dict[str, Any]]:
    """Return the options of every master, with their default values, by its name."""
    from orchestrator.coupling.masters import MASTERS

    return {name: _options(master) for name, master in MASTERS.items()}


def _options(master: type) -> dict[str, Any]:
    """Return the keyword arguments of `master`; those that it hands on are its base class's."""
    found: dict[str, Any] = {}
    for base in master.__mro__:
        if "__init__" not in vars(base):
            continue
        parameters = signature(vars(base)["__init__"]).parameters.values()
        found |= {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY and p.name not in found}
        if not any(p.kind is p.VAR_KEYWORD for p in parameters):
            break
    return found
