"""The command line in this process: a process of its own takes 2 s for imports and kernels before it does anything."""

from __future__ import annotations

import contextlib
import io
from dataclasses import dataclass
from pathlib import Path

from orchestrator.cli import commands
from tests.scenarios import ROOT


@dataclass(frozen=True)
class Done:
    """How a command has ended, by the names of `subprocess.CompletedProcess`."""

    returncode: int
    stdout: str
    stderr: str


def orchestrate(*arguments: object, folder: Path = ROOT) -> Done:
    """Run a command in `folder`; there is never a traceback."""
    out, err = io.StringIO(), io.StringIO()
    status = None
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), contextlib.chdir(folder):
        try:
            commands.main([str(argument) for argument in arguments])
        except SystemExit as end:
            status = end.code
    assert isinstance(status, int), "it has not ended"
    assert "Traceback" not in err.getvalue(), err.getvalue()
    return Done(status, out.getvalue(), err.getvalue())
