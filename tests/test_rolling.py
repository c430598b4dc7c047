"""A contact point that moves within the step: the cable's port, what it does work on, and the order while a wheel rolls."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.cable.module import Cable
from fmus.contact import places as at
from fmus.contact.module import Contact
from orchestrator.api import load_scenario
from orchestrator.coupling.errors import InputError
from orchestrator.landing.monolithic.solve import solve
from orchestrator.landing.wiring import landing_graph
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.systems import resolve
from verification.cable import time_steps
from verification.cable.setups import cable as soft_cable
from verification.cable.time_steps import SOFT

LINE = {"span": 20.0, "unstretched_length": 20.1, "n_elements": 10, "integration_step": 2.5e-4}
H = 0.01


def made(module, values):
    """Return a module with these start values, initialised."""
    module.table.assign(module.values, values)
    module.initialize(0.0)
    return module


def cable(**values: float) -> Cable:
    return made(Cable(), {**LINE, **values})


def shown(one: Cable, name: str) -> np.ndarray:
    return one.values[one.table.indices([f"port[1].{name}.{axis}" for axis in "xyz"])]


def put(one: Cable, **values: float) -> None:
    one.table.assign(one.values, {f"port[1].{name}": value for name, value in values.items()})


def test_a_port_moves_along_a_cable_at_rest():
    """Expected: what a port shows that stands at s + s_rate H; the means, of the cubic between two nodes, in closed form."""
    one, there, middle = (cable(**{"port[1].s": s}) for s in (6.5, 6.52, 6.51))
    put(one, s_rate=2.0)
    start = shown(one, "position").copy()
    one.step(0.0, H)
    for name in ("position", "tangent", "curvature"):
        assert shown(one, name) == pytest.approx(shown(there, name), rel=1e-9, abs=1e-9), name
    simpson = (start + 4.0 * shown(middle, "position") + shown(there, "position")) / 6.0  # exact for a cubic
    assert shown(one, "position_mean") == pytest.approx(simpson, abs=1e-10)
    assert shown(one, "velocity") == pytest.approx(0.0, abs=1e-9)  # the material's
    assert shown(one, "tangent_rate_mean") == pytest.approx(0.0, abs=1e-9)
    one.step(H, H)  # s is not set anew: it goes on from where it is
    put(there, s_rate=2.0)
    there.step(0.0, H)
    assert shown(one, "position") == pytest.approx(shown(there, "position"), abs=1e-9)


def test_a_moving_load_is_many_that_stand():
    """Expected: the limit of n loads that stand in the middle of the n-th parts of the way; their error falls as n⁻²."""

    def end(parts: int) -> np.ndarray:
        one = cable(integration_step=H / 64, **{"port[1].s": 6.5})
        put(one, **{"force.z": -300.0, "moment.x": 10.0})
        for i in range(parts):
            put(one, s=6.5 + 5.0 * H * (i + 0.5) / parts)
            one.step(i * H / parts, H / parts)
        return one.nodes_at(one.state)

    one = cable(integration_step=H / 64, **{"port[1].s": 6.5})
    put(one, **{"force.z": -300.0, "moment.x": 10.0, "s_rate": 5.0})
    one.step(0.0, H)
    coarse, fine = end(8), end(16)
    estimate = np.max(np.abs(fine - coarse)) / 3.0
    assert np.max(np.abs(one.nodes_at(one.state) - fine)) < 1.5 * estimate
    assert estimate < 1e-2 * np.max(np.abs(fine - cable().nodes_at(cable().state)))


def missing(integrator: str, step: float, s: float) -> float:
    """Return what is missing in the energy balance of a soft cable whose port moves by 0.5 m from `s`, of the work done."""
    one = soft_cable(SOFT, integrator=integrator, spectral_radius=1.0, integration_step=step)
    before = time_steps.energies(one).sum()
    put(one, s=s, s_rate=1.0, **{"force.z": 20.0, "force.y": 5.0, "force_rate.z": 100.0, "moment.x": 3.0})
    for k in range(5):
        one.step(0.1 * k, 0.1)
    return abs(time_steps.energies(one).sum() - before - one["port[1].work"]) / one["port[1].work"]


def test_the_work_through_a_moving_port_is_the_energy_of_the_cable():
    """Expected: first law, but for the error of the method: order 4 (round-off here) and 2. From 3.3 m on the port passes the
    node at 3.5 m, where the curvature jumps: the mean of the tangent is then one of order 2."""
    assert missing("collocation", 1e-3, 3.6) < 1e-9
    assert missing("collocation", 1e-3, 3.3) < 0.3 * missing("collocation", 2e-3, 3.3) < 1e-6
    assert missing("generalized_alpha", 1e-3, 3.6) < 0.3 * missing("generalized_alpha", 2e-3, 3.6) < 1e-3


def test_a_port_that_would_leave_the_cable_is_refused():
    one = cable(**{"port[1].s": 20.0, "port[1].s_rate": 30.0})
    with pytest.raises(Exception, match=r"port\[1\]\.s = 20\.3 m is off the cable .* at t = 0\.01 s"):
        one.step(0.0, H)
    assert one.values[one.table.index["port[1].s"]] == 20.0


def test_the_rate_is_that_of_the_foot():
    """Expected: on a straight line, the wheel's speed along it over |t|; the place is where the port has gone, and the rest."""
    contact = made(
        Contact(), {"moving_port": True, "cable.tangent.y": 1.01, "wheel.velocity.y": 2.0, "cable.velocity.y": 0.5}
    )
    value = lambda name: float(contact.values[contact.table.index[name]])  # noqa: E731
    rate = 1.5 / 1.01
    assert value("cable.s_rate") == pytest.approx(rate, rel=1e-14)
    motion = {"cable.position.y": 1.01 * rate * H + 0.5 * H, "wheel.position.y": 2.0 * H + 1e-4}
    motion |= {"cable.position_mean.y": 0.5 * motion["cable.position.y"], "wheel.position_mean.y": 0.5 * 2.0 * H}
    contact.table.assign(contact.values, {**motion, "cable.tangent_mean.y": 1.01})
    contact.step(0.0, H)
    assert value("cable.s") == pytest.approx(rate * H + 1e-4 / 1.01, rel=1e-12)


def test_what_a_moving_contact_books_is_what_the_law_stores_and_takes():
    """Expected: work on both bodies, energy stored and dissipated sum to zero, to the Gauss rule, whatever the motion."""
    rng = np.random.default_rng(7)
    contact = made(Contact(), {"moving_port": True, "wheel.position.z": 0.045, "friction_coefficient": 5.0})
    table, values = contact.table, contact.values
    assert contact.state[at.GONE] == 0.0
    stored = values[table.index["strain_energy"]]
    for i in range(5):
        rate = float(values[table.index["cable.s_rate"]])
        way = {"wheel.position.y": 0.002 * (i + 1), "wheel.position.z": 0.045 + 2e-4 * rng.normal()}
        end = {"cable.position.y": rate * H + 1e-3 * rng.normal(), "cable.position.z": 1e-4 * rng.normal(), **way}
        means = {name.replace("position", "position_mean"): value + 1e-4 * rng.normal() for name, value in end.items()}
        speeds = {"wheel.velocity.y": 0.3 * rng.normal(), "cable.velocity.y": 0.1 * rng.normal()}
        table.assign(values, {**end, **means, **speeds})
        contact.step(i * H, H)
    names = ("work_cable", "work_wheel", "dissipated_energy", "strain_energy")
    work = [float(values[table.index[name]]) for name in names]
    assert sum(work) - stored == pytest.approx(0.0, abs=1e-6 * max(map(abs, work)))


RAMP = {"time": [0.0, 0.1, 0.2], "value": [0.0, 0.0, 2.0], "unit": "N.m", "source": "assumed", "reason": "driven off"}
DRIVEN = {
    "robot.parameters.wheel[1].braked": False,
    "robot.inputs.wheel[1].drive_torque": RAMP,
    "landing.position": 5.3,
    "cable.parameters.n_elements": 20,
    "contact.parameters.friction_coefficient": 2.0,
}
SIGNALS = ("robot.body.position.z", "robot.body.position.y", "robot.roll")


def driven(macro_step: float, **values: object):
    settings = {**DRIVEN, "master.tolerance": 1e-9, **values}
    return load_scenario("rig_10m", stop=0.4, macro_step=macro_step, set=settings)


def test_order_while_a_wheel_is_driven_along_the_rig():
    """Expected: order 4 of the exchange in z, and no less than 2.7 in all, where nothing slips; the reference is the monolithic
    solver. With the place held in each step it is 1 (docs/notebook/exchange.md)."""
    time = np.arange(161) * 0.0025
    reference = solve(resolve(driven(0.01)).problem(), time, 1e-12).signals
    assert np.ptp(reference["contact1.cable.s"]) > 0.02
    errors = []
    for every in (4, 2, 1):
        run = run_coupled(driven(0.0025 * every))
        errors.append([np.max(np.abs(run.table[name] - reference[name][::every])) for name in SIGNALS])
    orders = np.log2(np.array(errors[0]) / np.array(errors[2])) / 2.0
    assert np.all(orders > 2.7), (orders, errors)
    assert np.all(np.array(errors[1]) < 1e-5 * np.array([np.ptp(reference[name]) for name in SIGNALS]))


def test_the_books_know_that_the_place_moves():
    """Expected: the work that the cable itself has booked through its port, by stages of its own integration."""
    run = run_coupled(driven(0.005))
    work, books = run.table["cable.port[1].work"], run.log.energy
    total = books["cable.port[1].force"] + books["cable.port[1].moment"]
    assert np.max(np.abs(total - work)) < 1e-5 * np.max(np.abs(work))


def test_the_port_moves_where_the_exchange_and_the_scenario_let_it():
    landing = resolve(driven(0.005)).landing
    for exchange, moves in (("waveform", True), ("hermite", True), ("point", False)):
        with landing_graph(landing, exchange) as graph:
            assert graph.components["contact1"].parameters["moving_port"] is moves
    held = resolve(driven(0.005, **{"contact.parameters.moving_port": False})).landing
    with landing_graph(held, "waveform") as graph:
        assert graph.components["contact1"].parameters["moving_port"] is False
    asked = resolve(driven(0.005, **{"contact.parameters.moving_port": True})).landing
    with pytest.raises(InputError, match=r"contact\.parameters\.moving_port = true: exchange = point has no motion"):
        landing_graph(asked, "point")
