"""Options that several commands have, and the names that a shell completes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated

import typer

OSP_FILE = "OspSystemStructure.xml"
# -- completion -----------------------------------------------------------------------------------------------


def scenarios(incomplete: str) -> Iterator[str]:
    """Yield the shipped scenarios, the files (system structures, too) and the folders that `incomplete` may become."""
    from orchestrator.catalogue.listing import scenarios

    yield from starting(incomplete, scenarios())
    yield from files(incomplete, ".toml", ".ssp", OSP_FILE)


def robots(incomplete: str) -> Iterator[str]:
    """Yield the robots of the catalogue and the FMUs that `incomplete` may become."""
    from orchestrator.catalogue.listing import robots

    yield from starting(incomplete, robots())
    yield from files(incomplete, ".fmu", ".toml")


def masters(incomplete: str) -> Iterator[str]:
    """Yield the masters that `incomplete` may become; of names with commas between, the last is completed."""
    from orchestrator.catalogue.listing import masters

    before, comma, last = incomplete.rpartition(",")
    yield from (f"{before}{comma}{name}" for name in starting(last, masters()))


def files(incomplete: str, *endings: str) -> Iterator[str]:
    """Yield the folders, and the files with one of the `endings`, that `incomplete` may become."""
    folder = Path(incomplete) if incomplete.endswith("/") else Path(incomplete).parent
    names = (f"{path}/" if path.is_dir() else str(path) for path in sorted(folder.glob("*")))
    yield from (name for name in starting(incomplete, names) if name.endswith(("/", *endings)))


def starting(incomplete: str, names: Iterable[str]) -> Iterator[str]:
    """Yield those of `names` that begin with `incomplete`."""
    yield from (name for name in names if name.startswith(incomplete))


# -- options --------------------------------------------------------------------------------------------------

Scenario = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        help="Scenario file (TOML, SSP, OSP), or the name of a shipped one.",
        autocompletion=scenarios,
    ),
]
Out = Annotated[
    Path | None, typer.Option(help="Directory of the results; it must not exist. Default: runs/SCENARIO-NNN.")
]
Robot = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|FILE.toml|FILE.fmu", help="Another robot in the scenario's place.", autocompletion=robots
    ),
]
Master = Annotated[str | None, typer.Option(help="Another master, see `orchestrator list`.", autocompletion=masters)]
Masters = Annotated[str | None, typer.Option(metavar="A,B,…", help="Masters to compare.", autocompletion=masters)]
MacroStep = Annotated[float | None, typer.Option(help="Another macro step, s.")]
MacroSteps = Annotated[str | None, typer.Option(metavar="H,H,…", help="Macro steps to compare, s.")]
Stop = Annotated[float | None, typer.Option(help="Another stop time, s.")]
Timeout = Annotated[float | None, typer.Option(help="Wall time that one step of an FMU may take, s.")]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Another value, e.g. robot.parameters.mass=12; repeatable."),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress.")]
NoPictures = Annotated[
    bool, typer.Option("--no-pictures", help="No pictures and no page; `orchestrator report` makes them later.")
]
