"""Runs that are made up, and known: what several tests of pictures and pages show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from orchestrator.coupling.run.compare import signal_errors
from orchestrator.landing.safety import Limit, Limits, judge
from orchestrator.runs.compare import Comparison, Reference, RunErrors
from orchestrator.runs.result import Run

TIME = np.linspace(0.0, 2.0, 201)
S = np.linspace(0.0, 200.0, 41)
Z = -0.4 * np.sin(2.0 * TIME) ** 2


def landing(n_wheels: int = 1, shift: float = 0.0) -> dict[str, np.ndarray]:
    """The signals of a landing that touches at 0.5 s and is in the air from 1.2 to 1.5 s, `shift` too high."""
    closed = (TIME >= 0.5) & ~((TIME > 1.2) & (TIME < 1.5))
    table = {"time": TIME, "robot.body.position.y": np.full(201, 20.0), "robot.body.position.z": 3.0 + Z + shift}
    table |= {f"robot.{name}": k * 0.01 * np.sin(TIME) for k, name in enumerate(("roll", "pitch", "yaw"))}
    for k in range(1, n_wheels + 1):
        table |= {f"contact{k}.normal_force": np.where(closed, 400.0 + k, 0.0), f"contact{k}.status": 1.0 * closed}
    return table | {"cable.tension_mid": 22000.0 + 1000.0 * np.sin(TIME)}


def kinked_shape() -> dict[str, np.ndarray]:
    """A cable that hangs in a parabola and is pulled down under a wheel at 20 m."""
    hanging = -2.0 * (1.0 - (S / 100.0 - 1.0) ** 2)
    kink = np.minimum(S / 20.0, (200.0 - S) / 180.0)
    position = np.stack([np.stack([0.0 * S, S, hanging + z * kink], axis=-1) for z in Z])
    return {"time": TIME, "arc_length": S, "position": position, "tension": np.full((201, 41), 22000.0)}


def made_up(table: dict[str, np.ndarray], master: str = "iqn_ils", macro_step: float = 0.01, **summary: object) -> Run:
    """A run with these signals."""
    n = len(table["time"]) - 1
    steps = {"time": table["time"][1:], "iterations": 2 + np.arange(n) % 3, "converged": np.arange(n) != 7}
    content = {
        "scenario": "made_up", "master": master, "macro_step": macro_step, "units": {}, "tolerances": {}, "steps": n,
        "estimated_error": {}, "unconverged_steps": 1, "left_the_groove": [], "verdict": "within",
        "iterations_per_step": 3.0, "wall_s": 1.0 + macro_step, "solves": {"cable": int(1 / macro_step)},
    }  # fmt: skip
    manifest = {"complete": True, "error": None, "resolved": {"title": "Made up <here>"}}
    return Run(table, steps, {}, content | summary, manifest)


# -- with all that a page shows -----------------------------------------------------------------------------------


def on_a_line(n_wheels: int = 1, shift: float = 0.0) -> Run:
    """A landing that is drawn: with wheels, ports, a line, limits, geometry, sources and estimated errors."""
    table = landing(n_wheels, shift) | _places(n_wheels, shift)
    limits = Limits(
        {"roll": Limit("roll", 0.25, "rad", "eq. 1"), "tension": Limit("tension", 0.4, "1", "a code", reference=98e3)},
        {"slip": "no limit given"},
    )
    said = judge(limits, table).content()
    parts = {"coupling": 1e-8, "inner_steps": None, "mesh": 2e-5, "total": 3e-5}
    units = {name: "m" if "position" in name else "N" for name in table}
    run = made_up(
        table, tolerances={"robot.body.position.z": 1e-3}, units=units, geometry=geometry(n_wheels),
        estimated_error={"robot.body.position.z": parts}, estimate_failure="", robot="made_up", **said,
    )  # fmt: skip
    resolved = {"title": "A landing that was made up", "cable": {"parameters": {"span": 200.0}}}
    provenance = {"cable.parameters.span": {"source": "Jia et al. 2025", "reason": "", "unit": "m"}}
    return replace(
        run, fields=kinked_shape(), manifest={**run.manifest, "resolved": resolved, "provenance": provenance}
    )


def geometry(n_wheels: int) -> dict[str, Any]:
    """What ``summary.json`` says of span and robot."""
    assumed = {"value": 0.1, "unit": "m", "source": "assumed", "reason": "nobody has measured it"}
    wheel = {
        "axle_direction": [1.0, 0.0, 0.0],
        "axle_yaw": 0.0,
        "axle_tilt": 0.0,
        "braked": True,
        "radius": 0.075,
        "groove_angle": 1.745,
        "groove_width": 0.08,
    }
    return {
        "span": 200.0, "level_difference": 1.5, "cable_length": 200.0, "cable_diameter": 0.018, "landing_position": 20.0,
        "robot": {
            "name": "made_up", "layout": "top", "line_above_rotors": 0.162, "weight": 372.4, "center_of_mass": [0.0, 0.0, -0.1],
            "size": {"across": 1.25, "along": 1.25, "height": 1.2, "below_line": None},
            "wheels": [wheel | {"mount": [0.0, _along(k, n_wheels), 0.2152]} for k in range(n_wheels)],
            "quantities": {"body.height": assumed, "body.width": assumed},
        },
    }  # fmt: skip


def _along(k: int, n_wheels: int) -> float:
    """Where wheel k stands along the line, m."""
    return 0.3 * (k - 0.5 * (n_wheels - 1))


def _places(n_wheels: int, shift: float) -> dict[str, np.ndarray]:
    """The signals of places and forces that are drawn."""
    zero, up = np.zeros(TIME.size), 3.2152 + Z + shift
    table = {"robot.body.position.x": zero, "cable.tension_left": 23000.0 + zero, "cable.tension_right": 22500.0 + zero}
    for k in range(1, n_wheels + 1):
        y = 20.0 + _along(k - 1, n_wheels)
        for name, place in {f"robot.wheel[{k}].position": up, f"cable.port[{k}].position": up - 0.053}.items():
            table |= {f"{name}.x": zero, f"{name}.y": y + zero, f"{name}.z": place}
        vectors = {f"robot.wheel[{k}].axle": "x", f"cable.port[{k}].tangent": "y", f"contact{k}.wheel.force": "z"}
        table |= {f"{name}.{c}": (1.0 if c == one else 0.0) + zero for name, one in vectors.items() for c in "xyz"}
        table |= {f"contact{k}.{name}": 0.01 + zero for name in ("slip_velocity", "penetration", "friction_force")}
        table |= {f"contact{k}.cable.s": y + zero}
    return table


def compared_to(run: Run, masters: Sequence[str]) -> Comparison:
    """A comparison of runs that are `run` moved up, by another millimetre each, against `run` itself."""
    n_wheels = sum(name.endswith(".status") for name in run.table)
    reference = Reference("made up", run.table, 1.0, {"robot.body.position.z": 1e-12}, run.fields, safety=run.summary)
    results, held = [], []
    for i, master in enumerate(masters, start=1):
        moved = on_a_line(n_wheels, shift=1e-3 * i)
        results.append(replace(moved, summary={**moved.summary, "master": master}))
        held.append(RunErrors(master, 0.01, 200, 3.0, 0, 100, 1.0, signal_errors(moved.table, run.table)))
    reference.safety = {key: run.summary[key] for key in ("safe", "safety", "limits", "not_judged")}
    return Comparison(reference, held, {"robot.body.position.z": 1e-4}, results)
