"""Conductors of the catalogue against the wires that they are made of: geometry, mass, strength, stiffness, expansion."""

from math import pi
from pathlib import Path

import numpy as np
import pytest

from orchestrator.catalogue.conductor_spec import ConductorSpec, load_conductor, names
from orchestrator.catalogue.strands import Layer, bending_range, load_material, outer_diameter
from orchestrator.coupling.errors import InputError
from orchestrator.scenario.read import load

STRANDED = [name for name in names() if load_conductor(name).layers]
ACSR = [name for name in STRANDED if {layer.material for layer in load_conductor(name).layers} == {"al1", "steel"}]
AAAC = [name for name in STRANDED if {layer.material for layer in load_conductor(name).layers} == {"al4"}]
OPGW = [name for name in STRANDED if name.startswith("opgw")]
LAY = 1.02
"""A wire's length by that of the conductor: 1.004 to 1.006 of steel cores, 1.013 to 1.024 of layers (EN 50182, table 4)."""


def areas(spec: ConductorSpec) -> dict[str, float]:
    """Return the section of the wires by their material, m²."""
    found: dict[str, float] = {}
    for layer in spec.layers:
        found[layer.material] = found.get(layer.material, 0.0) + layer.area
    return found


def test_the_catalogue_has_what_lines_are_built_of():
    assert len(ACSR) >= 8 and len(AAAC) >= 3 and len(OPGW) >= 2 and sorted(ACSR + AAAC + OPGW) == sorted(STRANDED)


@pytest.mark.parametrize("name", STRANDED)
def test_section_diameter_and_mass_follow_from_the_wires(name: str):
    """Section and diameter are geometry, to the rounding of the tables; the mass has the lay."""
    spec = load_conductor(name)
    assert spec.metallic_area.value == pytest.approx(sum(areas(spec).values()), rel=5e-3)
    assert spec.diameter.value == pytest.approx(outer_diameter(spec.layers), rel=5e-3)
    mass = LAY * sum(area * load_material(material).density.value for material, area in areas(spec).items())
    assert spec.linear_density.value == pytest.approx(mass, rel=0.12 if name in OPGW else 0.01)


def strength_of_aluminium(diameter: float) -> float:
    """Return the least strength (Pa) of hard-drawn wires, EN 60889 and IEC 60889."""
    limits = ((2.25e-3, 180e6), (2.5e-3, 175e6), (3.0e-3, 170e6), (3.5e-3, 165e6), (5.0e-3, 160e6))
    return next(strength for largest, strength in limits if diameter <= largest)


def stress_of_steel(diameter: float) -> float:
    """Return the least stress (Pa) at 1 % of strain of steel wires of regular strength, EN 50189 and IEC 60888."""
    limits = ((2.25e-3, 1170e6), (3.0e-3, 1140e6), (3.5e-3, 1100e6))
    return next(stress for largest, stress in limits if diameter <= largest)


@pytest.mark.parametrize("name", ACSR)
def test_strength_of_acsr_follows_from_the_wires(name: str):
    """IEC 61089: the strength of the aluminium and the stress of the steel at 1 %. ASTM B232 has wires of its own strengths."""
    spec = load_conductor(name)
    steel, aluminium = spec.layers[0], spec.layers[-1]
    rule = areas(spec)["al1"] * strength_of_aluminium(aluminium.diameter.value)
    rule += areas(spec)["steel"] * stress_of_steel(steel.diameter.value)
    by_iec = spec.diameter.source is not None and "ASTM" not in spec.diameter.source
    assert spec.rated_strength is not None
    assert spec.rated_strength.value == pytest.approx(rule, rel=3e-3 if by_iec else 0.04)


@pytest.mark.parametrize("name", [name for name in AAAC if name.startswith("aster")])
def test_strength_of_almelec(name: str):
    spec = load_conductor(name)
    assert spec.rated_strength is not None
    assert spec.rated_strength.value == pytest.approx(325e6 * areas(spec)["al4"], rel=2e-3)


@pytest.mark.parametrize("name", ACSR)
def test_modulus_and_expansion_of_acsr(name: str):
    """IEC 61597: 55 GPa and 23e-6 of the aluminium, 190 GPa and 11.5e-6 of the steel, weighted; tables are rounded."""
    spec = load_conductor(name)
    aluminium, steel = 55e9 * areas(spec)["al1"], 190e9 * areas(spec)["steel"]
    modulus = (aluminium + steel) / (areas(spec)["al1"] + areas(spec)["steel"])
    assert spec.youngs_modulus.value == pytest.approx(modulus, rel=0.06)
    assert spec.thermal_expansion is not None
    assert spec.thermal_expansion.value == pytest.approx(
        (23e-6 * aluminium + 11.5e-6 * steel) / (aluminium + steel), rel=0.015
    )
    if "61597" in f"{spec.youngs_modulus.source} {spec.youngs_modulus.reason}" and "DIN" not in str(
        spec.youngs_modulus.source
    ):
        assert spec.youngs_modulus.value == pytest.approx(modulus, rel=2e-3)


def wires(layers: list[Layer]) -> np.ndarray:
    """Return every wire as (E, diameter, height over the axis): layers as rings, from the centre outwards."""
    rows, edge = [], 0.0
    for layer in layers:
        d, e = layer.diameter.value, load_material(layer.material).youngs_modulus.value
        radius = 0.0 if edge == 0.0 else edge + d / 2.0
        angles = 0.1 + 2.0 * pi * np.arange(layer.wires) / max(layer.wires, 1)
        rows += [(e, d, radius * np.sin(angle)) for angle in angles]
        edge = radius + d / 2.0
    return np.array(rows)


@pytest.mark.parametrize("name", STRANDED)
def test_bending_range_is_that_of_every_wire(name: str):
    """Wire by wire: about its own axis, and by Steiner's theorem about the conductor's."""
    spec = load_conductor(name)
    e, d, height = wires(spec.layers).T
    slip, steiner = np.sum(e * pi * d**4 / 64.0), np.sum(e * pi * d**2 / 4.0 * height**2)
    assert bending_range(spec.layers) == pytest.approx((slip, slip + steiner), rel=1e-12)
    for name, (ea, ei) in {
        "slip": (1, slip),
        "stick": (1, slip + steiner),
        "metallic": (1, (slip + steiner) / 2),
    }.items():
        found = spec.stiffnesses(name)
        assert found["axial_stiffness"].value == ea * spec.youngs_modulus.value * spec.metallic_area.value
        assert found["bending_stiffness"].value == pytest.approx(ei, rel=1e-12)
    assert slip < (slip + steiner) / 2.0


def test_bending_range_of_seven_wires_in_closed_form():
    """Seven equal wires: E π d⁴/64 times 7, and 7 + 48 when they stick (Σ 16 (R/d)², R = d)."""
    spec = load_conductor("linnet")
    slip, stick = bending_range(spec.layers[:2])
    one = 207e9 * pi * spec.layers[0].diameter.value ** 4 / 64.0
    assert (slip, stick) == pytest.approx((7.0 * one, 55.0 * one), rel=1e-12)


def test_bending_range_beside_that_of_rte():
    """RTE's strdcable has 28.28 and 2155 N m² for ASTER570 (readme of dohl), with the lay of the wires, ours without."""
    slip, stick = bending_range(load_conductor("aster_570").layers)
    assert slip == pytest.approx(28.28, rel=0.025) and stick == pytest.approx(2155.0, rel=0.07)
    assert slip > 28.28 and stick > 2155.0


TEXT = """
title = "A landing"
simulation = { stop_time = 1.0, macro_step = 0.005 }
cable = { conductor = "drake" }
robot.model = "fptlir"
landing.position = 20.0
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def test_a_conductor_has_a_default_set(file: Path):
    found, drake = load(file), load_conductor("drake")
    assert found.cable.stiffness_set == "metallic" and found.limits.rated_strength == drake.rated_strength.value
    assert found.cable.parameters["axial_stiffness"] == pytest.approx(77e9 * 468.6e-6)
    assert found.provenance["cable.parameters.bending_stiffness"].source == "assumed"
    assert found.provenance["cable.stiffness_set"].source == "the conductor's default"
    assert found.contact.parameters == {"cable_diameter": drake.diameter.value}
    stick = load(file, ["cable.stiffness_set=stick"]).cable
    assert stick.stiffness_set == "stick"
    assert stick.parameters["bending_stiffness"] == pytest.approx(2.0 * found.cable.parameters["bending_stiffness"])


def test_a_conductor_named_anew_brings_its_default_set():
    found = load("landing_200m_point9", ["cable.conductor=drake"])
    assert found.cable.stiffness_set == "metallic"
    assert "cable: drake has no set table1; metallic is taken" in found.notes
    kept = load("landing_200m_point9", ["cable.conductor=drake", "cable.stiffness_set=slip"])
    assert kept.cable.stiffness_set == "slip"
    with pytest.raises(InputError, match=r"drake has no set 'table1'; it has metallic, slip, stick"):
        load("landing_200m_point9", ["cable.conductor=drake", "cable.stiffness_set=table1"])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('material = "steel"', 'material = "stele"', "is no material of wires 'stele'; did you mean steel?"),
        ("wires = 10", "wires = -1", "layers[3].wires: -1 must be greater than or equal to 0"),
        ('default_set = "metallic"', 'default_set = "metalic"', "no set 'metalic'; did you mean metallic?"),
        ("diameter = { value = 0.1749", "diameter = { value = -0.1749", "layers[3].diameter"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(file: Path, old: str, new: str, words: str):
    text = load_conductor("drake").path.read_text(encoding="utf-8")
    assert old in text
    (file.parent / "mine.toml").write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_conductor(str(file.parent / "mine.toml"))
    assert any("mine.toml" in problem and words in problem for problem in caught.value.problems)


def test_a_conductor_without_stiffness_is_refused(file: Path):
    text = load_conductor("drake").path.read_text(encoding="utf-8").partition("\n# from the centre")[0]
    (file.parent / "mine.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"has no stiffness; give \[\[layers\]\] of wires, or \[stiffness_sets.NAME\]"):
        load_conductor(str(file.parent / "mine.toml"))
