"""The options of every master and their bounds, from its signature."""

from __future__ import annotations

import operator
from collections.abc import Iterator
from functools import cache
from inspect import signature
from typing import Any, get_args, get_type_hints

from annotated_types import Ge, Gt, Le, Lt

CHECKS = (
    (Gt, "gt", operator.gt, "greater than"),
    (Ge, "ge", operator.ge, "at least"),
    (Lt, "lt", operator.lt, "less than"),
    (Le, "le", operator.le, "at most"),
)


def master_options() -> dict[str, dict[str, Any]]:
    """Return the options of every master, with their default values, by its name."""
    from orchestrator.coupling.masters import MASTERS

    return {name: dict(_options(master)) for name, master in MASTERS.items()}


def out_of_bounds(master: str, option: str, value: float) -> str:
    """Return what is wanted of an option where `value` is out of its bounds (``greater than 0``), else an empty string."""
    from orchestrator.coupling.masters import MASTERS

    for init in _initializers(MASTERS[master]):
        hint = get_type_hints(init, include_extras=True).get(option)
        if hint is not None:
            return " and ".join(_broken(getattr(hint, "__metadata__", ()), value))
    return ""


def takes(master: str, option: str, value: Any) -> bool:
    """Return whether `value` is of a type that the option is declared with, beside that of its default."""
    from orchestrator.coupling.masters import MASTERS

    for init in _initializers(MASTERS[master]):
        hint = get_type_hints(init).get(option)
        if hint is not None:
            wanted = get_args(hint) or (hint,)
            return not isinstance(value, bool) and isinstance(value, (*wanted, int) if float in wanted else wanted)
    return False


def _broken(bounds: tuple[Any, ...], value: float) -> Iterator[str]:
    for bound in bounds:
        for kind, name, holds, words in CHECKS:
            if isinstance(bound, kind) and not holds(value, getattr(bound, name)):
                yield f"{words} {getattr(bound, name):g}"


@cache
def _options(master: type) -> dict[str, Any]:
    """Return the keyword arguments of `master`; those that it hands on are its base class's."""
    found: dict[str, Any] = {}
    for init in _initializers(master):
        parameters = signature(init).parameters.values()
        found |= {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY and p.name not in found}
    return found


def _initializers(master: type) -> Iterator[Any]:
    """Yield the initializer of `master`, and of its base classes as long as options are handed on."""
    for base in master.__mro__:
        init = vars(base).get("__init__")
        if init is None:
            continue
        yield init
        if not any(p.kind is p.VAR_KEYWORD for p in signature(init).parameters.values()):
            return
