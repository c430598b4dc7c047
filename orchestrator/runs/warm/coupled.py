"""Import this to have what a coupled run of our modules needs; kernels that are not compiled yet are left alone."""

from __future__ import annotations

import lxml.etree  # noqa: F401  reads model descriptions

from fmus.face.first_use import LANDING, compile_module
from fmus.kernels.jit import is_compiled
from orchestrator.runs.job import code_version

code_version()
if is_compiled("fmus"):
    for name in LANDING:
        compile_module(name)  # what is compiled is loaded
