"""What a name in a scenario stands for: parameters of the catalogue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from orchestrator.catalogue.quantities import Number
from orchestrator.scenario.types import Provenance


@dataclass(frozen=True)
class Given:
    """Parameters that belong together.

    Attributes
    ----------
    title : what they are called where people read it
    named_by : the keys of the section that choose them
    parameters : by name, each with its unit and source
    file : where they stand
    """

    title: str
    named_by: frozenset[str]
    parameters: Mapping[str, Number]
    file: Path


def said(quantity: Number, file: Path) -> Provenance:
    """Return what a quantity of the catalogue says of itself."""
    return Provenance(str(quantity.source), quantity.reason or "", quantity.unit, file=str(file))
