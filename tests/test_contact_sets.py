"""Stiffness sets of the contact: what they follow from, and how a scenario names one."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from fmus.contact import places as at
from fmus.contact.module import Contact
from orchestrator.catalogue import contact_sets
from orchestrator.catalogue.listing import contact_sets as listed
from orchestrator.coupling.errors import InputError
from orchestrator.scenario.read import load
from orchestrator.scenario.types import LandingScenario
from tests.contacts import SEAT, SIN, wheel_above, wrench
from tests.scenarios import LANDING

DIAMETER = 0.018
WEIGHT = 38.0 * 9.8


@pytest.mark.parametrize("name", contact_sets.names())
def test_sets_say_where_their_numbers_come_from(name):
    one = contact_sets.load_set(name)
    known = set(Contact.table.names("parameter"))
    assert one.title and set(one.parameters) <= known
    assert listed()[name] == one.title
    for quantity in [*one.parameters.values(), *one.basis.values()]:
        assert quantity.source


def test_units_of_the_default_of_adams():
    """1e5 N/mm^n is 1e5 * 1000^n N/m^n: 1e8 at n = 1 alone."""
    si, mm = (contact_sets.load_set(name).parameters for name in ("adams_si", "adams_mm"))
    assert si["stiffness"].value == pytest.approx(1e5 * 1000.0**1, rel=1e-12)
    assert mm["stiffness"].value == pytest.approx(1e5 * 1000.0 ** mm["exponent"].value, rel=1e-12)


def sunk(stiffness: float, load: float = WEIGHT):
    """How far (m) a wheel sinks into a straight line under a load (N), and the law's results there."""

    def missing(depth):
        return wrench(wheel_above(depth), stiffness=stiffness, friction_coefficient=0.0)[at.RADIAL] - load

    depth = brentq(missing, 1e-8, 0.04, xtol=1e-15)
    return depth, wrench(wheel_above(depth), stiffness=stiffness, friction_coefficient=0.0)


@pytest.mark.parametrize(
    ("name", "sinks", "deepest", "length"),
    [("adams_si", 10.0, 7.6, 62.0), ("hertz", 1.53, 1.17, 25.0), ("adams_mm", 0.30, 0.23, 11.4)],
)
def test_how_deep_38_kg_stand(name, sinks, deepest, length):
    """The numbers of docs/concepts/contact.md, mm."""
    depth, out = sunk(contact_sets.load_set(name).parameters["stiffness"].value)
    assert 1e3 * depth == pytest.approx(sinks, rel=0.02)
    assert 1e3 * out[at.DEEPEST] == pytest.approx(deepest, rel=0.02)
    assert 1e3 * out[at.CONTACT_LENGTH] == pytest.approx(length, rel=0.02)


def hertz_depth(force: float, modulus: float) -> float:
    """Return by how much a cylinder approaches the wall of a groove (m): K. L. Johnson, Contact Mechanics, section 4.2.

    The wall is a cone: straight where it meets the cylinder's circle, and round along the cylinder, with the radius from
    the axle over sin(θ/2). Semi-axes a > b of the ellipse follow from B/A and the load.
    """
    round_cable, round_wall = DIAMETER / 2.0, (SEAT - SIN * DIAMETER / 2.0) / SIN
    A, B = 0.5 / round_wall, 0.5 / round_cable

    def misfit(e):
        K, E = ellipk(e * e), ellipe(e * e)
        return (E / (1.0 - e * e) - K) / (K - E) - B / A

    e = brentq(misfit, 1e-6, 1.0 - 1e-12)
    K, E, flat = ellipk(e * e), ellipe(e * e), math.sqrt(1.0 - e * e)
    a = (1.5 * force * (K - E) / (math.pi * modulus * e * e * A)) ** (1.0 / 3.0)
    pressure = 1.5 * force / (math.pi * a * a * flat)
    return pressure * a * flat * K / modulus


def test_hertz_set_is_hertz_at_38_kg():
    """To three digits, as its file writes it; at 10 and 100 kg it is off by what its file says."""
    one = contact_sets.load_set("hertz")
    basis = {name: quantity.value for name, quantity in one.basis.items()}
    line = (1.0 - basis["line_poisson_ratio"] ** 2) / (1e9 * basis["line_modulus"])
    lining = (1.0 - basis["lining_poisson_ratio"] ** 2) / (1e6 * basis["lining_modulus"])
    modulus, stiffness = 1.0 / (line + lining), one.parameters["stiffness"].value
    for mass, theirs, ours in ((basis["mass"], 1.17, 1.17), (10.0, 0.48, 0.75), (100.0, 2.23, 1.62)):
        load = 9.8 * mass
        depth = hertz_depth(load / (2.0 * SIN), modulus)
        assert 1e3 * depth == pytest.approx(theirs, abs=6e-3)
        assert 1e3 * sunk(stiffness, load)[1][at.DEEPEST] == pytest.approx(ours, abs=6e-3)
    assert sunk(stiffness)[1][at.DEEPEST] == pytest.approx(hertz_depth(WEIGHT / (2.0 * SIN), modulus), rel=2e-3)


def test_what_else_the_docs_say_of_the_sets():
    """docs/concepts/contact.md: 1e8 is a wall of 1.3 MPa; bare steel yields 7 µm; D of IMPACT over the depth."""
    force = WEIGHT / (2.0 * SIN)
    assert 1e3 * hertz_depth(force, 1.26e6 / 0.75) == pytest.approx(7.6, rel=0.01)
    steel = 1.0 / ((1.0 - 0.33**2) / 69e9 + (1.0 - 0.3**2) / 200e9)
    assert 1e6 * hertz_depth(force, steel) == pytest.approx(7.2, rel=0.01)
    for delta, D in ((1e-3, 88.0), (0.01, 10.0)):
        x = delta / 0.01
        assert 1e4 * x**2 * (3.0 - 2.0 * x) / (1e8 * delta**2.5) == pytest.approx(D, rel=0.01)


def test_hertz_depth_of_a_sphere():
    """With both radii alike it is F = 4/3 E* R^1/2 δ^3/2; the ellipse of nearly equal radii is known to be close to it."""
    flat = DIAMETER / 2.0
    mean = math.sqrt(flat * (SEAT - SIN * flat) / SIN)
    sphere = (0.75 * 243.0 / (5.7e10 * math.sqrt(mean))) ** (2.0 / 3.0)
    assert hertz_depth(243.0, 5.7e10) == pytest.approx(sphere, rel=0.06)  # F2 = 0.95 at R1/R2 = 6.7, Johnson fig. 4.4


# -- in a scenario -----------------------------------------------------------------------------------------------


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return child(tmp_path, "a.toml", '[contact]\nstiffness_set = "hertz"\n[contact.parameters]\nexponent = 2.0')


def child(folder: Path, name: str, text: str, base: str = LANDING.stem) -> Path:
    path = folder / name
    path.write_text(f'extends = "{base}"\n{text}\n', encoding="utf-8")
    return path


def parameters(path: Path, *overrides: str) -> dict:
    scenario = load(path, overrides)
    assert isinstance(scenario, LandingScenario)
    return scenario.contact.parameters


def test_what_a_file_gives_itself_wins_over_its_set(file: Path):
    found = parameters(file)
    assert (found["stiffness"], found["exponent"]) == (2.533e10, 2.0)
    provenance = load(file).provenance["contact.parameters.stiffness"]
    assert provenance.source == "assumed" and provenance.file == str(contact_sets.file_of("hertz"))


def test_a_set_named_later_wins_over_what_an_earlier_file_gave(file: Path):
    path = child(file.parent, "b.toml", '[contact]\nstiffness_set = "adams_mm"', "a.toml")
    assert parameters(path)["exponent"] == 2.5
    assert "contact: exponent are those of the set adams_mm" in load(path).notes
    assert parameters(file, "contact.stiffness_set=adams_si") == {**parameters(LANDING)}
    assert parameters(file, "contact.stiffness_set=adams_si", "contact.parameters.stiffness=1e9")["stiffness"] == 1e9


@pytest.mark.parametrize(("name", "said"), [("herz", "did you mean hertz"), ("x", "choose adams_mm, adams_si, hertz")])
def test_a_wrong_name_gets_a_suggestion(file: Path, name: str, said: str):
    with pytest.raises(InputError) as caught:
        load(file, [f"contact.stiffness_set={name}"])
    (problem,) = caught.value.problems
    assert problem.startswith("--set: contact.stiffness_set: no stiffness set") and said in problem
