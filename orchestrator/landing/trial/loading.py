"""Whether an FMU can be loaded and instantiated: the first thing that runs code of it."""

from __future__ import annotations

from pathlib import Path

from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.landing.contract import Finding
from orchestrator.landing.trial.bench import Isolation

DONE = "its code was run so far: neither initialised nor stepped"


def loaded(path: Path, isolate: Isolation = False) -> Finding:
    """Load and instantiate the FMU at `path`, free it again, and return whether that went well."""
    what = "loads and instantiates"
    try:
        with Fmu(path, isolate=isolate):
            return Finding(what, "ok", DONE)
    except (ValueError, FmuError) as error:
        return Finding(what, "wrong", str(error))
