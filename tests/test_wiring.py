"""Wiring that cannot be silently wrong: exchanges, slopes, differences, open inputs, times of steps, modules of one name."""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pythonfmu import FmuBuilder

from orchestrator.coupling.exchange import base_of, coarsest
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection, GraphError, Link
from orchestrator.coupling.graph.order import _edges, levels
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.simulate import simulate
from orchestrator.runs.coupled import run_coupled
from orchestrator.scenario.read import load
from tests.fmus import MILD, OPTIONS, chain_solution, described, fmu, oscillator
from tests.systems import closing

ALL = [
    ("m0.position", "m1.neighbour.position"),
    ("m0.velocity", "m1.neighbour.velocity"),
    ("m1.neighbour.force", "m0.force"),
]
COMPANIONS = [("m0.position_mean", "m1.neighbour.position_mean"), ("m1.neighbour.force_rate", "m0.force_rate")]
TWO = """
title = "two masses on springs, coupled by a third one"
connections = [{0}]
[simulation]
stop_time = 1.0
macro_step = {1}
master = "{2}"
estimate = "none"
[components.m0]
model = "oscillator"
parameters.stiffness = 10.0
parameters.initial_position = 0.1
[components.m1]
model = "oscillator"
parameters.stiffness = 10.0
parameters.coupling_stiffness = 200.0
{3}
"""


def two_masses(folder: Path, connections, H: float = 0.01, master: str = "iqn_ils", more: str = ""):
    path = folder / "two.toml"
    listed = ", ".join(f'"{a} -> {b}"' for a, b in connections)
    path.write_text(TWO.format(listed, H, master, more), encoding="utf-8")
    return load(path)


def error_of(coupled) -> float:
    """Largest error of both positions against the matrix exponential."""
    exact = chain_solution(coupled.table["time"], 2)
    return max(float(np.max(np.abs(coupled.table[f"m{i}.position"] - exact[:, i]))) for i in range(2))


# -- the exchange -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("left_out", [COMPANIONS, COMPANIONS[:1], COMPANIONS[1:]])
def test_an_exchange_whose_means_or_slopes_do_not_come_is_not_chosen(tmp_path, left_out):
    """Then the inputs are held, and joined by the master: order 2 (POINT in tests/systems.py), and it is said."""
    connections = [*ALL, *(c for c in COMPANIONS if c not in left_out)]
    coarse, fine = (run_coupled(two_masses(tmp_path, connections, H)) for H in (0.01, 0.005))
    assert coarse.exchange == "held"
    assert np.log2(error_of(coarse) / error_of(fine)) == pytest.approx(2.0, abs=0.2)
    said = [note for note in coarse.notes if "exchange held in the place of waveform" in note]
    assert len(said) == 1 and said[0].startswith("m1: ") and left_out[0][1] in said[0]


def test_an_exchange_whose_means_and_slopes_come_is_chosen(tmp_path):
    """Order 4 (docs/concepts/exchange.md)."""
    coarse, fine = (run_coupled(two_masses(tmp_path, ALL + COMPANIONS, H)) for H in (0.02, 0.01))
    assert coarse.exchange == "waveform" and not any("exchange" in note for note in coarse.notes)
    assert np.log2(error_of(coarse) / error_of(fine)) == pytest.approx(4.0, abs=0.2)


def test_an_exchange_that_is_asked_for_by_name_is_refused_where_it_cannot_be(tmp_path):
    scenario = two_masses(tmp_path, ALL, more='parameters.exchange = "waveform"')
    with pytest.raises(
        Exception, match=r"m1: exchange = waveform, but nothing feeds m1\.neighbour\.position_mean and 1 more"
    ):
        run_coupled(scenario)
    assert run_coupled(two_masses(tmp_path, ALL, more='parameters.exchange = "held"')).exchange == "held"


def test_the_coarsest_exchange_limits_the_whole():
    assert coarsest(["waveform", "", "held"]) == "held" and coarsest(["waveform", "hermite"]) == "hermite"
    assert coarsest(["their own", "waveform"]) == "waveform" and coarsest(["their own"]) == "their own"
    assert coarsest([]) == ""


# -- inputs that nothing feeds ------------------------------------------------------------------------------------


def test_open_inputs_are_listed_unless_the_scenario_sets_them(tmp_path):
    coupled = run_coupled(two_masses(tmp_path, ALL + COMPANIONS))
    assert coupled.notes == [
        "inputs that nothing feeds keep their start values: m0.neighbour.position, m0.neighbour.velocity, m1.force"
    ]
    more = 'inputs.force = 0.0\n[components.m0.inputs]\n"neighbour.position" = 0.0\n"neighbour.velocity" = 0.0'
    assert run_coupled(two_masses(tmp_path, ALL + COMPANIONS, more=more)).notes == []


def test_a_means_input_left_open_is_listed_for_an_fmu_without_an_exchange_to_choose():
    parts = {"a": fmu("link", "a"), "b": fmu("wave", "b")}
    pairs = [("a.position", "b.left.position"), ("a.velocity", "b.left.velocity"), ("b.left.force", "a.force")]
    with closing(Graph(parts, [Connection(*pair) for pair in pairs])) as graph:
        assert graph.unfed == ["a.left.position", "a.left.velocity", "b.force", "b.left.position_mean"]


# -- slopes -------------------------------------------------------------------------------------------------------


def plants(**inputs: float) -> Graph:
    """Two of the test FMU, the ramps of one feeding the other, whose `inputs` are set."""
    pairs = [Connection(f"a.ramp.{name}", f"b.{name}") for name in ("flow", "heat", "stroke")]
    return Graph({"a": fmu("plant", "a"), "b": fmu("plant", "b", **inputs)}, pairs)


SEEN = [f"b.seen.{name}" for name in ("flow_rate", "heat_rate", "stroke_rate")]
SLOPED = [("jacobi", {"extrapolation": 1}), ("gauss_seidel", {"extrapolation": 1}), ("nepce", {"extrapolation": 1})]


@pytest.mark.parametrize(("master", "options"), SLOPED)
def test_a_slope_is_known_by_its_unit_or_by_its_declaration(master, options):
    """J and W, one second apart in their base units; ``derivative``. The ramps rise by 1 a second; m3/s is no slope of m3/s."""
    with closing(plants()) as graph:
        assert graph.free_rates == [("b", "heat_rate"), ("b", "stroke_rate")]
        log = simulate(graph, MASTERS[master](graph, **options), 0.0, 0.5, 0.1, SEEN)
    assert log.values[-1] == pytest.approx([5.0, 1.0, 1.0], rel=1e-12)


@pytest.mark.parametrize("master", ["jacobi", "gauss_seidel", "nepce", "iqn_ils", "fixed_point", "semi_implicit"])
def test_an_input_that_is_set_is_never_overwritten(master):
    with closing(plants(flow_rate=7.0, heat_rate=8.0, stroke_rate=9.0)) as graph:
        log = simulate(graph, MASTERS[master](graph), 0.0, 0.5, 0.1, SEEN)
    assert np.all(log.values[1:] == [7.0, 8.0, 9.0])


def test_sub_steps_make_up_no_slope_in_the_place_of_another_input():
    with closing(
        Graph({"a": fmu("plant", "a"), "b": fmu("plant", "b", steps=3, flow_rate=7.0)}, ["a.ramp.flow -> b.flow"])
    ) as graph:
        log = simulate(graph, MASTERS["jacobi"](graph, extrapolation=1), 0.0, 0.5, 0.1, SEEN)
    assert np.all(log.values[1:, 0] == 7.0)


def test_names_that_are_declared_need_no_unit():
    with closing(plants()) as graph:
        b = graph.components["b"]
        assert "heat_rate" in b.vocabulary and "flow_rate" not in b.vocabulary
        b.declare(["flow_rate"])
        assert "flow_rate" in b.vocabulary
    assert base_of("port[1].force_rate.x", "_rate") == "port[1].force.x" and base_of("_rate", "_rate") is None


# -- units of differences -----------------------------------------------------------------------------------------


def test_a_difference_has_no_offset():
    """300 K are 26.85 degC; a difference of 10 K is one of 10 degC (FMI 2.0.4, 2.2.3: relativeQuantity)."""
    parts = {"a": fmu("plant", "a"), "b": fmu("plant", "b")}
    with closing(Graph(parts, ["a.absolute -> b.absolute_in", "a.difference -> b.difference_in"])) as graph:
        simulate(graph, "jacobi", 0.0, 0.1, 0.1)
        assert parts["b"].read("absolute_in") == pytest.approx(26.85, rel=1e-12)
        assert parts["b"].read("difference_in") == 10.0


def test_a_difference_feeds_no_absolute_value_across_an_offset():
    with pytest.raises(GraphError, match=r"one of the two is a difference \(relativeQuantity\), the other is not"):
        Graph({"a": fmu("plant", "a"), "b": fmu("plant", "b")}, ["a.difference -> b.unsaid_in"])


# -- whole numbers ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["cd", "dc"])
@pytest.mark.parametrize("master", list(MASTERS))
def test_whole_numbers_arrive_at_the_communication_point_where_the_next_step_begins(master, order):
    """A counter shows n after n steps: during step n + 1, and until it is over, its follower has n, whatever the master."""
    base = oscillator(**MILD)
    parts = {**base.components, **{name: fmu("odd", name) for name in order}}
    pairs = [Connection("c.count", "d.count_in"), Connection("c.flag", "d.flag_in"), Connection("a.position", "c.u")]
    received = []

    def note(report) -> None:
        received.append((parts["d"].read("count_in"), parts["d"].read("flag_in")))

    with closing(Graph(parts, [*base.connections, *pairs])) as graph:
        simulate(graph, master, 0.0, 0.5, 0.1, on_step=note)
    assert received == [(n, n % 2 == 1) for n in range(5)]


# -- times of steps -----------------------------------------------------------------------------------------------

LENGTHS = [
    (10.0, 1.0 / 60.0),
    (0.3, 0.1),
    (1.0, 1.0 / 3.0),
    (0.7, 0.1),
    (1.1, 0.1),
    (2.9, 0.1),
    (1.0, 0.016666666667 * 6),
]


@pytest.mark.parametrize("steps", [1, 3])
@pytest.mark.parametrize("master", ["jacobi", "iqn_ils"])
@pytest.mark.parametrize(("stop", "H"), LENGTHS)
def test_steps_end_at_the_stop_time_and_none_behind_it(master, stop, H, steps):
    parts = {"a": fmu("plant", "a", steps=steps), "b": fmu("plant", "b")}
    with closing(Graph(parts, ["a.ramp.flow -> b.flow", "b.ramp.flow -> a.flow"])) as graph:
        log = simulate(graph, master, 0.0, stop, H, ["a.behind", "a.end", "b.behind", "b.end"])
    assert log.values[-1].tolist() == [0.0, stop, 0.0, stop] and log.time[-1] == stop


def test_a_step_that_is_advised_can_be_typed():
    with closing(Graph({"a": fmu("plant", "a")}, [])) as graph:
        with pytest.raises(ValueError, match=r"0\.0166667 s does not divide 10 s; 0\.016666666666666666 s does"):
            simulate(graph, "jacobi", 0.0, 10.0, 0.0166667)
        simulate(graph, "jacobi", 0.0, 10.0, 0.016666666666666666)
    with pytest.raises(Exception, match=r"0\.0166667 s does not divide stop_time 10 s; 0\.016666666666666666 s does"):
        load("oscillator", ["simulation.stop_time=10.0", "simulation.macro_step=0.0166667"])
    load("oscillator", ["simulation.stop_time=10.0", "simulation.macro_step=0.016666666666666666"])


# -- FMUs in Python -----------------------------------------------------------------------------------------------

SCRIPT = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
{top}

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        {first}
        self.y, self.own = helper.VALUE, {own}
        for name in ("y", "own"):
            self.register_variable(Real(name, causality=Fmi2Causality.output, variability=Fmi2Variability.continuous))

    def do_step(self, t, h):
        return True
"""


def built(
    folder: Path,
    value: float,
    *,
    late: bool = False,
    name: str = "Thing",
    script: str = "thing_of_one_name",
    helper: str = "measure_of_one_name",
) -> Path:
    """Build an FMU whose script and helper module have names that others have too; it shows `value` of both."""
    folder.mkdir()
    (folder / f"{helper}.py").write_text(f"VALUE = {value}\n", encoding="utf-8")
    code = f"import {helper} as helper"
    text = SCRIPT.format(name=name, own=value, top="" if late else code, first=code if late else "")
    (folder / f"{script}.py").write_text(text, encoding="utf-8")
    files = [folder / f"{helper}.py"]
    return Path(FmuBuilder.build_FMU(str(folder / f"{script}.py"), dest=str(folder), project_files=files, **OPTIONS))


@pytest.fixture
def alone():
    """The interpreter without the modules of the FMUs that a test builds."""
    path = list(sys.path)
    yield
    sys.path[:] = path
    for name in [name for name in sys.modules if "of_one_name" in name]:
        del sys.modules[name]


@pytest.mark.usefixtures("alone")
def test_fmus_whose_modules_share_their_names_run_their_own_code(tmp_path):
    first, second = built(tmp_path / "first", 10.0), built(tmp_path / "second", 20.0)
    mine = sys.modules["measure_of_one_name"]
    parts = {"a": Fmu(first), "b": Fmu(second), "c": Fmu(first), "d": Fmu(second)}
    with closing(Graph(parts, [])) as graph:
        log = simulate(graph, "jacobi", 0.0, 0.1, 0.1)
    assert sys.modules["measure_of_one_name"] is mine  # that of the program itself
    assert {name: log.signal(f"{name}.{v}")[-1] for name in "abcd" for v in ("y", "own")} == dict.fromkeys(
        "ac", 10.0
    ) | dict.fromkeys("bd", 20.0)


@pytest.mark.usefixtures("alone")
def test_fmus_that_import_a_shared_name_only_later_are_refused(tmp_path):
    with (
        Fmu(built(tmp_path / "first", 10.0)),
        pytest.raises(ValueError, match="imports measure_of_one_name inside a function"),
    ):
        Fmu(built(tmp_path / "second", 20.0, late=True))


@pytest.mark.usefixtures("alone")
def test_a_package_that_is_missing_is_named(tmp_path):
    """pythonfmu says it in the second line of its message."""
    names = {"name": "Poor", "script": "poor_of_one_name", "helper": "absent_of_one_name"}
    whole, poor = built(tmp_path / "whole", 1.0, **names), tmp_path / "poor.fmu"
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(poor, "w") as new:
        for item in old.namelist():
            if not item.endswith("absent_of_one_name.py"):
                new.writestr(item, old.read(item))
    del sys.modules["absent_of_one_name"]
    sys.path[:] = [place for place in sys.path if "whole" not in place]
    with pytest.raises(ValueError, match=r"ModuleNotFoundError.*No module named 'absent_of_one_name'"):
        Fmu(poor)


ONCE = ('canBeInstantiatedOnlyOncePerProcess="false"', 'canBeInstantiatedOnlyOncePerProcess="true"')


@pytest.mark.usefixtures("alone")
def test_what_is_advised_for_an_fmu_of_one_instance_works(tmp_path):
    """A copy of the file is refused; the model exported under another name is not, nor one in a process of its own."""
    once = described(built(tmp_path / "one", 1.0), tmp_path, ONCE)
    copy = tmp_path / "copy.fmu"
    copy.write_bytes(once.read_bytes())
    with Fmu(once):
        with pytest.raises(ValueError, match="export the model once more under another name"):
            Fmu(copy)
        Fmu(copy, isolate=True).close()
        other = built(tmp_path / "two", 1.0, name="Other", script="other_of_one_name")
        (tmp_path / "described").mkdir()
        Fmu(described(other, tmp_path / "described", ONCE)).close()


# -- large graphs -------------------------------------------------------------------------------------------------


def test_dependence_grows_with_the_graph_and_not_with_its_square():
    """600 connections each way between two FMUs that say nothing: as many edges as inputs and outputs, all in one loop."""
    n = 600
    ports = {f"{kind}{i}": SimpleNamespace(variable=f"{kind}{i}") for i in range(n) for kind in "uy"}
    parts = {name: SimpleNamespace(ports=ports) for name in "ab"}
    links = [Link((a, f"y{i}"), (b, f"u{i}"), 1.0, 0.0, False) for a, b in ("ab", "ba") for i in range(n)]
    outputs = [link.source for link in links]
    unsaid = {name: {f"y{i}": None for i in range(n)} for name in "ab"}
    edges, _, vertices = _edges(links, outputs, parts, unsaid)
    assert len(edges) == 4 * n and vertices == 2 * n + 2
    level, loop = levels(links, outputs, parts, unsaid)
    assert set(level.values()) == {1} and loop.tolist() == list(range(2 * n))


def test_stages_of_a_chain_that_ends_in_a_loop():
    """c.y waits for b.y waits for a.y, which needs nothing; d and e feed one another and c.

    By hand: 0 for a; one more for each link behind; the loop stands behind what feeds it.
    """
    names = {
        "u0": SimpleNamespace(variable="u0"),
        "u1": SimpleNamespace(variable="u1"),
        "y": SimpleNamespace(variable="y"),
    }
    parts = {name: SimpleNamespace(ports=names) for name in "abcde"}
    pairs = [("a", "b", "u0"), ("b", "c", "u0"), ("c", "d", "u0"), ("e", "d", "u1"), ("d", "e", "u0")]
    links = [Link((x, "y"), (y, u), 1.0, 0.0, False) for x, y, u in pairs]
    needs = {"a": {"y": frozenset()}, **{name: {"y": frozenset(["u0", "u1"])} for name in "bcde"}}
    outputs = [(name, "y") for name in "abcde"]
    level, loop = levels(links, outputs, parts, needs)
    assert [level[s] for s in outputs] == [0, 1, 2, 3, 3] and loop.tolist() == [3, 4]
