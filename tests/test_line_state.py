"""The state of the line: strung by sag, tension or length at a temperature, then warmer, colder, icy. Against closed forms."""

from math import pi
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import orchestrator
from fmus.cable.module import Cable
from orchestrator.catalogue.conductor_spec import load_conductor
from orchestrator.cli.commands import app
from orchestrator.coupling.errors import InputError
from orchestrator.landing.build import problem as monolithic
from orchestrator.landing.line_state import rest_words
from orchestrator.landing.modes import of_scenario
from orchestrator.landing.resolve import Landing, resolve
from orchestrator.runs.systems import LandingSystem
from orchestrator.scenario.read import load
from verification.cable.beam import Beam, catenary

TEXT = """
title = "A line of JL/G1A-240/30"
simulation = { stop_time = 0.02, macro_step = 0.005 }
robot.model = "fptlir"
landing.position = 60.0
contact.stiffness_set = "adams_si"

[cable]
conductor = "jl_g1a_240_30"
parameters = { span = 300.0, level_difference = 20.0, gravity = 9.8 }
state = { horizontal_tension = 15e3, at_temperature = 15.0 }
"""
SLENDER = "cable.parameters.bending_stiffness=1e-3"
"""Without bending the line is a catenary."""
CONDUCTOR = load_conductor("jl_g1a_240_30")
ALPHA = CONDUCTOR.thermal_expansion.value


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def landing(file: Path, *sets: str) -> Landing:
    return resolve(load(file, sets))


def closed_form(length: float, density: float, level: float = 20.0) -> tuple[float, float]:
    """Return horizontal tension (N) and sag in the middle (m) of the elastic catenary of the project's strain."""
    ea = CONDUCTOR.youngs_modulus.value * CONDUCTOR.metallic_area.value
    h, _, middle = catenary(Beam(ea, 0.0, density, length), 300.0, level, np.array([length / 2.0]))
    return h, 0.5 * level - float(middle[1, 0])


def words(file: Path, *sets: str) -> str:
    with pytest.raises(InputError) as caught:
        load(file, sets)
    return "\n".join(caught.value.problems)


# -- physics --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("level", [0.0, 20.0, -60.0])
@pytest.mark.parametrize("tension", [5e3, 15e3, 30e3])
def test_strung_by_tension_it_is_the_catenary_of_that_tension(file: Path, tension: float, level: float):
    found = landing(
        file, SLENDER, f"cable.state.horizontal_tension={tension}", f"cable.parameters.level_difference={level}"
    )
    rest = found.rest
    h, sag = closed_form(rest.unstretched_length, rest.linear_density, level)
    assert rest.horizontal_tension == pytest.approx(tension, rel=1e-9)
    assert h == pytest.approx(tension, rel=1e-6) and rest.sag == pytest.approx(sag, rel=1e-6)


@pytest.mark.parametrize("temperature", [-20.0, 5.0, 40.0, 70.0])
def test_change_of_state_against_the_closed_form(file: Path, temperature: float):
    """The unstretched length grows by α ΔT, the mass stays: tension and sag are those of the catenary of that length."""
    cold = landing(file, SLENDER).rest
    rest = landing(file, SLENDER, f"cable.state.temperature={temperature}").rest
    growth = 1.0 + ALPHA * (temperature - 15.0)
    length = cold.unstretched_length * growth
    assert rest.unstretched_length == pytest.approx(length, rel=1e-14) and rest.temperature == temperature
    assert rest.linear_density * length == pytest.approx(cold.linear_density * cold.unstretched_length, rel=1e-14)
    h, sag = closed_form(length, CONDUCTOR.linear_density.value / growth)
    assert rest.horizontal_tension == pytest.approx(h, rel=1e-6) and rest.sag == pytest.approx(sag, rel=1e-6)
    assert (rest.horizontal_tension < cold.horizontal_tension) == (temperature > 15.0)


def test_change_of_state_by_the_parabola(file: Path):
    """The equation of state that line engineers know, H2 - EA (w l)²/(24 H2²) = H1 - EA (w l)²/(24 H1²) - EA α (T2 - T1).

    Of shallow level spans: to the square of the sag by the span. The warm line is lighter a metre.
    """
    ea, w, l = CONDUCTOR.youngs_modulus.value * CONDUCTOR.metallic_area.value, 9.8 * 0.9207, 300.0
    level = "cable.parameters.level_difference=0"
    one = landing(file, SLENDER, level).rest.horizontal_tension
    two = landing(file, SLENDER, level, "cable.state.temperature=40").rest
    left = two.horizontal_tension - ea * (w / (1.0 + 25.0 * ALPHA) * l) ** 2 / (24.0 * two.horizontal_tension**2)
    right = one - ea * (w * l) ** 2 / (24.0 * one**2) - ea * ALPHA * 25.0
    assert left == pytest.approx(right, abs=4.0 * (two.sag / l) ** 2 * abs(ea * ALPHA * 25.0))


def test_ice_is_weight(file: Path):
    """10 mm of 900 kg/m³ around 21.6 mm: the catenary of the heavier line, of the length of the bare one."""
    bare = landing(file, SLENDER).rest
    found = landing(file, SLENDER, "cable.state.ice_thickness={ value = 10.0, unit = 'mm' }")
    density = 0.9207 + pi * 900.0 * 0.01 * (0.0216 + 0.01)
    assert found.rest.linear_density == pytest.approx(density, rel=1e-14)
    assert found.rest.unstretched_length == bare.unstretched_length
    h, sag = closed_form(bare.unstretched_length, density)
    assert found.rest.horizontal_tension == pytest.approx(h, rel=1e-6) and found.rest.sag == pytest.approx(
        sag, rel=1e-6
    )
    assert found.contact.settings["cable_diameter"] == 0.0216, "wheels meet the bare line"


def test_sag_tension_share_and_length_say_the_same(file: Path):
    """What one says of the line, given back to another, strings the same line; with bending, on an inclined span."""
    rest = landing(file).rest
    share = rest.horizontal_tension / CONDUCTOR.rated_strength.value
    for given in (f"sag={rest.sag!r}", f"tension_share={share!r}", f"unstretched_length={rest.unstretched_length!r}"):
        again = landing(file, f"cable.state.{given}").rest
        assert again.unstretched_length == pytest.approx(rest.unstretched_length, rel=1e-9), given
        assert again.horizontal_tension == pytest.approx(rest.horizontal_tension, rel=1e-5), given


def test_a_clamped_line_has_the_tension_too(file: Path):
    """To what its mesh leaves in clamps, 7e-6 of a support's force: it is strung on that of a line as long as its chord."""
    rest = landing(file, "cable.parameters.clamped=true").rest
    assert rest.horizontal_tension == pytest.approx(15e3, rel=7e-6)


def test_what_is_said_of_the_line_at_rest(file: Path):
    """Supports: the vertical forces carry the weight, and the share of the strength is the larger tension's."""
    rest = landing(file).rest
    vertical = [np.sqrt(t**2 - rest.horizontal_tension**2) for t in (rest.tension_left, rest.tension_right)]
    weight = 9.8 * rest.linear_density * rest.unstretched_length
    assert sum(vertical) == pytest.approx(weight, rel=1e-6)
    assert rest.share_of_strength == max(rest.tension_left, rest.tension_right) / CONDUCTOR.rated_strength.value
    said = rest_words(rest.content())
    assert "horizontal tension 15.000 kN" in said and said.endswith("at 15 °C") and "% of the rated strength" in said


# -- who takes it ----------------------------------------------------------------------------------------------


def test_fmu_and_monolithic_solver_have_the_same_line(file: Path):
    found = landing(file, "cable.state.temperature=40", "cable.state.ice_thickness=0.005")
    length, density = found.rest.unstretched_length, found.rest.linear_density
    assert found.cable.settings["unstretched_length"] == found.cable.module["unstretched_length"] == length
    assert found.cable.settings["linear_density"] == density
    cable: Cable = monolithic(found).cable
    assert (cable["unstretched_length"], cable["linear_density"]) == (length, density)
    assert found.changed(found.scenario.changed({}, macro_step=0.01)).rest == found.rest


def test_the_mesh_follows_and_a_finer_one_keeps_the_length(file: Path):
    coarse = landing(file)
    finer = LandingSystem(coarse).meshed()
    assert finer is not None and finer.ratio > 1.2
    here, there = coarse.rest, finer.system.landing.rest
    assert here.unstretched_length == there.unstretched_length
    assert there.horizontal_tension == pytest.approx(here.horizontal_tension, rel=1e-6)


def test_modes_of_the_line_alone_are_those_of_its_state(file: Path):
    """The first mode out of the plane is that of a string: √(H/ρA)/(2 l) of the shallow line, along its chord."""
    level = "cable.parameters.level_difference=0"
    for temperature in (15.0, 60.0):
        rest = landing(file, level, f"cable.state.temperature={temperature}").rest
        found = of_scenario(load(file, [level, f"cable.state.temperature={temperature}"]), 1).out_of_plane
        string = np.sqrt(rest.horizontal_tension / rest.linear_density) / 600.0
        assert found.frequency[0] == pytest.approx(string, rel=4.0 * (rest.sag / 300.0) ** 2)


def test_run_and_validate_say_it(file: Path):
    result = orchestrator.run(file, estimate="none")
    assert result.summary["line"] == pytest.approx(landing(file).rest.content())
    said = CliRunner().invoke(app, ["validate", str(file)])
    assert said.exit_code == 0 and "line at rest: sag " in said.output


# -- how it is given -------------------------------------------------------------------------------------------


def test_strung_anew_by_a_later_file_or_option(file: Path):
    found = load(file, ["cable.state.sag=7.5"])
    assert found.cable.state.sag == 7.5 and found.cable.state.horizontal_tension is None
    assert "cable: the line is strung by state.sag, not by state.horizontal_tension" in found.notes
    plain = load(file, ["cable.parameters.unstretched_length=300.9"])
    assert plain.cable.state is None and plain.cable.parameters["unstretched_length"] == 300.9
    state = load("landing_200m_point9", ["cable.state.sag=4.5"])
    assert "unstretched_length" not in state.cable.parameters
    warmer = load(file, ["cable.state.temperature=40"])
    assert warmer.cable.state.horizontal_tension == 15e3 and warmer.provenance[
        "cable.state.thermal_expansion"
    ].file.endswith("jl_g1a_240_30.toml")


def test_units(file: Path):
    found = load(file, ["cable.state.horizontal_tension={ value = 12.5, unit = 'kN' }"])
    assert found.cable.state.horizontal_tension == 12500.0
    assert found.provenance["cable.state.horizontal_tension"].written == "12.5 kN"
    wrong = words(file, "cable.state.temperature={ value = 280.0, unit = 'K' }")
    assert "cable.state.temperature: unit 'K' does not fit; possible here: degC" in wrong


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        (["cable.state={ horizontal_tension = 1e4, sag = 5.0 }"], "contradicts cable.state.sag; give one of sag, "),
        (["cable.state={ at_temperature = 15.0 }"], "says not how the line is strung; give one of sag, "),
        (["cable.state={ sag = 5.0, temperature = 40.0 }"], "says nothing without at_temperature"),
        (["cable.state.horizontal_tension=-1.0"], "cable.state.horizontal_tension: -1.0 must be greater than 0"),
        (["cable.state.tension_share=1.5"], "cable.state.tension_share: 1.5 must be less than or equal to 1"),
        (["cable.state.temperature=1e4"], "cable.state.temperature: 10000.0 must be less than or equal to 300"),
        (["cable.state.ice_thickness=-0.01"], "cable.state.ice_thickness: -0.01 must be greater than or equal to 0"),
        (["cable.state.tension=1.0"], "cable.state.tension: unknown key"),
        (["cable.state=3"], "cable.state: 3 must be a table"),
        (
            ["cable.state.sag=5.0", "cable.parameters.unstretched_length=300.0"],
            "cable.parameters.unstretched_length: strings the line a second time; give it as cable.state",
        ),
    ],
    ids=str,
)
def test_contradictions_are_refused(file: Path, sets: list[str], said: str):
    assert said in words(file, *sets)


BARE = TEXT.replace('conductor = "jl_g1a_240_30"\n', "")


@pytest.mark.parametrize(
    ("state", "said"),
    [
        ("tension_share = 0.2", "cable.state.tension_share: is a share of the rated tensile strength; give limits."),
        (
            "sag = 5.0, ice_thickness = 0.01",
            "cable.state.ice_thickness: is ice around a line whose diameter is not known",
        ),
        (
            "sag = 5.0, at_temperature = 15.0, temperature = 40.0",
            "cable.state.temperature: differs from at_temperature, but no thermal expansion is known; give cable.state.",
        ),
    ],
)
def test_what_a_line_without_conductor_lacks(file: Path, state: str, said: str):
    text = BARE.replace("horizontal_tension = 15e3, at_temperature = 15.0", state)
    file.write_text(text, encoding="utf-8")
    assert said in words(file)


def test_without_a_conductor_expansion_and_strength_are_the_scenario_s(file: Path):
    state = "tension_share = 0.2, at_temperature = 15.0, temperature = 40.0, thermal_expansion = 2e-5"
    text = BARE.replace("horizontal_tension = 15e3, at_temperature = 15.0", state)
    file.write_text(text + "[limits]\nrated_strength = 75e3\n", encoding="utf-8")
    strung = landing(file, "cable.state.temperature=15").rest
    assert strung.horizontal_tension == pytest.approx(15e3, rel=1e-9)
    warm = landing(file).rest
    assert warm.unstretched_length == pytest.approx(strung.unstretched_length * (1.0 + 2e-5 * 25.0), rel=1e-14)


@pytest.mark.parametrize("given", ["horizontal_tension=0.1", "sag=1e-3"])
def test_what_cannot_be_reached_is_said(file: Path, given: str):
    with pytest.raises(InputError, match="cannot be reached; check it against span, axial_stiffness"):
        landing(file, f"cable.state.{given}")
