"""The command line. Progress and errors go to stderr, answers to stdout.

Exit status: 0 done and within tolerance; 1 done, but a tolerance or a safety limit is missed; 2 wrong input;
3 the run failed; 130 interrupted. What is heavy is imported where it is used, so that ``--help`` is quick.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from orchestrator.coupling.errors import DONE, FAILED, INTERRUPTED, MISSED, InputError, OrchestratorError, RunError
from orchestrator.runs.compare import compared
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.estimate import estimate_error
from orchestrator.runs.files import write, write_comparison, write_runs
from orchestrator.runs.reference import solve_reference

if TYPE_CHECKING:
    from orchestrator.scenario.types import Scenario
from orchestrator.cli import new
from orchestrator.cli.printing import (
    complain,
    complain_once,
    markup,
    print_comparison,
    print_run,
    print_table,
    progress_bars,
    status,
)


class Commands(TyperGroup):
    """The commands; what they raise for the user ends in a message and an exit status, not in a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Carry out one command."""
        try:
            return super().invoke(ctx)
        except OrchestratorError as error:
            for line in str(error).splitlines():
                complain(line)
            raise typer.Exit(error.exit_status) from None
        except BrokenPipeError:
            raise
        except OSError as error:  # a full disk, a folder that was taken away
            complain(f"{error.filename or 'results'}: {error.strerror}; make room or choose another place with --out")
            raise typer.Exit(FAILED) from None
        except KeyboardInterrupt:
            complain("interrupted")
            raise typer.Exit(INTERRUPTED) from None


app = typer.Typer(
    cls=Commands,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Land power-line robots on a flexible cable: FMUs coupled, and held against a monolithic solver.",
    epilog="Exit status: 0 done and within tolerance; 1 a tolerance or safety limit is missed; "
    "2 wrong input; 3 the run failed; 130 interrupted.",
)

app.add_typer(new.app, name="new")

ScenarioFile = Annotated[str, typer.Argument(metavar="SCENARIO", help="Name of a shipped scenario, or a TOML file.")]
Out = Annotated[
    Path | None, typer.Option(help="Directory of the results; it must not exist. Default: runs/SCENARIO-NNN.")
]
Robot = Annotated[
    str | None, typer.Option(metavar="NAME|FILE.toml|FILE.fmu", help="Another robot in the scenario's place.")
]
MasterName = Annotated[str | None, typer.Option(help="Another master, see `orchestrator list`.")]
MacroStep = Annotated[float | None, typer.Option(help="Another macro step, s.")]
Stop = Annotated[float | None, typer.Option(help="Another stop time, s.")]
Timeout = Annotated[float | None, typer.Option(help="Wall time that one step of an FMU may take, s.")]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Another value, e.g. robot.parameters.mass=12; repeatable."),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress.")]


@app.command()
def build(
    out: Annotated[Path | None, typer.Option(help="Folder of the FMUs. Default: the cache that runs use.")] = None,
) -> None:
    """Build the FMUs of cable, contact and every robot of the catalogue; print where they are."""
    from orchestrator.catalogue.library import build_all

    for path in build_all(out):
        print(path)


@app.command("list")
def list_() -> None:
    """List scenarios, robots and masters, with a line each."""
    from rich.table import Table

    from orchestrator.catalogue import listing as catalogue

    groups = {
        "Scenarios": catalogue.scenarios(),
        "Robots": catalogue.robots(),
        "Masters": catalogue.masters(),
    }
    table = Table(box=None, show_header=False, pad_edge=False)
    for title, lines in groups.items():
        table.add_row(f"[bold]{title}[/bold]")
        for name, line in lines.items():
            table.add_row(f"  {name}", line)
    print_table(table)


@app.command()
def validate(scenario: ScenarioFile, robot: Robot = None, set_: Set = None) -> None:
    """Parse, load, check connections, units and contract; nothing is run."""
    loaded = _load(scenario, robot, set_)
    from orchestrator.runs.components import master_of, opened

    with opened(loaded) as graph:
        master_of(loaded, graph)
        print(f"{scenario}: valid; {len(graph.components)} FMUs, {len(list(graph.connections))} connections")


@app.command()
def check(
    fmu: Annotated[Path, typer.Argument(metavar="FILE.fmu", help="The FMU.")],
    contract: Annotated[
        str | None, typer.Option(help="robot, cable or contact. Default: the one it suits best.")
    ] = None,
) -> None:
    """Check point by point whether an FMU meets the contract of a robot, a cable or a contact."""
    from rich.table import Table

    from orchestrator.landing.contract import check_fmu, is_met

    kind, findings = check_fmu(fmu, contract)
    colours = {"ok": "green", "missing": "red", "wrong": "red", "advice": "yellow"}
    table = Table(f"{kind} contract", "", "", box=None, pad_edge=False, header_style="bold")
    for finding in findings:
        table.add_row(finding.what, f"[{colours[finding.verdict]}]{finding.verdict}[/]", markup(finding.note))
    print_table(table)
    met = is_met(findings)
    print(f"{fmu}: {'meets' if met else 'does not meet'} the {kind} contract")
    raise typer.Exit(DONE if met else MISSED)


@app.command()
def run(
    scenario: ScenarioFile,
    out: Out = None,
    robot: Robot = None,
    master: MasterName = None,
    macro_step: MacroStep = None,
    stop: Stop = None,
    timeout: Timeout = None,
    set_: Set = None,
    quiet: Quiet = False,
) -> None:
    """Run a scenario coupled."""
    from orchestrator.coupling.run.results import RunDirectory

    loaded = _load(scenario, robot, set_, master, macro_step, stop, timeout)
    path = _free(out, loaded.name)
    with progress_bars(quiet) as show:
        coupled = run_coupled(loaded, show(_task(loaded), loaded.simulation.stop_time))
        if loaded.simulation.estimate != "none":
            words = f"error estimate, {loaded.simulation.estimate} run"
            estimate_error(coupled, show(words, loaded.simulation.stop_time))
    write(RunDirectory(path), coupled)
    print_run(coupled)
    print(f"results in {path}")
    raise typer.Exit(status([coupled], within=not coupled.fallen))


@app.command()
def compare(
    scenario: ScenarioFile,
    out: Out = None,
    robot: Robot = None,
    master: MasterName = None,
    macro_step: MacroStep = None,
    stop: Stop = None,
    timeout: Timeout = None,
    set_: Set = None,
    masters: Annotated[str | None, typer.Option(metavar="A,B,…", help="Masters to compare.")] = None,
    macro_steps: Annotated[str | None, typer.Option(metavar="H,H,…", help="Macro steps to compare, s.")] = None,
    quiet: Quiet = False,
) -> None:
    """Run a scenario coupled and with the monolithic solver, and say how large the coupling error is."""
    from orchestrator.coupling.run.results import RunDirectory

    first = _load(scenario, robot, set_, master, macro_step, stop, timeout)
    variants = _variants(first, masters, macro_steps, lambda m, h: _load(scenario, robot, set_, m, h, stop, timeout))
    path, runs = _free(out, f"{first.name}-compare"), []
    steps = sorted({v.simulation.macro_step for v in variants})
    try:
        with progress_bars(quiet) as show:
            for v in variants:
                runs.append(run_coupled(v, show(_task(v), v.simulation.stop_time)))
            reference = solve_reference(first, steps, show("reference", first.simulation.stop_time))
    except RunError as error:
        if runs:
            write_runs(RunDirectory(path), runs, str(error))
            status(runs, within=True)
            print(f"results so far in {path}")
        raise
    comparison = compared(runs, reference)
    write_comparison(RunDirectory(path), comparison, runs)
    print_comparison(comparison)
    print(f"verdict: {'pass' if comparison.passed else 'FAIL'}; results in {path}, pictures in {path / 'plots'}")
    raise typer.Exit(status(runs, comparison.passed and not any(coupled.fallen for coupled in runs)))


@app.command()
def modes(
    scenario: ScenarioFile,
    count: Annotated[int, typer.Option(help="Number of modes out of the vertical plane, and in it.")] = 6,
    out: Annotated[Path | None, typer.Option(help="Directory for table and picture; it must not exist.")] = None,
    set_: Set = None,
) -> None:
    """Natural frequencies, damping ratios and shapes of the scenario's cable about its static equilibrium."""
    from rich.table import Table

    from orchestrator.landing import modes as vibration
    from orchestrator.report.modes import write as write_modes

    loaded = _load(scenario, None, set_)
    path = None if out is None else _free(out, loaded.name)
    found = vibration.of_scenario(loaded, count)
    table = Table("mode", "out of plane \\[Hz]", "damping", "in plane \\[Hz]", "damping", box=None, pad_edge=False)
    groups = (found.out_of_plane, found.in_plane)
    for k in range(max(group.frequency.size for group in groups)):
        cells = [f"{x[k]:{form}}" if k < x.size else "" for g in groups for x, form in g.columns()]
        table.add_row(str(k + 1), *cells)
    print_table(table)
    if path is not None:
        write_modes(found, path)
        print(f"table and picture in {path}")


@app.command()
def report(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="Directory of a finished run.")],
) -> None:
    """Draw the pictures of a finished run or comparison anew, and a page that shows them."""
    from orchestrator.report.page import report as make

    print(make(directory))


def _load(
    path: str,
    robot: str | None,
    overrides: list[str] | None,
    master: str | None = None,
    macro_step: float | None = None,
    stop: float | None = None,
    timeout: float | None = None,
) -> Scenario:
    """Return the scenario with the options of the command line in place of its own values."""
    from orchestrator.scenario.read import load

    options = {"macro_step": macro_step, "stop_time": stop, "timeout": timeout}
    settings = [f"simulation.{key}={float(value)!r}" for key, value in options.items() if value is not None]
    scenario = load(path, [*settings, *(overrides or [])], robot, master)
    for note in scenario.notes:
        complain_once(note)
    return scenario


def _variants(
    first: Scenario,
    masters: str | None,
    macro_steps: str | None,
    load: Callable[[str | None, float | None], Scenario],
) -> list[Scenario]:
    """Return the scenario for every pair of master and macro step that is asked for."""
    names = _items(masters) or [first.simulation.master]
    try:
        steps = [float(text) for text in _items(macro_steps)] or [first.simulation.macro_step]
    except ValueError:
        raise InputError(f"--macro-steps {macro_steps}: write numbers with commas between, 0.01,0.005") from None
    return [load(name, step) for name in dict.fromkeys(names) for step in dict.fromkeys(steps)]


def _items(text: str | None) -> list[str]:
    return [item.strip() for item in (text or "").split(",") if item.strip()]


def _free(out: Path | None, name: str) -> Path:
    """Return the directory to be made; `InputError`, before anything is run, if it exists or cannot be made."""
    from orchestrator.coupling.run.results import default_directory

    path = out or default_directory(name)
    if path.exists():
        raise InputError(f"{path}: exists already; remove it or choose another with --out")
    parent = next(p for p in path.absolute().parents if p.exists())
    if not (parent.is_dir() and os.access(parent, os.W_OK)):
        raise InputError(f"{path}: cannot be made, {parent} is no folder to write to; choose another with --out")
    return path


def _task(scenario: Scenario) -> str:
    from orchestrator.runs.record import run_label

    return run_label(scenario.simulation.master, scenario.simulation.macro_step)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and end the process with its exit status."""
    try:
        app(arguments)
    except SystemExit as end:
        if _left_behind():
            # the thread that waits for an FMU which hangs cannot be ended; only the process can
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(end.code if isinstance(end.code, int) else FAILED)
        raise


def _left_behind() -> bool:
    """Whether a call of an FMU was given up; nothing is imported for the question."""
    module = sys.modules.get("orchestrator.coupling.fmu.instance")
    return module is not None and module.any_abandoned()


if __name__ == "__main__":
    main()
