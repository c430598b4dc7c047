"""Model-based prediction: what is foretold of a component, from what, and when it is used."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.api import load_scenario
from orchestrator.coupling.exchange import rate_of
from orchestrator.coupling.masters.interface_jacobian import InterfaceJacobian
from orchestrator.coupling.stepping import free_response
from orchestrator.coupling.stepping.free_response import FreeResponse
from orchestrator.coupling.stepping.record import PROBE, Record
from orchestrator.runs.coupled import run_coupled

H = 0.01
NAMES = ("p.position.z", "p.position_mean.z", "p.velocity.z", "p.rotation.x", "p.rotation_mean.x", "p.heat")


class _Group:
    """Variables read from a motion that is known in closed form."""

    def __init__(self, owner: _Fmu, names: list[str]):
        self.owner, self.names = owner, tuple(names)
        self.values = np.zeros(len(names))

    def get_finite(self) -> None:
        self.values[:] = [self.owner.values[name] for name in self.names]


class _Fmu:
    def __init__(self) -> None:
        extra = ("p.angular_velocity.x",)
        self.ports = dict.fromkeys((*NAMES, *extra))
        self.vocabulary = frozenset(self.ports)
        self.values = dict.fromkeys(self.ports, 0.0)

    def group(self, names: list[str]) -> _Group:
        return _Group(self, names)


class _Node:
    """A component whose motion is a polynomial in time, and whose heat answers to a load for three steps."""

    def __init__(self) -> None:
        self.fmu = _Fmu()
        self.outputs = self.fmu.group(list(NAMES))
        self.loads: list[float] = []

    def show(self, t: float, h: float) -> None:
        """Show what there is at `t`, the step of length `h` behind it."""
        z = np.polynomial.Polynomial([1.0, -2.0, 3.0, 0.5])  # m
        turn = np.polynomial.Polynomial([0.0, 0.7, -0.4])  # rad
        Z, T = z.integ(), turn.integ()
        before = t - h
        values = {
            "p.position.z": z(t),
            "p.position_mean.z": (Z(t) - Z(before)) / h if h else z(t),
            "p.velocity.z": z.deriv()(t),
            "p.rotation.x": turn(t) - turn(before),
            "p.rotation_mean.x": (T(t) - T(before)) / h - turn(before) if h else 0.0,
            "p.angular_velocity.x": turn.deriv()(t),
            "p.heat": sum(g * x for g, x in zip((5.0, 3.0, -1.0), self.loads[::-1], strict=False)),
        }
        self.fmu.values.update(values)
        self.outputs.get_finite()


def _run(free: FreeResponse, node: _Node, h: float, steps: int) -> np.ndarray:
    """Step along the closed form, under loads as rough as can be; return the error of what is foretold of the last step."""
    jacobian = np.array([[0.0]] * 5 + [[5.0]])
    rough = np.random.default_rng(1).normal(size=steps)
    node.show(0.0, 0.0)
    foretold = np.zeros(len(NAMES))
    for i in range(steps):
        free.begin()
        if free.known(h):
            foretold = free.foretold(h, jacobian) + jacobian[:, 0] * rough[i]
        node.loads.append(rough[i])
        node.show((i + 1) * h, h)
        free.append(h, free.seen(h, free.start, node.outputs.values.copy(), rough[i : i + 1]))
    return foretold - node.outputs.values


def test_smooth_motion_and_remembered_loads_are_foretold_exactly():
    """Expected: zero to round-off. What kinematics leave is a polynomial of degree 2 at most, extrapolated by degree 4 (the
    weights grow round-off by 2^5). Heat 5, 3, -1 of a pulse changes by 5, -2, -4, 1: three steps to be remembered."""
    node = _Node()
    free = FreeResponse(node, 3.0 * H)
    free.pulses[H] = np.array([[0.0, 0.0, 0.0]] * 5 + [[-2.0, -4.0, 1.0]])
    assert free.lags(H) == 3
    assert np.allclose(_run(free, node, H, 12), 0.0, atol=1e-12)


def test_without_its_memory_a_rough_load_spoils_what_is_foretold():
    node = _Node()
    error = _run(FreeResponse(node, 2.0 * H), node, H, 12)
    assert np.allclose(error[:5], 0.0, atol=1e-12)
    assert abs(error[5]) > 0.1


def test_two_halves_joined_are_the_whole_step():
    """Expected: what the closed form shows of one step of twice the length."""
    node, whole = _Node(), _Node()
    free = FreeResponse(node, 0.0)
    pasts = []
    node.show(0.3, 0.0)
    for i in range(2):
        free.begin()
        node.show(0.3 + (i + 1) * H, H)
        pasts.append(free.seen(H, free.start, node.outputs.values.copy(), np.zeros(1)))
    whole.show(0.3 + 2 * H, 2 * H)
    assert np.allclose(free.joined(2 * H, *pasts, np.zeros(1)).end, whole.outputs.values, atol=1e-14)


@pytest.mark.parametrize("k", range(1, free_response.ORDER + 2))
def test_weights_extrapolate_polynomials(k: int):
    """Expected: a polynomial of degree k - 1 through k values is met one step further."""
    values = np.polynomial.Polynomial(np.arange(1.0, k + 1.0))(-np.arange(1.0, k + 1.0))
    assert free_response._WEIGHTS[k - 1] @ values == pytest.approx(1.0, abs=1e-9)


def test_names_of_rates():
    assert rate_of("port[1].position.x") == "port[1].velocity.x"
    assert rate_of("wheel[2].rotation.z") == "wheel[2].angular_velocity.z"
    assert rate_of("port[1].tangent.y") == "port[1].tangent_rate.y"


def test_the_better_beginning_is_chosen_and_the_other_tried_ever_more_rarely():
    record = Record()
    assert record.asks_models
    record.note(by_model=False, residual=1e-4, iterations=2)
    record.note(by_model=True, residual=1e-6, iterations=1)
    assert record.models_win
    for _ in range(40):
        record.note(by_model=True, residual=1.0, iterations=5)
    assert not record.models_win
    record, waits = Record(), []
    record.note(by_model=False, residual=1e-4, iterations=2)
    for _ in range(200):
        waits.append(record.asks_models)
        record.note(by_model=record.asks_models, residual=1e-2 if record.asks_models else 1e-4, iterations=2)
    tried = np.flatnonzero(waits)
    assert tried[0] == 0
    assert np.all(np.diff(tried, 2) >= 0)
    assert tried[1] - tried[0] >= PROBE


def test_steps_in_the_air_say_nothing_of_either():
    """Nothing acts, both foretell it exactly: fifteen digits that would count for as many steps after the touch."""
    record = Record()
    for by_model in (False, True, True):
        record.note(by_model=by_model, residual=0.0, iterations=1)
    assert np.isnan(record.model) and np.isnan(record.polynomial)
    assert record.asks_models


def test_a_record_is_worth_the_less_the_older_it_is():
    """Expected: models that were bad 32 steps ago, and are good now, win at once; the past weighs 0.8 a step."""
    record = Record()
    record.note(by_model=True, residual=1.0, iterations=3)
    for _ in range(31):
        record.note(by_model=False, residual=1e-3, iterations=2)
    record.note(by_model=True, residual=1e-6, iterations=1)
    assert record.model == pytest.approx(-6.0 * (1.0 - 0.8**32))
    assert record.models_win


def test_pulses_are_made_where_they_pay():
    record = Record()
    for _ in range(50):
        record.note(by_model=True, residual=1e-7, iterations=2)
        record.note(by_model=False, residual=1e-4, iterations=2)
    assert record.pays(65, 1000)
    assert record.pays(65, np.nan)
    assert not record.pays(65, 100)  # 100 solves saved at most, 65 spent
    assert not record.pays(650, np.nan)  # nobody has seen yet that it would


@pytest.fixture(scope="module")
def beginnings():
    """A second of a landing with both beginnings."""
    runs = {}
    for prediction in ("model", "polynomial"):
        settings = {"master.prediction": prediction, "master.tolerance": 1e-6, "master.energy_budget": "none"}
        runs[prediction] = run_coupled(load_scenario("landing_200m_point9", stop=1.0, macro_step=0.0025, set=settings))
    return runs


def test_models_save_solves_of_the_cable(beginnings):
    """Expected: the solves of a step that are not saved come from the first steps, from which nothing is known yet, and from
    the waves of the touch; here no pulses are made (a second is too short for them)."""
    model, polynomial = (run.log for run in beginnings.values())
    assert model.solves["cable"] < 0.9 * polynomial.solves["cable"]
    assert not model.unconverged


def test_the_beginning_changes_nothing_but_the_solves(beginnings):
    """Expected: both converge to one solution: they differ by what the tolerance 1e-6 of the contact force of 372 N leaves, a
    relative 1e-6 of the motion, times the few periods of the contact's vibration that it lives on."""
    a, b = (run.table["robot.body.position.z"] for run in beginnings.values())
    assert np.max(np.abs(a - b)) < 1e-5 * np.ptp(b)


@pytest.mark.parametrize(
    ("stiffness", "macro_step", "most"), [(1e8, 0.01, 3.44), (1e10, 0.005, 2.82), (1e10, 0.01, 3.60)]
)
def test_hard_drops_cost_no_more_solves_than_before_there_were_models(stiffness: float, macro_step: float, most: float):
    """Expected: the solves of the polynomial alone at a tolerance of 1e-6 (docs/notebook/masters.md), all that is tried and
    measured on the way included."""
    hard = {"contact.parameters.stiffness": stiffness}
    log = run_coupled(load_scenario("drop_5cm", stop=1.0, macro_step=macro_step, set=hard)).log
    assert log.solves["cable"] / len(log.steps) <= most
    assert not log.unconverged


def test_an_iteration_that_ends_soon_gets_no_new_jacobian():
    """Expected: three more iterations by a factor of 1e-2 each take 1e-3 below 3e-6; by 0.5 each they do not."""
    master = SimpleNamespace(max_iterations=10, outer=7, tolerance=3e-6)
    assert InterfaceJacobian._ends_soon(master, 1e-3, 1e-2)
    assert not InterfaceJacobian._ends_soon(master, 1e-3, 0.5)
    assert not InterfaceJacobian._ends_soon(master, 1e-3, 1e200)


def test_iterations_say_which_beginning_it_was(beginnings):
    assert not np.any(beginnings["polynomial"].steps_table["by_model"])
    assert np.mean(beginnings["model"].steps_table["by_model"]) > 0.9


def test_a_prediction_that_does_not_exist():
    from orchestrator.coupling.errors import InputError

    with pytest.raises(InputError, match="prediction 'magic': choose model, polynomial"):
        run_coupled(load_scenario("landing_200m_point9", stop=0.01, set={"master.prediction": "magic"}))
