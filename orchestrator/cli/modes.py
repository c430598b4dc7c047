"""The command that shows the modes of a line, with the robot on it or alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestrator.cli import options, printing
from orchestrator.cli.start import importing

if TYPE_CHECKING:
    from orchestrator.landing.modes import CableModes
    from orchestrator.landing.robot_modes import SystemModes
    from orchestrator.runs.directory import RunDirectory
    from orchestrator.scenario.types import Scenario


def modes(
    scenario: options.Scenario,
    count: Annotated[
        int | None, typer.Option(help="Number of modes: 12; without the robot 6 out of the vertical plane and 6 in it.")
    ] = None,
    without_robot: Annotated[bool, typer.Option("--without-robot", help="The line alone.")] = False,
    positions: Annotated[
        int, typer.Option(min=0, help="With --out: landing positions at which bounce and pendulum are looked for.")
    ] = 20,
    out: Annotated[Path | None, typer.Option(help="Directory for tables and pictures; it must not exist.")] = None,
    robot: options.Robot = None,
    set_: options.Set = None,
) -> None:
    """Natural frequencies of a line with its robot at rest on it.

    With damping ratios and shapes; the resonance of bounce and pendulum is warned of.
    """
    with importing():
        from orchestrator.api import load_scenario
        from orchestrator.runs.directory import claimed

    loaded = load_scenario(scenario, set=set_, robot=robot)
    if out is None:
        _show_modes(loaded, count, without_robot)
        return
    with claimed(out, loaded.name) as directory:
        found = _show_modes(loaded, count, without_robot)
        _write_modes(directory, found, loaded, positions)
    print(f"tables and pictures in {out}")


def _show_modes(scenario: Scenario, count: int | None, without_robot: bool) -> CableModes | SystemModes:
    """Find and print the modes of the line, alone or with the robot."""
    from orchestrator.landing import modes, robot_modes

    if without_robot:
        alone = modes.of_scenario(scenario, 6 if count is None else count)
        printing.print_modes(alone)
        return alone
    wanted = 12 if count is None else count
    found = robot_modes.of_scenario(scenario, wanted)
    printing.print_robot_modes(found, wanted)
    return found.first(wanted)


def _write_modes(directory: RunDirectory, found: CableModes | SystemModes, scenario: Scenario, positions: int) -> None:
    """Write tables and pictures of what `_show_modes` has found."""
    from orchestrator.landing.modes import CableModes
    from orchestrator.landing.robot_modes import over_positions
    from orchestrator.report import modes as pictures
    from orchestrator.report import robot_modes as pictures_with_robot
    from orchestrator.report.drawn import drawn
    from orchestrator.runs import modes as tables
    from orchestrator.runs import robot_modes as tables_with_robot
    from orchestrator.scenario.types import LandingScenario

    if isinstance(found, CableModes):
        tables.write_modes(directory, found)
        drawn(lambda: pictures.draw(directory.path))
        return
    assert isinstance(scenario, LandingScenario)  # others have no modes
    tables_with_robot.write_modes(directory, found)
    if positions > 0:
        tables_with_robot.write_positions(directory, over_positions(scenario, positions))
    drawn(lambda: pictures_with_robot.draw(directory.path, scenario.landing.position))
