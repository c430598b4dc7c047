"""Hostile FMUs and hostile users, through the command line: status, message with place and cure, results so far kept."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cli import commands as cli
from orchestrator.coupling.errors import FORWARD
from orchestrator.coupling.run.results import read_table
from orchestrator.runs.coupled import run_coupled
from orchestrator.scenario.read import load
from tests.fmus import build, compiled, described, needs_compiler
from tests.scenarios import LANDING, OSCILLATOR

pytestmark = pytest.mark.usefixtures("coarse_pictures")
LOOP = """
title = "p' = q, q' = -p"
connections = ["p.y -> q.u", "q.y -> p.u"]
[simulation]
stop_time = 0.1
macro_step = 0.01
[components.p]
fmu = "{0}"
parameters.start = 1.0
[components.q]
fmu = "{0}"
parameters.gain = -1.0
"""


@pytest.fixture
def loop(tmp_path: Path) -> Path:
    path = tmp_path / "loop.toml"
    path.write_text(LOOP.format(compiled("lag2")), encoding="utf-8")
    return path


@pytest.fixture
def orchestrate(capsys: pytest.CaptureFixture[str]):
    """Run one command in this process; return its exit status and what it says on stderr."""

    def command(*arguments: object) -> tuple[int, str]:
        with pytest.raises(SystemExit) as ended:
            cli.main([str(argument) for argument in arguments])
        return int(ended.value.code or 0), capsys.readouterr().err

    return command


AT_ONCE, LATER = None, 6  # rows of results: none, or those up to 0.05 s
FAULTS = [  # the numbers are those of tests/fmus/lag2.c
    ("jacobi", 2, LATER, "q, t = 0.05 s: the step of 0.01 s came back with discard; a smaller macro step may help"),
    ("iqn_ils", 2, LATER, "came back with discard"),
    ("jacobi", 3, LATER, "q, t = 0.05 s: the step of 0.01 s came back with error"),
    ("iqn_ils", 4, LATER, "q, t = 0.05 s: the step of 0.01 s came back with fatal"),
    ("iqn_ils", 5, LATER, "q, t = 0.05 s: the step of 0.01 s came back with pending"),
    ("jacobi", 10, LATER, "q, t = 0.05 s: output y is not a finite number; a smaller macro step may help"),
    ("iqn_ils", 10, LATER, "output y is not a finite number"),
    ("interface_jacobian", 11, AT_ONCE, f"its state is not saved completely; {FORWARD}"),
    ("reduced_interface", 11, AT_ONCE, f"its state is not saved completely; {FORWARD}"),
    ("iqn_ils", 12, AT_ONCE, f"restoring the state came back with error; {FORWARD}"),
    ("iqn_ils", 13, AT_ONCE, f"saving the state came back with error; {FORWARD}"),
    ("jacobi", 14, AT_ONCE, "q, t = 0 s: writing u came back with error"),
    ("jacobi", 15, AT_ONCE, "q, t = 0 s: initialisation came back with error"),
    ("jacobi", 16, AT_ONCE, "q, t = 0 s: end of initialisation came back with error"),
]


@needs_compiler
@pytest.mark.parametrize(("master", "fault", "rows", "message"), FAULTS)
def test_a_fault_ends_with_status_3_and_what_there_is(loop, orchestrate, tmp_path, master, fault, rows, message):
    options = [f"components.q.parameters.fault={fault}", "components.q.parameters.fault_time=0.045"]
    out, settings = tmp_path / "out", [text for option in options for text in ("--set", option)]
    settings += [] if fault == 2 else ["--no-pictures"]  # what has failed is drawn, too: that of one fault will do
    status, said = orchestrate("run", loop, "--master", master, "--out", out, "--quiet", *settings)
    assert status == 3 and message in said
    assert out.exists() == (rows is not None)
    if rows is not None:
        table = read_table(out / "results.csv")
        assert len(table["time"]) == rows and all(np.all(np.isfinite(values)) for values in table.values())
        assert json.loads((out / "manifest.json").read_text())["complete"] is False


APART = [  # call and fault of tests/fmus/hostile2.c, status, rows of results
    (
        "load crash",
        3,
        AT_ONCE,
        "q, t = 0 s: loading it: its process was ended by SIGSEGV; its last words: [printed] about to crash",
    ),
    ("instantiate exit", 3, AT_ONCE, "q, t = 0 s: loading it: its process ended with exit code 0"),
    ("exit hang", 3, AT_ONCE, "q, t = 0 s: end of initialisation: no answer within 2 s; raise the time-out?"),
    ("step exit 0.045", 3, LATER, "q, t = 0.05 s: the step of 0.01 s: its process ended with exit code 0"),
    ("get hang 0.045", 3, 5, "reading y: no answer within 2 s; raise the time-out?"),
    ("free crash", 0, 11, "q: the FMU has warned 1 times"),
]


@needs_compiler
@pytest.mark.parametrize(("hostile", "wanted", "rows", "message"), APART, ids=[a[0] for a in APART])
def test_what_ends_its_process_is_said_and_costs_no_result(
    loop, orchestrate, tmp_path, monkeypatch, hostile, wanted, rows, message
):
    monkeypatch.setenv("HOSTILE", hostile)
    text = loop.read_text(encoding="utf-8").replace("parameters.gain = -1.0", "").split("[components.q]")
    loop.write_text(f'{text[0]}[components.q]\nfmu = "{compiled("hostile2")}"\n', encoding="utf-8")
    out = tmp_path / "out"
    status, said = orchestrate(
        "run", loop, "--master", "jacobi", "--out", out, "--quiet", "--timeout", 2, "--no-pictures"
    )
    assert status == wanted and message in said
    assert out.exists() == (rows is not None)
    if rows is not None:
        assert len(read_table(out / "results.csv")["time"]) == rows
        content = json.loads((out / "manifest.json").read_text())
        assert content["complete"] is (wanted == 0) and content["fmus"]["q"]["isolated"] is True
        assert wanted or "freeing it: its process was ended by SIGSEGV" in (out / "fmu.log").read_text()


@needs_compiler
def test_validate_says_who_has_a_process_of_its_own(loop, capsys):
    for options, said in (([], "in processes of their own: p, q"), (["--set", "components.p.isolate=false"], "own: q")):
        with pytest.raises(SystemExit):
            cli.main(["validate", str(loop), *options])
        assert said in capsys.readouterr().out


def packed(path: Path, *changes: tuple[str, str], binary: bool = True) -> Path:
    """Write the test FMU ``lag2`` to `path` with parts of its description replaced."""
    with zipfile.ZipFile(compiled("lag2")) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            for before, after in changes if name == "modelDescription.xml" else ():
                content = content.replace(before.encode(), after.encode())
            if binary or not name.startswith("binaries"):
                new.writestr(name, content)
    return path


ONCE = ('modelIdentifier="lag2"', 'modelIdentifier="lag2" canBeInstantiatedOnlyOncePerProcess="true"')
FILES = [
    ({"changes": [("{lag2}", "{other}")]}, "cannot be loaded: Failed to instantiate"),
    ({"binary": False}, "has no binary for"),
    ({"changes": [('fmiVersion="2.0"', 'fmiVersion="1.0"')]}, "not an FMU"),
    ({"changes": [("CoSimulation", "ModelExchange")]}, "export it for co-simulation"),
    ({"changes": [ONCE], "more": "isolate = false"}, "can be instantiated only once per process"),
    ({"changes": [("<ModelVariables>", "<ModelVariables")]}, "its modelDescription.xml is not one: not well-formed"),
    ({"changes": [('"canGetAndSetFMUstate="true"', ""), ('canGetAndSetFMUstate="true"', "")]}, "cannot save its state"),
]


@needs_compiler
@pytest.mark.parametrize(("how", "message"), FILES, ids=[message for _, message in FILES])
def test_an_fmu_that_cannot_be_used_is_refused_by_name(loop, orchestrate, tmp_path, how, message):
    path = packed(tmp_path / "a + b #1 ü.fmu", *how.get("changes", []), binary=how.get("binary", True))
    more = how.get("more", "")
    loop.write_text(
        LOOP.format(path.name).replace("[components.q]", f"{more}\n[components.q]\n{more}"), encoding="utf-8"
    )
    status, said = orchestrate("validate", loop)
    assert status == 2 and message in said


@needs_compiler
def test_an_fmu_for_once_per_process_runs_twice_in_two(loop, orchestrate, tmp_path):
    packed(tmp_path / "once.fmu", ONCE)
    loop.write_text(LOOP.format("once.fmu"), encoding="utf-8")
    assert orchestrate("run", loop, "--out", tmp_path / "out", "--quiet", "--no-pictures")[0] == 0
    assert json.loads((tmp_path / "out" / "manifest.json").read_text())["complete"] is True


@needs_compiler
@pytest.mark.parametrize("cut", [0.5, 0.9])
def test_a_damaged_archive_is_refused(loop, orchestrate, tmp_path, cut):
    whole = compiled("lag2").read_bytes()
    (tmp_path / "cut.fmu").write_bytes(whole[: int(cut * len(whole))])
    loop.write_text(LOOP.format("cut.fmu"), encoding="utf-8")
    status, said = orchestrate("validate", loop)
    assert status == 2 and "cut.fmu: not an FMU" in said


@needs_compiler
@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("master.max_iterations=0", "master.max_iterations: 0 must be greater than 0"),
        ("master.tolerance=-1.0", "master.tolerance: -1.0 must be greater than 0"),
        ("master.max_depth=-1", "master.max_depth: -1 must be at least 0"),
        ("simulation.tolerances.q.z=1e-3", "simulation.tolerances.q.z: no such signal; did you mean q.y?"),
        ("components.q.parameters.y=1.0", "is no parameter; its causality is output"),
    ],
)
def test_wrong_settings_are_found_before_the_run(loop, orchestrate, option, message):
    status, said = orchestrate("validate", loop, "--set", option)
    assert status == 2 and message in said


FIXED = ('canHandleVariableCommunicationStepSize="true"', 'canHandleVariableCommunicationStepSize="false"')
SAMPLED = """
title = "a controller that is sampled"
[simulation]
stop_time = 1.0
macro_step = 0.1
master = "jacobi"
tolerances = { "c.ramp.flow" = 1e-2 }
[components.c]
fmu = "sampled.fmu"
parameters.only = 0.1
"""


@pytest.mark.parametrize("says_so", [True, False])
def test_an_fmu_that_allows_no_finer_run_leaves_no_reference_and_is_said_to(orchestrate, tmp_path, says_so):
    described(build("plant"), tmp_path, *([FIXED] if says_so else [])).rename(tmp_path / "sampled.fmu")
    (tmp_path / "sampled.toml").write_text(SAMPLED, encoding="utf-8")
    status, said = orchestrate(
        "compare", tmp_path / "sampled.toml", "--out", tmp_path / "out", "--quiet", "--no-pictures"
    )
    assert status == 3 and "no reference" in said and "this controller is sampled at 0.1 s" in said
    assert ("c cannot vary the step (canHandleVariableCommunicationStepSize is false)" in said) is says_so
    assert "smaller" not in said
    assert len(read_table(tmp_path / "out" / "jacobi_0.1s" / "results.csv")["time"]) == 11


def test_open_inputs_and_another_exchange_are_said_by_validate_and_by_run(tmp_path, capsys):
    """The shipped oscillator without its means and slopes; stdout of `validate`, stderr of `run`, whose estimate misses."""
    text = OSCILLATOR.read_text(encoding="utf-8")
    kept = [line for line in text.splitlines() if "_mean" not in line and "_rate" not in line]
    (tmp_path / "less.toml").write_text("\n".join(kept), encoding="utf-8")
    for command in (["validate"], ["run", "--quiet", "--stop", "0.1", "--no-pictures", "--out", str(tmp_path / "out")]):
        with pytest.raises(SystemExit) as ended:
            cli.main([*command, str(tmp_path / "less.toml")])
        told = capsys.readouterr()
        said = told.out if command == ["validate"] else told.err
        assert (ended.value.code or 0) == (0 if command == ["validate"] else 1)
        assert (
            "right: exchange held in the place of waveform, because nothing feeds right.neighbour.position_mean" in said
        )
        assert "inputs that nothing feeds keep their start values: left.neighbour.position" in said
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["wiring"]


@needs_compiler
def test_an_unconverged_step_is_never_silent(loop, orchestrate, tmp_path):
    """One iteration cannot reach the tolerance: status 1 and a line on stderr; the comparison fails too."""
    options = ["--set", "master.max_iterations=1", "--set", "master.max_depth=0", "--quiet", "--no-pictures"]
    status, said = orchestrate("run", loop, "--out", tmp_path / "run", *options)
    assert status == 1 and "macro steps did not converge, the first at t = 0.01 s" in said
    assert orchestrate("compare", loop, "--out", tmp_path / "compare", *options)[0] == 1
    assert json.loads((tmp_path / "compare" / "comparison.json").read_text())["verdict"] == "fail"


def test_a_diverging_run_is_written_to_its_end(orchestrate, tmp_path):
    """Explicit coupling far beyond its limit: 1e300 m does not fit any picture, but the tables and the verdict are there."""
    stiff = ["--set", "components.right.parameters.coupling_stiffness=1e6", "--quiet", "--stop", 1.8]
    status, said = orchestrate("compare", OSCILLATOR, "--master", "jacobi", "--out", tmp_path / "out", *stiff)
    assert status in (1, 3) and "Traceback" not in said
    assert json.loads((tmp_path / "out" / "comparison.json").read_text())["verdict"] == "fail"
    assert (tmp_path / "out" / "manifest.json").is_file()


@pytest.mark.portable
def test_a_robot_by_other_means_in_the_landing():
    """Same robot, own integrator, no units, means or slopes, outputs known only after the initialisation.

    Without slopes the exchange falls back to `point`, of order 2: at 5 ms and 2.5 ms (0.3 s, first dip) the
    difference to the catalogue's robot must be small and fall by four; it is 5e-5 and 1.3e-5 of the range of z.
    """
    differences = []
    for H in (0.005, 0.0025):
        options = ["simulation.stop_time=0.3", f"simulation.macro_step={H}"]
        ours, theirs = (run_coupled(load(LANDING, options, robot)) for robot in ("fptlir", str(build("robot"))))
        assert theirs.log.error is None and theirs.log.unconverged == 0
        assert (ours.exchange, theirs.exchange) == ("waveform", "point")
        z, other = (c.table["robot.body.position.z"] for c in (ours, theirs))
        differences.append(np.max(np.abs(z - other)) / np.ptp(z))
    assert differences[0] < 1e-4
    assert np.log2(differences[0] / differences[1]) == pytest.approx(2.0, abs=0.2)
