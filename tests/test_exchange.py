"""The exchanges within a macro step, through FMUs, graph and master: stability, order, work, contact.

The masses are exact under a force that is linear in time, so that all error is the exchange's. Expected values: the
amplification matrices of docs/methods/exchange.md in closed form, the (2,2) Padé approximant of the
exponential, solutions by `solve_ivp` to 1e-12.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.log import Log
from orchestrator.coupling.run.simulate import simulate
from tests.fmus import chain, chain_solution, fmu

pytestmark = pytest.mark.portable

WAVEFORM, HERMITE, POINT = 0.0, 1.0, 2.0
OMEGA_H = [0.1, 1.0, 3.0, 3.3, 3.6, 10.0, 100.0, 1000.0]
H = 0.01


def system(masses: dict[str, dict], law: dict, *, rates: bool = True) -> Graph:
    """Return masses `a` and, if given, `b` with the law between them; without `b` it acts towards the ground.

    Without `rates` the force's slope is the master's business.
    """
    parts = {name: fmu("link", name, **settings) for name, settings in masses.items()}
    parts["law"] = fmu("law", "law", **law)
    pairs: list[tuple[str, str]] = []
    for side in masses:
        pairs += [(f"{side}.{name}", f"law.{side}.{name}") for name in ("position", "velocity", "position_mean")]
        pairs += [(f"law.{side}.{name}", f"{side}.{name}") for name in ("force", "force_rate")[: 1 + rates]]
    return Graph(parts, [Connection(*pair) for pair in pairs])


def run(graph: Graph, stop: float, step: float = H, record=None, master="iqn_ils", **options) -> Log:
    try:
        log = simulate(graph, MASTERS[master](graph, **options), 0.0, stop, step, record)
    finally:
        graph.close()
    assert log.error is None
    assert log.unconverged == 0
    return log


def amplification(law: dict, starts: np.ndarray, ground: float = 0.0, **options) -> np.ndarray:
    """Return the matrix that takes (x, v H) of all masses over one macro step, column by column."""
    names, columns = "ab"[: len(starts) // 2], []
    for start in starts:
        masses = {
            name: {
                "mass": 1.0,
                "ground_stiffness": ground,
                "initial_position": start[2 * i],
                "initial_velocity": start[2 * i + 1] / H,
            }
            for i, name in enumerate(names)
        }
        record = [f"{name}.{signal}" for name in names for signal in ("position", "velocity")]
        rates = options.pop("rates", True)
        log = run(system(masses, law, rates=rates), H, record=record, tolerance=1e-13, **options)
        columns.append(log.values[1] * np.tile([1.0, H], len(names)))
        options["rates"] = rates
    return np.array(columns).T


def pade(stiffness: float, damping: float = 0.0) -> np.ndarray:
    """Return the (2,2) Padé approximant of the exponential for (x, v H) of a unit mass."""
    A = np.array([[0.0, 1.0], [-stiffness * H**2, -damping * H]])
    even, odd = np.eye(2) + A @ A / 12.0, A / 2.0
    return np.linalg.solve(even - odd, even + odd)


def cayley(alpha: float, beta: float) -> np.ndarray:
    """Return the matrix of x1 - x0 = alpha (w0 + w1)/2, w1 - w0 = -beta (x0 + x1)/2 for (x, w)."""
    left, right = np.array([[1.0, -alpha / 2], [beta / 2, 1.0]]), np.array([[1.0, alpha / 2], [-beta / 2, 1.0]])
    return np.linalg.solve(left, right)


def radius(matrix: np.ndarray) -> float:
    return float(np.max(np.abs(np.linalg.eigvals(matrix))))


def roundoff(omega_h: float) -> float:
    """The iteration stops at 1e-13 of the largest force, which is (omega H)² x0 in these units."""
    return 1e-11 * (1.0 + omega_h**2)


@pytest.mark.parametrize("omega_h", OMEGA_H)
def test_mass_on_spring_is_pade_and_neither_grows_nor_decays(omega_h):
    stiffness = (omega_h / H) ** 2
    matrix = amplification({"stiffness": stiffness}, np.eye(2))
    np.testing.assert_allclose(matrix, pade(stiffness), rtol=1e-9, atol=roundoff(omega_h))
    np.testing.assert_allclose(np.abs(np.linalg.eigvals(matrix)), 1.0, atol=roundoff(omega_h))


@pytest.mark.parametrize("ratio", OMEGA_H)
def test_mass_on_damper_is_pade_and_decays(ratio):
    """With dH/m = ratio the speed falls by R(-ratio), R(z) = (1 + z/2 + z²/12)/(1 - z/2 + z²/12), always below 1."""
    damping = ratio / H
    matrix = amplification({"stiffness": 0.0, "damping": damping}, np.eye(2))
    np.testing.assert_allclose(matrix, pade(0.0, damping), rtol=1e-9, atol=1e-11 * (1.0 + ratio))
    factor = (1 - ratio / 2 + ratio**2 / 12) / (1 + ratio / 2 + ratio**2 / 12)
    assert matrix[1, 1] == pytest.approx(factor, abs=1e-11 * (1.0 + ratio))
    assert abs(matrix[1, 1]) < 1.0


@pytest.mark.parametrize("omega_h", OMEGA_H)
def test_damped_oscillator_decays(omega_h):
    """A tenth of critical damping; bound: |R(z)| < 1 in the left half plane, from the closed form."""
    stiffness, damping = (omega_h / H) ** 2, 0.2 * omega_h / H
    matrix = amplification({"stiffness": stiffness, "damping": damping}, np.eye(2))
    assert radius(matrix) == pytest.approx(radius(pade(stiffness, damping)), abs=roundoff(omega_h))
    assert radius(matrix) < 1.0


@pytest.mark.parametrize("omega_h", OMEGA_H)
def test_masses_coupled_by_a_spring_keep_their_energy(omega_h):
    """Both masses on springs of their own, which no Padé approximant covers; energy is a quadratic invariant."""
    stiffness, ground = (omega_h / H) ** 2 / 2.0, 0.25 / H**2
    matrix = amplification({"stiffness": stiffness}, np.eye(4), ground)
    np.testing.assert_allclose(np.abs(np.linalg.eigvals(matrix)), 1.0, atol=roundoff(omega_h))
    energy = np.diag([ground, 1 / H**2, ground, 1 / H**2])
    energy[np.ix_([0, 2], [0, 2])] += stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
    np.testing.assert_allclose(matrix.T @ energy @ matrix, energy, atol=1e-9 * np.max(energy), rtol=0.0)


@pytest.mark.parametrize("omega_h", [1.0, 3.0, 3.3, 3.6, 7.0, 8.0, 100.0])
def test_hermite_is_unstable_from_root_10_to_root_12_and_beyond_root_60(omega_h):
    z = omega_h**2
    matrix = amplification({"stiffness": z / H**2, "exchange": HERMITE}, np.eye(2))
    closed = cayley((1 - z / 60) / (1 - z / 10), z / (1 - z / 12))
    np.testing.assert_allclose(matrix, closed, rtol=1e-9, atol=roundoff(omega_h))
    grows = math.sqrt(10) < omega_h < math.sqrt(12) or omega_h > math.sqrt(60)
    assert (radius(matrix) > 1.01) == grows


POINTS = [
    # held: the force at the end of the step; linear: the master joins start and end
    ("iqn_ils", False, lambda z: np.linalg.solve([[1 + z / 2, 0.0], [z, 1.0]], [[1.0, 1.0], [0.0, 1.0]])),
    ("iqn_ils", True, lambda z: cayley(1 / (1 - z / 12), z)),
    ("jacobi", False, lambda z: np.array([[1 - z / 2, 1.0], [-z, 1.0]])),
]


@pytest.mark.parametrize(("master", "linear", "closed"), POINTS)
@pytest.mark.parametrize("omega_h", [0.1, 1.0, 3.0, 3.6])
def test_point_has_its_closed_form(master, linear, closed, omega_h):
    options = {} if master == "jacobi" else {"tolerance": 1e-13}
    law, columns = {"stiffness": (omega_h / H) ** 2, "exchange": POINT}, []
    for x, w in np.eye(2):
        graph = system({"a": {"initial_position": x, "initial_velocity": w / H}}, law, rates=not linear)
        log = run(graph, H, record=["a.position", "a.velocity"], master=master, **options)
        columns.append(log.values[1] * [1.0, H])
    np.testing.assert_allclose(np.array(columns).T, closed(omega_h**2), rtol=1e-9, atol=roundoff(omega_h))


NONLINEAR = {"stiffness": 100.0, "exponent": 3.0, "damping": 0.3}
ORDERS = [
    ("iqn_ils", WAVEFORM, True, 4),
    ("iqn_ils", HERMITE, True, 4),
    ("iqn_ils", POINT, False, 2),
    ("iqn_ils", POINT, True, 1),
    ("jacobi", POINT, True, 1),
]


@pytest.mark.parametrize(("master", "exchange", "rates", "order"), ORDERS)
def test_order_on_a_smooth_nonlinear_law(master, exchange, rates, order):
    """x'' = -10 x - 100 x³ - 0.3 x', from x = 0.5; order 4 also where the mass has a spring of its own."""

    def right(t, y):
        return y[1], -10.0 * y[0] - 100.0 * y[0] ** 3 - 0.3 * y[1]

    exact = solve_ivp(right, (0.0, 1.6), [0.5, 0.0], rtol=1e-12, atol=1e-14, method="DOP853").y[:, -1]
    errors = []
    for step in (0.04, 0.02) if order == 4 else (0.0025, 0.00125):
        graph = system(
            {"a": {"ground_stiffness": 10.0, "initial_position": 0.5}}, NONLINEAR | {"exchange": exchange}, rates=rates
        )
        options = {} if master == "jacobi" else {"tolerance": 1e-11}
        log = run(graph, 1.6, step, ["a.position", "a.velocity"], master, **options)
        errors.append(np.max(np.abs(log.values[-1] - exact)))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


HERTZ = {"stiffness": 1e6, "exponent": 1.5, "gap": -0.1, "two_sided": 0.0}
"""A wall that the ground spring of the mass presses it against, 2.2 mm deep."""


@pytest.mark.parametrize("law", [HERTZ, HERTZ | {"hunt_crossley": 0.5}, HERTZ | {"tangential": 1e4, "limit": 20.0}])
def test_interface_work_is_the_laws_work(law):
    """Booked on the mass's side (force, slope, positions, mean) against the law's samples along the path, to
    round-off; and the passivity of the law is that of the interface: what it does not store has been dissipated."""
    mass = {"mass": 1.0, "ground_stiffness": 1e3, "initial_position": -0.099, "initial_velocity": 0.5}
    record = ["law.law_work", "law.stored", "a.position", "a.velocity"]
    log = run(system({"a": mass}, law), 1.0, record=record, tolerance=1e-12)
    work, stored, x, v = log.values.T
    exchanged = np.sum(np.abs(np.diff(work)))
    # round-off of the positions (0.1 m) times the force (2 kN) in every step; the iteration stops at 1e-12
    assert log.energy["a.force"] == pytest.approx(-work, abs=1e-11 * exchanged)
    mechanical = 0.5 * v**2 + 0.5 * 1e3 * x**2
    assert mechanical + work == pytest.approx(mechanical[0], abs=1e-10 * exchanged)
    lost = work - (stored - stored[0])
    # Gauss rule across touch and lift-off (12 points): 1e-4 of what a step exchanges
    assert np.all(np.diff(lost) > -1e-3 * exchanged / len(work))


def energy_after_a_minute(exchange: float) -> tuple[float, float]:
    """Return the energies at the start and after 60 s of undamped contact, omega H = 3.3 on Hertz' law."""
    mass = {"mass": 1.0, "ground_stiffness": 1e3, "initial_position": -0.0979, "initial_velocity": 0.01}
    record = ["a.position", "a.velocity", "law.stored"]
    graph = system({"a": mass}, HERTZ | {"exchange": exchange})
    try:
        master = MASTERS["iqn_ils"](graph, tolerance=1e-10)
        log = simulate(graph, master, 0.0, 60.0, 0.0125, record)
    finally:
        graph.close()
    x, v, stored = log.values.T
    energy = 0.5 * v**2 + 0.5 * 1e3 * x**2 + stored
    rest = 0.5 * 1e3 * 0.0979**2 + 1e6 / 2.5 * 0.0021**2.5
    return float(energy[0] - rest), float(np.max(energy) - rest)


def test_a_minute_of_undamped_contact_does_not_grow():
    start, largest = energy_after_a_minute(WAVEFORM)
    assert largest == pytest.approx(start, rel=1e-4)


def test_hermite_grows_in_the_same_minute():
    start, largest = energy_after_a_minute(HERMITE)
    assert largest > 1.5 * start


def bounce(step: float, **law: float) -> np.ndarray:
    """Return position and speed after a touch and a lift-off inside macro steps; the mass has a spring of its own."""
    mass = {"mass": 1.0, "ground_stiffness": 1e3, "initial_position": -0.12, "initial_velocity": 0.0}
    graph = system({"a": mass}, {"gap": 0.0, "two_sided": 0.0} | law)
    return run(graph, 0.16, step, ["a.position", "a.velocity"], tolerance=1e-12).values[-1]


@pytest.mark.parametrize(("exponent", "stiffness", "order"), [(1.0, 1e4, 1.8), (1.5, 3e4, 2.3), (2.5, 3e5, 3.5)])
def test_order_across_touch_and_lift_off(exponent, stiffness, order):
    """The events fall anywhere in the step; slope over eight steps. With exact integrals the order is 4; the Gauss rule
    across the kink leaves a small part of order exponent + 1 (docs/methods/exchange.md), which is the bound."""

    def right(t, y):
        return y[1], -1e3 * y[0] - stiffness * max(y[0], 0.0) ** exponent

    exact = solve_ivp(right, (0.0, 0.16), [-0.12, 0.0], rtol=1e-12, atol=1e-14, max_step=1e-4, method="DOP853").y[:, -1]
    steps = 0.16 / np.array([20, 28, 40, 56, 80, 113, 160, 226])
    errors = [abs(bounce(step, stiffness=stiffness, exponent=exponent)[0] - exact[0]) for step in steps]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] > order


BRISTLE, LIMIT = 4e3, 8.0


def stick_slip(time: float) -> np.ndarray:
    """Return x, v of a unit mass on a ground spring and a bristle that gives way at its limit, event by event."""
    y, t, z, slips = np.array([0.02, 0.0]), 0.0, 0.0, False
    while t < time - 1e-12:
        x0, z0 = y[0], z
        side = math.copysign(1.0, y[1] or -y[0])

        def right(_, y, slips=slips, x0=x0, z0=z0):
            return y[1], -1e3 * y[0] - BRISTLE * (z0 if slips else z0 + y[0] - x0)

        def full(_, y, x0=x0, z0=z0):
            return BRISTLE * abs(z0 + y[0] - x0) - LIMIT

        def halt(_, y, side=side):
            return side * y[1]

        event = halt if slips else full
        event.terminal, event.direction = True, -1.0 if slips else 1.0
        piece = solve_ivp(right, (t, time), y, events=event, rtol=1e-12, atol=1e-15, method="DOP853", max_step=1e-3)
        t, y = piece.t[-1], piece.y[:, -1]
        if not slips:
            z = z0 + y[0] - x0
        slips = not slips
    return y


def test_order_across_stick_and_slip():
    """Every half swing sticks, slips and sticks again inside macro steps; a kink in the force as at exponent 1."""
    exact = stick_slip(0.16)
    steps, errors = 0.16 / np.array([20, 28, 40, 56, 80, 113, 160, 226]), []
    for step in steps:
        mass = {"mass": 1.0, "ground_stiffness": 1e3, "initial_position": 0.02}
        graph = system({"a": mass}, {"stiffness": 0.0, "tangential": BRISTLE, "limit": LIMIT})
        errors.append(abs(run(graph, 0.16, step, ["a.position"], tolerance=1e-12).values[-1, 0] - exact[0]))
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] > 1.8


@pytest.mark.parametrize(
    ("master", "extrapolation"), [("iqn_ils", None), ("jacobi", 1), ("gauss_seidel", 1), ("jacobi", 0)]
)
def test_work_of_a_force_that_the_master_joins_or_extrapolates(master, extrapolation):
    """What the mass gains is the work booked, slope set by the master included: the mass is exact."""
    options = {} if extrapolation is None else {"extrapolation": extrapolation}
    graph = system({"a": {"initial_position": 0.1}}, {"stiffness": 100.0, "exchange": POINT}, rates=False)
    log = run(graph, 1.0, record=["a.velocity"], master=master, **options)
    assert log.energy["a.force"] == pytest.approx(0.5 * log.values[:, 0] ** 2, abs=1e-12)


def test_chain_of_twelve_masses_springs_and_dampers_has_order_4():
    """Eleven interfaces, solved together; the matrix exponential of the whole chain."""
    errors = []
    for step in (0.04, 0.02):
        graph = chain(12, waveform=True, damping=1.0)
        log = run(graph, 1.2, step, [f"m{i}.position" for i in range(12)], tolerance=1e-10)
        errors.append(np.max(np.abs(log.values - chain_solution(log.time, 12, damping=1.0))[:: round(0.04 / step)]))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)
