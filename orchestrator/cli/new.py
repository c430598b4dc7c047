"""``orchestrator new``: commented files to start from."""

from __future__ import annotations

from typing import Annotated

import typer

app = typer.Typer(no_args_is_help=True, help="Write a commented file to start from; nothing is overwritten.")
Name = Annotated[str, typer.Argument(metavar="NAME", help="Name or path of the file; .toml is added.")]


@app.command()
def scenario(name: Name) -> None:
    """Write a landing with all its sections explained."""
    from orchestrator.catalogue.new import write_new

    print(write_new("scenario", name))


@app.command()
def robot(name: Name) -> None:
    """Write a robot with all its numbers explained."""
    from orchestrator.catalogue.new import write_new

    print(write_new("robot", name))
