"""System structures of other tools, run here: flattened, their values mapped and converted, what is not read refused."""

from __future__ import annotations

import contextlib
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from orchestrator import load_scenario, run
from orchestrator.catalogue.library import module_fmu
from orchestrator.coupling.errors import InputError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection, GraphError
from orchestrator.coupling.run.simulate import simulate
from orchestrator.export.write import export
from orchestrator.scenario.ssp import archive
from tests.fmus import compiled, needs_compiler
from tests.scenarios import OSCILLATOR
from tests.systems import closing

pytestmark = pytest.mark.filterwarnings("ignore::orchestrator.scenario.types.ScenarioNote")

SPACES = " ".join(
    f'xmlns:{prefix}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for prefix, name in (
        ("ssc", "Common"), ("ssd", "Description"), ("ssv", "ParameterValues"), ("ssm", "ParameterMapping"),
    )
)  # fmt: skip
MASS = "resources/mass.fmu"


def connectors(**kinds: str) -> str:
    rows = "".join(f'<ssd:Connector name="{n.replace("__", ".")}" kind="{k}"/>' for n, k in kinds.items())
    return f"<ssd:Connectors>{rows}</ssd:Connectors>"


def mass(name: str, inside: str = "", source: str = MASS, more: str = "") -> str:
    shown = connectors(force="input", position="output", neighbour__position="input", neighbour__force="output")
    return f'<ssd:Component name="{name}" source="{source}" {more}>{shown}{inside}</ssd:Component>'


def connection(start: str, end: str, inside: str = "", more: str = "") -> str:
    ends = ""
    for side, text in (("start", start), ("end", end)):
        element, _, connector = text.rpartition("/")
        ends += f' {side}Element="{element}"' if element else ""
        ends += f' {side}Connector="{connector}"'
    return f"<ssd:Connection{ends} {more}>{inside}</ssd:Connection>"


def system(elements: str, connections: str = "", before: str = "", name: str = "all") -> str:
    wires = f"<ssd:Connections>{connections}</ssd:Connections>" if connections else ""
    return f'<ssd:System name="{name}">{before}<ssd:Elements>{elements}</ssd:Elements>{wires}</ssd:System>'


def structure(system: str, after: str = '<ssd:DefaultExperiment startTime="0" stopTime="1"/>') -> str:
    root = "ssd:SystemStructureDescription"
    return f'<{root} {SPACES} version="1.0" name="made">{system}{after}</{root}>'


def values(*parameters: str, more: str = "") -> str:
    inside = f"<ssv:Parameters>{''.join(parameters)}</ssv:Parameters>{more}"
    return f'<ssv:ParameterSet {SPACES} version="1.0" name="v">{inside}</ssv:ParameterSet>'


def real(name: str, value: float | str, unit: str = "") -> str:
    said = f' unit="{unit}"' if unit else ""
    return f'<ssv:Parameter name="{name}"><ssv:Real value="{value}"{said}/></ssv:Parameter>'


def bound(inside: str = "", **attributes: str) -> str:
    said = " ".join(f'{name}="{value}"' for name, value in attributes.items())
    return (
        f"<ssd:ParameterBindings><ssd:ParameterBinding {said}>{inside}</ssd:ParameterBinding></ssd:ParameterBindings>"
    )


def inline(content: str) -> str:
    return f"<ssd:ParameterValues>{content}</ssd:ParameterValues>"


@pytest.fixture
def pack(tmp_path):
    """Write an archive of a description, other files, and our oscillator."""

    def packed(ssd: str, name: str = "made.ssp", fmu: Path | None = None, **files: str) -> Path:
        path = tmp_path / name
        with zipfile.ZipFile(path, "w") as made:
            made.writestr("SystemStructure.ssd", ssd)
            made.write(fmu or module_fmu("oscillator"), MASS)
            for file, content in files.items():
                made.writestr(file, content)
        return path

    return packed


def refused(path: Path) -> str:
    with pytest.raises(InputError) as told:
        load_scenario(path)
    return str(told.value)


# -- back again -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["model.ssp", "osp/OspSystemStructure.xml"])
def test_what_we_have_exported_runs_as_before_to_the_last_bit(kind, tmp_path):
    loaded = load_scenario(OSCILLATOR, master="jacobi", stop=0.5)
    export(loaded, ssp_file=tmp_path / "model.ssp", osp_folder=tmp_path / "osp")
    before = run(OSCILLATOR, master="jacobi", stop=0.5, estimate="none")
    after = run(tmp_path / kind, master="jacobi", estimate="none")
    assert sorted(after.signals) == sorted(before.signals)
    for name, signal in before.signals.items():
        np.testing.assert_array_equal(after[name].values, signal.values)


def test_a_landing_comes_back_as_a_graph(tmp_path):
    """Step, exchange and values of the first steps, contact included."""
    changes = {"master": "jacobi", "macro_step": 5e-4, "stop": 0.02}
    export(load_scenario("rig_10m", **changes), ssp_file=tmp_path / "rig.ssp")
    before, after = (run(s, estimate="none", **c) for s, c in (("rig_10m", changes), (tmp_path / "rig.ssp", {})))
    assert after.summary["master"] == "jacobi" and len(after["robot.roll"].values) == 41
    for name in ("robot.body.position.z", "contact1.normal_force", "contact1.cable.s"):
        np.testing.assert_array_equal(after[name].values, before[name].values)


def test_every_master_runs_it_and_a_scenario_may_build_on_it(tmp_path):
    export(load_scenario(OSCILLATOR, stop=0.2), ssp_file=tmp_path / "model.ssp")
    (tmp_path / "more.toml").write_text("""
extends = "model.ssp"
simulation = { master = "iqn_ils", macro_step = 0.02 }
components.left.parameters.mass = 2.0
""")
    found = run(tmp_path / "more.toml", estimate="none", set={"components.right.parameters.mass": 3.0})
    assert found.verdict != "failed" and len(found["left.position"].values) == 11
    resolved = load_scenario(tmp_path / "more.toml")
    assert resolved.components["left"].parameters["mass"] == 2.0
    assert resolved.components["left"].parameters["stiffness"] == 10.0
    assert resolved.provenance["components.left.parameters.stiffness"].source == "resources/parameters.ssv"


# -- of other tools ---------------------------------------------------------------------------------------------------

NESTED = structure(
    system(
        mass("left", bound(inline(values(real("mass", 2.0), real("initial_position", 0.5)))))
        + system(
            mass("mass"),
            connection("x", "mass/neighbour.position") + connection("mass/neighbour.force", "f"),
            connectors(x="input", f="output", m="parameter"),
            name="right",
        ),
        connection("left/position", "right/x", '<ssc:LinearTransformation factor="2" offset="-0.25"/>')
        + connection("left/force", "right/f"),  # the wrong way round: what gives is found by the kinds
        bound(source="values.ssv"),
    )
)


def test_nested_systems_are_flattened(pack):
    """Values of the outermost system win; what a connection does on the way is kept; names that fit nothing are told."""
    outer = values(
        real("left.mass", 3.0), real("right.mass.coupling_stiffness", 100.0), real("elsewhere.mass", 1.0),
    )  # fmt: skip
    found = load_scenario(pack(NESTED, **{"values.ssv": outer}))
    assert list(found.components) == ["left", "right_mass"]
    assert found.components["left"].parameters == {"mass": 3.0, "initial_position": 0.5}
    assert found.components["right_mass"].parameters == {"coupling_stiffness": 100.0}
    assert set(found.connections) == {
        "2.0 * left.position - 0.25 -> right_mass.neighbour.position",
        "right_mass.neighbour.force -> left.force",
    }
    assert any("elsewhere.mass" in note for note in found.notes)
    assert run(found, estimate="none", stop=0.1, macro_step=0.01).verdict != "failed"


def test_values_are_mapped_and_converted(pack):
    """Grams by the file's own definition, a prefix, a linear transformation; what a mapping leaves out is left out."""
    units = '<ssv:Units><ssc:Unit name="gramme"><ssc:BaseUnit kg="1" factor="0.001"/></ssc:Unit></ssv:Units>'
    mapping = f"""<ssm:ParameterMapping {SPACES} version="1.0">
      <ssm:MappingEntry source="my.M" target="a.mass"/>
      <ssm:MappingEntry source="my.K" target="a.stiffness"><ssc:LinearTransformation factor="2" offset="1"/></ssm:MappingEntry>
    </ssm:ParameterMapping>"""
    given = values(real("M", 1500.0, "gramme"), real("K", 10.0), real("damping", 7.0), more=units)
    binding = bound(inline(given) + '<ssd:ParameterMapping source="maps/m.ssm"/>', prefix="my.")
    found = load_scenario(pack(structure(system(mass("a"), before=binding)), **{"maps/m.ssm": mapping}))
    assert found.components["a"].parameters == {"mass": 1.5, "stiffness": 21.0}


def test_units_that_do_not_fit_are_refused(pack):
    units = '<ssv:Units><ssc:Unit name="second"><ssc:BaseUnit s="1"/></ssc:Unit></ssv:Units>'
    given = inline(values(real("mass", 1.0, "second"), more=units))
    said = refused(pack(structure(system(mass("a", bound(given))))))
    assert "a.mass: unit 'second' is no measure of 'kg'" in said


def test_variants_are_chosen_by_their_name(pack):
    path = pack(structure(system(mass("a"))), **{"Other.ssd": structure(system(mass("b")))})
    assert list(load_scenario(path).components) == ["a"]
    assert any("variants: Other.ssd" in note for note in load_scenario(path).notes)
    assert list(load_scenario(f"{path}#Other.ssd").components) == ["b"]
    assert "no None.ssd in the archive (it has Other.ssd, SystemStructure.ssd)" in refused(Path(f"{path}#None.ssd"))


def test_what_is_chosen_for_want_of_anything_said_is_told(pack):
    """The FMU's own step of 5 ms, which divides the run; the master that all can serve."""
    found = load_scenario(pack(structure(system(mass("a")))))
    assert (found.simulation.macro_step, found.simulation.master) == (0.005, "iqn_ils")
    notes = " ".join(found.notes)
    assert "no macro step: 0.005 s" in notes and "no master: iqn_ils" in notes
    assert "stop_time" in refused(pack(structure(system(mass("a")), after=""), "endless.ssp"))


SCALED = '<ssc:LinearTransformation factor="2"/>'
LOOKED_UP = "<ssc:BooleanMappingTransformation/>"
SUPPRESSED = 'suppressUnitConversion="true"'
DICTIONARY = "<ssd:SignalDictionaries><ssd:SignalDictionary/></ssd:SignalDictionaries>"
ENTITIES = '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>'


def pair(inside: str, more: str = "") -> str:
    return system(mass("a") + mass("b"), connection("a/position", "b/neighbour.position", inside, more))


@pytest.mark.parametrize(
    ("ssd", "said"),
    [
        (
            structure(system(mass("a", more='type="application/x-ssp-package"'))),
            "type application/x-ssp-package, no FMU",
        ),
        (structure(system(mass("a", more='implementation="ModelExchange"'))), "wants ModelExchange"),
        (structure(system(mass("a", source="../mass.fmu"))), "no path within the package"),
        (structure(system(mass("a", source="http://x/mass.fmu"))), "no path within the package"),
        (structure(system(mass("a", source="resources/mas.fmu"))), "did you mean resources/mass.fmu?"),
        (structure(system(mass("a") + mass("a"))), "two elements are called a"),
        (structure(system(mass("a b") + mass("a_b"))), "would both be called a_b"),
        (structure(system('<ssd:SignalDictionaryReference name="bus" dictionary="d"/>')), "SignalDictionaryReference"),
        (structure(system(mass("a"), before=DICTIONARY)), "signal dictionaries (SSB)"),
        (structure(pair(LOOKED_UP)), "BooleanMappingTransformation"),
        (structure(pair(SCALED, SUPPRESSED)), "suppressUnitConversion"),
        (structure(system(mass("a", bound(source="v.ssv", sourceBase="component")))), "sourceBase"),
        (structure(system(mass("a", bound(source="v.ssv")))), "no file 'v.ssv'"),
        (structure(system(mass("a", bound(inline(values(real("mass", "much"))))))), "'much' is no number"),
        (structure(system("")), "no components"),
        ("<other/>", "has no System"),
        ("no XML", "not XML"),
        (ENTITIES + structure(system(mass("a"))), "document type"),
        ('<!DOCTYPE x SYSTEM "file:///etc/passwd">' + structure(system(mass("a"))), "document type"),
    ],
)
def test_what_is_not_read_is_named(pack, ssd, said):
    path = pack(ssd)
    told = refused(path)
    assert said in told and str(path) in told


def test_an_invalid_description_is_read_and_that_is_said(pack):
    ssd = structure(system(mass("a", more='colour="red"')))
    assert any("not valid by the schema" in note and "colour" in note for note in load_scenario(pack(ssd)).notes)


def test_a_circle_of_connectors_ends(pack):
    inside = system(mass("a"), connection("x", "y") + connection("y", "x"), connectors(x="input", y="input"), name="in")
    assert load_scenario(pack(structure(system(inside)))).connections == []


def test_systems_may_not_lie_without_end_in_one_another(pack):
    inside = mass("a")
    for depth in range(60):
        inside = system(inside, name=f"s{depth}")
    assert "deep in one another" in refused(pack(structure(system(inside))))


@given(
    start=st.integers(0, len(NESTED)),
    length=st.integers(0, 40),
    filling=st.sampled_from(("", '"', "<", "nan", "1e999", "x.")),
)
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_stands_there_ends_in_a_scenario_or_a_message(pack, start, length, filling):
    """A span of the description is taken out, or something else is in its place."""
    outer = values(real("left.mass", 3.0))
    with contextlib.suppress(InputError):
        load_scenario(pack(NESTED[:start] + filling + NESTED[start + length :], **{"values.ssv": outer}))


# -- archives ---------------------------------------------------------------------------------------------------------


def test_archives_are_bounded(pack, monkeypatch, tmp_path):
    ssd = structure(system(mass("a")))
    path = pack(ssd)
    monkeypatch.setattr(archive, "MOST_BYTES", 1000)
    monkeypatch.setenv("LINE_LANDING_CACHE", str(tmp_path / "cache"))
    assert "is not unpacked" in refused(path)
    monkeypatch.setattr(archive, "MOST_FILES", 1)
    assert "is not unpacked" in refused(path)
    assert list((tmp_path / "cache" / "structures").iterdir()) == []


def test_a_size_that_is_a_lie_is_found(pack, monkeypatch, tmp_path):
    """What is written is counted, not what the archive says."""
    path = pack(structure(system(mass("a"))))
    monkeypatch.setattr(archive, "_require_bounded", lambda *_: None)
    monkeypatch.setattr(archive, "MOST_BYTES", 1000)
    monkeypatch.setenv("LINE_LANDING_CACHE", str(tmp_path / "cache"))
    assert "is not unpacked" in refused(path)


def test_archives_that_are_none_are_refused(tmp_path, pack):
    (tmp_path / "text.ssp").write_text("no archive")
    assert "no SSP" in refused(tmp_path / "text.ssp")
    assert "leads outside" in refused(pack(structure(system(mass("a"))), **{"../evil": "x"}))
    assert "no such scenario file" in refused(tmp_path / "none.ssp")


def test_archives_are_held_to_what_those_of_fmus_are(pack):
    """The checks are those of `orchestrator.coupling.fmu.archive`; two of them stand for all."""
    ssd = structure(system(mass("a")))
    assert "one where case does not count" in refused(pack(ssd, **{"extra/A.txt": "x", "extra/a.txt": "y"}))
    assert "both as a file and as a folder" in refused(pack(ssd, **{"extra": "x", "extra/a.txt": "y"}))


# -- the engine: connections with a factor and an offset ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("a.x -> b.u", ("a.x", "b.u", 1.0, 0.0)),
        ("2.5e-1 * a.x + 1 -> b.u", ("a.x", "b.u", 0.25, 1.0)),
        ("-3 * a.x - .5 -> b.u", ("a.x", "b.u", -3.0, -0.5)),
        ("a.der(x) - 2.0 -> b.u", ("a.der(x)", "b.u", 1.0, -2.0)),
        ("a.x*2+1 -> b.u", ("a.x*2+1", "b.u", 1.0, 0.0)),
    ],
)
def test_connections_are_read(text, found):
    one = Connection.parse(text)
    assert (one.source, one.target, one.gain, one.offset) == found


@needs_compiler
def test_a_linear_connection_is_what_it_says():
    """p' = -2 q + 0.5 and q' = p by the explicit Euler method, which is what held inputs make of it."""
    H, n = 0.01, 30
    p, q = Fmu(compiled("lag2"), "p"), Fmu(compiled("lag2"), "q")
    p.set_parameters({"start": 1.0})
    with closing(Graph({"p": p, "q": q}, ["p.y -> q.u", "-2.0 * q.y + 0.5 -> p.u"], order=("p", "q"))) as graph:
        found = simulate(graph, "jacobi", 0.0, n * H, H, ["p.y", "q.y"]).values
    x = np.array([1.0, 0.0])
    for row in found[1:]:
        x = x + H * np.array([-2.0 * x[1] + 0.5, x[0]])
        np.testing.assert_allclose(row, x, rtol=0.0, atol=1e-15 * n)


def test_only_reals_take_a_factor():
    file = module_fmu("contact")
    one, other = Fmu(file, "one"), Fmu(file, "other")
    try:
        with pytest.raises(GraphError):
            Graph(
                {"one": one, "other": other},
                ["2.0 * one.status -> other.cable.position.x", "one.status -> other.status"],
            )
    finally:
        one.close()
        other.close()
