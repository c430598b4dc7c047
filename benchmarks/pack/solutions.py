"""How references are made: closed forms, tight integrations, the monolithic solver."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import eig, expm

from benchmarks.pack.case import Case, Reference
from orchestrator.landing.monolithic.solve import solve
from orchestrator.runs.systems import resolve
from orchestrator.scenario.types import GraphScenario

ROUND_OFF = 1e-14
"""Of a signal's largest value: what the digits of a reference file leave."""
TIGHT, LESS_TIGHT = 1e-12, 1e-10
TRUTH = 1e-11
"""m, local tolerance of the monolithic solver (its default is 2e-10)."""

# -- linear: the matrix exponential -------------------------------------------------------------------------------


def linear(case: Case, times: np.ndarray) -> Reference:
    """Return oscillators in closed form: x(t) = exp(A t) x(0), held against the sum over the eigenvectors of A."""
    names, A, start = linear_system(case)
    exact = np.array([expm(A * t) @ start for t in times])
    rates, modes = eig(A)
    weights = np.linalg.solve(modes, start.astype(complex))
    second = np.real(np.exp(np.outer(times, rates)) * weights @ modes.T)
    table, other = _positions(case, names, times, exact), _positions(case, names, times, second)
    method = "matrix exponential; error: its difference from the sum over the eigenvectors, and round-off"
    return Reference(table, _differences(table, other), method)


def linear_system(case: Case) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Return the names of n masses, A (2n, 2n) of (x, v)' = A (x, v), and the start (2n,)."""
    scenario = case.scenario()
    assert isinstance(scenario, GraphScenario)
    names, n = list(scenario.components), len(scenario.components)
    values = [_oscillator(scenario, name) for name in names]
    K, D = (np.diag([one[key] for one in values]) for key in ("stiffness", "damping"))
    for owner, neighbour in _coupled(scenario):
        i, j = names.index(owner), names.index(neighbour)
        stamp = np.zeros(n)
        stamp[i], stamp[j] = 1.0, -1.0
        K = K + values[i]["coupling_stiffness"] * np.outer(stamp, stamp)
        D = D + values[i]["coupling_damping"] * np.outer(stamp, stamp)
    mass = np.array([one["mass"] for one in values])[:, None]
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K / mass, -D / mass]])
    return names, A, np.array([one[f"initial_{what}"] for what in ("position", "velocity") for one in values])


def _oscillator(scenario: GraphScenario, name: str) -> Mapping[str, float]:
    """Return the parameters of an oscillator, those that are not given as its table has them."""
    from fmus.module.registry import find

    table, given = find("oscillator").table(), scenario.components[name].parameters
    return {v.name: given.get(v.name, v.start) for v in table.variables if v.causality == "parameter"}  # type: ignore[misc]


def _coupled(scenario: GraphScenario) -> Iterator[tuple[str, str]]:
    """Yield the owner of each coupling spring, and its neighbour."""
    for text in scenario.connections:
        source, _, target = text.partition(" -> ")
        if target.endswith(".neighbour.position"):
            yield target.partition(".")[0], source.partition(".")[0]


def _positions(case: Case, names: list[str], times: np.ndarray, states: np.ndarray) -> dict[str, np.ndarray]:
    return {"time": times} | {s: states[:, names.index(s.partition(".")[0])] for s in case.signals}


def _differences(table: Mapping[str, np.ndarray], other: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Return the largest difference by signal, no less than round-off."""
    names = [name for name in table if name != "time"]
    least = {name: ROUND_OFF * float(np.max(np.abs(table[name]))) for name in names}
    return {name: max(least[name], float(np.max(np.abs(table[name] - other[name])))) for name in names}


# -- two masses that meet: integrated from touch to touch ---------------------------------------------------------


def impact(case: Case, times: np.ndarray) -> Reference:
    """Return two masses with a bumper between them by an explicit method of order 8, anew from each touch and parting."""
    tight, less = (_meeting(case, times, tolerance) for tolerance in (TIGHT, LESS_TIGHT))
    names = list(case.scenario().components)[:2]
    table, other = (_positions(case, names, times, states) for states in (tight, less))
    method = (
        f"DOP853 from event to event, tolerance {TIGHT:g}, independent of the FMUs; "
        f"error: its difference from tolerance {LESS_TIGHT:g}"
    )
    return Reference(table, _differences(table, other), method)


def _meeting(case: Case, times: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the states (n, 4): both positions, both velocities."""
    scenario = case.scenario()
    assert isinstance(scenario, GraphScenario)
    sides = [_oscillator(scenario, name) for name in ("left", "right")]
    mass, stiffness, damping = (np.array([one[key] for one in sides]) for key in ("mass", "stiffness", "damping"))
    bumper = scenario.components["bumper"].parameters
    k, n, D = (float(bumper[name]) for name in ("stiffness", "exponent", "damping"))  # type: ignore[arg-type]
    assert not bumper.get("gap"), "the gap is left out here"

    def rate(_: float, y: np.ndarray, touches: bool) -> np.ndarray:
        depth = max(y[0] - y[1], 0.0) if touches else 0.0
        force = max(k * depth**n * (1.0 + D * (y[2] - y[3])), 0.0)
        return np.concatenate([y[2:], (-stiffness * y[:2] - damping * y[2:] + force * np.array([-1.0, 1.0])) / mass])

    def approach(_: float, y: np.ndarray, touches: bool) -> float:
        return y[0] - y[1]

    approach.terminal = True  # type: ignore[attr-defined]
    y = np.array([one[f"initial_{what}"] for what in ("position", "velocity") for one in sides])
    t, touches, rows = 0.0, False, [y]
    while t < times[-1]:
        approach.direction = -1.0 if touches else 1.0  # type: ignore[attr-defined]
        found = solve_ivp(
            rate,
            (t, times[-1]),
            y,
            "DOP853",
            dense_output=True,
            events=approach,
            args=(touches,),
            rtol=tolerance,
            atol=1e-3 * tolerance,
            max_step=0.01,
        )
        rows += [found.sol(point) for point in times[(times > t) & (times <= found.t[-1])]]
        t, y, touches = float(found.t[-1]), found.y[:, -1], not touches
    return np.array(rows)


# -- landings: the monolithic solver ------------------------------------------------------------------------------


def monolithic(case: Case, times: np.ndarray) -> Reference:
    """Return a landing by our monolithic solver of the same equations on the same mesh."""
    problem = resolve(case.scenario()).problem()
    assert problem is not None, f"{case.name}: no monolithic problem"
    found = solve(problem, times, TRUTH)
    method = (
        f"our monolithic solver on the same mesh, local tolerance {TRUTH:g} m; "
        "error: its difference from steps twice as long at 16 times the tolerance"
    )
    return Reference(
        {"time": times} | {name: found.signals[name] for name in case.signals},
        {name: found.estimated_error[name] for name in case.signals},
        method,
    )
