"""A scenario written as a package of another tool's format."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

from fmus.face.build import pack, write_atomically
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.masters import MASTERS
from orchestrator.export import osp, ssp
from orchestrator.export.baked import baked
from orchestrator.export.notes import notes
from orchestrator.export.package import Package, packed
from orchestrator.export.readme import readme
from orchestrator.runs.components import opened
from orchestrator.runs.systems import System, resolve
from orchestrator.scenario.layers import shared_options
from orchestrator.scenario.ssp.names import OSP_FILE
from orchestrator.scenario.types import Scenario

AS_OTHERS = "jacobi"
"""Our master that does what other engines do: all step, then all values move."""


@dataclass(frozen=True)
class Exported:
    """What was written: `paths`, and the `package` in them."""

    paths: tuple[Path, ...]
    package: Package


def export(scenario: Scenario, *, ssp_file: Path | None = None, osp_folder: Path | None = None) -> Exported:
    """Write a scenario as SSP 1.0, as an OSP system structure, or as both.

    Parameters
    ----------
    ssp_file : the archive; one that is there is replaced
    osp_folder : the folder; it must be empty, or not exist

    Raises
    ------
    InputError : nothing is asked for, the folder has something in it, or the scenario has what no system structure can say
    RunError : an FMU fails
    """
    if ssp_file is None and osp_folder is None:
        raise InputError(f"{scenario.path}: say where to: --ssp FILE.ssp or --osp FOLDER")
    _require_empty(osp_folder)
    with tempfile.TemporaryDirectory() as scratch:
        package = package_of(scenario, Path(scratch))
        paths = (_archive(package, ssp_file), _folder(package, osp_folder))
    return Exported(tuple(path for path in paths if path is not None), package)


def package_of(scenario: Scenario, folder: Path) -> Package:
    """Return the package of a scenario; FMUs that are made for it are in `folder`."""
    system = resolve(scenario)
    plain = _explicit(system)
    with opened(plain) as graph:
        package = packed(plain.scenario, graph)
        package = replace(package, parts=tuple(baked(package.parts, package.simulation, folder)))
        return package.noted(notes(package, graph, scenario))


def _explicit(system: System) -> System:
    """Return the system under an explicit master: what iterates has another exchange, which others cannot serve."""
    scenario = system.scenario
    if not MASTERS[scenario.simulation.master].IMPLICIT:
        return system
    exchange = None if scenario.simulation.exchange is None else scenario.simulation.exchange
    return system.changed(shared_options(scenario.master, AS_OTHERS), master=AS_OTHERS, exchange=exchange)


def _require_empty(folder: Path | None) -> None:
    if folder is not None and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: is there already; choose another folder, or empty it")


def _archive(package: Package, path: Path | None) -> Path | None:
    if path is None:
        return None
    fmus = {f"resources/{part.file}": part.fmu.read_bytes() for part in package.parts}
    path.parent.mkdir(parents=True, exist_ok=True)
    about = {"documentation/README.md": readme(package, path.name).encode()}
    write_atomically(path, pack(ssp.files(package) | about | fmus))
    return path


def _folder(package: Package, folder: Path | None) -> Path | None:
    if folder is None:
        return None
    folder.mkdir(parents=True, exist_ok=True)
    contents = {part.file: part.fmu.read_bytes() for part in package.parts}
    contents |= {"README.md": readme(package, OSP_FILE).encode()} | osp.files(package)
    for name, content in contents.items():
        write_atomically(folder / name, content)
    return folder
