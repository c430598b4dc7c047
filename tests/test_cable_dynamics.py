"""The cable in motion: order in the step, energy, waves, damping, a point mass, replay.

Where the expected values come from is said in `verification/cable`.
"""

import numpy as np
import pytest

from fmus.module.variables import ModuleError
from verification.cable import point_mass, time_steps
from verification.cable.setups import TABLE1, cable
from verification.cable.time_steps import METHODS, SOFT

pytestmark = pytest.mark.portable

LOAD = {"port[1].s": 57.0, "port[1].force.x": 90.0, "port[1].force.z": -372.0, "port[1].moment.x": 20.0}


@pytest.mark.parametrize("method", METHODS)
def test_order_in_the_step(method):
    """Loads jump between macro steps, as those of an explicit master do."""
    row = time_steps.order_row(method)
    assert row.passed, row


def test_energy_of_free_vibration():
    """6 s; the whole minute is left to `make verify`."""
    _, history = time_steps.energy_history(6.0, 1e-3, spectral_radius=1.0, damping_time=0.0)
    assert time_steps.drift(history) < 1e-8


def balance(integrator: str, step: float) -> float:
    """Return what is missing in the energy balance of the soft cable, of the work done at the port."""
    made = cable(SOFT, integrator=integrator, spectral_radius=1.0, integration_step=step)
    before = time_steps.energies(made).sum()
    load = {"port[1].s": 3.7, "port[1].force.z": 20.0, "port[1].force_rate.z": 100.0, "port[1].moment.x": 3.0}
    made.table.assign(made.values, load)
    for k in range(5):
        made.step(0.1 * k, 0.1)
    return abs(time_steps.energies(made).sum() - before - made["port[1].work"]) / made["port[1].work"]


def test_energy_balance_with_damping_and_a_load():
    """What the port gives is stored or dissipated, but for the error of the method: order 4 (round-off here) and 2."""
    assert balance("collocation", 1e-3) < 1e-9
    assert balance("generalized_alpha", 1e-3) < 0.3 * balance("generalized_alpha", 2e-3) < 1e-3


def test_decay_and_waves():
    for row in [*time_steps.decay_rows(), *time_steps.wave_rows()]:
        assert row.passed, row


def test_point_mass_set_on_the_cable():
    _, found, expected = point_mass.placed(60, 0.01, 1.5)
    row = point_mass.row("", found, expected, "modes of beam and mass", 1e-4)
    assert row.passed, row


def test_point_mass_that_strikes():
    _, found, expected = point_mass.impact(120, 0.005, 0.25)
    row = point_mass.row("", found, expected, "infinite beam-string", 2e-4)
    assert row.passed, row


def test_laplace_inversion():
    """1/(p + 2) ↦ exp(-2t), 1/√(p + 1) ↦ exp(-t)/√(πt)."""
    t = np.array([0.1, 1.0, 3.0])
    assert point_mass.talbot(lambda p: 1.0 / (p + 2.0), t) == pytest.approx(np.exp(-2.0 * t), abs=1e-10)
    expected = np.exp(-t) / np.sqrt(np.pi * t)
    assert point_mass.talbot(lambda p: 1.0 / np.sqrt(p + 1.0), t) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("integrator", ["collocation", "generalized_alpha"])
def test_rest_stays_at_rest(integrator):
    made = cable(TABLE1, integrator=integrator)
    start = made.state.copy()
    for k in range(20):
        made.step(0.01 * k, 0.01)
    n = made.model.weight.size
    # the equilibrium is found to 1e-13 of the length
    assert np.abs(made.state[:n] - start[:n]).max() < 1e-9
    assert made["kinetic_energy"] < 1e-12


@pytest.mark.parametrize("integrator", ["collocation", "generalized_alpha"])
def test_replay_is_bit_identical(integrator):
    made = cable(TABLE1, LOAD, integrator=integrator)
    for k in range(3):
        made.step(0.005 * k, 0.005)
    values, state = made.values.copy(), made.state.copy()
    made.step(0.015, 0.005)
    first = made.values.copy(), made.state.copy()
    other = cable(TABLE1, integrator=integrator)
    for again in (made, other):
        again.values[:], again.state[:] = values, state
        again.step(0.015, 0.005)
        assert np.array_equal(again.values, first[0]) and np.array_equal(again.state, first[1])


def test_mirrored_load_gives_mirrored_motion():
    one, other = cable(TABLE1, LOAD), cable(TABLE1, LOAD, {"port[1].force.x": -90.0})
    for k in range(20):
        one.step(0.01 * k, 0.01)
        other.step(0.01 * k, 0.01)
    for axis, sign in (("x", -1.0), ("y", 1.0), ("z", 1.0)):
        assert other[f"port[1].position.{axis}"] == pytest.approx(sign * one[f"port[1].position.{axis}"], abs=1e-12)


def test_momentum():
    """Newton's second law for the whole cable: impulse of supports, weight and load = change of momentum."""
    made = cable(SOFT, {"port[1].s": 4.0, "port[1].force.z": 8.0}, spectral_radius=1.0, integration_step=1e-3)
    n, h, force = made.model.weight.size, 1e-3, []
    weight = 0.7 * 9.8 * 10.5
    mass = np.zeros(n)
    mass[2::6] = 1.0

    def applied() -> float:
        return made["reaction_left.z"] + made["reaction_right.z"] - weight + made["port[1].force.z"]

    def momentum() -> float:
        l = np.diff(made.model.s)
        v, slope = made.state[n : 2 * n][2::6], made.state[n : 2 * n][5::6]
        return 0.7 * float(np.sum(l * (v[1:] + v[:-1]) / 2.0 + l**2 * (slope[:-1] - slope[1:]) / 12.0))

    made.step(0.0, h)
    start = momentum()
    force.append(applied())
    for k in range(1, 400):
        made.step(k * h, h)
        force.append(applied())
    impulse = h * (np.sum(force) - 0.5 * (force[0] + force[-1]))
    # trapezoidal rule at 1 ms; the largest momentum is of the order of 5 N s
    assert momentum() - start == pytest.approx(impulse, abs=2e-3)


def test_moment_at_a_port_turns_the_cable():
    """A couple M at midspan of a hinged beam turns it there by M L/(12 EI) (Roark), for small angles."""
    made = cable(
        {"span": 2.0, "unstretched_length": 2.0, "gravity": 0.0, "linear_density": 0.1, "bending_stiffness": 100.0},
        {
            "axial_stiffness": 1e6,
            "damping_time": 0.05,
            "spectral_radius": 0.0,
            "integration_step": 0.05,
            "n_elements": 10,
        },
    )
    made.table.assign(made.values, {"port[1].s": 1.0, "port[1].moment.x": 0.1})
    for k in range(40):
        made.step(0.5 * k, 0.5)
    assert made["port[1].tangent.z"] == pytest.approx(0.1 * 2.0 / (12.0 * 100.0), rel=1e-5)


def test_a_very_long_step():
    """A macro step, and inner step, of 2 s under a sudden load: converges, halving the inner step where it must."""
    made = cable(TABLE1, LOAD, integration_step=2.0)
    made.step(0.0, 2.0)
    assert np.all(np.isfinite(made.values)) and -5.0 < made["port[1].position.z"] < 0.0


def test_finest_cable_moves():
    made = cable(TABLE1, LOAD, {"n_elements": 500})
    made.step(0.0, 0.005)
    coarse = cable(TABLE1, LOAD, {"n_elements": 250})
    coarse.step(0.0, 0.005)
    assert made["port[1].position.z"] == pytest.approx(coarse["port[1].position.z"], rel=1e-3)


def test_what_cannot_be_stepped_is_said():
    made = cable(TABLE1, {"port[1].s": 250.0})
    with pytest.raises(ModuleError, match=r"port\[1\]\.s = 250 m is off the cable"):
        made.step(0.0, 0.01)
    made = cable(TABLE1, {"port[2].force.z": float("nan")})
    with pytest.raises(ModuleError, match="not a finite number at t = 0 s"):
        made.step(0.0, 0.01)
    made = cable(TABLE1, {"port[1].s": 100.0, "port[1].force.z": 1e300})
    with pytest.raises(ModuleError, match=r"does not converge at t = 1 s"):
        made.step(1.0, 0.01)
