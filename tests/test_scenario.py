"""Scenario files: what they may say, and what is said of a wrong one."""

from pathlib import Path

import pytest

from orchestrator.coupling.errors import InputError
from orchestrator.scenario.read import load
from orchestrator.scenario.types import GraphScenario, LandingScenario

FOLDER = Path(__file__).resolve().parents[1] / "scenarios"
LANDINGS = sorted(path for path in FOLDER.glob("*.toml") if "[landing]" in path.read_text(encoding="utf-8"))
GOOD = """
title = "A landing"
[simulation]
stop_time = 1.0
macro_step = 0.005
tolerances = { "robot.body.position.z" = 1e-4 }
[cable.parameters]
span = { value = 50.0, unit = "m", source = "a drawing" }
unstretched_length = 50.0
[robot]
model = "fptlir"
parameters.inertia.xx = 6.0
[landing]
position = 20.0
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.toml"
    path.write_text(GOOD, encoding="utf-8")
    return path


def problems(path: Path, *overrides: str, **options: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        load(path, overrides, **options)
    return caught.value.problems


def replaced(path: Path, old: str, new: str) -> Path:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


@pytest.mark.parametrize("path", LANDINGS, ids=lambda path: path.stem)
def test_shipped_scenarios_are_valid_and_sourced(path: Path):
    scenario = load(path)
    assert isinstance(scenario, LandingScenario) and scenario.name == path.stem
    for key, provenance in scenario.provenance.items():
        if key.startswith(("cable.parameters.", "contact.parameters.", "landing.")):
            assert provenance.source != "scenario", f"{key} says not where it comes from"


def test_values_and_provenance(file: Path):
    scenario = load(file)
    assert isinstance(scenario, LandingScenario) and scenario.cable.parameters["span"] == 50.0
    assert scenario.provenance["cable.parameters.span"].source == "a drawing"
    assert scenario.provenance["landing.position"].source == "scenario"


def test_dotted_parameter_names_are_one_name(file: Path):
    scenario = load(file, ["robot.parameters.inertia.xx=7.5"])
    assert isinstance(scenario, LandingScenario) and scenario.robot.parameters == {"inertia.xx": 7.5}


def test_overrides_have_toml_types_and_their_own_provenance(file: Path):
    scenario = load(
        file, ["cable.parameters.clamped=true", "cable.parameters.n_elements=10", "simulation.master=jacobi"]
    )
    assert isinstance(scenario, LandingScenario)
    assert scenario.cable.parameters["clamped"] is True and scenario.cable.parameters["n_elements"] == 10
    assert scenario.simulation.master == "jacobi"
    assert scenario.provenance["cable.parameters.clamped"].source == "command line"


def test_another_robot_and_another_master(file: Path):
    text = GOOD.replace("[cable", 'exchange = "hermite"\n[master]\ntolerance = 1e-6\n[cable', 1)
    file.write_text(text, encoding="utf-8")
    scenario = load(file, robot="hybrid_robot_2", master="jacobi")
    assert isinstance(scenario, LandingScenario) and scenario.robot.model == "hybrid_robot_2"
    assert scenario.master == {} and scenario.simulation.exchange is None


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("robot.parameters.mas=12", "robot.parameters.mas: unknown key; did you mean mass?"),
        ("robot.parametres.mass=12", "robot.parametres: unknown key; did you mean parameters?"),
        ("simulation.stoptime=1.0", "simulation.stoptime: unknown key; did you mean stop_time?"),
        ("cabel.fmu=a.fmu", "cabel: unknown key; did you mean cable?"),
        ("cable.parameters.span=true", "cable.parameters.span: True is not of type real"),
        ("cable.parameters.n_elements=2.5", "cable.parameters.n_elements: 2.5 is not of type integer"),
        ("cable.parameters.span=[1, 2]", "must be a number, true, false or a string"),
        ("simulation.stop_time=later", "simulation.stop_time: 'later' must be a valid number"),
        ("simulation.stop_time=inf", "simulation.stop_time: inf must be a finite number"),
        ("cable.parameters.span=nan", "cable.parameters.span: nan must be a finite number"),
        ('landing.position={value=20.0,unit="km"}', "landing.position: unit is km; m is wanted"),
        ('robot.parameters.mass={value=20.0,unit="g"}', "robot.parameters.mass: unit is g; kg is wanted"),
        ("robot.parameters.mass=-38", "robot.parameters.mass: -38 must be greater than 0"),
        ("cable.parameters.span=0", "cable.parameters.span: 0 must be greater than 0"),
        ("cable.parameters.damping_time=-1.0", "cable.parameters.damping_time: -1.0 must not be negative"),
        ("simulation.macro_step=0", "simulation.macro_step: 0 must be greater than 0"),
        ("simulation.timeout=0", "simulation.timeout: 0 must be greater than 0"),
        ("simulation.macro_step=0.3", "simulation.macro_step: 0.3 s does not divide stop_time 1 s; 0.333333 s does"),
        ("simulation.macro_step=2.0", "simulation.macro_step: 2 s does not divide stop_time 1 s; 1 s does"),
        ("landing.position=50.0", "landing.position: 50 m is off the span"),
        ("landing.position=-1.0", "landing.position: -1 m is off the span"),
        ("landing.height=-1.0", "landing.height: -1.0 must be greater than or equal to 0"),
        ("simulation.master=iqn_il", "simulation.master: no master 'iqn_il'; did you mean iqn_ils?"),
        ("master.tolerence=1e-6", "master.tolerence: unknown key for master iqn_ils; did you mean tolerance?"),
        ("master.tolerance=small", "master.tolerance: 'small' is not of type float"),
        ("simulation.exchange=wave", "simulation.exchange: 'wave' must be 'point', 'hermite' or 'waveform'"),
        ("contact.parameters.exchange=wave", "contact.parameters.exchange: 'wave' is not one of"),
        ("robot.model=fptlr", "robot.model: no robot 'fptlr' in the catalogue; did you mean fptlir?"),
        ('robot.parameters.mass={value=1.0,source="assumed"}', 'an assumed value needs a reason = "…"'),
        (
            'robot.parameters.mass={value=1.0,sauce="x"}',
            "robot.parameters.mass.sauce: unknown key; did you mean source?",
        ),
        ("simulation.tolerances.robot.roll=0.0", "simulation.tolerances.robot.roll: 0.0 must be greater than 0"),
    ],
)
def test_each_mistake_is_named_with_its_cure(file: Path, override: str, message: str):
    (found,) = problems(file, override)
    assert found.startswith("--set: ") and message in found


def test_mistakes_in_the_file_name_the_file(file: Path):
    replaced(file, "model =", "modell =")
    assert f"{file}: robot.modell: unknown key; did you mean model?" in problems(file)


def test_all_mistakes_are_collected(file: Path):
    found = problems(file, "robot.parameters.mas=1", "simulation.macro_step=0.3", "landing.position=99.0")
    assert len(found) == 3


def test_a_general_graph_has_components_and_no_landing():
    scenario = load(FOLDER / "oscillator.toml")
    assert isinstance(scenario, GraphScenario) and set(scenario.components) == {"left", "right"}
    assert isinstance(scenario.changed(macro_step=0.02), GraphScenario)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[landing]", '[components.a]\nmodel = "oscillator"\n[landing]', "has both components and a landing; give one"),
        (
            'title = "A landing"',
            'title = "A landing"\ncompnents = 1',
            "compnents: unknown key; did you mean components?",
        ),
    ],
)
def test_what_is_neither_a_landing_nor_a_graph(file: Path, old: str, new: str, message: str):
    (found,) = problems(replaced(file, old, new))
    assert message in found


def test_missing_sections_and_keys(file: Path):
    assert any("landing: missing" in line for line in problems(replaced(file, "[landing]\nposition = 20.0", "")))
    assert f"{file}: simulation.stop_time: missing" in problems(replaced(file, "stop_time = 1.0", ""))


@pytest.mark.parametrize("override", ["", "a", "=1", "a=", "title.x=1", "landing.position=1 2"])
def test_what_is_no_override(file: Path, override: str):
    (found,) = problems(file, override)
    assert found.startswith("--set")


def test_no_file_and_no_toml(tmp_path: Path):
    assert "no such scenario file" in problems(tmp_path / "none.toml")[0]
    (tmp_path / "bad.toml").write_text("title = ", encoding="utf-8")
    assert "not a TOML file" in problems(tmp_path / "bad.toml")[0]


def test_fmu_files(file: Path, tmp_path: Path):
    assert "no such file" in problems(file, robot=str(tmp_path / "none.fmu"))[0]
    (tmp_path / "text.fmu").write_text("no archive", encoding="utf-8")
    assert "not an FMU: not a zip archive" in problems(file, robot=str(tmp_path / "text.fmu"))[0]


def test_fmu_paths_are_relative_to_the_scenario(file: Path, tmp_path: Path):
    (found,) = problems(replaced(file, 'model = "fptlir"\nparameters.inertia.xx = 6.0', 'fmu = "mine.fmu"'))
    assert str(tmp_path / "mine.fmu") in found


def test_changed_copy_keeps_the_rest(file: Path):
    scenario = load(file)
    copy = scenario.changed(macro_step=0.01)
    assert isinstance(copy, LandingScenario) and copy.simulation.macro_step == 0.01
    assert isinstance(scenario, LandingScenario) and copy.cable == scenario.cable
    assert copy.provenance == scenario.provenance and copy.path == scenario.path
