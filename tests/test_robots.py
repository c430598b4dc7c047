"""The catalogue of robots: numbers by hand, and what is said about faulty files."""

import contextlib
import math

import pytest

from fmus.robot.module import Robot
from orchestrator.catalogue import listing, robot_spec
from orchestrator.catalogue.library import robot_fmu, robot_recipe
from orchestrator.catalogue.modules import of_fmu
from orchestrator.catalogue.robot_spec import FOLDER, catalogue, load_robot
from orchestrator.cli.commands import main
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
    assert set(spec.assumptions()) == {"body.center_of_mass", "wheel[1].mount", "rotors.max_thrust"}


@pytest.mark.parametrize("mass", [10, 55, 100])
def test_inertia_scales_with_the_mass(mass):
    light, standard = load_robot(f"fptlir_{mass}kg").parameters, load_robot("fptlir").parameters
    for name in ("mass", "inertia.xx", "inertia.yy", "inertia.zz"):
        assert light[name] == pytest.approx(standard[name] * mass / 38.0, rel=1e-14)  # a few roundings


@pytest.mark.parametrize(
    ("mass", "xx", "zz"), [(10, 1.52632, 2.23684), (55, 8.39474, 12.3026), (100, 15.2632, 22.3684)]
)
def test_scaled_inertia_is_that_of_the_paper(mass, xx, zz):
    """Jia et al. 2025, section 4.4, vary the density; the numbers (about b) have six digits."""
    inertia = load_robot(f"fptlir_{mass}kg").body.inertia
    assert inertia.xx.value == inertia.yy.value == pytest.approx(xx, rel=5e-6)
    assert inertia.zz.value == pytest.approx(zz, rel=5e-6)
    assert inertia.zz.source == f"Jia et al. 2025, Table 1; scaled by {mass / 38:.6g} with the mass"


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


# -- robots that build on others ---------------------------------------------------------------------------------

MASS = 'body.mass = { value = 76.0, unit = "kg", source = "scales" }'


def written(folder, text, name="mine.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_robot_takes_from_another_what_it_does_not_say(tmp_path):
    path = written(
        tmp_path, 'extends = "fptlir"\ncontact.wheel_radius = { value = 8, unit = "cm", source = "measured" }'
    )
    mine, standard = load_robot(path), load_robot("fptlir")
    assert mine.parameters == standard.parameters and mine.title == standard.title
    assert mine.contact_parameters == standard.contact_parameters | {"wheel_radius": 0.08}


def test_inertia_that_a_robot_gives_is_not_scaled(tmp_path):
    """Twice the mass alone doubles it; an entry of its own says that the others hold as they are."""
    doubled = load_robot(written(tmp_path, f'extends = "fptlir"\n{MASS}')).body.inertia.tensor
    assert (doubled == 2.0 * load_robot("fptlir").body.inertia.tensor).all()
    own = 'body.inertia.zz = { value = 9.0, unit = "kg.m2", source = "measured" }'
    tensor = load_robot(written(tmp_path, f'extends = "fptlir"\n{MASS}\n{own}')).body.inertia.tensor
    assert tensor[0, 0] == 5.8 and tensor[2, 2] == 9.0


def test_inertia_is_scaled_once_through_two_files(tmp_path):
    """From 10 kg, which is scaled from 38 kg itself, to 76 kg: twice that of 38 kg."""
    tensor = load_robot(written(tmp_path, f'extends = "fptlir_10kg"\n{MASS}')).body.inertia.tensor
    assert tensor == pytest.approx(2.0 * load_robot("fptlir").body.inertia.tensor, rel=1e-14)


def test_the_file_with_the_mistake_is_named(tmp_path):
    base = written(
        tmp_path, (FOLDER / "fptlir.toml").read_text(encoding="utf-8").replace("5.8,", "-5.8,", 1), "base.toml"
    )
    path = written(tmp_path, 'extends = "base.toml"\nlayuot = "top"')
    with pytest.raises(InputError) as caught:
        load_robot(path)
    first, second = sorted(caught.value.problems)
    assert first.startswith(f"{base}: body.inertia.xx: -5.8 kg.m2 must be greater than 0")
    assert second.startswith(f"{path}: layuot: unknown key; did you mean layout?")


@pytest.mark.parametrize(("unit", "value"), [("g", 38000.0), ("t", 0.038), ("kg", 38.0)])
def test_units_are_those_of_scenarios(tmp_path, unit, value):
    text = (FOLDER / "fptlir.toml").read_text(encoding="utf-8")
    path = written(tmp_path, text.replace('value = 38.0, unit = "kg"', f'value = {value}, unit = "{unit}"'))
    assert load_robot(path).parameters == load_robot("fptlir").parameters


@pytest.mark.parametrize(
    ("name", "fmu"), [("mine", "mine"), ("my robot-2", "my_robot_2"), ("4 wheels", "robot_4_wheels")]
)
def test_an_fmu_has_a_name_whatever_the_file_is_called(tmp_path, name, fmu):
    spec = load_robot(written(tmp_path, 'extends = "fptlir"', f"{name}.toml"))
    assert spec.name == name and robot_recipe(spec).name == fmu


def test_two_robots_of_one_name_have_an_fmu_each(tmp_path, monkeypatch):
    monkeypatch.setenv("LINE_LANDING_FMUS", str(tmp_path / "fmus"))
    (tmp_path / "other").mkdir()
    one = load_robot(written(tmp_path, 'extends = "fptlir"'))
    other = load_robot(written(tmp_path / "other", f'extends = "fptlir"\n{MASS}'))
    first, second = robot_fmu(one), robot_fmu(other)
    masses = [of_fmu(path)["mass"].start for path in (first, second, robot_fmu(one))]
    assert first != second and masses == [38.0, 76.0, 38.0]


ODD = [
    "3",
    "-1.5",
    '"x"',
    "[1]",
    "{}",
    "nan",
    f"1{'0' * 400}",
    "{ value = 3 }",
    "{ a = 1 }",
    "{ value = 1.0, unit = 3 }",
]
ODD += ['{ value = { a = 1 }, unit = "kg" }', f'{{ value = 1{"0" * 400}, unit = "kg", source = "x" }}']


@pytest.mark.parametrize("place", ["title", "body", "body.mass", "body.inertia", "body.inertia.xx", "contact", "wheel"])
def test_nothing_in_a_file_ends_in_a_traceback(tmp_path, place):
    """Not in the file, and not in one that extends it with another mass."""
    for odd in ODD:
        path = written(tmp_path, f'extends = "fptlir"\n{place} = {odd}', "base.toml")
        heavier = written(tmp_path, f'extends = "base.toml"\n{MASS}')
        for file in (path, heavier):
            with contextlib.suppress(InputError):
                assert load_robot(file).parameters["mass"] > 0.0


# -- a faulty file in the catalogue ------------------------------------------------------------------------------


@pytest.fixture
def faulty(tmp_path, monkeypatch):
    """A catalogue of two, one of which is faulty."""
    for name in ("fptlir", "linedrone"):
        written(tmp_path, (FOLDER / f"{name}.toml").read_text(encoding="utf-8"), f"{name}.toml")
    path = written(tmp_path, "title = ", "broken.toml")
    monkeypatch.setattr(robot_spec, "FOLDER", tmp_path)
    return path


def test_a_faulty_file_is_listed_with_its_fault(faulty):
    robots = listing.robots()
    assert list(robots) == ["broken", "fptlir", "linedrone"] and robots["linedrone"] == load_robot("linedrone").title
    assert robots["broken"].startswith(f"faulty: {faulty}: not a TOML file: ") and "mend that line" in robots["broken"]


@pytest.mark.parametrize("arguments", [["build"], ["validate", "landing_200m_point9", "--robot", "broken"]])
def test_a_faulty_file_ends_in_a_message(faulty, arguments, capsys):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2 and f"{faulty}: not a TOML file" in capsys.readouterr().err


def test_the_rest_of_a_catalogue_with_a_faulty_file_is_of_use(faulty, capsys):
    with pytest.raises(SystemExit) as end:
        main(["list"])
    shown = capsys.readouterr().out
    assert end.value.code == 0 and "faulty: " in shown and load_robot("linedrone").title in shown
