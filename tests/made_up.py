"""Runs that are made up, and known: what several tests of pictures and pages show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from orchestrator.coupling.run.compare import signal_errors
from orchestrator.coupling.run.results import write_json, write_table
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


LIMITS = Limits(
    {"roll": Limit("roll", 0.25, "rad", "eq. 1"), "tension": Limit("tension", 0.4, "1", "a code", reference=98e3)},
    {"slip": "no limit given"},
)


def on_a_line(n_wheels: int = 1, shift: float = 0.0) -> Run:
    """A landing that is drawn: with wheels, ports, a line, limits, geometry, sources and estimated errors."""
    table = landing(n_wheels, shift) | _places(n_wheels, shift)
    said = judge(LIMITS, table).content()
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
    """The signals of places and forces that are drawn; wheels are where the robot's angles put them."""
    zero = np.zeros(TIME.size)
    angles = np.stack([k * 0.01 * np.sin(TIME) for k in (2, 1, 0)], axis=1)  # yaw, pitch, roll of `landing`
    turned = Rotation.from_euler("ZYX", angles)
    body = np.stack([zero, 20.0 + zero, 3.0 + Z + shift], axis=1)
    table = {"robot.body.position.x": zero, "cable.tension_left": 23000.0 + zero, "cable.tension_right": 22500.0 + zero}
    for k in range(1, n_wheels + 1):
        centre = body + turned.apply([0.0, _along(k - 1, n_wheels), 0.2152])
        vectors = {
            f"robot.wheel[{k}].position": centre, f"cable.port[{k}].position": centre - [0.0, 0.0, 0.0532],
            f"robot.wheel[{k}].axle": turned.apply([1.0, 0.0, 0.0]),
            f"cable.port[{k}].tangent": np.tile([0.0, 1.0, 0.0], (TIME.size, 1)),
            f"contact{k}.wheel.force": np.tile([0.0, 0.0, 400.0], (TIME.size, 1)),
        }  # fmt: skip
        table |= {f"{name}.{axis}": values[:, i] for name, values in vectors.items() for i, axis in enumerate("xyz")}
        table |= {f"contact{k}.{name}": 0.01 + zero for name in ("slip_velocity", "penetration", "friction_force")}
        table |= {f"contact{k}.cable.s": centre[:, 1]}
    return table


def swept(folder: Path) -> Path:
    """The folder of a made-up sweep of two places and two masses; the third run has left no signals, the last is unsafe."""
    cells, rows = [], []
    for i, (place, mass) in enumerate(product((20.0, 60.0), (38.0, 80.0)), start=1):
        run = on_a_line()
        table = run.table | {"robot.body.position.y": place + 0.0 * TIME}
        table |= {"robot.roll": (0.3 if i == 4 else 0.1) * np.sin(TIME)}
        said = judge(LIMITS, table).content()
        write_json(
            folder / "runs" / f"run{i}" / "summary.json",
            {**said, "geometry": geometry(1) | {"landing_position": place}},
        )
        if i != 3:
            write_table(folder / "runs" / f"run{i}" / "results.csv", table)
        margins = {name: 1.0 - one["share"] for name, one in said["limits"].items()}
        binding = min(margins, key=lambda name: margins[name])
        verdict = "safe" if said["safe"] else "unsafe"
        cells.append({
            "at": [place, mass], "areas": [[[place - 20.0, place + 20.0], [mass - 21.0, mass + 21.0]]],
            "margin": margins[binding], "binding": binding, "verdict": verdict, "margins": margins, "probability": None,
            "run": i, "folder": f"runs/run{i}", "recorded": i != 3, "runs": [i], "failed": 0,
        })  # fmt: skip
        rows.append(f"{i},{place},{mass},{int(said['safe'])},{margins[binding]},{binding},{said['safety']},")
    axes = [
        _axis("landing.position", "Landing position", "m", [20.0, 60.0]),
        _axis("robot.parameters.mass", "Mass of the robot", "kg", [38.0, 80.0]),
    ]
    limits = ["roll", "tension"]
    content = {
        "format": 1,
        "study": "made_up",
        "title": "A sweep",
        "complete": True,
        "refined": None,
        "axes": axes,
        "limits": limits,
    }
    write_json(folder / "map.json", content | {"maps": [{"where": {}, "cells": cells}]})
    counts = {"runs": 4, "safe": 3, "not_safe": 1, "not_judged": 0, "failed": 0}
    study = {
        "study": "made_up",
        "title": "A sweep",
        "complete": True,
        "counts": counts,
        "content": {"scenario": "made_up"},
    }
    write_json(folder / "study.json", study)
    head = "run,landing.position,robot.parameters.mass,safe,least_margin,binding,verdict,failure"
    (folder / "table.csv").write_text(
        "\n".join([head, *(row.replace(": roll, tension", ": roll and tension") for row in rows)]) + "\n"
    )
    return folder


def _axis(key: str, label: str, unit: str, values: list[float]) -> dict[str, Any]:
    return {
        "key": key,
        "label": label,
        "unit": unit,
        "numeric": True,
        "values": values,
        "range": [values[0], values[-1]],
    }


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
