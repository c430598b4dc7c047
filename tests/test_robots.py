"""The catalogue of robots: numbers by hand, and what is said about faulty files."""

import math

import pytest

from fmus.robot import Robot
from orchestrator.catalogue.robot_spec import FOLDER, catalogue, load_robot
from orchestrator.coupling.errors import InputError

CABLE_DIAMETER = 0.018


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_every_robot_can_be_initialised(name):
    """The names are those of the robot's table, and the numbers are those of a possible body."""
    spec = load_robot(name)
    robot = Robot(spec.n_wheels)
    robot.table.assign(robot.values, spec.parameters)
    robot.initialize(0.0)


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_every_robot_hangs_stably(name):
    """The centre of mass is below the line, whose distance from the wheel is R_b + (d/2) / sin(angle/2)."""
    spec = load_robot(name)
    wheel, half = spec.contact_parameters, spec.contact_parameters["groove_angle"] / 2
    apex = wheel["wheel_radius"] - wheel["groove_width"] / 2 / math.tan(half)
    to_line = apex + CABLE_DIAMETER / 2 / math.sin(half)
    for k in range(1, spec.n_wheels + 1):
        line = spec.parameters[f"wheel[{k}].mount.z"] - to_line
        assert spec.parameters["center_of_mass.z"] < line - 0.03


def test_fptlir_by_hand():
    """5.8 kg m² about b less 38 kg (0.1 m)²; the line 0.162 m above b."""
    spec = load_robot("fptlir")
    assert spec.parameters["inertia.xx"] == pytest.approx(5.42)
    assert spec.parameters["inertia.zz"] == pytest.approx(8.5)
    assert spec.parameters["wheel[1].mount.z"] - 0.0532 == pytest.approx(0.162)
    assert spec.contact_parameters["groove_angle"] == pytest.approx(math.radians(100.0))
    assert set(spec.assumptions()) == {"body.center_of_mass", "wheel[1].mount"}


@pytest.mark.parametrize("mass", [10, 55, 100])
def test_inertia_scales_with_the_mass(mass):
    light, standard = load_robot(f"fptlir_{mass}kg").parameters, load_robot("fptlir").parameters
    for name in ("mass", "inertia.xx", "inertia.yy", "inertia.zz"):
        assert light[name] == pytest.approx(standard[name] * mass / 38.0, rel=1e-5)  # six digits in the file


def test_the_number_of_wheels_is_that_of_table_4():
    wheels = {name: load_robot(name).n_wheels for name in ("hybrid_robot_1", "hybrid_robot_2", "linedrone", "fptlir")}
    assert wheels == {"hybrid_robot_1": 3, "linedrone": 4, "hybrid_robot_2": 2, "fptlir": 1}


@pytest.mark.parametrize(
    ("old", "new", "messages"),
    [
        ("mass =", "mas =", ["body.mass: missing", "body.mas: unknown key", "did you mean mass?"]),
        ("[wheel.mount]", "[wheel.mouth]", ["wheel[1].mouth: unknown key", "did you mean mount?"]),
        ('unit = "kg",', 'unit = "m",', ["body.mass: unit 'm' does not fit; possible here: kg, g, t, lb"]),
        ("value = 38.0", "value = -1.0", ["body.mass: -1 kg must be greater than 0"]),
        ("value = 38.0", 'value = "heavy"', ["body.mass.value", "valid number", "'heavy'"]),
        ("value = 38.0", "value = nan", ["body.mass.value", "finite number"]),
        ("[0.0, 0.0, -0.10]", "[0.0, -0.1]", ["body.center_of_mass.value[3]: missing"]),
        ('reason = "not stated; b', '# "', ["body.center_of_mass: what is assumed needs its reason"]),
        ('layout = "top"', 'layout = "up"', ["layout:", "'top' or 'bottom'", "'up'"]),
        ("mass = {", "mass = 38.0 # {", ["body.mass:", "write { value ="]),
        ("braked = {", "# {", ["wheel[1].braked: missing"]),
        ('unit = "kg",', 'unit = "kg', ["not a TOML file", "line"]),
    ],
)
def test_faulty_files_are_explained(tmp_path, old, new, messages):
    text = (FOLDER / "fptlir.toml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_robot(path)
    for message in ["mine.toml", *messages]:
        assert message in str(caught.value)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("fptlr", "did you mean fptlir?"),
        ("../fptlir", "no robot '../fptlir' in the catalogue"),
        ("absent.toml", "absent.toml: cannot be read"),
    ],
)
def test_unknown_robots_are_named(name, message):
    with pytest.raises(InputError) as caught:
        load_robot(name)
    assert message in str(caught.value)


def test_own_file_is_named_after_itself(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text((FOLDER / "fptlir.toml").read_text(encoding="utf-8"), encoding="utf-8")
    assert load_robot(path).name == "mine"
