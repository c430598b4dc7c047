"""Import this to have what a monolithic run needs; kernels that are not compiled yet are left alone."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from fmus.kernels.jit import is_compiled
from orchestrator.coupling.errors import InputError
from orchestrator.landing import monolithic
from orchestrator.runs.job import Job, code_version
from orchestrator.runs.systems import resolve

SCENARIO = "landing_200m_point9"
"""A landing that is shipped; what it is does not matter."""


def load() -> None:
    """Call the kernels, which loads them."""
    problem = resolve(Job(SCENARIO).loaded()).problem()
    if problem is not None:
        monolithic.solve(problem, np.array([0.0, 1e-3]), 1e-5, estimate=False)


code_version()
if is_compiled("orchestrator.landing.monolithic") and is_compiled("fmus"):
    with suppress(InputError):  # whoever runs it will be told
        load()
