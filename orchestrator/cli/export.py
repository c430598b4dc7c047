"""The command `export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orchestrator.cli import options
from orchestrator.cli.start import importing


def export(
    scenario: options.Scenario,
    ssp: Annotated[Path | None, typer.Option(metavar="FILE", help="Archive of SSP 1.0 to write.")] = None,
    osp: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for OspSystemStructure.xml and its FMUs.")
    ] = None,
    robot: options.Robot = None,
    master: options.Master = None,
    macro_step: options.MacroStep = None,
    stop: options.Stop = None,
    set_: options.Set = None,
) -> None:
    """Write a scenario for other tools, as SSP or OSP; nothing is run.

    The FMUs are loaded. Says what another engine does differently.
    """
    with importing():
        from orchestrator.api import load_scenario
        from orchestrator.export.write import export as write

    loaded = load_scenario(scenario, set=set_, robot=robot, master=master, macro_step=macro_step, stop=stop)
    done = write(loaded, ssp_file=ssp, osp_folder=osp)
    for path in done.paths:
        print(f"{path}: {len(done.package.parts)} FMUs, {len(done.package.wires)} connections")
    for note in done.package.notes:
        print(note)
