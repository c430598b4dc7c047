"""FMUs with other start values: those of ours are built anew, others get another model description.

An engine that sets no parameters, FMPy's runner of system structures for one, then runs the right system all the same, as
far as an FMU heeds its own description: whether it does is asked of the FMU itself.
"""

from __future__ import annotations

import contextlib
import json
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

from fmus.face.build import RECORD, pack, record
from fmus.module.recipe import FmuRecipe
from fmus.module.variables import ModuleError
from orchestrator.catalogue.library import kept
from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.instance import Fmu, Value
from orchestrator.export.package import Part
from orchestrator.scenario.types import Simulation

DESCRIPTION = "modelDescription.xml"
SCALARS = ("Real", "Integer", "Boolean", "String", "Enumeration")
"""Elements that hold a start value in FMI 1.0 and 2.0; in FMI 3.0 the variable itself does."""


def baked(parts: Sequence[Part], simulation: Simulation, folder: Path) -> list[Part]:
    """Return the parts with FMUs that have their values as start values; what cannot be built is written to `folder`."""
    recipes = {part.name: recipe for part in parts if (recipe := recipe_of(part.fmu)) is not None}
    own = [_started(recipes[part.name], part, simulation) for part in parts if part.name in recipes]
    built = dict(zip(recipes, kept(own), strict=True))
    return [_asked(_named(part, built.get(part.name) or _described(part, folder)), simulation) for part in parts]


def recipe_of(path: Path) -> FmuRecipe | None:
    """Return the recipe of an FMU that this version of ours would build byte for byte; None of any other."""
    with contextlib.suppress(OSError, KeyError, ValueError, TypeError, ModuleError, zipfile.BadZipFile):
        with zipfile.ZipFile(path) as archive:
            facts = json.loads(archive.read(RECORD))
        recipe = FmuRecipe(**facts["recipe"])
        return recipe if record(recipe) == facts else None
    return None


def _started(recipe: FmuRecipe, part: Part, simulation: Simulation) -> FmuRecipe:
    times = {"step_size": simulation.macro_step / part.steps, "stop_time": simulation.stop_time}
    return replace(recipe, start={**recipe.start, **part.values}, **times)


def _named(part: Part, fmu: Path) -> Part:
    return replace(part, fmu=fmu)


def _described(part: Part, folder: Path) -> Path:
    """Return a copy of a foreign FMU whose description has the values; the FMU itself where there are none."""
    if not part.values:
        return part.fmu
    path = folder / part.file
    with zipfile.ZipFile(part.fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}
    path.write_bytes(pack(files | {DESCRIPTION: with_starts(files[DESCRIPTION], part.values)}))
    return path


def with_starts(description: bytes, values: Mapping[str, Value]) -> bytes:
    """Return a model description with other start values: name → value."""
    root = ElementTree.fromstring(description)
    for variable in root.iterfind("ModelVariables/*"):
        if (name := variable.get("name", "")) in values:
            _start(variable, text_of(values[name]))
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)


def _start(variable: ElementTree.Element, text: str) -> None:
    if variable.tag == "String":  # FMI 3.0
        for old in variable.findall("Start"):
            variable.remove(old)
        variable.insert(0, ElementTree.Element("Start", value=text))
        return
    scalar = next((child for child in variable if child.tag in SCALARS), variable)
    scalar.set("start", text)


def text_of(value: Value) -> str:
    """Return a value as XML Schema writes it, a float with all its digits."""
    return str(value).lower() if isinstance(value, bool) else repr(value) if isinstance(value, float) else str(value)


def _asked(part: Part, simulation: Simulation) -> Part:
    """Return the part with the values that its FMU does not start from by itself."""
    return replace(part, strange=tuple(not_started(part.fmu, part.values, simulation.start_time)))


def not_started(path: Path, values: Mapping[str, Value], start: float) -> Iterable[str]:
    """Return those of `values` that an instance to which nobody gives them does not have; all if it cannot be asked."""
    if not values:
        return []
    try:
        with Fmu(path, isolate=True) as fmu:  # somebody else's program
            fmu.enter_initialization(start)
            return [name for name, value in values.items() if fmu.read(name) != value]
    except (FmuError, ValueError):
        return list(values)
