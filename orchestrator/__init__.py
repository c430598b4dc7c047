"""Scenario, graph, masters, reference, results: everything above the modules."""

from __future__ import annotations


def __getattr__(name: str) -> str:
    """Return ``__version__``: that of the installed package, which has it from pyproject.toml."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import PackageNotFoundError, version  # 20 ms that `--help` need not wait for

    try:
        return version("line-landing")
    except PackageNotFoundError:  # a source tree that was never installed
        return "0+unknown"
