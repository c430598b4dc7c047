"""``orchestrator new``: commented files and small projects to start from."""

from __future__ import annotations

from typing import Annotated

import typer

app = typer.Typer(
    no_args_is_help=True, help="Write a commented file or a project to start from; nothing is overwritten."
)
Name = Annotated[str, typer.Argument(metavar="NAME", help="Name or path of the file; .toml is added.")]


@app.command()
def scenario(name: Name) -> None:
    """Write a landing with all its sections explained."""
    from orchestrator.catalogue.new import write_new

    print(write_new("scenario", name))


@app.command()
def robot(
    name: Annotated[str, typer.Argument(metavar="NAME|NAME.toml", help="Name or path of the project, or of a file.")],
    c: Annotated[bool, typer.Option("--c", help="In C, FMI 2.0, instead of Python.")] = False,
    fmi3: Annotated[bool, typer.Option("--fmi3", help="In C, FMI 3.0.")] = False,
    wheels: Annotated[int, typer.Option(help="Number of wheels, 1 to 4.")] = 1,
) -> None:
    """Write a robot: as a project for an FMU of your own, or, NAME.toml, as a file of the catalogue's kind.

    The project has the robot's source, a scenario that lands it, a Makefile and a README.
    """
    from orchestrator.catalogue.new import write_new
    from orchestrator.catalogue.project import write_project

    if name.endswith(".toml"):
        _require_none({"--c": c, "--fmi3": fmi3, "--wheels": wheels != 1})
        print(write_new("robot", name))
        return
    if c and fmi3:
        raise _wrong("--c and --fmi3: choose one")
    folder = write_project(name, "fmi3" if fmi3 else "c" if c else "python", wheels)
    print(f"{folder}: README.md says how to build, check and land it")


def _require_none(given: dict[str, bool]) -> None:
    """Refuse options of a project for a file of the catalogue."""
    wrong = [option for option, there in given.items() if there]
    if wrong:
        raise _wrong(f"{', '.join(wrong)}: for projects; leave .toml away from the name")


def _wrong(message: str) -> Exception:
    from orchestrator.coupling.errors import InputError

    return InputError(message)
