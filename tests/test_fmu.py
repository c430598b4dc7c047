"""One FMU behind its buffers: loading, types, states, messages, failures."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from orchestrator.coupling.exchange import suffixed
from orchestrator.coupling.fmu.failure import NOT_FINITE, TIMEOUT, FmuError
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.unzipped import unzip, unzip_folder
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection
from orchestrator.coupling.masters import MASTERS
from orchestrator.coupling.run.simulate import simulate
from tests.fmus import build, compiled, described, fmu, needs_compiler, started


@pytest.fixture
def odd():
    instance = fmu("odd", "odd", gain=2.0, note="100% %s %n")
    yield instance
    instance.close()


def test_ports_carry_what_the_description_says(odd):
    assert (odd.ports["u"].unit, odd.ports["u"].kind, odd.ports["u"].causality) == ("m", "real", "input")
    assert odd.ports["held_in"].variability == "discrete"
    assert {odd.ports[n].kind for n in ("count", "flag", "note")} == {"integer", "boolean", "string"}
    assert odd.capabilities.rollback
    assert not fmu("odd", "stuck", rollback=False).capabilities.rollback


def test_group_of_all_types(odd):
    """u = 3 m held for 0.5 s: x = 1.5, y = 2 * 3000 mm; one step counted."""
    started(odd)
    inputs = odd.group(["u", "count_in", "flag_in"])
    inputs.values[:] = 3.0, 7.0, 1.0
    inputs.set()
    odd.step(0.0, 0.5)
    outputs = odd.group(["x", "y", "count", "flag", "count_in", "flag_in"])
    outputs.get()
    assert outputs.values.tolist() == [1.5, 6000.0, 1.0, 1.0, 7.0, 1.0]
    assert odd.read("note") == "100% %s %n"
    assert odd.read("flag") is True


def test_group_uses_a_given_buffer(odd):
    buffer = np.zeros(4)
    group = started(odd).group(["u", "x"], buffer[1:3])
    group.values[:] = 2.0, 0.0
    odd.group(["u"], buffer[1:2]).set()
    group.get()
    assert buffer.tolist() == [0.0, 2.0, 0.0, 0.0]
    with pytest.raises(ValueError, match="must be contiguous"):
        odd.group(["u", "x"], buffer[::2])
    with pytest.raises(ValueError, match="note is a string"):
        odd.group(["u", "note"])


def test_replay_is_bit_identical(odd):
    started(odd)
    u, x = odd.group(["u"]), odd.group(["x", "count"])
    u.values[0] = 0.1
    u.set()
    odd.step(0.0, 0.3)
    state = odd.save()
    outcomes = []
    for _ in range(3):
        odd.step(0.3, 0.7)
        x.get()
        outcomes.append(x.values.tolist())
        odd.restore(state)
    odd.release(state)
    assert outcomes[0] == outcomes[1] == outcomes[2]


def test_instances_are_independent():
    a, b = started(fmu("odd", "a", initial=1.0)), started(fmu("odd", "b", initial=2.0))
    assert (a.read("x"), b.read("x")) == (1.0, 2.0)
    a.close()
    assert b.read("x") == 2.0
    b.close()
    b.close()


WRONG = [
    ({"gian": 1.0}, "no variable gian; did you mean gain"),
    ({"y": 1.0}, "y is no parameter"),
    ({"note": 1.0}, "of type string"),
    ({"gain": "one"}, "of type real"),
    ({"fault": 1.5}, "of type Integer"),
    ({"fault": 2**40}, "1099511627776 does not fit"),
]


@pytest.mark.parametrize(("parameters", "message"), WRONG)
def test_wrong_parameters(odd, parameters, message):
    with pytest.raises(ValueError, match=message):
        odd.set_parameters(parameters)


def test_files_that_are_no_fmu(tmp_path):
    text, archive = tmp_path / "a.fmu", tmp_path / "b.fmu"
    text.write_text("no archive")
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("readme.txt", "nothing")
    for path in (text, archive):
        with pytest.raises(ValueError, match="not an FMU"):
            Fmu(path)
    with pytest.raises(ValueError, match="no such file"):
        Fmu(tmp_path / "missing.fmu")


def test_fmu_without_a_binary_for_this_machine(tmp_path):
    empty = tmp_path / "empty.fmu"
    with zipfile.ZipFile(build("odd")) as source, zipfile.ZipFile(empty, "w") as target:
        for name in source.namelist():
            if not name.startswith("binaries"):
                target.writestr(name, source.read(name))
    with pytest.raises(ValueError, match=r"no binary for .*; export it for this platform"):
        Fmu(empty)


def test_awkward_path(tmp_path):
    """Loaders crash on such names; the FMU is unzipped elsewhere, and once only."""
    folder = tmp_path / "Größe + #1 Ω"
    folder.mkdir()
    path = shutil.copy(build("odd"), folder / "öd.fmu")
    instance = started(Fmu(path))
    assert str(unzip_folder(instance.sha256)).isascii()
    assert instance.sha256 == fmu("odd", "same").sha256
    instance.close()


def test_where_no_folder_of_the_users_has_a_plain_path_another_serves(tmp_path, monkeypatch):
    monkeypatch.delenv("LINE_LANDING_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "Höhle"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "vorübergehend"))
    assert unzip_folder("0").parts[1] in ("tmp", "var") and not list(tmp_path.iterdir())


def test_a_link_that_anybody_can_have_put_there_is_no_folder_of_the_users(tmp_path, monkeypatch):
    monkeypatch.setenv("LINE_LANDING_CACHE", str(tmp_path / "Höhle"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / "other").mkdir()
    (tmp_path / f"line-landing-{os.getuid()}").symlink_to(tmp_path / "other")
    assert tmp_path not in unzip_folder("0").parents


def test_unzipped_fmus_that_nobody_uses_are_removed(tmp_path, monkeypatch):
    monkeypatch.setenv("LINE_LANDING_CACHE", str(tmp_path))
    for kind in ("fmu", "unzipped", "unpacked"):
        old, new = tmp_path / kind / "old", tmp_path / kind / "new"
        (old / "resources").mkdir(parents=True)
        new.mkdir()
        os.utime(old, (0, 0))
    path = build("odd")
    folder = unzip(path, "0123")
    assert (folder / "modelDescription.xml").is_file() and folder.parent == tmp_path / "unpacked"
    assert sorted(place.name for place in tmp_path.glob("*/*")) == ["0123", "0123.json", "new", "new", "new"]


def test_messages_are_collected_with_their_percent_signs():
    instance = started(fmu("odd", "odd", fault=5))
    instance.step(0.0, 0.1)
    assert list(instance.log) == ["[warning] all of 100%s%n"]
    instance.close()


def test_discard_carries_the_fmus_own_words():
    instance = started(fmu("odd", "odd", fault=1, longest_step=0.01))
    instance.step(0.0, 0.01)
    with pytest.raises(FmuError, match=r"discard; the FMU says: .*100% too long") as caught:
        instance.step(0.01, 0.1)
    assert (caught.value.component, caught.value.time, caught.value.status) == ("odd", 0.01, 2)
    instance.close()


def test_not_a_number_is_found():
    instance = started(fmu("odd", "odd", fault=2))
    instance.step(0.0, 0.1)
    with pytest.raises(FmuError, match="output x is not a finite number") as caught:
        instance.group(["y", "x"]).get_finite()
    assert caught.value.status == NOT_FINITE
    instance.close()


def test_large_numbers_are_no_error(odd):
    group = started(odd).group(["u"])
    group.values[0] = 1e200
    group.set()
    group.get_finite()


def test_hang_in_a_process_of_its_own():
    """An FMU that sleeps for a minute: the run comes back within the time-out, and the process ends with
    status 3."""
    code = (
        "import os\n"
        "from orchestrator.coupling import MASTERS, Graph, simulate\n"
        "from tests.fmus import fmu\n"
        "graph = Graph({'a': fmu('odd', 'a', fault=3, fault_time=0.1)}, [])\n"
        "log = simulate(graph, MASTERS['jacobi'](graph), 0.0, 1.0, 0.05, timeout=1.0)\n"
        "print(log.error, '|', log.error.status, len(log.time), flush=True)\n"
        "os._exit(3)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=40)
    assert done.returncode == 3, done.stderr
    assert "no answer within 1 s" in done.stdout
    assert done.stdout.split("|")[1].split() == [str(TIMEOUT), "3"]


def test_all_outputs_are_recorded_by_default():
    graph = Graph({"a": fmu("odd", "a", initial=1.0)}, [])
    log = simulate(graph, MASTERS["jacobi"](graph), 0.0, 0.2, 0.1)
    graph.close()
    assert log.signals == [f"a.{n}" for n in ("y", "x", "angle", "held_out", "count", "flag")]
    assert log.signal("a.count").tolist() == [0.0, 1.0, 2.0]
    assert log.solves == {"a": 1}


def test_unknown_signal_is_named():
    graph = Graph({"a": fmu("odd", "a")}, [])
    with pytest.raises(ValueError, match="no variable z"):
        simulate(graph, MASTERS["jacobi"](graph), 0.0, 0.2, 0.1, record=["a.z"])
    with pytest.raises(ValueError, match=r"cannot record b\.x"):
        simulate(graph, MASTERS["jacobi"](graph), 0.0, 0.2, 0.1, record=["b.x"])
    graph.close()


def test_process_ends_cleanly():
    """Without the end of the interpreters in the libraries the process may abort on its way out."""
    code = "from tests.fmus import fmu; fmu('odd', 'a').enter_initialization(0.0)"
    assert subprocess.run([sys.executable, "-c", code], timeout=40).returncode == 0


def test_suffix_goes_before_the_axis():
    assert suffixed("port[1].force.x", "_rate") == "port[1].force_rate.x"
    assert suffixed("force", "_mean") == "force_mean"


@needs_compiler
def test_fmi3_arrays_types_and_states():
    """u = (1, 2) mm held for 0.5 s from x = 1: x = 1 + 1.5, y = (x, 2 x); by hand."""
    lag = Fmu(compiled("lag3"), "lag")
    assert [lag.ports[n].unit for n in ("u[1]", "u[2]", "y[1]")] == ["mm", "mm", "m"]
    lag.set_parameters({"start": 1.0})
    started(lag)
    inputs, outputs = lag.group(["u[1]", "u[2]"]), lag.group(["y[2]", "count", "flag", "y[1]"])
    inputs.values[:] = 1.0, 2.0
    inputs.set()
    state = lag.save()
    for _ in range(2):
        lag.step(0.0, 0.5)
        outputs.get()
        assert outputs.values.tolist() == [5.0, 1.0, 1.0, 2.5]
        lag.restore(state)
    lag.release(state)
    assert list(lag.log) == ["[ok] made for 100% of the tests"]
    lag.close()


@needs_compiler
def test_fmi3_types_that_are_no_numbers_are_left_alone(tmp_path: Path):
    """A binary output and a clock: neither recorded nor read, named when they are asked for."""
    more = '<Binary name="blob" valueReference="8" causality="output"/>'
    more += (
        '<Clock name="tick" valueReference="9" causality="output" intervalVariability="triggered"/></ModelVariables>'
    )
    lag = Fmu(described(compiled("lag3"), tmp_path, ("</ModelVariables>", more)), "lag")
    graph = Graph({"lag": lag}, [])
    log = simulate(graph, MASTERS["jacobi"](graph), 0.0, 0.1, 0.1)
    assert log.error is None
    assert log.signals == ["lag.y[1]", "lag.y[2]", "lag.count", "lag.flag"]
    with pytest.raises(ValueError, match="blob is a binary"):
        lag.group(["blob"])
    graph.close()


@needs_compiler
def test_units_with_an_offset_are_converted(tmp_path: Path):
    """25 degC is 298.15 K; x' = 298.15 K for 0.1 s."""
    path = compiled("lag2")
    kelvin = '<Unit name="K"><BaseUnit K="1"/></Unit>'
    celsius = '<Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>'
    units = "<ModelVariables>", f"<UnitDefinitions>{kelvin}{celsius}</UnitDefinitions><ModelVariables>"
    (tmp_path / "out").mkdir()
    hot = described(path, tmp_path / "out", units, ("<Real/>", '<Real unit="degC"/>'))
    cold = described(path, tmp_path, units, ('causality="input"><Real', 'causality="input"><Real unit="K"'))
    parts = {"hot": Fmu(hot, "hot"), "cold": Fmu(cold, "cold")}
    parts["hot"].set_parameters({"start": 25.0, "gain": 0.0})
    graph = Graph(parts, [Connection("hot.y", "cold.u")])
    log = simulate(graph, MASTERS["jacobi"](graph), 0.0, 0.1, 0.1, ["cold.y"])
    graph.close()
    assert log.values[-1, 0] == pytest.approx(29.815, rel=1e-12)


@needs_compiler
@pytest.mark.parametrize("master", MASTERS)
def test_fmu_in_c_with_every_master(master):
    """p' = q, q' = -p: p = cos t. Held inputs at H = 1 ms leave at most t H/2, twice that for Jacobi's phase."""
    parts = {name: Fmu(compiled("lag2"), name) for name in "pq"}
    parts["p"].set_parameters({"start": 1.0})
    parts["q"].set_parameters({"gain": -1.0})
    graph = Graph(parts, [Connection("p.y", "q.u"), Connection("q.y", "p.u")])
    log = simulate(graph, MASTERS[master](graph), 0.0, 1.0, 1e-3, ["p.y"])
    graph.close()
    assert log.error is None and log.unconverged == 0
    assert np.max(np.abs(log.values[:, 0] - np.cos(log.time))) < 1e-3


@needs_compiler
def test_fmi3_and_fmi2_in_one_graph():
    """Two FMI 3.0 lags in a loop, metres into millimetres: p' = 1000 q, q' = 1000 p, so p = cosh(1000 t) mm;
    order 2."""
    errors = []
    for H in (1e-4, 5e-5):
        lags = {n: Fmu(compiled("lag3"), n) for n in ("p", "q")}
        lags["p"].set_parameters({"start": 1e-3})
        pairs = [("p.y[1]", "q.u[1]"), ("q.y[1]", "p.u[2]"), ("p.y[1]", "c.u")]
        graph = Graph({**lags, "c": fmu("odd", "c", gain=1.0)}, [Connection(*pair) for pair in pairs])
        log = simulate(graph, MASTERS["iqn_ils"](graph), 0.0, 2e-3, H, ["p.y[1]", "c.y"])
        graph.close()
        assert log.error is None
        assert log.signal("c.y") == pytest.approx(1e3 * log.signal("p.y[1]"), rel=1e-12)
        errors.append(np.max(np.abs(log.signal("p.y[1]") - 1e-3 * np.cosh(1e3 * log.time))))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
