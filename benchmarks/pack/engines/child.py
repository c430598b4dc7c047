"""What an engine's own process does; it imports nothing of the project."""

from __future__ import annotations

import json
from collections.abc import Callable

Rows = list[list[float]]
Drive = Callable[[str, float, int, int, list[str]], tuple[Rows, float]]
"""Package, macro step (s), steps, how many lie between two rows, signals → rows, CPU time of the loop (s)."""


def main(drive: Drive, arguments: list[str]) -> None:
    """Run a package with one step length after the other; print rows and CPU time of each as soon as it is there."""
    place, plan, *signals = arguments
    for H, steps, every in json.loads(plan):
        rows, cpu = drive(place, H, steps, every, signals)
        print(json.dumps({"cpu": cpu, "rows": rows}), flush=True)
