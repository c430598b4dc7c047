"""Scenarios written as SSP and OSP: valid, baked, told what they lose; and run by engines that are not ours."""

from __future__ import annotations

import re
import zipfile
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from orchestrator import load_scenario, run
from orchestrator.catalogue.library import module_fmu, module_recipe
from orchestrator.coupling.errors import InputError
from orchestrator.export import baked
from orchestrator.export.write import Exported, export
from orchestrator.scenario.ssp.schema import SCHEMAS
from tests.engines import by_engine
from tests.fmus import build, compiled, needs_compiler
from tests.scenarios import OSCILLATOR

H, N = 2e-3, 150
LANDED = ("robot.body.position.z", "robot.body.velocity.z", "contact1.cable.s")
POSITIONS = ("left.position", "right.position")
RIG = {"landing.height": 0.001}
"""The rig's robot falls 1 mm and touches after 14 ms."""


def written(folder: Path, scenario: object, **changes: object) -> Exported:
    loaded = load_scenario(scenario, **changes)
    return export(loaded, ssp_file=folder / "model.ssp", osp_folder=folder / "osp")


@dataclass(frozen=True)
class Case:
    """A scenario exported, and what our explicit master that does as others do says of it."""

    exported: Exported
    ours: np.ndarray


def case(folder: Path, scenario: object, signals: tuple[str, ...], **changes: Any) -> Case:
    found = run(scenario, estimate="none", master="jacobi", **changes)
    values = np.array([found[signal].values[1:] for signal in signals]).T
    return Case(written(folder, scenario, master="jacobi", **changes), values)


@pytest.fixture(scope="module")
def coarse(tmp_path_factory) -> Case:
    return case(tmp_path_factory.mktemp("coarse"), OSCILLATOR, POSITIONS, macro_step=2 * H, stop=N * H)


@pytest.fixture(scope="module")
def fine(tmp_path_factory) -> Case:
    return case(tmp_path_factory.mktemp("fine"), OSCILLATOR, POSITIONS, macro_step=H, stop=N * H)


@pytest.fixture(scope="module")
def oscillators(fine) -> Exported:
    return fine.exported


@pytest.fixture(scope="module")
def landing(tmp_path_factory) -> Case:
    return case(tmp_path_factory.mktemp("rig"), "rig_10m", LANDED, macro_step=2e-4, stop=0.02, set=RIG)


@pytest.fixture(scope="module")
def rig(tmp_path_factory) -> Exported:
    """With the scenario's own master, which iterates."""
    return written(tmp_path_factory.mktemp("rig"), "rig_10m", macro_step=2e-4, stop=0.02, set=RIG)


def xml(path: Path, name: str) -> etree._Element:
    if path.is_dir():
        return etree.parse(str(path / name)).getroot()
    with zipfile.ZipFile(path) as archive:
        return etree.fromstring(archive.read(name))


def osp_schema() -> etree.XMLSchema:
    """libcosim's own, which its library holds as a text."""
    found = find_spec("libcosimpy")
    if found is None or found.origin is None:
        pytest.skip("libcosimpy is not installed: pip install -e '.[engines]'")
    library = (Path(found.origin).parent / "libcosimc" / "libcosimc.so").read_bytes()
    return etree.XMLSchema(etree.fromstring(re.search(rb"<xs:schema.*?</xs:schema>", library, re.S)[0]))


# -- valid --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["oscillators", "rig"])
def test_exports_are_valid_by_the_official_schemas(request, name):
    ssp, osp = request.getfixturevalue(name).paths
    for file, schema in (
        ("SystemStructure.ssd", "SystemStructureDescription.xsd"),
        ("resources/parameters.ssv", "SystemStructureParameterValues.xsd"),
    ):
        etree.XMLSchema(etree.parse(str(SCHEMAS / schema))).assertValid(xml(ssp, file))
    osp_schema().assertValid(xml(osp, "OspSystemStructure.xml"))


def test_every_reference_has_its_definition(rig):
    """Units of connectors and values, FMUs of components, ends of connections."""
    root, values = xml(rig.paths[0], "SystemStructure.ssd"), xml(rig.paths[0], "resources/parameters.ssv")
    for one in (root, values):
        assert set(one.xpath("//@unit")) == set(one.xpath("//*[local-name()='Unit']/@name"))
    with zipfile.ZipFile(rig.paths[0]) as archive:
        assert set(root.xpath("//@source")) <= set(archive.namelist())
    for side in ("start", "end"):
        for connection in root.xpath("//*[local-name()='Connection']"):
            element, connector = connection.get(f"{side}Element"), connection.get(f"{side}Connector")
            kind = "output" if side == "start" else "input"
            assert root.xpath(
                f"//*[local-name()='Component'][@name='{element}']//*[@name='{connector}'][@kind='{kind}']"
            )


def test_the_same_scenario_gives_the_same_bytes(oscillators, tmp_path):
    again = written(tmp_path, OSCILLATOR, macro_step=H, stop=N * H, master="jacobi")
    assert again.paths[0].read_bytes() == oscillators.paths[0].read_bytes()


# -- baked --------------------------------------------------------------------------------------------------------


def test_our_fmus_start_from_what_the_scenario_gives(rig):
    """Description, documentation and the instance itself, to which nobody has given anything."""
    for part in rig.package.parts:
        assert part.strange == () and part.values
        starts = {v.name: v.start for v in fmpy.read_model_description(str(part.fmu)).modelVariables}
        assert {name: starts[name] for name in part.values} == {n: baked.text_of(v) for n, v in part.values.items()}
        assert not list(baked.not_started(part.fmu, part.values, 0.0))
    contact = next(part for part in rig.package.parts if part.name == "contact1")
    assert validate_fmu(str(contact.fmu)) == []
    assert contact.values["exchange"] == "point" and baked.not_started(module_fmu("contact"), contact.values, 0.0)


def test_baked_fmus_of_one_module_are_told_apart(oscillators):
    """libcosim keeps FMUs by their GUID, pythonfmu scripts by their name."""
    guids = {fmpy.read_model_description(str(part.fmu)).guid for part in oscillators.package.parts}
    assert len(guids) == len(oscillators.package.parts) == 2


def test_of_an_fmu_that_is_not_ours_the_description_alone_changes(tmp_path):
    """A pythonfmu FMU of somebody else: its script does not read the description, and that is said."""
    file = build("link")
    text = f"""
title = "one"
components.a.fmu = "{file}"
components.a.parameters.mass = 3.0
simulation = {{ stop_time = 1.0, macro_step = 0.1, master = "jacobi" }}
"""
    (tmp_path / "one.toml").write_text(text)
    package = written(tmp_path, tmp_path / "one.toml").package
    (part,) = package.parts
    starts = (
        {v.name: v.start for v in fmpy.read_model_description(str(part.fmu.parent / part.fmu.name)).modelVariables}
        if part.fmu.exists()
        else {}
    )
    with zipfile.ZipFile(tmp_path / "model.ssp") as archive:
        archive.extract("resources/a.fmu", tmp_path)
    starts = {
        v.name: v.start for v in fmpy.read_model_description(str(tmp_path / "resources" / "a.fmu")).modelVariables
    }
    assert float(starts["mass"]) == 3.0 and part.strange == ("mass",)
    assert any("does not start from mass" in note for note in package.notes)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('<Real start="1"/>', '<Real start="2.5" />'),
        ('<Float64 name="k" start="1"/>', '<Float64 name="k" start="2.5" />'),
        ('<String name="k"><Start value="1"/></String>', '<String name="k"><Start value="2.5" /></String>'),
    ],
)
def test_start_values_are_written_where_each_version_has_them(before, after):
    inside = before if "name=" in before else f'<ScalarVariable name="k">{before}</ScalarVariable>'
    found = baked.with_starts(f"<d><ModelVariables>{inside}</ModelVariables></d>".encode(), {"k": 2.5})
    assert after.encode() in found


def test_a_recipe_is_found_in_fmus_of_this_version_alone(tmp_path):
    assert baked.recipe_of(module_fmu("oscillator")) == module_recipe("oscillator")
    assert baked.recipe_of(build("link")) is None and baked.recipe_of(tmp_path / "none.fmu") is None


# -- what is lost is said ---------------------------------------------------------------------------------------------


def test_what_another_engine_does_not_do_is_said(rig):
    notes = " ".join(rig.package.notes)
    for said in (
        "interface_jacobian iterates within a step",
        "contact1 point",
        "macro step 0.0002 s",
        "outputs of contact1 follow from inputs without a step",
        "makes its first step with zeros",
    ):
        assert said in notes
    with zipfile.ZipFile(rig.paths[0]) as archive:
        readme = archive.read("documentation/README.md").decode()
    annotation = " ".join(xml(rig.paths[0], "SystemStructure.ssd").itertext())
    assert all(note in readme and note in annotation for note in rig.package.notes)


def test_a_conversion_of_units_is_in_both(tmp_path):
    text = """
title = "units"
connections = ["-2.0 * left.position + 0.5 -> right.neighbour.position"]
components.left.model = "oscillator"
components.right.model = "oscillator"
simulation = { stop_time = 1.0, macro_step = 0.1, master = "jacobi" }
"""
    (tmp_path / "units.toml").write_text(text)
    ssp, osp = written(tmp_path, tmp_path / "units.toml").paths
    (found,) = xml(ssp, "SystemStructure.ssd").xpath("//*[local-name()='LinearTransformation']")
    assert dict(found.attrib) == {"factor": "-2.0", "offset": "0.5"}
    osp_schema().assertValid(xml(osp, "OspSystemStructure.xml"))
    root = xml(osp, "OspSystemStructure.xml")
    (function,) = root.xpath("//*[local-name()='LinearTransformation']")
    assert (function.get("factor"), function.get("offset")) == ("-2.0", "0.5")
    assert len(root.xpath("//*[local-name()='SignalConnection']")) == 2


def test_inputs_over_time_are_refused(tmp_path):
    loaded = load_scenario(OSCILLATOR, set={"components.right.inputs.force": {"time": [0.0, 1.0], "value": [0.0, 1.0]}})
    with pytest.raises(InputError, match=r"right\.force follows a table over time"):
        export(loaded, ssp_file=tmp_path / "model.ssp")
    assert not (tmp_path / "model.ssp").exists()


def test_what_is_wrong_with_the_place_is_said(tmp_path):
    loaded = load_scenario(OSCILLATOR)
    with pytest.raises(InputError, match="say where to: --ssp"):
        export(loaded)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    with pytest.raises(InputError, match="is there already"):
        export(loaded, osp_folder=tmp_path / "full")


# -- other engines ----------------------------------------------------------------------------------------------------


def place(exported: Exported, engine: str) -> Path:
    return exported.paths[1 if engine.endswith("osp") else 0]


CHAIN = """
title = "a chain whose outputs all start at zero"
connections = ["a.y -> b.u", "b.y -> c.u"]
components.a = {{ fmu = "{fmu}", inputs.u = 1.0, parameters.gain = 2.0 }}
components.b = {{ fmu = "{fmu}", parameters.gain = -3.0 }}
components.c = {{ fmu = "{fmu}" }}
simulation = {{ stop_time = 1.0, macro_step = 0.01, master = "jacobi" }}
"""


@pytest.fixture(scope="module")
def chain(tmp_path_factory) -> Case:
    folder = tmp_path_factory.mktemp("chain")
    (folder / "chain.toml").write_text(CHAIN.format(fmu=compiled("lag2")))
    return case(folder, folder / "chain.toml", ("a.y", "b.y", "c.y"))


@needs_compiler
@pytest.mark.parametrize("engine", ["fmpy_set", "cosim_osp", "cosim_ssp", "ecos_set"])
def test_where_the_algorithm_is_the_same_so_is_the_result(engine, chain):
    """C FMUs without feedthrough that start at zero: all step, then all values move. To round-off of 100 sums."""
    found = by_engine(engine, place(chain.exported, engine), 0.01, 100, "a.y", "b.y", "c.y")
    np.testing.assert_allclose(found, chain.ours, rtol=0.0, atol=1e-15 * 100 * np.max(np.abs(chain.ours)))


SLOW = pytest.mark.slow
"""What loads our kernels into an engine that runs in another test anyway: some seconds each."""


@pytest.mark.parametrize(
    "engine", ["fmpy_ssp", *(pytest.param(name, marks=SLOW) for name in ("cosim_osp", "cosim_ssp", "ecos_ssp"))]
)
def test_other_engines_agree_to_the_order_of_the_step(engine, coarse, fine):
    """The spring's force is a step older there: half the step, half the difference."""
    distance = []
    for one, step, count in ((coarse, 2 * H, N // 2), (fine, H, N)):
        theirs = by_engine(engine, place(one.exported, engine), step, count, *POSITIONS)
        distance.append(np.max(np.abs(theirs - one.ours)))
    assert 0.8 < np.log2(distance[0] / distance[1]) < 1.2, distance


@pytest.mark.parametrize(
    "engine", [pytest.param("fmpy_ssp", marks=SLOW), "cosim_osp", pytest.param("ecos_ssp", marks=SLOW)]
)
def test_the_robot_lands_in_other_engines(engine, landing):
    """It falls 1 mm and is caught after 14 ms. There the contact is a step late, or two where the first step has zeros: what
    moves is wrong by what it moves in as many steps, at most."""
    theirs = by_engine(engine, place(landing.exported, engine), 2e-4, 100, *LANDED)
    change = np.max(np.abs(np.diff(landing.ours, axis=0)), axis=0)
    assert np.all(np.max(np.abs(theirs - landing.ours), axis=0) <= 2.0 * change + 1e-12)
