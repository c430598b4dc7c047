"""Whether an FMU can be loaded and instantiated: the first thing that runs code of it."""

from __future__ import annotations

from pathlib import Path

from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.landing.contract import Finding

DONE = "its code was run so far: neither initialised nor stepped"


def loaded(path: Path) -> Finding:
    """Load and instantiate the FMU at `path`, free it again, and return whether that went well."""
    what = "loads and instantiates"
    try:
        with Fmu(path):
            return Finding(what, "ok", DONE)
    except (ValueError, FmuError) as error:
        return Finding(what, "wrong", str(error))
