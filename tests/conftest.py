"""What every test has: the same examples of a property each time, and a header that says what decides over last bits."""

from __future__ import annotations

import os
from pathlib import Path

import llvmlite.binding as llvm
import numba
import pytest
import scipy.linalg  # brings its own BLAS
from hypothesis import settings
from threadpoolctl import threadpool_info

from fmus.kernels import notice
from tests.browser import wanting

settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.register_profile("searching", deadline=None)
settings.load_profile("repeatable")


def blas_kernels() -> set[str]:
    """Return the processors that the BLAS kernels of NumPy and SciPy are made for, as far as they say so."""
    assert scipy.linalg
    return {library["architecture"] for library in threadpool_info() if "architecture" in library}


def pytest_configure() -> None:
    """See that the BLAS kernels asked for are those that run: OpenBLAS falls back without a word."""
    wanted, found = os.environ.get("OPENBLAS_CORETYPE"), blas_kernels()
    if wanted and found != {wanted}:
        raise pytest.UsageError(f"OPENBLAS_CORETYPE is {wanted}, but the BLAS has kernels for {', '.join(found)}")


def pytest_report_header() -> str:
    """Return for which processors the kernels are made that run here."""
    processor = numba.config.CPU_NAME or llvm.get_host_cpu_name()  # type: ignore[attr-defined]
    return f"kernels: {processor}; BLAS: {', '.join(sorted(blas_kernels())) or 'unknown'}"


@pytest.fixture(autouse=True)
def heard(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every test hear notices, whatever ``--quiet`` one before it has said."""
    monkeypatch.setattr(notice, "muted", False)


@pytest.fixture(scope="session")
def module() -> Path:
    """The compiled solver of the page, built where it is not yet; a minute. Skips where there is no linker."""
    from orchestrator.landing.monolithic import wasm  # with kernels that most tests do not need
    from tests.what_if import DIST

    try:
        wasm.build(DIST)
    except wasm.NoLinker as error:
        wanting(str(error))
    return DIST / wasm.MODULE
