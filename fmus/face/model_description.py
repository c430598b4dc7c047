"""The modelDescription.xml of a module, after its table (FMI 2.0.4, section 2.2), and a page for people."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from pythonfmu._version import __version__ as PYTHONFMU_VERSION

from fmus.face.fmu_start import PYTHON
from fmus.module.recipe import FmuRecipe
from fmus.module.units import unit
from fmus.module.variables import Variable, VariableTable

CAPABILITIES = {
    "needsExecutionTool": "true",
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}

LOG_CATEGORIES = {
    "logStatusWarning": "Messages with status warning",
    "logStatusDiscard": "Why a step was discarded",
    "logStatusError": "Why outputs could not be calculated",
    "logStatusFatal": "Why the FMU cannot go on",
    "logAll": "All messages",
}

XML_TYPES = {"real": "Real", "integer": "Integer", "boolean": "Boolean", "string": "String"}


def variability(variable: Variable) -> str:
    """Return the FMI variability of `variable`."""
    if variable.causality == "parameter":
        return "fixed"
    return "discrete" if variable.discrete or variable.kind != "real" else "continuous"


def model_description(recipe: FmuRecipe, table: VariableTable, values: np.ndarray, guid: str, date: str) -> bytes:
    """Return modelDescription.xml.

    Parameters
    ----------
    values : (len(table),) float64, start values
    date : ISO 8601, generation date
    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=recipe.name,
        guid=guid,
        description=recipe.description,
        license="MIT",
        generationTool=f"line-landing with PythonFMU {PYTHONFMU_VERSION}",
        generationDateAndTime=date,
        variableNamingConvention="structured",
    )
    SubElement(root, "CoSimulation", {"modelIdentifier": recipe.name, **CAPABILITIES})
    _add_units(root, sorted({v.unit for v in table.variables if v.kind == "real"}))
    categories = SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=description)
    experiment = {"startTime": 0.0, "stopTime": recipe.stop_time, "stepSize": recipe.step_size}
    SubElement(root, "DefaultExperiment", {key: repr(value) for key, value in experiment.items()})
    _add_variables(root, table, values)
    _add_structure(root, table)
    indent(root)
    return tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def _add_units(root: Element, units: Iterable[str]) -> None:
    definitions = SubElement(root, "UnitDefinitions")
    for name in units:
        node = SubElement(definitions, "Unit", name=name)
        known = unit(name)
        if known is not None:
            factor = {"factor": repr(float(known.factor))} if known.factor != 1 else {}
            SubElement(node, "BaseUnit", {base: str(n) for base, n in known.exponents.items()} | factor)


def _add_variables(root: Element, table: VariableTable, values: np.ndarray) -> None:
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(table.variables):
        node = SubElement(
            variables,
            "ScalarVariable",
            name=variable.name,
            valueReference=str(reference),
            description=variable.description,
            causality=variable.causality,
            variability=variability(variable),
        )
        if variable.causality != "input":  # FMI fixes it for inputs
            node.set("initial", "exact" if variable.causality == "parameter" else "calculated")
        typed = SubElement(node, XML_TYPES[variable.kind])
        if variable.kind == "real":
            typed.set("unit", variable.unit)
        _add_bounds(typed, variable)
        if variable.causality != "output":
            start = variable.decode(values[reference])
            typed.set("start", str(start).lower() if isinstance(start, bool) else str(start))


def _add_bounds(typed: Element, variable: Variable) -> None:
    """Add min and max: FMI 2.0 knows no exclusive bound, so that one stands there as if it were allowed."""
    for name, bound in (("min", variable.bounds.lowest), ("max", variable.bounds.highest)):
        if bound is not None:
            typed.set(name, str(int(bound) if variable.kind == "integer" else float(bound)))


def _add_structure(root: Element, table: VariableTable) -> None:
    """Add which input acts on which output without a step (Outputs) and at the start (InitialUnknowns)."""
    structure = SubElement(root, "ModelStructure")
    outputs = SubElement(structure, "Outputs")
    unknowns = SubElement(structure, "InitialUnknowns")
    parameters = [table.index[name] for name in table.names("parameter")]
    for place, variable in enumerate(table.variables):
        if variable.causality == "output":
            direct = sorted(table.index[name] for name in variable.feedthrough)
            _add_unknown(outputs, place, direct)
            _add_unknown(unknowns, place, sorted({*direct, *parameters}))


def _add_unknown(parent: Element, place: int, dependencies: list[int]) -> None:
    SubElement(parent, "Unknown", index=str(place + 1), dependencies=" ".join(str(i + 1) for i in dependencies))


def documentation(
    recipe: FmuRecipe, table: VariableTable, values: np.ndarray, readme: str, needs: Sequence[str]
) -> str:
    """Return ``documentation/index.html``: what it needs, the variables with their start values, then the README.

    Parameters
    ----------
    needs : the libraries, as requirements of pip
    """
    rows = "\n".join(_row(v, values[i]) for i, v in enumerate(table.variables))
    title = html.escape(f"{recipe.name}: {recipe.description}")
    return f"""<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{title}</title></head>
<body>
<h1>{title}</h1>
<p>FMI 2.0 co-simulation. It runs in Python: the interpreter that loads it is Python {html.escape(PYTHON)} and has
{html.escape(", ".join(needs))}; <code>pip install -r resources/requirements.txt</code>. Nothing else is needed.
A step that fails is discarded and leaves the FMU as it was; a failed initialisation is fatal; the log says
why.</p>
<table>
<tr><th>name</th><th>causality</th><th>type</th><th>unit</th><th>start</th><th>bounds</th><th>description</th></tr>
{rows}
</table>
<pre>
{html.escape(readme)}
</pre>
</body>
</html>
"""


def _row(variable: Variable, number: float) -> str:
    start = "" if variable.causality == "output" else str(variable.decode(number))
    description = variable.description
    if variable.choices:
        description += f" ({', '.join(variable.choices)})"
    unit = variable.unit if variable.kind == "real" else ""
    cells = (variable.name, variable.causality, variable.kind, unit, start, str(variable.bounds), description)
    return "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>"
