"""Prediction from models in graphs that are made up: many interfaces, several rates, no means, names of any kind.

A free mass answers to a load that is linear in time exactly linearly, and constant velocity explains all the rest of its
motion: nothing is left to be extrapolated or remembered. So what is foretold is exact, however hard and crooked the law between
the masses is, and every step after the first ones is one solve.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.run.log import Log
from tests.fmus import fmu
from tests.systems import run

H = 0.01
BUFFER = {"stiffness": 3e4, "exponent": 1.5, "two_sided": 0.0, "damping": 0.2}
WAVES = ("position", "position_mean")
KNOWN = 1
"""Steps until every mass has been seen once."""


def pair(
    number: int, variables: Iterable[str], kind: str, law: dict, *, steps: int = 1
) -> tuple[dict, list[Connection]]:
    """Return two free masses that fly against one another, and the law between them, which is told their `variables`."""
    names = [f"{side}{number}" for side in "ab"]
    speeds = (0.3 + 0.1 * number, -0.2)
    parts = {
        name: fmu("link", name, mass=1.0 + i, initial_velocity=speeds[i], steps=steps) for i, name in enumerate(names)
    }
    gap = {"gap": -0.01 * number} if kind == "spring" else {}
    parts[f"s{number}"] = fmu(kind, f"s{number}", **law, **gap)
    pairs = []
    for side, name in zip("ab", names, strict=True):
        pairs += [(f"{name}.{v}", f"s{number}.{side}.{v}") for v in variables]
        pairs += [(f"s{number}.{side}.{v}", f"{name}.{v}") for v in ("force", "force_rate")]
    return parts, [Connection(*one) for one in pairs]


def graph(*pairs: tuple[dict, list[Connection]]) -> Graph:
    parts = {name: part for some, _ in pairs for name, part in some.items()}
    return Graph(parts, [connection for _, some in pairs for connection in some])


def collided(prediction: str, *pairs: tuple[dict, list[Connection]], **options: object) -> Log:
    settings = {"prediction": prediction, "tolerance": 1e-9, "energy_budget": "none"} | options
    record = [f"a{i}.velocity" for i in range(len(pairs))]
    return run(graph(*pairs), "interface_jacobian", H, 0.4, record, **settings)


def buffers(n: int, *, steps: int = 1) -> list[tuple[dict, list[Connection]]]:
    return [pair(i, WAVES, "spring", BUFFER, steps=steps) for i in range(n)]


@pytest.mark.parametrize(("n", "steps"), [(1, 1), (3, 1), (2, 3)])
def test_what_is_exactly_linear_is_foretold_exactly(n: int, steps: int):
    """Expected: one iteration a step, whatever the number of interfaces and of sub-steps of the masses; and the same motion."""
    model, polynomial = (collided(p, *buffers(n, steps=steps)) for p in ("model", "polynomial"))
    assert np.all(model.steps.column("iterations")[KNOWN:] == 1)
    assert np.all(model.steps.column("by_model")[KNOWN:])
    assert np.max(polynomial.steps.column("iterations")[KNOWN:]) > 1
    for name in model.signals:
        v = model.signal(name)
        assert np.min(v) < 0.0 < v[0]  # it has bounced
        assert polynomial.signal(name) == pytest.approx(v, abs=1e-7)


def test_halved_and_adaptive_steps_too():
    """Expected: two half steps of a free mass are as linear as one, so that pairs of steps need one solve each."""
    log = collided("model", *buffers(2), local_tolerance=1e-6)
    steps = 1 + log.steps.column("subdivisions")
    assert np.max(steps) > 2
    assert log.solves["a0"] <= 1.75 * np.sum(steps[1:]) + 20  # 1.5: two steps, and one of both for the error


def test_without_means():
    """The law rebuilds the motion from positions and velocities, and the masses show no mean: their ends are foretold."""
    law = {"stiffness": 1e3, "exponent": 1.0, "exchange": 1.0}
    log = collided("model", pair(0, ("position", "velocity"), "law", law))
    assert np.all(log.steps.column("iterations")[KNOWN:] == 1)


def test_where_the_past_is_felt_for_long_models_cost_nothing():
    """Expected: a mass on a spring of its own remembers all loads, and the steps do not resolve the stiff spring between: what
    is foretold is wrong, its record says so, and no more solves are needed than without it."""
    counts = {}
    for prediction in ("model", "polynomial"):
        one, connections = pair(0, WAVES, "spring", BUFFER | {"two_sided": 1.0, "exponent": 1.0, "damping": 0.0})
        for name in ("a0", "b0"):
            one[name].set_parameters({"ground_stiffness": 40.0})
        log = collided(prediction, (one, connections), tolerance=1e-6)
        counts[prediction] = np.mean(log.steps.column("iterations"))
        assert not log.unconverged
    assert counts["model"] <= counts["polynomial"]
