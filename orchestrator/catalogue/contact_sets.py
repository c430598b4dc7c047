"""Stiffness sets of the contact: one TOML file each, every number with its unit and source."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from orchestrator.catalogue import shelf
from orchestrator.catalogue.documents import read
from orchestrator.catalogue.quantities import SOURCED, Number, complaints
from orchestrator.coupling.errors import InputError

FOLDER = Path(__file__).parent / "contacts"


class ContactSet(BaseModel):
    """A set: what it is, the contact's parameters that it gives, and the numbers that they follow from."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    title: str
    parameters: Annotated[dict[str, Annotated[Number, SOURCED]], Field(min_length=1)]
    basis: dict[str, Annotated[Number, SOURCED]] = {}


def names() -> list[str]:
    """Return the names of the sets."""
    return shelf.names(FOLDER)


def file_of(name: str) -> Path:
    """Return the file of a set; `InputError` names the nearest one."""
    return shelf.find(FOLDER, name, f"stiffness set {name!r} of the contact")


def load_set(name: str) -> ContactSet:
    """Return the set of that name, checked."""
    path = file_of(name)
    try:
        return ContactSet.model_validate(read(path))
    except ValidationError as error:
        raise InputError(f"{path}: {one}" for one in complaints(error, ContactSet)) from None
