"""What every test has: the same examples of a property each time, and a header that says what decides over last bits."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import llvmlite.binding as llvm
import numba
import pytest
import scipy.linalg  # brings its own BLAS
from hypothesis import settings
from threadpoolctl import threadpool_info

from fmus.kernels import notice
from tests.browser import wanting

LONG = (
    "docs", "examples", "trial", "cli", "nothing_lost", "isolated", "sweep_robust", "export", "page_browser", "whatif_browser",
    "controlled", "system_contact", "exchange", "limits", "report", "reproduce", "fuzz", "hostile", "whatif_compiled", "sweep",
    "batch", "estimate", "api", "kernels", "build", "identification", "masters", "contact_exchange", "system_energy", "net",
)  # fmt: skip
"""Files that take 10 s and more, the longest first: one that comes last keeps one process busy while the others have ended."""

settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.register_profile("searching", deadline=None)
settings.load_profile("repeatable")


def blas_kernels() -> set[str]:
    """Return the processors that the BLAS kernels of NumPy and SciPy are made for, as far as they say so."""
    assert scipy.linalg
    return {library["architecture"] for library in threadpool_info() if "architecture" in library}


def pytest_configure() -> None:
    """See that the BLAS kernels asked for are those that run (OpenBLAS falls back without a word), and hear Ctrl-C.

    A shell starts what it runs in its background with SIGINT ignored, and so would be what tests start: they would wait for
    ever for the end of what they interrupt.
    """
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    wanted, found = os.environ.get("OPENBLAS_CORETYPE"), blas_kernels()
    if wanted and found != {wanted}:
        raise pytest.UsageError(f"OPENBLAS_CORETYPE is {wanted}, but the BLAS has kernels for {', '.join(found)}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put long files first; within a file the order stays."""
    places = {f"test_{name}": place for place, name in enumerate(LONG)}
    items.sort(key=lambda item: places.get(item.path.stem, len(places)))


def pytest_report_header() -> str:
    """Return for which processors the kernels are made that run here."""
    processor = numba.config.CPU_NAME or llvm.get_host_cpu_name()  # type: ignore[attr-defined]
    return f"kernels: {processor}; BLAS: {', '.join(sorted(blas_kernels())) or 'unknown'}"


@pytest.fixture(autouse=True)
def heard(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every test hear notices, whatever ``--quiet`` one before it has said."""
    monkeypatch.setattr(notice, "muted", False)


@pytest.fixture(scope="module")
def coarse_pictures() -> Iterator[None]:
    """Pictures of a fifth of the resolution, for files of tests that do not look at them: they take half the time."""
    from orchestrator.report import style  # with matplotlib

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(style.STYLE, "savefig.dpi", 40)
        yield


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
