"""Small FMUs for the tests, built into a temporary folder."""

from __future__ import annotations

from pathlib import Path

from pythonfmu import FmuBuilder

SCRIPTS = Path(__file__).resolve().parent
OPTIONS = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True, "needsExecutionTool": False}


def build(script: str, folder: Path, **options: bool) -> Path:
    """Build one of the scripts of this folder into `folder`; return the FMU."""
    folder.mkdir(parents=True, exist_ok=True)
    return Path(FmuBuilder.build_FMU(str(SCRIPTS / script), dest=str(folder), **{**OPTIONS, **options}))
