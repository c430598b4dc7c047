"""Studies of FMUs that crash or hang, in runs that are known."""

from __future__ import annotations

from pathlib import Path

from tests.fmus import compiled

CRASHES, HANGS, HARMLESS = 20, 21, 100
"""Faults of tests/fmus/lag2.c; those from `HARMLESS` on are none."""
PATIENCE = 8.0
"""s that a run may take; one that does not hang takes 0.03 s, and at first, on a busy machine, some more."""
SCENARIO = """
title = "p' = q, q' = -p"
connections = ["p.y -> q.u", "q.y -> p.u"]
[simulation]
stop_time = 0.1
macro_step = 0.01
master = "jacobi"
[components.p]
fmu = "{fmu}"
isolate = false
parameters.start = 1.0
[components.q]
fmu = "{fmu}"
isolate = false
parameters.gain = -1.0
"""
STUDY = """
scenario = "loop.toml"
timeout = {timeout}
extremes = ["p.y", "q.y"]
[vary]
"components.q.parameters.fault" = {faults}
"components.q.parameters.start" = {{ from = 0.0, to = 1.0, count = {count} }}
"""


def study_in(folder: Path, kinds: int, count: int, timeout: float) -> Path:
    """Write a study of `kinds` times `count` runs, `count` of which crash and as many hang."""
    faults = [HARMLESS + i for i in range(kinds - 2)]
    faults[kinds // 3 : kinds // 3] = [CRASHES]
    faults[kinds // 2 : kinds // 2] = [HANGS]
    (folder / "loop.toml").write_text(SCENARIO.format(fmu=compiled("lag2")), encoding="utf-8")
    path = folder / "study.toml"
    path.write_text(STUDY.format(timeout=timeout, faults=[float(x) for x in faults], count=count), encoding="utf-8")
    return path
