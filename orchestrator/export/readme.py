"""The page inside a package: what is in it, what its engine has to know."""

from __future__ import annotations

from orchestrator.coupling.errors import digits
from orchestrator.export.package import TOOL, Package


def readme(package: Package, file: str) -> str:
    """Return README.md of a package whose structure is in `file`."""
    simulation = package.simulation
    span = f"{digits(simulation.start_time)} s to {digits(simulation.stop_time)} s"
    rows = "\n".join(f"| {p.name} | {p.file} | {len(p.values)} | {len(p.ports)} |" for p in package.parts)
    told = "\n".join(f"- {note}." for note in package.notes)
    return f"""# {package.title}

`{file}`, written by {TOOL}: from {span}, macro step {digits(simulation.macro_step)} s.

| component | FMU | values given | connectors |
|---|---|---|---|
{rows}

Values are given twice: in the structure, and as start values of the FMUs. What an FMU needs to run stands in its own
documentation, `documentation/index.html` within it.

## What the engine has to know
{told}
"""
