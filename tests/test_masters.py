"""The masters: order, stability, sub-division, hostile FMUs. One row a master in every parametrised test.

Expected values: matrix exponential of the coupled system; every test FMU is exact inside a step, so that all
error is the coupling's.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.coupling.fmu.failure import FmuError
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection, GraphError
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.log import Log
from orchestrator.coupling.run.simulate import simulate
from orchestrator.coupling.stepping.least_squares import LeastSquares
from tests.fmus import MILD, STIFF, chain, chain_solution, fmu, oscillator, oscillator_solution
from tests.systems import IMPLICIT, ITERATED, POINT, POSITIONS, closing, faulty_oscillator, run

pytestmark = pytest.mark.portable


def error(master: str, H: float, system: dict, waveform: bool = False, stop: float = 2.0, **options) -> float:
    """Return the largest error of both positions at the communication points, m."""
    log = run(oscillator(**system, waveform=waveform), master, H, stop, POSITIONS, **options)
    assert log.error is None
    assert log.unconverged == 0
    return float(np.max(np.abs(log.values - oscillator_solution(log.time, **system))))


def slopes(errors: list[float]) -> np.ndarray:
    return np.log2(np.array(errors[:-1]) / errors[1:])


@pytest.mark.parametrize(("master", "options", "order"), POINT, ids=lambda v: str(v))
def test_order_of_point_exchange(master, options, order):
    errors = [error(master, H, MILD, **options) for H in (0.02, 0.01, 0.005)]
    assert slopes(errors) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("master", IMPLICIT)
def test_order_of_waveform_exchange(master):
    options = {} if master == "semi_implicit" else {"tolerance": 1e-11}
    errors = [error(master, H, MILD, waveform=True, **options) for H in (0.1, 0.05, 0.025)]
    assert slopes(errors) == pytest.approx(4.0, abs=0.2)


def test_quadratic_extrapolation_is_better_than_linear():
    """Order 2 either way here (held inputs), but with a smaller constant."""
    assert error("jacobi", 0.01, MILD, extrapolation=2) < 0.5 * error("jacobi", 0.01, MILD, extrapolation=1)


@pytest.mark.parametrize("system", [MILD, STIFF], ids=["mild", "stiff"])
@pytest.mark.parametrize("master", IMPLICIT)
def test_implicit_masters_are_stable_at_large_steps(master, system):
    """omega H = 4.5 in the stiff set; bar 1e-3 of the amplitude of 0.1 m at H = 10 ms over 10 s."""
    assert error(master, 0.01, system, waveform=True, stop=10.0) < 1e-3 * 0.1


@pytest.mark.parametrize("master", ["jacobi", "gauss_seidel", "nepce"])
def test_explicit_masters_fail_where_implicit_ones_do_not(master):
    log = run(oscillator(**STIFF), master, 0.01, 2.0, POSITIONS)
    assert log.error is not None or np.max(np.abs(log.values)) > 1.0


@pytest.mark.parametrize("master", ITERATED)
def test_chain_of_five(master):
    """Five masses, four interfaces, an order with several torn inputs; error against the order-4 estimate.

    The highest of the chain's frequencies is 28 rad/s; (omega H)^4/720 of 0.1 m at H = 10 ms, times 2 s of
    phase: 1e-5 m.
    """
    log = run(chain(5, waveform=True), master, 0.01, 2.0, [f"m{i}.position" for i in range(5)])
    assert log.error is None
    assert log.unconverged == 0
    assert np.max(np.abs(log.values - chain_solution(log.time, 5))) < 1e-5


@pytest.mark.parametrize("master", ["iqn_ils", "interface_jacobian"])
def test_interface_work_is_equal_and_opposite_to_the_stored_energy(master):
    """No damping: what the interface takes from mass a is what mass b and the springs gain (energy
    identity)."""
    system = {"stiffness": 1e4, "damping": 0.0, "ground": 0.0, "start": (0.1, 0.0)}
    graph = chain(2, waveform=True, stiffness=1e4)
    record = ["m0.position", "m0.velocity", "m1.position", "m1.velocity"]
    log = run(graph, master, 0.01, 5.0, record, tolerance=1e-12)
    x0, v0, x1, v1 = log.values.T
    stored = 0.5 * (v0**2 + v1**2 + 10.0 * (x0**2 + x1**2))
    # the coupling spring stores the rest; at communication points it is stretched by the difference, to
    # order H^4
    total = stored + 0.5 * 1e4 * (x1 - x0) ** 2
    gained = 0.5 * (v0**2 + 10.0 * x0**2) - 0.5 * 10.0 * 0.1**2
    assert log.energy["m0.force"] == pytest.approx(gained, abs=1e-9 * total[0])
    assert system["damping"] == 0.0


@pytest.mark.parametrize("master", ["iqn_ils", "interface_jacobian"])
def test_unconditional_stability_without_damping(master):
    """omega H from 0.1 to 1000: the energy-conjugate exchange neither grows nor damps (|x| bounded by the
    energy)."""
    for stiffness in (1e2, 1e4, 1e6, 1e8, 1e10):
        log = run(chain(2, waveform=True, stiffness=stiffness), master, 0.01, 10.0, ["m0.position", "m0.velocity"])
        energy = 0.5 * stiffness * 0.1**2 + 0.5 * 10.0 * 0.1**2
        assert log.error is None
        assert log.unconverged == 0
        assert np.all(0.5 * log.signal("m0.velocity") ** 2 <= energy * (1 + 1e-6))


def bouncing(master: str, H: float, stiffness: float, **options) -> Log:
    """A mass that hits a one-sided Hertzian spring on a second mass at 1 m/s."""
    a = fmu("link", "a", mass=1.0, initial_position=-0.01, initial_velocity=1.0)
    b = fmu("link", "b", mass=2.0, ground_stiffness=100.0)
    s = fmu("spring", "s", stiffness=stiffness, exponent=1.5, two_sided=0.0)
    pairs = []
    for side in "ab":
        pairs += [(f"{side}.{v}", f"s.{side}.{v}") for v in ("position", "position_mean")]
        pairs += [(f"s.{side}.{v}", f"{side}.{v}") for v in ("force", "force_rate")]
    graph = Graph({"a": a, "b": b, "s": s}, [Connection(*pair) for pair in pairs])
    return run(graph, master, H, 0.05, ["a.velocity", "b.velocity", "b.position"], **options)


@pytest.mark.parametrize("master", ITERATED)
def test_impact_within_a_macro_step_converges(master):
    """Contact lasts 1 ms at k = 1e7 (Hertz: 2.94 d/v with d = (5/4 m v²/k)^0.4); macro step 5 ms. Momentum
    is kept."""
    log = bouncing(master, 0.005, 1e7)
    assert log.error is None
    assert log.unconverged == 0
    ground = 100.0 * np.concatenate([[0.0], np.cumsum(0.5 * (log.values[1:, 2] + log.values[:-1, 2])) * 0.005])
    momentum = log.values[:, 0] + 2.0 * log.values[:, 1] + ground
    assert momentum == pytest.approx(1.0, abs=2e-3)  # the impulse of the ground spring by the trapezoidal rule


@pytest.mark.parametrize("master", ITERATED)
def test_step_control_keeps_the_local_error(master):
    """Local errors below 1e-7 of 0.2 m, about 60 sub-steps in 2 s, undamped growth at most linear: 2e-6 m."""
    options = {"local_tolerance": 1e-7, "tolerance": 1e-9}
    log = run(oscillator(**MILD, waveform=True), master, 0.1, 2.0, POSITIONS, **options)
    assert log.time == pytest.approx(np.linspace(0.0, 2.0, 21))
    assert 0.0 < max(step.estimate for step in log.steps) <= 1e-7
    assert np.max(np.abs(log.values - oscillator_solution(log.time, **MILD))) < 2e-6
    fixed = error(master, 0.1, MILD, waveform=True)
    assert fixed > 2e-6


def test_step_control_books_no_work_twice():
    """The work booked at the interface with rejected sub-steps, against the energy mass a has lost."""
    record = ["m0.position", "m0.velocity"]
    options = {"local_tolerance": 1e-6, "tolerance": 1e-12}
    log = run(chain(2, waveform=True, stiffness=1e3), "iqn_ils", 0.05, 1.0, record, **options)
    assert sum(step.subdivisions for step in log.steps) > 0
    x, v = log.values.T
    assert log.energy["m0.force"] == pytest.approx(0.5 * (v**2 + 10.0 * x**2) - 0.05, abs=1e-9)


@pytest.mark.parametrize("solves", [1, 3])
def test_columns_are_kept_for_as_many_steps_as_reuse_says(solves):
    """All solves of a step count as one; each column is kept once. 3 iterations a solve make 2 differences."""
    model, steps, reuse = LeastSquares(4, 2, 0.0, 0.5), 5, 2
    rng = np.random.default_rng(1)
    for _ in range(steps):
        for _ in range(solves):
            model.begin(0.01, np.ones(4))
            for _ in range(3):
                model.propose(rng.normal(size=4), rng.normal(size=4))
            if solves > 1:
                model.conclude()
        model.accept()
    kept = np.concatenate([V for _, V, _ in model.past])
    assert len(model.past) == reuse and len(kept) == reuse * solves * 2
    assert len(np.unique(kept, axis=0)) == len(kept)


def test_interface_jacobian_keeps_no_column_twice():
    graph = oscillator(**STIFF, waveform=True)
    with closing(graph):
        master = MASTERS["interface_jacobian"](graph, reuse=3)
        simulate(graph, master, 0.0, 0.2, 0.01)
    kept = [V for _, V, _ in master.inner.past]
    assert 0 < len(kept) <= 3
    rows = np.concatenate(kept)
    assert len(np.unique(rows, axis=0)) == len(rows)


def test_rollback_is_required():
    with closing(oscillator(**MILD, rollback=False)) as graph:
        for name in IMPLICIT:
            with pytest.raises(GraphError, match="a cannot save its state"):
                MASTERS[name](graph)


def test_reduced_interface_needs_no_rollback_of_the_modelled_component():
    log = run(oscillator(**MILD, rollback=False), "reduced_interface", 0.01, 2.0, POSITIONS)
    assert log.error is None
    assert np.max(np.abs(log.values - oscillator_solution(log.time, **MILD))) < 1e-4


@pytest.mark.parametrize("master", MASTERS)
@pytest.mark.parametrize(("fault", "status"), [(1, 2), (2, 5)], ids=["discard", "nan"])
def test_fault_ends_the_run_with_a_message_and_what_there_is(master, fault, status):
    system = faulty_oscillator(fault=fault, fault_time=0.05, longest_step=1e-9)
    log = run(system, master, 0.01, 0.1, ["a.position", "c.x"])
    assert log.error is not None
    assert log.error.status == status
    assert log.error.component == "c"
    assert log.error.time == pytest.approx(0.05, abs=1e-3)
    assert len(log.time) == len(log.values) == len(log.steps) + 1 == 6
    assert np.all(np.isfinite(log.values))


@pytest.mark.parametrize("master", ITERATED)
def test_discarded_step_is_subdivided(master):
    """An FMU that makes no step longer than 2.5 ms: four sub-steps, communication stays at 10 ms."""
    log = run(faulty_oscillator(fault=1, longest_step=2.5e-3), master, 0.01, 0.1, POSITIONS)
    assert log.error is None
    assert log.unconverged == 0
    assert log.time == pytest.approx(np.linspace(0.0, 0.1, 11))
    assert all(step.subdivisions == 3 for step in log.steps)
    assert np.max(np.abs(log.values - oscillator_solution(log.time, **MILD))) < 1e-5


@pytest.mark.parametrize("master", IMPLICIT)
def test_incomplete_state_is_noticed(master):
    log = run(faulty_oscillator(fault=4), master, 0.01, 0.05, POSITIONS)
    assert log.error is not None
    assert "not saved completely" in log.error.message
    assert len(log.time) == 1


@pytest.mark.parametrize("master", IMPLICIT)
def test_refused_rollback_ends_the_run(master):
    graph = oscillator(**MILD)
    graph.components["b"].fmi.set_state = lambda state: 3
    log = run(graph, master, 0.01, 0.05, POSITIONS)
    assert log.error is not None
    assert log.error.component == "b"
    assert "restoring the state" in log.error.message


@pytest.mark.parametrize("master", MASTERS)
@pytest.mark.parametrize("status", [3, 4])
def test_error_and_fatal_end_the_run(master, status):
    graph = oscillator(**MILD)
    step = graph.components["b"].fmi.do_step
    graph.components["b"].fmi.do_step = lambda t, h, none_before: step(t, h, none_before) if t < 0.045 else status
    log = run(graph, master, 0.01, 0.1, POSITIONS)
    assert log.error is not None
    assert log.error.status == status
    assert len(log.time) == 6


def test_not_converging_is_never_silent():
    """Plain fixed-point iteration where the loop's gain is about k H²/(4 m) = 2.5: every step is counted."""
    graph = oscillator(**STIFF, waveform=True)
    log = run(graph, "fixed_point", 0.01, 0.05, POSITIONS, relaxation=1.0, max_iterations=5, max_depth=0)
    assert log.unconverged == len(log.steps) == 5
    assert all(step.residual > 1e-6 for step in log.steps)


def test_macro_step_must_divide_the_time():
    with closing(oscillator(**MILD)) as graph:
        master = MASTERS["jacobi"](graph)
        for H in (0.0, -0.01, 0.03):
            with pytest.raises(ValueError, match="macro step"):
                simulate(graph, master, 0.0, 1.0, H)


def test_interrupt_leaves_the_callers_error():
    """What is no failure of an FMU goes through to the caller."""

    def stop(report):
        raise KeyboardInterrupt

    with closing(oscillator(**MILD)) as graph, pytest.raises(KeyboardInterrupt):
        simulate(graph, MASTERS["jacobi"](graph), 0.0, 0.1, 0.01, on_step=stop)


def test_errors_say_where_and_why():
    error = FmuError("cable", 1.5, 2, "did not converge")
    assert str(error) == "cable, t = 1.5 s: did not converge"
    assert error.recoverable
    assert not FmuError("cable", 1.5, 3, "").recoverable
