"""The command line. Progress and errors go to stderr, answers to stdout.

Exit status: 0 done and within tolerance; 1 done, but a tolerance or a safety limit is missed; 2 wrong input;
3 the run failed; 130 interrupted; 128 + the number of another signal that has ended it. What is heavy is imported where it
is used, so that ``--help`` is quick.
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
from orchestrator.cli import modes, new, options, printing, streams
from orchestrator.cli.check import check
from orchestrator.cli.export import export
from orchestrator.cli.identify import identify
from orchestrator.cli.start import importing
from orchestrator.cli.sweep import sweep
from orchestrator.coupling.signals import Stopped, ending

ANSWERS = ("list", "validate", "limits", "check")
"""Commands that print, and leave nothing else: where their answer cannot be printed they have failed."""


class Commands(TyperGroup):
    """The commands; what they raise for the user ends in a message and an exit status, not in a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Carry out one command."""
        warnings.simplefilter("once")  # a scenario may be read for every master and step
        warnings.showwarning = lambda message, *_: printing.complain(str(message))
        try:
            done = super().invoke(ctx)
            if streams.lost() is not None and ctx.invoked_subcommand in ANSWERS:
                raise typer.Exit(3)  # which says why in the end
            return done
        except (Exception, KeyboardInterrupt, Stopped) as error:
            status = _explained(error)
            if status is None:
                raise
            raise typer.Exit(status) from None


def _explained(error: BaseException) -> int | None:
    """Say on stderr what ended a command and return its exit status; None where that is for others to say."""
    from orchestrator.coupling.errors import FAILED, INTERRUPTED, SIGNALLED, OrchestratorError

    if isinstance(error, OrchestratorError):
        for line in str(error).splitlines():
            printing.complain(line)
        return error.exit_status
    if isinstance(error, Stopped):
        printing.complain(str(error))
        return SIGNALLED + error.number
    if isinstance(error, KeyboardInterrupt):
        printing.complain("interrupted")
        return INTERRUPTED
    if isinstance(error, OSError) and not isinstance(
        error, BrokenPipeError
    ):  # a full disk, a folder that was taken away
        cure = "make room or choose another place with --out"
        printing.complain(f"{error.filename or 'results'}: {error.strerror}; {cure}")
        return FAILED
    return None


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain text: half the time, and a pipe or an ASCII terminal shows it as it is
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Land power-line robots on a flexible cable: FMUs coupled, and held against a monolithic solver.",
    epilog="Exit status: 0 done and within tolerance; 1 a tolerance or safety limit is missed; "
    "2 wrong input; 3 the run failed; 130 interrupted.",
)
app.add_typer(new.app, name="new")


def _print_version(asked: bool) -> None:
    if asked:
        print(f"orchestrator {orchestrator.__version__}")
        raise typer.Exit


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and end.")
    ] = False,
) -> None: ...


@app.command()
def build(
    out: Annotated[Path | None, typer.Option(help="Folder of the FMUs. Default: the cache that runs use.")] = None,
) -> None:
    """Build the FMUs of all modules and robots, and print where they are."""
    from orchestrator.catalogue.library import build_all

    for path in build_all(out):
        print(path)


@app.command("list")
def list_() -> None:
    """List scenarios, robots, conductors, contact stiffness sets and masters."""
    from orchestrator.catalogue import listing

    groups = {"Scenarios": listing.scenarios(), "Robots": listing.robots(), "Conductors": listing.conductors()}
    groups |= {"Contact stiffness sets": listing.contact_sets(), "Masters": listing.masters()}
    printing.print_catalogue(groups)


@app.command()
def validate(scenario: options.Scenario, robot: options.Robot = None, set_: options.Set = None) -> None:
    """Check a scenario; nothing is run.

    Parsed and loaded, with connections, units and contracts.
    """
    with importing():
        from orchestrator.api import load_scenario
        from orchestrator.landing.line_state import rest_words
        from orchestrator.runs.components import master_of, opened
        from orchestrator.runs.systems import LandingSystem, resolve

    loaded = load_scenario(scenario, set=set_, robot=robot)
    system = resolve(loaded)
    with opened(system) as graph:
        master_of(loaded, graph)
        print(f"{scenario}: valid; {len(graph.components)} FMUs, {len(list(graph.connections))} connections")
        apart = [name for name, fmu in graph.components.items() if fmu.limits]
        if apart:
            print(f"in processes of their own: {', '.join(apart)}")
        for note in system.notes(graph):
            print(note)
    if isinstance(system, LandingSystem) and system.landing.rest is not None:
        print(rest_words(system.landing.rest.content()))


@app.command()
def limits(scenario: options.Scenario, robot: options.Robot = None, set_: options.Set = None) -> None:
    """What a landing is judged by: each limit with its formula, numbers and source; nothing is run."""
    with importing():
        from orchestrator.api import load_scenario
        from orchestrator.landing.limits import landing_only, limits_of, roll_range
        from orchestrator.landing.resolve import resolve

    landing = resolve(landing_only(load_scenario(scenario, set=set_, robot=robot)))
    found = limits_of(landing)
    printing.print_limits(found)
    for line in roll_range(landing, found):
        print(line)


app.command()(check)


@app.command()
def run(
    scenario: options.Scenario,
    out: options.Out = None,
    robot: options.Robot = None,
    master: options.Master = None,
    macro_step: options.MacroStep = None,
    stop: options.Stop = None,
    timeout: options.Timeout = None,
    set_: options.Set = None,
    no_pictures: options.NoPictures = False,
    quiet: options.Quiet = False,
) -> None:
    """Run a scenario coupled, and estimate its error: coupling, inner steps and mesh.

    Exit status 1 where an estimated error misses its tolerance.
    """
    with importing():
        from orchestrator import api

    with printing.progress_bars(quiet) as progress:
        done = api.run(
            scenario,
            set=set_,
            robot=robot,
            master=master,
            macro_step=macro_step,
            stop=stop,
            timeout=timeout,
            out=True if out is None else out,
            progress=progress,
            pictures=not no_pictures,
        )
    printing.print_run(done)
    print(f"results in {done.directory}{printing.page_of(done.directory)}")
    printing.complain_of([done])
    raise typer.Exit(done.exit_status)


@app.command()
def compare(
    scenario: options.Scenario,
    out: options.Out = None,
    robot: options.Robot = None,
    master: options.Master = None,
    macro_step: options.MacroStep = None,
    stop: options.Stop = None,
    timeout: options.Timeout = None,
    set_: options.Set = None,
    masters: options.Masters = None,
    macro_steps: options.MacroSteps = None,
    no_pictures: options.NoPictures = False,
    quiet: options.Quiet = False,
) -> None:
    """Run coupled and monolithic, and say the error of coupling and mesh.

    Exit status 1 where it misses a tolerance.
    """
    with importing():
        from orchestrator import api

    try:
        with printing.progress_bars(quiet) as progress:
            done = api.compare(
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
                pictures=not no_pictures,
            )
    except api.Unfinished as error:
        printing.complain_of(error.runs)
        print(f"results so far in {error.directory}")
        raise
    printing.print_comparison(done)
    pictures = "" if no_pictures else f", pictures in {done.directory}/plots{printing.page_of(done.directory)}"
    unsafe = ", but the landing is not (clearly) safe" if done.safe is False else ""
    print(f"verdict: {'pass' if done.passed else 'FAIL'}{unsafe}; results in {done.directory}{pictures}")
    printing.complain_of(done.results)
    raise typer.Exit(done.exit_status)


app.command()(modes.modes)


@app.command()
def reproduce(
    out: Annotated[Path, typer.Option(help="Folder of finished runs; none of them is made again.")] = Path(
        "runs/reproduce"
    ),
    docs: Annotated[
        Path | None, typer.Option(help="Folder of page, JSON and pictures. Default: docs; with --only that of --out.")
    ] = None,
    only: Annotated[
        str | None, typer.Option(metavar="ID,ID,…", help="These claims alone, without the studies.")
    ] = None,
    study: Annotated[
        Path | None, typer.Option(help="Folder with claims.toml and landings.toml. Default: the paper's.")
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes. Default: one a processor.")] = None,
    quiet: options.Quiet = False,
) -> None:
    """Hold the paper against our runs, claim by claim.

    Writes reproduction.md and reproduction.json; an interrupted study goes on where it was.
    """
    with importing():
        from orchestrator.studies.reproduce import reproduce as hold

    with printing.counting_bar(quiet, "runs") as progress:
        done = hold(study, out, docs, _items(only), workers, progress)
    printing.print_reproduction(done)
    print(f"page in {done.page}, {done.wall_s:.0f} s")
    raise typer.Exit(done.exit_status)


app.command()(export)
app.command()(identify)
app.command()(sweep)


@app.command()
def report(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="Directory of a run.")],
) -> None:
    """Draw pictures and a page of results: of a finished run, or of what an unfinished one has left so far."""
    with importing():
        from orchestrator.api import report_of
        from orchestrator.coupling.run.results import read_json

    page = report_of(directory)
    manifest = page.parent / "manifest.json"
    if manifest.is_file() and (error := read_json(manifest)["error"]) is not None:
        printing.complain(f"{page.parent}: {error}")
    print(page)


def _numbers(text: str | None) -> list[float]:
    """Return the macro steps of ``--macro-steps``."""
    from orchestrator.coupling.errors import InputError

    try:
        return [float(item) for item in _items(text)]
    except ValueError:
        raise InputError(f"--macro-steps {text}: write numbers with commas between, 0.01,0.005") from None


def _items(text: str | None) -> list[str]:
    return [item.strip() for item in (text or "").split(",") if item.strip()]


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and end the process with its exit status."""
    printing.forgive_encodings()
    streams.forgive()
    try:
        with ending():
            app(arguments)
    except SystemExit as end:
        if _left_behind():
            from orchestrator.coupling.errors import FAILED

            # the thread that waits for an FMU which hangs cannot be ended; only the process can
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(end.code if isinstance(end.code, int) else FAILED)
        raise
    finally:
        _say_what_is_lost()


def _say_what_is_lost() -> None:
    """Say on stderr that answers could not be printed."""
    if (failure := streams.lost()) is not None:
        printing.complain(f"standard output: {failure.strerror}; what was to be printed is lost, results are kept")
    sys.stderr.flush()


def _left_behind() -> bool:
    """Whether a call of an FMU was given up; nothing is imported for the question."""
    module = sys.modules.get("orchestrator.coupling.fmu.instance")
    return module is not None and module.any_abandoned()


if __name__ == "__main__":
    main()
