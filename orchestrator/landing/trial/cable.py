"""The trial of a cable: at rest it stays, its ports answer each other, means and tangents are what they say."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

from orchestrator.coupling.errors import InputError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.landing.contract import CABLE, MOST_PORTS
from orchestrator.landing.trial.bench import Bench, Course, Isolation, Motion, held
from orchestrator.landing.trial.means import means, motions, pair, rate_of
from orchestrator.landing.trial.row import ACCURACY, Row, deviation, judged, untestable

PLACES = (0.31, 0.52, 0.23, 0.74)
"""Where the ports stand, as shares of the length: at no node, and not mirrored."""
FORCE, MOMENT = 10.0, 1.0
"""N, N m; small against the tension of any line."""
STEPS = 20
"""Macro steps at rest."""
REST = "equilibrium"
SPEED = 1.0
"""m/s along the line, of a port that moves."""


def bench_of(path: Path, macro_step: float | None = None, isolate: Isolation = False) -> Bench:
    """Return a bench on which a cable hangs at rest, its ports within the span."""
    with Fmu(path, isolate=isolate) as fmu:
        names = ("unstretched_length", "span")
        length = next((float(fmu.read(name)) for name in names if name in fmu.ports), 0.0)
        n = sum(f"port[{k + 1}].s" in fmu.ports for k in range(MOST_PORTS))
    if length <= 0.0:
        raise InputError(
            f"{path}: shows neither unstretched_length nor span as a parameter: nobody knows how long it is"
        )
    start = {f"port[{k + 1}].s": PLACES[k] * length for k in range(n)}
    driven = (name for point in CABLE if point.causality == "input" for k in range(n) for name in point.names(k + 1))
    return Bench(path, start, macro_step, (name for name in driven if not name.endswith(".s")), isolate)


def cable_rows(bench: Bench) -> Iterator[Row]:
    """Yield what a cable's answers say, row by row."""
    n = _ports(bench)
    yield _tangents(bench, n)
    yield _rest(bench)
    yield _moving(bench)
    yield from _answers(bench, min(n, 2))
    two = pair(bench, cable_course(bench, 2))
    ports = [f"port[{k + 1}]" for k in range(n)]
    for name, rate in (("position", "velocity"), ("tangent", "tangent_rate")):
        names, rates = ([f"{port}.{what}" for port in ports] for what in (name, rate))
        yield rate_of(two, names, rates, f"{rate} is the rate of {name}")
    yield from means(two, motions(bench))
    yield _energy(bench)


def cable_course(bench: Bench, steps: int) -> Course:
    """Return loads at the first port that rise from nothing, as far as the cable takes slopes."""
    duration = steps * bench.H
    loads = {"port[1].force.z": -FORCE, "port[1].force.x": 0.5 * FORCE}
    smooth = bench.has("port[1].force_rate")
    return held(loads, duration, {name: 2.0 * load / duration for name, load in loads.items()} if smooth else None)


def _ports(bench: Bench) -> int:
    return sum(bench.has(f"port[{k + 1}].position") for k in range(MOST_PORTS))


def _shown(bench: Bench, s: float, name: str) -> np.ndarray:
    fmu = bench.fresh({"port[1].s": s})
    try:
        group = fmu.group([f"port[1].{name}.{axis}" for axis in "xyz"])
        group.get_finite()
        return group.values.copy()
    finally:
        fmu.close()


def _tangents(bench: Bench, n: int) -> Row:
    """Return whether the tangent is the rate of the position with arc length."""
    s = float(bench.parameters["port[1].s"])
    ds = 1e-3 * s
    slopes = [(_shown(bench, s + d, "position") - _shown(bench, s - d, "position")) / (2 * d) for d in (ds, ds / 2)]
    limit = (4 * slopes[1] - slopes[0]) / 3
    compared = deviation(_shown(bench, s, "tangent"), limit, float(np.max(np.abs(limit - slopes[1]))), at=s / ds)
    expected = "tangent = d position / ds"
    return judged(
        "tangent",
        expected,
        "positions at other s",
        compared.words(),
        compared.good,
        "normalised, or another arc length",
    )


def _moving(bench: Bench) -> Row:
    """Return whether a port that moves along is afterwards where a port is that has been there from the start."""
    name = "port[1] moves along"
    if not bench.has("port[1].s_rate"):
        return untestable(name, "it has no port[1].s_rate: a load that rolls stands still within a step")
    s, way = float(bench.parameters["port[1].s"]), SPEED * bench.H
    motion = bench.run({"port[1].s_rate": SPEED}, bench.H, 1)
    start, end = motion["port[1].position"]
    there = _shown(bench, s + way, "position")
    compared = deviation(end - start, there - start, at=float(np.max(np.abs(start))))
    why = "it stands still, or s counts from elsewhere"
    return judged(name, "at s + s_rate H after a step", "positions at other s", compared.words(), compared.good, why)


def _rest(bench: Bench) -> Row:
    """Return whether the cable stays where it is with nothing applied."""
    duration = STEPS * bench.H
    motions_ = [bench.run(loads, duration, STEPS) for loads in ({}, {"port[1].force.z": -FORCE})]
    drift, moved = (float(np.max(np.abs(m["port[1].position"] - m["port[1].position"][0]))) for m in motions_)
    found = f"{drift:.1e} m, against {moved:.1e} m under {FORCE:g} N"
    good = drift <= ACCURACY * moved + 1e-12 * float(np.max(np.abs(motions_[0]["port[1].position"])))
    expected = f"no motion over {duration:g} s with nothing applied"
    return judged("rest", expected, REST, found, good, "it does not start in equilibrium, or something else acts on it")


# -- known loads ----------------------------------------------------------------------------------------------


def _speeds(motion: Motion, n: int) -> np.ndarray:
    """Return velocity and turning of the ports after the first step, (6 n,)."""
    parts = []
    for k in range(n):
        tangent, rate = (motion[f"port[{k + 1}].{name}"][1] for name in ("tangent", "tangent_rate"))
        parts += [motion[f"port[{k + 1}].velocity"][1], np.cross(tangent, rate) / (tangent @ tangent)]
    return np.concatenate(parts)


def _answers(bench: Bench, n: int) -> Iterator[Row]:
    """Yield whether each force moves its port along, and whether ports answer each other."""
    names = [f"port[{k + 1}].{what}.{axis}" for k, what, axis in product(range(n), ("force", "moment"), "xyz")]
    sizes = np.tile(np.repeat([FORCE, MOMENT], 3), n)
    columns, bends = [], []
    for name, size in zip(names, sizes, strict=True):
        plus, minus = (_speeds(bench.run({name: sign * size}, bench.H, 1), n) / size for sign in (1.0, -1.0))
        columns.append((plus - minus) / 2)
        bends.append(float(np.max(np.abs(plus + minus))) / 2)
    Y = np.array(columns).T
    usual = float(np.max(np.diag(Y)[[i for i, name in enumerate(names) if ".force." in name]]))
    for i, name in enumerate(names):
        if ".force." in name:
            found = f"{Y[i, i]:.3g} m/s per N after a step"
            good = bool(Y[i, i] > 1e-9 * abs(usual) > 0.0)
            why = (
                "it has no effect"
                if abs(Y[i, i]) <= 1e-9 * abs(usual) or usual == 0.0
                else "it acts the wrong way round"
            )
            yield judged(f"{name} acts", "its port goes along with it", "power is positive", found, good, why)
    yield _reciprocity(Y, names, max(bends))


def _reciprocity(Y: np.ndarray, names: list[str], bend: float) -> Row:
    """Return whether the matrix of answers is symmetric, turning weighed to be as large as moving."""
    moving = np.array([".force." in name for name in names])
    turns = float(np.max(np.abs(np.diag(Y)[~moving]), initial=0.0))
    weights = np.where(moving, 1.0, np.sqrt(float(np.max(np.diag(Y))) / turns) if turns > 0.0 else 0.0)
    Y = Y * np.outer(weights, weights)
    compared = deviation(Y, Y.T, bend)
    worst = np.unravel_index(int(np.argmax(np.abs(Y - Y.T))), Y.shape)
    why = f"{names[worst[0]]} and {names[worst[1]]} do not answer each other"
    expected = "velocities at one port by loads at another, and the reverse, are the same"
    return judged("reciprocity", expected, "Maxwell–Betti", compared.words(), compared.good, why)


def _energy(bench: Bench) -> Row:
    """Return whether no energy comes from nowhere while a port is pulled."""
    name, parts = (
        "no energy from nowhere",
        ("kinetic_energy", "strain_energy", "gravitational_energy", "dissipated_energy"),
    )
    if not bench.has(*parts):
        return untestable(name, "it does not show all of its energies")
    steps = 2 * STEPS
    motion = bench.run({"port[1].force.z": -FORCE}, steps * bench.H, steps)
    done = -FORCE * float(motion["port[1].position"][-1, 2] - motion["port[1].position"][0, 2])
    energy = np.sum([motion[part] for part in parts], axis=0)
    gained = float(energy[-1] - energy[0])
    found = f"{gained:.5g} J of {done:.5g} J work"
    allowed = ACCURACY * abs(done) + 1e-12 * float(np.max(np.abs(energy)))
    expected = "energies grow by no more than the work done"
    return judged(name, expected, "energy balance", found, gained - done <= allowed, "energy is made")
