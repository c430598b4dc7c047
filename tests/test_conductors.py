"""Conductors of the catalogue: what they hold, and how a scenario takes it."""

from math import pi
from pathlib import Path

import pytest
from typer.testing import CliRunner

from orchestrator.catalogue.conductor_spec import load_conductor, names
from orchestrator.cli.commands import app
from orchestrator.coupling.errors import InputError
from orchestrator.scenario.read import load

TEXT = """
title = "A landing"
simulation = { stop_time = 1.0, macro_step = 0.005 }
cable = { conductor = "jia2025_200m", stiffness_set = "metallic" }
robot.model = "fptlir"
landing.position = 20.0
"""
WIRES = {"jia2025_200m": 3.6e-3, "jia2025_rig": 3.2e-3}
"""Diameter of each of the 1 + 6 + 12 wires, m."""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def problem(*arguments: object, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        load(*arguments, **options)
    return "\n".join(caught.value.problems)


@pytest.mark.parametrize("name", WIRES)
def test_sets_follow_from_modulus_diameter_and_wires(name: str):
    """physical: a solid rod; table1: the diameter for the radius; metallic: E times the area of the wires, and of EI
    half of what they have when all stick (parallel axes; rings at one and two wires' diameters). Rounded to 3 digits."""
    spec = load_conductor(name)
    e, d, wire = spec.youngs_modulus.value, spec.diameter.value, WIRES[name]
    one, own = pi * wire**2 / 4.0, pi * wire**4 / 64.0
    stuck = e * (19.0 * own + one * (6.0 * wire**2 + 12.0 * (2.0 * wire) ** 2) / 2.0)
    area = spec.metallic_area.value
    assert area == pytest.approx(19.0 * one, rel=1e-3) and d == pytest.approx(5.0 * wire, rel=1e-12)
    expected = {
        "table1": (e * pi * d**2, e * pi * d**4 / 4.0),
        "physical": (e * pi * d**2 / 4.0, e * pi * d**4 / 64.0),
        "metallic": (e * area, 0.5 * stuck),
    }
    assert list(spec.stiffness_sets) == list(expected)
    for name, (ea, ei) in expected.items():
        found = spec.stiffness_sets[name]
        assert found.axial_stiffness.value == pytest.approx(ea, rel=5e-3)
        assert found.bending_stiffness.value == pytest.approx(ei, rel=5e-3)
    metallic = spec.stiffness_sets["metallic"].bending_stiffness.value
    assert 19.0 * own * e < metallic < stuck < expected["physical"][1]


def test_a_scenario_takes_what_it_does_not_give(file: Path):
    scenario = load(file)
    expected = {"diameter": 0.018, "linear_density": 0.91, "axial_stiffness": 1.54e7, "bending_stiffness": 148.0}
    assert scenario.cable.parameters == expected and scenario.contact.parameters == {"cable_diameter": 0.018}
    assert scenario.notes == ()
    ei, d = (
        scenario.provenance[f"{name}"]
        for name in ("cable.parameters.bending_stiffness", "contact.parameters.cable_diameter")
    )
    assert ei.source == "assumed" and "stick together" in ei.reason and ei.file.endswith("jia2025_200m.toml")
    assert d.source == "Jia et al. 2025, section 4.3"


def test_the_set_is_chosen_on_the_command_line():
    found = {name: load("landing_200m_point9", [f"cable.stiffness_set={name}"]) for name in ("physical", "metallic")}
    assert [s.cable.parameters["axial_stiffness"] for s in found.values()] == [2.03e7, 1.54e7]
    assert [s.cable.stiffness_set for s in found.values()] == list(found)


def test_what_the_scenario_gives_stands_and_is_said(file: Path):
    scenario = load(file, ["cable.parameters.axial_stiffness=1e7"])
    assert scenario.cable.parameters["axial_stiffness"] == 1e7
    assert scenario.cable.parameters["bending_stiffness"] == 148.0
    assert scenario.notes == (
        "cable: axial_stiffness of the scenario is taken, not that of jia2025_200m's set metallic",
    )


def child(file: Path, text: str) -> Path:
    path = file.parent / "b.toml"
    path.write_text(f'extends = "{file.name}"\n{text}\n', encoding="utf-8")
    return path


def stiffnesses(path: Path, *overrides: str) -> tuple[float, float]:
    found = load(path, overrides).cable.parameters
    return found["axial_stiffness"], found["bending_stiffness"]


def test_a_set_named_later_wins_over_what_an_earlier_file_gave(file: Path):
    """The rule of the contact: a later file or --set names the set anew; what stands beside its name wins over it."""
    own = child(file, "cable.parameters.axial_stiffness = 1e7")
    assert stiffnesses(own) == (1e7, 148.0)
    assert stiffnesses(own, "cable.stiffness_set=metallic") == (1.54e7, 148.0)
    assert (
        "cable: axial_stiffness are those of jia2025_200m's set metallic"
        in load(own, ["cable.stiffness_set=metallic"]).notes
    )
    both = ["cable.stiffness_set=metallic", "cable.parameters.axial_stiffness=2e7"]
    assert stiffnesses(own, *both) == stiffnesses(own, *reversed(both)) == (2e7, 148.0)
    later = own.rename(own.parent / "c.toml")
    assert stiffnesses(child(later, 'cable.stiffness_set = "physical"')) == (2.03e7, 411.25)


def test_another_conductor_brings_all_of_its_own(file: Path):
    own = child(file, "cable.parameters = { axial_stiffness = 1e7, linear_density = 2.0 }")
    found = load(own, ["cable.conductor=jia2025_rig"])
    rig = load_conductor("jia2025_rig")
    assert found.cable.parameters["linear_density"] == rig.linear_density.value
    assert found.cable.parameters["axial_stiffness"] == rig.stiffness_sets["metallic"].axial_stiffness.value
    assert "cable: linear_density are those of the conductor jia2025_rig" in found.notes
    (file.parent / "mine.toml").write_text('extends = "jia2025_rig"\n', encoding="utf-8")
    assert load(own, ["cable.conductor=mine.toml"]).cable.parameters == found.cable.parameters


def test_a_set_without_conductor_leaves_the_stiffnesses(file: Path):
    file.write_text(TEXT.replace('conductor = "jia2025_200m", ', ""), encoding="utf-8")
    own = child(file, "cable.parameters.axial_stiffness = 1e7")
    assert load(own, ["cable.stiffness_set=physical"]).cable.parameters["axial_stiffness"] == 1e7


def test_wrong_names(file: Path):
    assert "cable.conductor: no conductor 'jia2025_200' in the catalogue; did you mean jia2025_200m?" in problem(
        file, ["cable.conductor=jia2025_200"]
    )
    wrong = problem(file, ["cable.stiffness_set=metalic"])
    assert "cable.stiffness_set: jia2025_200m has no set 'metalic'; did you mean metallic?" in wrong
    assert len(problem(file, ["cable.stiffness_set=3"]).splitlines()) == 1
    file.write_text(TEXT.replace(', stiffness_set = "metallic"', ""), encoding="utf-8")
    assert "cable.stiffness_set: missing; jia2025_200m has table1, physical, metallic" in problem(file)


def test_without_a_conductor_the_set_is_a_label(file: Path):
    file.write_text(TEXT.replace('conductor = "jia2025_200m", ', ""), encoding="utf-8")
    scenario = load(file)
    assert scenario.cable.stiffness_set == "metallic" and scenario.cable.parameters == {}


def test_one_diameter(file: Path):
    """Cable and contact share it: either gives it to the other, and both must agree."""
    file.write_text(TEXT.replace('cable = { conductor = "jia2025_200m", stiffness_set = "metallic" }', "cable = {}"))
    one = load(file, ["contact.parameters.cable_diameter=0.02"])
    assert one.cable.parameters == {"diameter": 0.02}
    other = load(file, ["cable.parameters.diameter=0.02"])
    assert other.contact.parameters == {"cable_diameter": 0.02}
    assert "diameter" not in load(file).cable.parameters
    both = ["cable.parameters.diameter=0.02", "contact.parameters.cable_diameter=0.018"]
    wrong = problem(file, both)
    assert "contact.parameters.cable_diameter: 0.018 m, but cable.parameters.diameter is 0.02 m" in wrong
    assert "leave one of them out" in wrong


def test_a_conductor_of_ones_own(file: Path):
    """By its path, relative to the scenario; it may build on one of the catalogue."""
    text = 'extends = "jia2025_200m"\ntitle = "mine"\n[stiffness_sets.mine]\n'
    text += 'axial_stiffness = { value = 20.0, unit = "MN", source = "test" }\n'
    text += 'bending_stiffness = { value = 300.0, unit = "N.m2", source = "test" }\n'
    (file.parent / "mine.toml").write_text(text, encoding="utf-8")
    file.write_text(TEXT.replace("jia2025_200m", "mine.toml").replace("metallic", "mine"), encoding="utf-8")
    scenario = load(file)
    assert scenario.cable.parameters["axial_stiffness"] == 2e7
    assert scenario.provenance["cable.parameters.axial_stiffness"].source == "test"
    (file.parent / "mine.toml").write_text(text.replace("value = 300.0", "value = -300.0"), encoding="utf-8")
    assert "mine.toml: stiffness_sets.mine.bending_stiffness: -300 N.m2 must be greater than 0" in problem(file)


def test_conductors_are_listed():
    listed = CliRunner().invoke(app, ["list"])
    assert listed.exit_code == 0
    for name in names():
        line = next(line for line in listed.output.splitlines() if line.split()[:1] == [name])
        spec = load_conductor(name)
        assert line.endswith(f"({', '.join(spec.sets)})")
        for value, unit in ((1e3 * spec.diameter.value, "mm"), (1e-3 * spec.rated_strength.value, "kN")):
            assert f" {value:.4g} {unit}" in line


@pytest.mark.parametrize("value", ["3", "true", "[1]", "{}", '{ value = "x" }', '""'])
@pytest.mark.parametrize(
    "place", ["cable.conductor", "cable.stiffness_set", "cable.parameters", "contact", "contact.parameters"]
)
def test_nothing_ends_in_a_traceback(file: Path, place: str, value: str):
    lines = [line for line in TEXT.splitlines() if not line.startswith("cable =")]
    given = {"cable.conductor": '"jia2025_rig"', "cable.stiffness_set": '"physical"', place: value}
    file.write_text("\n".join([*lines, *(f"{key} = {one}" for key, one in given.items())]), encoding="utf-8")
    try:
        load(file)
    except InputError as error:
        assert error.problems
