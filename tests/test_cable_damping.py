"""Damping from outside, in proportion to mass and by the air: forces, tangent, decay, energy, bounds."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.cable.assembly import add_outer_damping, element_work, residual
from fmus.module.variables import ModuleError
from orchestrator.landing.modes import banded_matrix, modes
from verification.cable.setups import RIG, TABLE1, cable, point
from verification.cable.taut import SETTINGS as TAUT
from verification.cable.taut import taut
from verification.cable.time_steps import SOFT, energies, release

pytestmark = pytest.mark.portable

AIR = {"mass_damping": 1.3, "drag_coefficient": 1.1, "diameter": 0.018, "air_density": 1.2}
PER_SPEED = 0.5 * 1.2 * 1.1 * 0.018
"""½ ρ_air C_d d, kg/m²."""
PARTS = ("material", "mass", "drag")


def straight(**more):
    """A weightless line along y, 10 m long; every node of it can be given any velocity."""
    return cable(RIG | {"gravity": 0.0, "n_elements": 4}, more).model


def outer(model, velocity):
    """Return resultant force (3,) and both powers for a uniform `velocity` (3,)."""
    n = model.weight.size
    q, v, force = np.zeros(n), np.zeros(n), np.zeros(n)
    q[1::6], q[4::6] = model.s, 1.0
    for k in range(3):
        v[k::6] = velocity[k]
    powers = add_outer_damping(model, q, v, force, element_work())
    return force.reshape(-1, 6)[:, :3].sum(axis=0), powers


def test_a_line_that_moves_as_a_whole():
    """α m v, and ½ ρ C_d d L |v_n| v_n across the line alone: closed forms."""
    velocity = np.array([0.3, 0.7, -0.4])
    across, speed = np.array([0.3, 0.0, -0.4]), 0.5
    force, (mass, drag) = outer(straight(**AIR), velocity)
    by_mass = 1.3 * 0.707 * 10.0 * velocity
    by_air = PER_SPEED * 10.0 * speed * across
    assert force == pytest.approx(by_mass + by_air, rel=1e-12)
    assert mass == pytest.approx(by_mass @ velocity, rel=1e-12)
    assert drag == pytest.approx(by_air @ velocity, rel=1e-12)


def test_what_counts_for_the_air_is_the_velocity_relative_to_the_wind():
    model = straight(**AIR | {"mass_damping": 0.0})
    model.wind[:] = 0.3, 9.0, -0.4
    force, (_, drag) = outer(model, np.array([0.3, 0.7, -0.4]))
    assert np.abs(force).max() < 1e-15 and abs(drag) < 1e-15
    force, (_, drag) = outer(model, np.zeros(3))
    assert force == pytest.approx(-PER_SPEED * 10.0 * 0.5 * np.array([0.3, 0.0, -0.4]), rel=1e-12, abs=1e-15)
    assert drag == 0.0


def test_tangent_against_differences():
    """Central differences of a smooth function: 1e-8 of the matrix's largest entries by round-off."""
    model = cable(SOFT | {"n_elements": 3}, AIR | {"air_density": 1e4}).model
    model.wind[:] = 0.4, -0.2, 0.1
    n, random = model.weight.size, np.random.default_rng(1)
    q, v = np.zeros(n), random.standard_normal(n)
    q[1::6], q[4::6] = model.s, 1.0
    q += 0.05 * random.standard_normal(n)
    free = np.r_[3 : n - 6, n - 3 : n]

    def force(q, v):
        out = np.zeros(n)
        residual(model, q, v, np.zeros(n), np.zeros(n), out, element_work())
        return out

    for which, step in (((0.0, 1.0, 0.0), 1e-6), ((0.0, 0.0, 1.0), 1e-6)):
        found = banded_matrix(model, q, v, *which).toarray()[np.ix_(free, free)]
        columns = []
        for column in free:
            d = np.zeros(n)
            d[column] = step
            dq, dv = (np.zeros(n), d) if which[1] else (d, np.zeros(n))
            columns.append((force(q + dq, v + dv) - force(q - dq, v - dv))[free] / (2.0 * step))
        expected = np.array(columns).T
        assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()
        # the drag is a part of it that such a test sees
        still = banded_matrix(model._replace(drag=0.0), q, v, *which).toarray()[np.ix_(free, free)]
        assert np.abs(found - still).max() > 1e-4 * np.abs(expected).max()


def test_modal_damping_ratios():
    """α/(2ω) beside what the material gives; for vibrations along the line, β ω/2 + α/(2ω)."""
    for settings in (TABLE1, RIG):
        without, damped = (modes(cable(settings, mass_damping=alpha), 6) for alpha in (0.0, 0.8))
        for before, after in zip(
            (without.out_of_plane, without.in_plane), (damped.out_of_plane, damped.in_plane), strict=True
        ):
            omega = 2.0 * np.pi * before.frequency
            assert after.frequency == pytest.approx(before.frequency, rel=1e-12)
            assert after.damping_ratio == pytest.approx(before.damping_ratio + 0.8 / (2.0 * omega), rel=1e-9)
    settings = RIG | {"gravity": 0.0, "bending_stiffness": 1e-3, "n_elements": 16, "damping_time": 1e-6}
    found = modes(cable(settings, mass_damping=50.0), 34).in_plane
    along = np.array([np.abs(shape[1::3]).max() > np.abs(shape[2::3]).max() for shape in found.shape])
    omega = np.pi / 10.0 * np.sqrt(2.111e7 / 0.707)
    assert found.damping_ratio[along][0] == pytest.approx(1e-6 * omega / 2.0 + 50.0 / (2.0 * omega), rel=1e-5)


STRING = TAUT | {"span": 10.01, "unstretched_length": 10.0, "bending_stiffness": 337.8}


@pytest.mark.parametrize("mode", [1, 2])
def test_decay_in_time(mode):
    """α/(2ω) + c EI λ² β⁴/(2 ρA ω), from five cycles of a free vibration; 1e-3 is what `time_steps.decay_rows` allows."""
    made = cable(STRING | {"damping_time": 0.005, "mass_damping": 4.0}, n_elements=40, spectral_radius=1.0)
    made.values[made.table.index["integration_step"]] = 2e-4
    theory, n, k = taut(STRING | {"damping_time": 0.005}), made.model.weight.size, mode - 1
    beta, omega = theory.wave_numbers(2)[k], theory.frequencies(2)[k]
    ratio = theory.damping_ratios(2)[k] + 4.0 / (2.0 * omega)
    made.state[:n:6] = 1e-5 * np.sin(beta * made.model.s)
    made.state[3:n:6] = 1e-5 * beta * np.cos(beta * made.model.s)
    made.step(0.0, 5 * 2.0 * np.pi / omega / np.sqrt(1.0 - ratio**2))
    decay = np.log(1e-5 / point(made.model, made.state[:n], 5.0 / mode)[0]) / (10.0 * np.pi)
    assert decay / np.sqrt(1.0 + decay**2) == pytest.approx(ratio, rel=1e-3)


def string_in_water(made, velocity, per_speed, stop):
    """Return the amplitudes (3,) of the first three odd modes of a string at `stop`, from the mode equations.

    q_k'' = -ω_k² q_k - 2 c/(ρA L) ∫ |u'| u' sin(kπs/L) ds, solved by scipy.
    """
    theory = taut(STRING)
    odd = np.array([1, 3, 5])
    omega = np.array(theory.frequencies(5))[odd - 1]
    s, w = np.polynomial.legendre.leggauss(60)
    shapes, weights = np.sin(np.outer(odd, np.pi * 0.5 * (s + 1.0))), 0.5 * w

    def rate(t, y):
        q, v = y[:3], y[3:]
        u = v @ shapes
        return np.concatenate([v, -(omega**2) * q - 2.0 * per_speed / 0.91 * (shapes @ (weights * np.abs(u) * u))])

    start = np.array([0.0, 0.0, 0.0, velocity, 0.0, 0.0])
    return solve_ivp(rate, (0.0, stop), start, rtol=1e-10, atol=1e-14).y[:, -1]


def test_free_decay_under_drag():
    """A string that swings through a fluid dense enough to lose 40 % in five cycles, against its mode equations, and
    against the closed form of one mode, a' = -4/(3π) κ ω a², κ = 8 c/(3π ρA), which leaves out κ² and the other modes."""
    fluid = {"drag_coefficient": 1.0, "diameter": 1.0, "air_density": 2e2, "damping_time": 0.0, "gravity": 0.0}
    made = cable(STRING | fluid, n_elements=40, spectral_radius=1.0)
    made.values[made.table.index["integration_step"]] = 2e-4
    n, beta = made.model.weight.size, np.pi / 10.0
    omega = taut(STRING).frequencies(1)[0]
    amplitude, per_speed = 1e-4, 1e2
    made.state[n : 2 * n : 6] = amplitude * omega * np.sin(beta * made.model.s)
    made.state[n + 3 : 2 * n : 6] = amplitude * omega * beta * np.cos(beta * made.model.s)
    stop = 5.25 * 2.0 * np.pi / omega
    expected = string_in_water(made, amplitude * omega, per_speed, stop)
    made.show()
    start = energies(made).sum()
    made.step(0.0, stop)
    middle = point(made.model, made.state[:n], 5.0)[0]
    assert middle == pytest.approx(expected[:3] @ [1.0, -1.0, 1.0], abs=1e-3 * amplitude)
    kappa = 8.0 * per_speed / (3.0 * np.pi * 0.91)
    closed = amplitude / (1.0 + 4.0 / (3.0 * np.pi) * kappa * amplitude * omega * stop)
    assert middle == pytest.approx(closed, rel=2.0 * kappa * amplitude)
    assert made["dissipated_energy_drag"] == pytest.approx(made["dissipated_energy"], rel=1e-12)
    # the strain is (g·g - 1)/2: of 1e-3 it keeps the last bit of 1, in the energy twice
    round_off = 2.0 * np.finfo(float).eps / 1e-3 * start
    assert made["dissipated_energy"] > 1e5 * round_off
    assert abs(energies(made).sum() - start) < round_off


@pytest.mark.parametrize("integrator", ["collocation", "generalized_alpha"])
def test_what_is_dissipated_is_what_the_cable_loses(integrator):
    """The same books as without: round-off for Gauss's collocation, second order for generalized-alpha."""

    def missing(step):
        made = cable(SOFT, AIR, integrator=integrator, spectral_radius=1.0, integration_step=step, air_density=400.0)
        before = energies(made).sum()
        load = {"port[1].s": 3.7, "port[1].force.z": 20.0, "port[1].force_rate.z": 100.0, "port[1].moment.x": 3.0}
        made.table.assign(made.values, load)
        for k in range(5):
            made.step(0.1 * k, 0.1)
        parts = [made[f"dissipated_energy_{part}"] for part in PARTS]
        assert min(parts) > 1e-3 * sum(parts) > 0.0
        assert made["dissipated_energy"] == pytest.approx(sum(parts), rel=1e-14)
        return abs(energies(made).sum() - before - made["port[1].work"]) / made["port[1].work"]

    if integrator == "collocation":
        assert missing(1e-3) < 1e-9
    else:
        assert missing(1e-3) < 0.3 * missing(2e-3) < 1e-3


def test_a_released_line_settles_and_its_supports_carry_what_the_air_does_not():
    """Newton's second law for the whole line: supports, weight and damping give the rate of its momentum."""
    made = release(TABLE1, 60.0, mass_damping=0.5, drag_coefficient=1.0, diameter=0.018, spectral_radius=1.0)
    h, n = 1e-3, made.model.weight.size
    impulse, last = np.zeros(3), None
    made.step(0.0, h)

    def applied():
        force = np.zeros(n)
        q, v = made.state[:n], made.state[n : 2 * n]
        add_outer_damping(made.model, q, v, force, element_work())
        supports = [made[f"reaction_left.{axis}"] + made[f"reaction_right.{axis}"] for axis in "xyz"]
        nodes = made.model.weight.reshape(-1, 6)[:, :3] - force.reshape(-1, 6)[:, :3]
        return np.array(supports) + nodes.sum(axis=0)

    def momentum():
        l, v = np.diff(made.model.s), made.state[n : 2 * n].reshape(-1, 6)
        ends, slopes = (v[1:, :3] + v[:-1, :3]) / 2.0, v[:-1, 3:] - v[1:, 3:]
        return 0.91 * (l @ ends + l**2 @ slopes / 12.0)

    before, last = momentum(), applied()
    for k in range(1, 200):
        made.step(k * h, h)
        now = applied()
        impulse, last = impulse + 0.5 * h * (last + now), now
    assert np.abs(momentum() - before).max() > 1.0
    assert momentum() - before == pytest.approx(impulse, abs=2e-3 * np.abs(momentum() - before).max())


def test_rest_is_as_it_was():
    plain, damped = cable(TABLE1), cable(TABLE1, AIR)
    assert np.array_equal(plain.state[: plain.model.weight.size], damped.state[: damped.model.weight.size])
    for k in range(10):
        damped.step(0.01 * k, 0.01)
    assert damped["kinetic_energy"] < 1e-12 and abs(damped["dissipated_energy_mass"]) < 1e-12


@pytest.mark.parametrize("name", ["mass_damping", "drag_coefficient", "air_density", "diameter"])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_what_is_no_damping_is_refused(name, value):
    with pytest.raises(ModuleError, match=rf"cable: {name} = .*(must be at least 0|not a finite number)"):
        cable(TABLE1, {name: value})


def test_drag_needs_a_diameter():
    with pytest.raises(ModuleError, match=r"drag_coefficient: .* set diameter, in m"):
        cable(TABLE1, drag_coefficient=1.0)
