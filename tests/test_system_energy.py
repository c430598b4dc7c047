"""Energy and momentum of whole runs, coupled and monolithic: the first law, and action = reaction at the interface."""

import numpy as np
import pytest

from fmus.kernels.rotations import from_euler, rotate
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.simulate import simulate
from orchestrator.landing import audit
from orchestrator.landing import build as landing
from orchestrator.landing.monolithic import solve
from orchestrator.landing.monolithic.solve import integrate
from orchestrator.runs.components import opened
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.summary import summary
from tests.scenarios import scenario

pytestmark = pytest.mark.portable


@pytest.fixture(scope="module")
def flagship():
    return run_coupled(scenario())


def test_terms_and_sources_add_up():
    """Made-up books: 3 J go from the robot's height to the cable, 1 J is lost at the interface."""
    zero, table = np.zeros(2), {"time": np.arange(2.0)}
    for component in ("cable", "robot", "contact1"):
        kind = component.rstrip("1")
        table |= {f"{component}.{name}": zero for name in audit.OF_COMPONENT[kind]}
    table["robot.gravitational_energy"] = np.array([10.0, 7.0])
    table["cable.strain_energy"] = np.array([5.0, 7.0])
    table |= {"cable.port[1].work": np.array([0.0, 2.0]), "robot.wheel[1].work": np.array([0.0, -3.0])}
    table |= {"contact1.work_cable": np.array([0.0, 3.0]), "contact1.work_wheel": np.array([0.0, -3.0])}
    books = audit.of_coupled(table, [0.01])
    assert books.drift == 1.0
    assert books.exchanged == 2.5  # half of 3 + 2
    assert books.allowed == pytest.approx(2 * 0.01 * 2.5)
    assert not books.within
    assert {name: values[-1] for name, values in books.sources.items() if values[-1]} == {"interface contact1": -1.0}
    assert "interface contact1" in books.warning()
    held = {n: x if n == "time" else x[0] + 1e-3 * audit.ROUND_OFF * (x - x[0]) for n, x in table.items()}
    for books in (audit.of_coupled(held, [0.01]), audit.of_monolithic(held, dict.fromkeys(held, 0.0))):
        assert books.within and books.warning() is None  # round-off of the 15 J that are there at the start
        assert books.allowed == pytest.approx(15.0 * audit.ROUND_OFF)
        assert books.content()["relative_drift"] is None


def test_a_component_that_does_not_show_its_energy_is_named(flagship):
    table = {name: values for name, values in flagship.table.items() if name != "robot.kinetic_energy"}
    assert audit.missing(table) == ["robot.kinetic_energy"]
    assert audit.of_coupled(table) is None


def test_coupled_books_balance(flagship):
    """Bar: 1e-6 of the energy exchanged. The sources are the whole drift, by construction."""
    books = flagship.energy
    np.testing.assert_allclose(sum(books.sources.values()), books.residual, atol=1e-10 * books.exchanged)
    assert books.drift < 1e-6 * books.exchanged
    assert books.within
    assert books.warning() is None
    content = summary(flagship)["energy"]
    assert content["verdict"] == "pass"
    assert content["drift_J"] == books.drift


def test_monolithic_books_balance_to_the_estimated_error():
    """The drift is at most the sum of the estimated errors of its terms, and falls with the third order of the method
    (16 times the tolerance doubles the steps)."""
    times = np.linspace(0.0, 1.0, 201)
    fine = solve(lambda: landing.problem(scenario()), times)
    books = audit.of_monolithic({"time": times} | fine.signals, fine.estimated_error)
    assert books.within
    assert books.drift < 1e-7 * books.exchanged
    drifts = []
    for tolerance in (1.6e-8, 2.56e-7):
        solution = integrate(lambda: landing.problem(scenario()), times, tolerance)
        drifts.append(audit.of_monolithic({"time": times} | solution.signals, {}).drift)
    assert np.log2(drifts[1] / drifts[0]) == pytest.approx(3.0, abs=0.2)


DAMPED = {f"cable.parameters.{name}": value for name, value in (("mass_damping", 1.0), ("drag_coefficient", 60.0))}
"""Sixty times the drag of a strand in air: it takes about as much as the other kinds."""


def test_books_balance_with_damping_from_outside():
    """Bars as without it. What each kind of damping takes is the same, coupled and monolithic, to the coupling's error."""
    one = scenario(stop=1.0, **DAMPED)
    coupled = run_coupled(one)
    solution = solve(lambda: landing.problem(one), coupled.table["time"])
    books = audit.of_monolithic({"time": solution.time} | solution.signals, solution.estimated_error)
    assert books.within and books.drift < 1e-7 * books.exchanged
    assert coupled.energy.within and coupled.energy.drift < 1e-6 * coupled.energy.exchanged
    parts = [f"cable.dissipated_energy_{kind}" for kind in ("material", "mass", "drag")]
    whole = coupled.table["cable.dissipated_energy"]
    np.testing.assert_allclose(sum(coupled.table[name] for name in parts), whole, rtol=1e-14)
    for name in parts:
        assert solution.signals[name][-1] > 0.01 * whole[-1]
        assert coupled.table[name][-1] == pytest.approx(solution.signals[name][-1], abs=1e-6 * coupled.energy.exchanged)


@pytest.mark.parametrize("case", ["drop_5cm", "controlled"])
def test_books_balance_in_impact_and_under_control(case):
    """Impact with sliding; thrust, torque and a driven free wheel."""
    control = {"robot.inputs.thrust": 150.0, "robot.inputs.torque.x": 2.0, "robot.inputs.torque.z": 0.2}
    control |= {"robot.parameters.wheel[1].braked": "false", "robot.inputs.wheel[1].drive_torque": 1.5}
    one = scenario("drop_5cm", 0.3) if case == "drop_5cm" else scenario(stop=0.5, **control)
    coupled = run_coupled(one)
    solution = solve(lambda: landing.problem(one), coupled.table["time"])
    books = audit.of_monolithic({"time": solution.time} | solution.signals, solution.estimated_error)
    assert books.within
    assert coupled.energy.drift < 5e-6 * coupled.energy.exchanged  # the cable's time integration after the impact
    if case == "controlled":
        work = coupled.table["robot.control_work"][-1]
        assert abs(work) > 1.0
        assert work == pytest.approx(solution.signals["robot.control_work"][-1], rel=1e-4)


def test_explicit_coupling_is_caught():
    """Jacobi at 1 ms makes energy in the impact of a stiff contact: the audit says so, and where.

    Eight times what is allowed, the interface's share twice that of the contact.
    """
    values = {"contact__parameters__stiffness": 1e9, "simulation__tolerances__robot__body__position__z": 1e-4}
    coupled = run_coupled(scenario("drop_5cm", stop=0.3, master="jacobi", macro_step=1e-3, **values))
    assert not coupled.energy.within
    assert "interface contact1" in coupled.energy.warning()


class Impulses:
    """Observer: adds up what cable and robot are given in every accepted step, sub-divided ones included."""

    def __init__(self, graph):
        self.graph = graph
        place = {name: i for i, name in enumerate(graph.input_names)}
        self.places = {
            body: np.array([[place[f"{body}.{load}.{axis}"] for axis in "xyz"] for load in ("force", "moment")])
            for body in ("cable.port[1]", "robot.wheel[1]")
        }
        motions = {"cable.port[1]": graph.components["cable"], "robot.wheel[1]": graph.components["robot"]}
        self.means = {
            body: fmu.group([f"{body.partition('.')[2]}.position_mean.{axis}" for axis in "xyz"])
            for body, fmu in motions.items()
        }
        self.linear = {body: np.zeros(3) for body in self.places}
        self.angular = {body: np.zeros(3) for body in self.places}
        self.largest = 0.0

    def departs(self):
        pass

    def __call__(self, t, h):
        for body, places in self.places.items():
            force, moment = self.graph.u[places]
            self.means[body].get()
            self.linear[body] += h * force
            self.angular[body] += h * (moment + np.cross(self.means[body].values, force))
            self.largest = max(self.largest, float(np.linalg.norm(force)))


@pytest.fixture(scope="module")
def exchanged():
    """What is exchanged in a landing with yaw and a push sideways: the impulses, and the robot's signals."""
    one = scenario(**{"robot.parameters.initial.yaw": 0.05, "robot.parameters.initial.velocity.x": 0.05})
    with opened(one) as graph:
        impulses = Impulses(graph)
        graph.observers.append(impulses)
        log = simulate(graph, MASTERS["iqn_ils"](graph), 0.0, 0.5, 0.005)
    table = dict(zip(log.signals, log.values[-1], strict=True))
    first = dict(zip(log.signals, log.values[0], strict=True))
    return impulses, first, table, one


def vector(table, name):
    return np.array([table[f"{name}.{axis}"] for axis in "xyz"])


def test_impulse_on_the_robot_is_minus_that_on_the_cable(exchanged):
    """Linear: up to the tolerance of the iteration, 1e-8 of the largest force. Angular, about the origin: the mean
    lever times the mean force leaves out how both change within a step, h²/12 of the rates of distance and force; the
    distance of cable point and wheel centre changes by some mm in 0.5 s, the force by some kN/s."""
    impulses, *_ = exchanged
    sum_linear = impulses.linear["cable.port[1]"] + impulses.linear["robot.wheel[1]"]
    assert np.linalg.norm(impulses.linear["cable.port[1]"]) > 100.0
    assert np.max(np.abs(sum_linear)) < 1e-8 * impulses.largest * 0.5
    sum_angular = impulses.angular["cable.port[1]"] + impulses.angular["robot.wheel[1]"]
    left_out = 0.5 * 0.005**2 / 12.0 * 0.1 * 1e4
    assert np.max(np.abs(sum_angular)) < left_out + 1e-8 * impulses.largest * 0.5 * 20.0


def test_impulse_is_what_the_robot_gained(exchanged):
    """m (v_G - v_G0) = impulse - m g t: exact, as the robot's integration is for forces linear in time."""
    impulses, first, last, one = exchanged
    robot = landing.problem(one).robot
    mass = robot.values[robot.table.index["mass"]]
    com = robot.values[robot.table.indices(f"center_of_mass.{axis}" for axis in "xyz")]

    def momentum(table):
        q = np.zeros(4)
        from_euler(table["robot.roll"], table["robot.pitch"], table["robot.yaw"], q)
        arm = np.array(rotate(q, *com))
        spin = np.cross(vector(table, "robot.body.angular_velocity"), arm)
        return mass * (vector(table, "robot.body.velocity") + spin)

    given = impulses.linear["robot.wheel[1]"] - [0.0, 0.0, mass * 9.8 * 0.5]
    np.testing.assert_allclose(momentum(last) - momentum(first), given, atol=1e-10 * np.linalg.norm(given))
