"""``orchestrator check``: an FMU against a contract, as far as it can be read, and by its answers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestrator.cli import printing
from orchestrator.cli.start import importing

if TYPE_CHECKING:
    from orchestrator.coupling.fmu.isolated import Limits
    from orchestrator.landing.trial.dynamic import Trial
    from orchestrator.landing.trial.row import Row

PATIENCE = 300.0
"""s; the first step of our own FMUs may compile for some minutes."""
UNTESTED = {
    "robot": "whether it obeys forces and moments, falls, turns, and comes back to a saved state",
    "cable": "whether it rests, answers forces, and comes back to a saved state",
    "contact": "whether it pushes, rubs, and balances its forces",
    "any": "whether its steps agree, its means are right, and it comes back to a saved state",
}


def check(
    fmu: Annotated[Path, typer.Argument(metavar="FILE.fmu", help="The FMU.")],
    contract: Annotated[
        str | None, typer.Option(help="robot, cable, contact, controller or any. Default: the one it suits best.")
    ] = None,
    run: Annotated[
        bool, typer.Option("--run", help="Start and step it too: hold its answers against mechanics.")
    ] = False,
    macro_step: Annotated[float | None, typer.Option(help="Macro step of --run, s. Default: 5 ms, or its own.")] = None,
    timeout: Annotated[float, typer.Option(help="Wall time that one call of it may take, s.")] = PATIENCE,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the findings of --run to a file.")] = None,
    read_only: Annotated[bool, typer.Option("--read-only", help="Run no code of it: only read what it says.")] = False,
) -> None:
    """Check an FMU against a contract, point by point: that of a robot, a cable or a contact.

    It is read, loaded and instantiated, in a process of its own; with --run also stepped, and its answers are held against
    mechanics.
    """
    with importing():
        from orchestrator.coupling.errors import DONE, MISSED, InputError
        from orchestrator.coupling.fmu.isolated import Limits
        from orchestrator.landing.contract import check_fmu, is_met
        from orchestrator.landing.trial.loading import loaded

    if read_only and run:
        raise InputError("--read-only and --run: choose one")
    if macro_step is not None and not macro_step > 0.0:
        raise InputError(f"--macro-step {macro_step:g}: must be greater than 0")
    kind, findings = check_fmu(fmu, contract)
    if not read_only and is_met(findings[:2]):
        findings.insert(2, loaded(fmu, Limits(timeout)))
    printing.print_findings(kind, findings)
    met = is_met(findings)
    said = (
        "has no contract, and can be tried"
        if kind == "any"
        else f"{'meets' if met else 'does not meet'} the {kind} contract"
    )
    print(f"{fmu}: {said}{'' if kind == 'any' else ' as far as it can be read'}")
    if not run:
        print(f"not tested: {UNTESTED.get(kind, UNTESTED['any'])}; `orchestrator check --run {fmu}` does")
        raise typer.Exit(DONE if met else MISSED)
    raise typer.Exit(_tried(fmu, kind, macro_step, Limits(timeout), json) if met else MISSED)


def _tried(fmu: Path, kind: str, macro_step: float | None, limits: Limits, json: Path | None) -> int:
    """Put the FMU on trial, say what came of it, and return the exit status."""
    from orchestrator.coupling.errors import DONE, FAILED, MISSED
    from orchestrator.coupling.fmu.archive import sha256_of
    from orchestrator.coupling.run.results import write_json
    from orchestrator.landing.trial.dynamic import put_on_trial
    from orchestrator.landing.trial.remembered import remember

    trial = put_on_trial(fmu, kind, macro_step, limits)
    failed = [row.name for row in trial.rows if row.verdict == "FAIL"]
    remember(sha256_of(fmu), kind, [*failed, trial.failure] if trial.failure else failed)
    _print(trial)
    if json is not None:
        write_json(json, {"fmu": str(fmu), **trial.content()})
    if trial.failure:
        printing.complain(trial.failure)
        return FAILED
    print(f"{fmu}: {'passes' if trial.passed else f'{len(failed)} of {len(trial.rows)} findings fail'}")
    return DONE if trial.passed else MISSED


def _print(trial: Trial) -> None:
    """Print a line a finding, and of each that fails what was expected, what came out, and what it points to."""
    print(f"macro step {trial.macro_step:g} s")
    printing.print_table(
        (f"{trial.kind} on trial", "", ""),
        ((r.name, r.verdict, r.found if r.verdict == "pass" else r.why) for r in trial.rows),
    )
    for row in trial.rows:
        if row.verdict == "FAIL":
            print("\n".join(_words(row)))


def _words(row: Row) -> list[str]:
    """Return a failure in lines."""
    return [f"{row.name}: {row.why}", f"  expected  {row.expected}  ({row.source})", f"  found     {row.found}"]
