"""Scenario files: what they may say, and what is said of a wrong one."""

import contextlib
import hashlib
import json
import math
import shutil
from pathlib import Path

import pytest

from orchestrator.catalogue.library import robot_fmu
from orchestrator.catalogue.new import write_new
from orchestrator.catalogue.robot_spec import load_robot
from orchestrator.catalogue.scenarios import find
from orchestrator.coupling.errors import InputError
from orchestrator.scenario.read import load
from orchestrator.scenario.types import GraphScenario, LandingScenario, Scenario

FOLDER = Path(__file__).resolve().parents[1] / "scenarios"
LANDINGS = sorted(path for path in FOLDER.glob("*.toml") if path.stem != "oscillator")
RESOLVED = json.loads((Path(__file__).parent / "data" / "resolved_scenarios.json").read_text(encoding="utf-8"))
"""What the scenarios said, value by value, when each of them stood in one file."""
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
        ("robot.limits.roll=0.1", "robot.limits: unknown key; limits stand in [limits], or in the robot's own file"),
        ("cable.sag=5.0", "cable.sag: unknown key; how the line is strung stands in [cable.state] as sag"),
        (
            "cable.model=x",
            "cable.model: unknown key; known here: fmu, isolate, conductor, stiffness_set, steps, state, parameters",
        ),
        ("cable.parameters.span=true", "cable.parameters.span: True is not of type real"),
        ("cable.parameters.n_elements=2.5", "cable.parameters.n_elements: 2.5 is not of type integer"),
        ("cable.parameters.span=[1, 2]", "must be a number, true, false or a string"),
        ("simulation.stop_time=later", "simulation.stop_time: 'later' must be a valid number"),
        ("simulation.stop_time=inf", "simulation.stop_time: inf must be a finite number"),
        ("cable.parameters.span=nan", "cable.parameters.span: nan must be a finite number"),
        (
            'landing.position={value=20.0,unit="kg"}',
            "landing.position: unit 'kg' does not fit; possible here: m, mm, cm",
        ),
        (
            'robot.parameters.mass={value=20.0,unit="N"}',
            "robot.parameters.mass: unit 'N' does not fit; possible here: kg, g",
        ),
        ("robot.parameters.mass=-38", "robot.parameters.mass: -38 must be greater than 0"),
        ("cable.parameters.span=0", "cable.parameters.span: 0 must be greater than 0"),
        ("cable.parameters.damping_time=-1.0", "cable.parameters.damping_time: -1.0 must be at least 0"),
        ("simulation.macro_step=0", "simulation.macro_step: 0 must be greater than 0"),
        ("simulation.timeout=0", "simulation.timeout: 0 must be greater than 0"),
        (
            "simulation.macro_step=0.3",
            "simulation.macro_step: 0.3 s does not divide stop_time 1 s; 0.3333333333333333 s does",
        ),
        ("simulation.macro_step=2.0", "simulation.macro_step: 2 s does not divide stop_time 1 s; 1 s does"),
        ("landing.position=50.0", "landing.position: 50 m is off the span"),
        ("landing.position=-1.0", "landing.position: -1 m is off the span"),
        ("landing.height=-1.0", "landing.height: -1.0 must be greater than or equal to 0"),
        ("simulation.master=iqn_il", "simulation.master: no master 'iqn_il'; did you mean iqn_ils?"),
        ("master.tolerence=1e-6", "master.tolerence: unknown key for master iqn_ils; did you mean tolerance?"),
        ("master.tolerance=small", "master.tolerance: 'small' is not of type float"),
        ("master.tolerance=0.0", "master.tolerance: 0.0 must be greater than 0"),
        ("master.max_iterations=0", "master.max_iterations: 0 must be greater than 0"),
        ("master.reuse=-1", "master.reuse: -1 must be at least 0"),
        ("master.threshold=-1e-9", "master.threshold: -1e-09 must be at least 0"),
        (
            "cable.parameters.spectral_radius=1.5",
            "cable.parameters.spectral_radius: 1.5 must be at least 0 and at most 1",
        ),
        ("simulation.exchange=wave", "simulation.exchange: 'wave' must be 'point', 'hermite' or 'waveform'"),
        ("contact.parameters.exchange=wave", "contact.parameters.exchange: 'wave' is not one of"),
        ("robot.model=fptlr", "robot.model: no robot 'fptlr' in the catalogue; did you mean fptlir?"),
        ('robot.parameters.mass={value=1.0,source="assumed"}', 'what is assumed needs its reason; add reason = "…"'),
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


# -- scenarios that build on others ------------------------------------------------------------------------------


def flat(table: dict, prefix: str = "") -> dict:
    found = {}
    for key, value in table.items():
        found |= flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return found


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_scenarios_say_what_they_always_said(path: Path):
    resolved = {key: value for key, value in flat(load(path).model_dump(exclude_none=True)).items() if value != []}
    assert resolved == RESOLVED[path.stem] | judged_by(path.stem) | {"simulation.start_time": 0.0}


def judged_by(name: str) -> dict[str, float | bool]:
    """Return the limits of a scenario of the paper, which it has beside what it always said."""
    if name.startswith(("line_", "crossing_")):
        return {}
    if name.startswith("rig"):
        return {"limits.z": False, "limits.rated_strength": 78110.0}
    line = {"limits.conductor_spacing": 3.45, "limits.safe_clearance": 1.0, "limits.rated_strength": 98370.0}
    return {} if name == "oscillator" else line


def child(file: Path, text: str, name: str = "b.toml") -> Path:
    path = file.parent / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_scenario_takes_from_another_what_it_does_not_say(file: Path):
    base = load(file)
    path = child(file, 'extends = "a.toml"\n[landing]\nposition = { value = 3000.0, unit = "cm", source = "planned" }')
    scenario = load(path)
    assert isinstance(scenario, LandingScenario) and isinstance(base, LandingScenario)
    assert scenario.landing.position == 30.0 and scenario.cable == base.cable and scenario.title == "A landing"
    assert scenario.name == "b" and scenario.path == path
    position, span = (scenario.provenance[key] for key in ("landing.position", "cable.parameters.span"))
    assert (position.source, position.written, position.file) == ("planned", "3000.0 cm", str(path))
    assert (span.source, span.file) == ("a drawing", str(file))


def test_a_quantity_is_replaced_whole(file: Path):
    """The base's source says nothing of the new value."""
    scenario = load(child(file, 'extends = "a.toml"\n[cable.parameters]\nspan = 60.0'))
    assert scenario.provenance["cable.parameters.span"].source == "scenario"


def test_bases_have_bases(file: Path):
    child(file, 'extends = "a.toml"\n[landing]\nposition = 21.0\nheight = 0.1')
    scenario = load(child(file, 'extends = "b.toml"\n[landing]\nposition = 22.0', "c.toml"))
    assert isinstance(scenario, LandingScenario)
    assert (scenario.landing.position, scenario.landing.height, scenario.cable.parameters["span"]) == (22.0, 0.1, 50.0)


def test_a_shipped_scenario_is_extended_by_its_name(file: Path):
    scenario = load(child(file, 'extends = "drop_5cm"'))
    drop = load("drop_5cm")
    assert scenario.model_dump() == drop.model_dump()
    assert scenario.provenance["cable.parameters.span"].file.endswith("landing_200m_point9.toml")


@pytest.mark.parametrize("names", ["a", "ab", "abc"])
def test_circles_are_refused(file: Path, names: str):
    for name, base in zip(names, names[1:] + names[0], strict=True):
        child(file, f'extends = "{base}.toml"', f"{name}.toml")
    (found,) = problems(file.parent / "a.toml")
    assert "extends: " in found and "is a circle" in found and found.startswith(str(file.parent / f"{names[-1]}.toml"))


@pytest.mark.parametrize(
    ("base", "message"),
    [
        ('"drop_5c"', "extends: drop_5c: no such scenario file; did you mean drop_5cm?"),
        ('"a.tml"', "extends: a.tml: no such scenario file; did you mean a.toml?"),
        ("3", "extends: 3 must be a string"),
    ],
)
def test_a_base_that_is_not_there(file: Path, base: str, message: str):
    path = child(file, f"extends = {base}")
    (found,) = problems(path)
    assert found.startswith(f"{path}: {message}")


@pytest.mark.parametrize(
    ("old", "new", "file_at_fault", "message"),
    [
        ("span = {", "spam = {", "a.toml", "cable.parameters.spam: unknown key; did you mean span?"),
        ("value = 50.0", "value = -50.0", "a.toml", "cable.parameters.span: -50.0 must be greater than 0"),
        ('source = "a drawing"', 'sauce = "a drawing"', "a.toml", "cable.parameters.span.sauce: unknown key"),
        ("position = 20.0", "position = 20.0\nheight = -1.0", "a.toml", "landing.height: -1.0 must be"),
        ("", "", "b.toml", "landing.position: 99 m is off the span"),
    ],
)
def test_a_mistake_is_that_of_the_file_in_which_it_stands(
    file: Path, old: str, new: str, file_at_fault: str, message: str
):
    replaced(file, old, new)
    position = 10.0 if old else 99.0
    path = child(file, f'extends = "a.toml"\n[landing]\nposition = {position}')
    found = [line for line in problems(path) if message in line]
    assert found and found[0].startswith(f"{file.parent / file_at_fault}: ")


def test_paths_are_relative_to_the_file_in_which_they_stand(file: Path):
    replaced(file, 'model = "fptlir"\nparameters.inertia.xx = 6.0', 'fmu = "mine.fmu"')
    (file.parent / "below").mkdir()
    path = file.parent / "below" / "b.toml"
    path.write_text('extends = "../a.toml"', encoding="utf-8")
    assert any(str(file.parent / "mine.fmu") in line.replace("below/../", "") for line in problems(path))


def test_another_robot_does_not_get_the_parameters_of_the_first(file: Path):
    scenario = load(child(file, 'extends = "a.toml"\n[robot]\nmodel = "hybrid_robot_2"\nparameters.initial.yaw = 0.1'))
    assert isinstance(scenario, LandingScenario) and scenario.robot.parameters == {"initial.yaw": 0.1}
    assert scenario.notes == ("robot: parameters.inertia.xx are fptlir's and not taken over for another",)
    same = load(child(file, 'extends = "a.toml"\n[robot]\nmodel = "fptlir"\nparameters.initial.yaw = 0.1'))
    assert isinstance(same, LandingScenario) and same.robot.parameters == {"inertia.xx": 6.0, "initial.yaw": 0.1}


def test_another_robot_of_the_command_line_neither(file: Path):
    scenario = load(file, robot="hybrid_robot_2")
    assert isinstance(scenario, LandingScenario) and scenario.robot.parameters == {} and len(scenario.notes) == 1
    assert load(file, robot="fptlir").model_dump() == load(file).model_dump()


def test_another_master_does_not_get_the_options_of_the_first(file: Path):
    text = GOOD.replace("[cable", 'exchange = "hermite"\n[master]\ntolerance = 1e-7\nreuse = 3\n[cable', 1)
    file.write_text(text, encoding="utf-8")
    scenario = load(child(file, 'extends = "a.toml"\n[simulation]\nmaster = "aitken"\n[master]\nrelaxation = 0.3'))
    assert scenario.master == {"tolerance": 1e-7, "relaxation": 0.3} and scenario.simulation.exchange is None


def test_components_of_a_graph_are_replaced_one_by_one(file: Path):
    text = 'extends = "oscillator"\n[components.left]\nparameters.mass = 2.0\n[components.right]\nmodel = "oscillator"'
    scenario, base = load(child(file, text)), load("oscillator")
    assert isinstance(scenario, GraphScenario) and isinstance(base, GraphScenario)
    left = dict(base.components["left"].parameters)
    assert scenario.components["left"].parameters == left | {"mass": 2.0}
    assert scenario.components["right"] == base.components["right"] and scenario.connections == base.connections


# -- whatever stands in a file -----------------------------------------------------------------------------------

ODD = [
    "3",
    "-1.5",
    "true",
    '"x"',
    "[1]",
    "[]",
    "{}",
    "nan",
    f"1{'0' * 400}",
    "{ value = 3 }",
    '{ unit = "m" }',
    "{ a = 1 }",
]
ODD += ['{ value = "q", unit = "m" }', "{ value = 1.0, unit = 3 }", "{ value = { a = 1 } }"]
ODD += [f'{{ value = 1{"0" * 400}, unit = "km" }}']
PLACES = [
    *("title", "extends", "simulation", "simulation.master", "simulation.stop_time", "simulation.tolerances", "master"),
    *("master.tolerance", "cable", "cable.fmu", "cable.parameters", "cable.parameters.span", "robot", "robot.model"),
    *(
        "robot.parameters",
        "robot.parameters.mass",
        "contact",
        "landing",
        "landing.position",
        "components",
        "connections",
    ),
]
WELL = """title = 'A'
simulation = { stop_time = 1.0, macro_step = 0.005 }
robot = { model = 'fptlir' }
landing.position = 20.0
"""


@pytest.mark.parametrize("place", PLACES)
def test_nothing_in_a_file_ends_in_a_traceback(tmp_path: Path, place: str):
    """A scenario, or an `InputError`: of the file itself, and of one that extends it and names another robot."""
    section = place.partition(".")[0]
    for odd in ODD:
        kept = [line for line in WELL.splitlines() if not line.startswith(section)]
        (tmp_path / "a.toml").write_text(
            "\n".join(["cable = {}" if section != "cable" else "", *kept, f"{place} = {odd}"])
        )
        (tmp_path / "b.toml").write_text('extends = "a.toml"\nrobot.model = "linedrone"\nsimulation.master = "aitken"')
        for name in ("a.toml", "b.toml"):
            with contextlib.suppress(InputError):
                assert isinstance(load(tmp_path / name), Scenario)


# -- names -------------------------------------------------------------------------------------------------------


def test_scenarios_are_found_by_name_and_by_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    assert find("drop_5cm") == FOLDER / "drop_5cm.toml"
    assert find(FOLDER / "drop_5cm.toml") == FOLDER / "drop_5cm.toml"
    monkeypatch.chdir(tmp_path)
    Path("drop_5cm").write_text(GOOD, encoding="utf-8")  # a path that exists wins
    assert load("drop_5cm").title == "A landing"
    with pytest.raises(InputError, match=r"did you mean drop_5cm\?"):
        load("dorp_5cm")


# -- units -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("override", "key", "value"),
    [
        ('landing.position={value=0.02,unit="km"}', "landing.position", 20.0),
        ('landing.velocity={value=3.6,unit="km/h"}', "landing.velocity", 1.0),
        ('simulation.macro_step={value=5,unit="ms"}', "simulation.macro_step", 0.005),
        ('simulation.stop_time={value=0.5,unit="min"}', "simulation.stop_time", 30.0),
        ('simulation.tolerances.robot.roll={value=1,unit="%"}', "simulation.tolerances.robot.roll", 0.01),
        ('robot.parameters.mass={ value = 38500, unit = "g" }', "robot.parameters.mass", 38.5),
        ('robot.parameters.initial.pitch={value=90,unit="°"}', "robot.parameters.initial.pitch", math.pi / 2),
        ('robot.inputs.thrust={value=0.1,unit="kN"}', "robot.inputs.thrust", 100.0),
        ('cable.parameters.axial_stiffness={value=81.2,unit="MN"}', "cable.parameters.axial_stiffness", 8.12e7),
        ('cable.parameters.linear_density={value=910,unit="g/m"}', "cable.parameters.linear_density", 0.91),
        (
            'cable.parameters.bending_stiffness={value=6580e6,unit="N.mm2"}',
            "cable.parameters.bending_stiffness",
            6580.0,
        ),
        ('cable.parameters.damping_time={value=5,unit="ms"}', "cable.parameters.damping_time", 0.005),
        ('contact.parameters.cable_diameter={value=18,unit="mm"}', "contact.parameters.cable_diameter", 0.018),
        (
            'contact.parameters.tangential_stiffness={value=1000,unit="N/mm"}',
            "contact.parameters.tangential_stiffness",
            1e6,
        ),
        ('contact.parameters.stiffness={value=1e8,unit="N/m^n"}', "contact.parameters.stiffness", 1e8),
        ('master.tolerance={value=1e-4,unit="%"}', "master.tolerance", 1e-6),
    ],
)
def test_any_unit_that_converts_exactly(file: Path, override: str, key: str, value: float):
    scenario = load(file, [override])
    assert flat(scenario.model_dump())[key] == value
    provenance = scenario.provenance[key]
    assert provenance.source == "command line" and provenance.unit is not None


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ('contact.parameters.stiffness={value=1e5,unit="N/mm"}', "unit 'N/mm' does not fit; possible here: N/m^n"),
        ('cable.parameters.clamped={value=true,unit="m"}', "True is no number and has no unit"),
        ('cable.parameters.n_elements={value=20,unit="m"}', "unit 'm' does not fit; possible here: 1, %"),
        ('simulation.stop_time={value=1.0,unit="furlong"}', "possible here: s, ms, min, h"),
        ('title={value="A",unit="m"}', "'A' is no number and has no unit"),
        ('cable.parameters.span={value=1e308,unit="km"}', "inf must be a finite number"),
    ],
)
def test_units_that_do_not_fit(file: Path, override: str, message: str):
    (found,) = problems(file, override)
    assert found.startswith(f"--set: {override.split('=')[0]}: ") and message in found


def test_a_source_of_the_command_line_is_kept(file: Path):
    scenario = load(file, ['robot.parameters.mass={value=40.0,unit="kg",source="scales"}'])
    assert scenario.provenance["robot.parameters.mass"].source == "scales"


# -- the inertia goes with the mass ------------------------------------------------------------------------------


def test_inertia_goes_with_an_overridden_mass(file: Path):
    replaced(file, "parameters.inertia.xx = 6.0", "")
    scenario = load(file, ["robot.parameters.mass=55.0"])
    assert isinstance(scenario, LandingScenario)
    ours, spec = scenario.robot.parameters, load_robot("fptlir").parameters
    for axes in ("xx", "yy", "zz", "xy", "xz", "yz"):
        assert ours[f"inertia.{axes}"] == pytest.approx(spec[f"inertia.{axes}"] * 55 / 38, rel=1e-15)
    assert scenario.notes == ("robot.parameters.mass: inertia scaled by 1.447 with the mass",)
    assert scenario.provenance["robot.parameters.inertia.zz"].reason == "inertia scaled by 1.447 with the mass"
    heavier = load_robot("fptlir_55kg").parameters
    assert ours["inertia.zz"] == pytest.approx(heavier["inertia.zz"], rel=1e-15)


def test_inertia_that_is_given_is_not_touched(file: Path):
    scenario = load(file, ["robot.parameters.mass=55.0"])
    assert isinstance(scenario, LandingScenario) and scenario.robot.parameters == {"inertia.xx": 6.0, "mass": 55.0}
    (note,) = scenario.notes
    assert "the inertia is not scaled with the mass, since inertia.xx is given" in note


def test_nothing_is_scaled_for_the_robot_s_own_mass(file: Path):
    replaced(file, "parameters.inertia.xx = 6.0", "")
    scenario = load(file, ["robot.parameters.mass=38.0"])
    assert (
        isinstance(scenario, LandingScenario) and scenario.robot.parameters == {"mass": 38.0} and scenario.notes == ()
    )


def test_inertia_of_a_foreign_fmu_is_not_scaled(file: Path, tmp_path: Path):
    fmu = shutil.copy(robot_fmu(load_robot("fptlir")), tmp_path / "theirs.fmu")
    replaced(file, "parameters.inertia.xx = 6.0", "")
    scenario = load(file, ["robot.parameters.mass=55.0"], robot=str(fmu))
    assert isinstance(scenario, LandingScenario) and scenario.robot.parameters == {"mass": 55.0}
    assert scenario.notes == (
        "robot.parameters.mass: the inertia of theirs.fmu is not scaled with the mass; give inertia.* as well",
    )


def test_bounds_of_a_foreign_fmu_are_kept(file: Path, tmp_path: Path):
    fmu = shutil.copy(robot_fmu(load_robot("fptlir")), tmp_path / "theirs.fmu")
    (found,) = problems(replaced(file, "parameters.inertia.xx = 6.0", ""), "robot.parameters.mass=-1.0", robot=str(fmu))
    assert found.startswith("--set: robot.parameters.mass: -1.0 must be at least ")


# -- a robot of one's own ----------------------------------------------------------------------------------------

HEAVY = """extends = "fptlir"
title = "A heavier one"
[body]
mass = { value = 50000.0, unit = "g", source = "scales" }
"""


def test_a_robot_is_named_by_its_file(file: Path):
    robot = child(file, HEAVY, "my robot.toml")
    replaced(file, 'model = "fptlir"\nparameters.inertia.xx = 6.0', 'model = "my robot.toml"')
    for scenario in (load(file), load("drop_5cm", robot=str(robot))):
        assert isinstance(scenario, LandingScenario) and scenario.robot.model == str(robot)
        sha256 = scenario.provenance["robot.model"].sha256
        assert sha256 == hashlib.sha256(robot.read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (', source = "scales"', "", "my.toml: body.mass: needs its source"),
        ('"g"', '"s"', "my.toml: body.mass: unit 's' does not fit; possible here: kg, g, t, lb"),
        ('"fptlir"', '"fptlr"', "my.toml: extends: no robot 'fptlr' in the catalogue; did you mean fptlir?"),
        ('"fptlir"', '"my.toml"', "is a circle"),
    ],
)
def test_a_faulty_robot_file_is_explained(file: Path, old: str, new: str, message: str):
    robot = child(file, HEAVY.replace(old, new), "my.toml")
    found = problems(file, robot=str(robot))
    assert any(line.startswith("--robot: robot.model: ") and message in line for line in found)


def test_a_robot_file_that_is_not_there(file: Path):
    assert "cannot be read" in problems(file, robot="absent.toml")[0]


# -- a new scenario ----------------------------------------------------------------------------------------------


def test_a_new_scenario_is_valid_as_it_is_written(tmp_path: Path):
    path = write_new("scenario", tmp_path / 'my "first"_line')
    scenario = load(path)
    assert isinstance(scenario, LandingScenario) and scenario.title == 'my "first" line'
    values = [
        key for key in scenario.provenance if key.startswith(("cable.parameters", "contact.parameters", "landing"))
    ]
    assert values and all(scenario.provenance[key].source == "assumed" for key in values)
    before = path.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        write_new("scenario", path)
    assert path.read_bytes() == before


@pytest.mark.parametrize("section", [*LandingScenario.model_fields])
def test_a_new_scenario_explains_every_section(tmp_path: Path, section: str):
    text = write_new("scenario", tmp_path / "a").read_text(encoding="utf-8")
    assert section == "title" or f"[{section}" in text


def test_a_new_robot_is_valid_as_it_is_written(tmp_path: Path):
    path = write_new("robot", tmp_path / "mine.toml")
    scenario = load(write_new("scenario", tmp_path / "a"), robot=str(path))
    assert isinstance(scenario, LandingScenario) and load_robot(path).title == "mine"


NAMELESS = ("", "/", ".", "..", " ", ".toml", "/.toml", "..toml")


@pytest.mark.parametrize("kind", ["scenario", "robot"])
@pytest.mark.parametrize(
    ("name", "message"),
    [
        *((name, "names no file; write a name") for name in NAMELESS),
        (".hidden", "leave away the dot"), ("con", "choose another, my_con"), ("Aux.toml", "device on Windows"),
        ("lpt1.line", "device on Windows"), ("a\nb", "control character"), ("a\0/b", "control character"),
    ],
)  # fmt: skip
def test_a_name_that_is_no_name_of_a_file_is_refused(tmp_path: Path, kind: str, name: str, message: str):
    with pytest.raises(InputError, match=message):
        write_new(kind, f"{tmp_path}/{name}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["", "/", ".toml"])
def test_a_name_that_is_empty_or_a_folder_s_is_refused_without_a_folder(name: str):
    with pytest.raises(InputError, match="names no file"):
        write_new("robot", name)
