"""The command line. Progress and errors go to stderr, answers to stdout.

Exit status: 0 done and within tolerance; 1 done, but a tolerance or a safety limit is missed; 2 wrong input;
3 the run failed; 130 interrupted. What is heavy is imported where it is used, so that ``--help`` is quick.
"""

from __future__ import annotations

import os
import sys
import warnings
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import orchestrator
from orchestrator.cli import new
from orchestrator.cli.printing import (
    complain,
    complain_of,
    markup,
    print_comparison,
    print_run,
    print_table,
    progress_bars,
)
from orchestrator.coupling.errors import DONE, FAILED, INTERRUPTED, MISSED, InputError, OrchestratorError


class Commands(TyperGroup):
    """The commands; what they raise for the user ends in a message and an exit status, not in a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Carry out one command."""
        warnings.showwarning = lambda message, *_: complain(str(message))
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

ScenarioFile = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A shipped scenario's name, or a scenario file (TOML).")
]
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
    from orchestrator.api import load_scenario
    from orchestrator.runs.components import master_of, opened

    loaded = load_scenario(scenario, set=set_, robot=robot)
    for note in loaded.notes:
        complain(note)
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
    with progress_bars(quiet) as progress:
        done = orchestrator.run(
            scenario,
            set=set_,
            robot=robot,
            master=master,
            macro_step=macro_step,
            stop=stop,
            timeout=timeout,
            out=True if out is None else out,
            progress=progress,
        )
    print_run(done)
    print(f"results in {done.directory}")
    complain_of([done])
    raise typer.Exit(done.exit_status)


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
    from orchestrator.api import Unfinished

    try:
        with progress_bars(quiet) as progress:
            done = orchestrator.compare(
                scenario,
                masters=_items(masters),
                macro_steps=_numbers(macro_steps),
                set=set_,
                robot=robot,
                master=master,
                macro_step=macro_step,
                stop=stop,
                timeout=timeout,
                out=True if out is None else out,
                progress=progress,
            )
    except Unfinished as error:
        complain_of(error.runs)
        print(f"results so far in {error.directory}")
        raise
    print_comparison(done)
    folder = done.directory
    print(f"verdict: {'pass' if done.passed else 'FAIL'}; results in {folder}, pictures in {folder}/plots")
    complain_of(done.results)
    raise typer.Exit(done.exit_status)


@app.command()
def modes(
    scenario: ScenarioFile,
    count: Annotated[int, typer.Option(help="Number of modes out of the vertical plane, and in it.")] = 6,
    out: Annotated[Path | None, typer.Option(help="Directory for table and picture; it must not exist.")] = None,
    set_: Set = None,
) -> None:
    """Natural frequencies, damping ratios and shapes of the scenario's cable about its static equilibrium."""
    from rich.table import Table

    from orchestrator.api import load_scenario
    from orchestrator.landing import modes as vibration
    from orchestrator.report.modes import write as write_modes

    if out is not None and out.exists():
        raise InputError(f"{out}: exists already; remove it or choose another with --out")
    found = vibration.of_scenario(load_scenario(scenario, set=set_), count)
    table = Table("mode", "out of plane \\[Hz]", "damping", "in plane \\[Hz]", "damping", box=None, pad_edge=False)
    groups = (found.out_of_plane, found.in_plane)
    for k in range(max(group.frequency.size for group in groups)):
        cells = [f"{x[k]:{form}}" if k < x.size else "" for g in groups for x, form in g.columns()]
        table.add_row(str(k + 1), *cells)
    print_table(table)
    if out is not None:
        write_modes(found, out)
        print(f"table and picture in {out}")


@app.command()
def report(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="Directory of a finished run.")],
) -> None:
    """Draw the pictures of a finished run or comparison anew, and a page that shows them."""
    from orchestrator.report.page import report as make

    print(make(directory))


def _numbers(text: str | None) -> list[float]:
    """Return the macro steps of ``--macro-steps``."""
    try:
        return [float(item) for item in _items(text)]
    except ValueError:
        raise InputError(f"--macro-steps {text}: write numbers with commas between, 0.01,0.005") from None


def _items(text: str | None) -> list[str]:
    return [item.strip() for item in (text or "").split(",") if item.strip()]


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
