"""The engine as a package of its own: what it offers, what it does not need, what a stranger is told."""

from __future__ import annotations

import ast
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import orchestrator.coupling
from orchestrator.coupling import (
    MASTERS,
    Connection,
    Fmu,
    FmuError,
    GaussSeidel,
    Graph,
    GraphError,
    IqnIls,
    Log,
    SubStepped,
    api,
    simulate,
)
from tests.fmus import MILD, build, fmu, oscillator

ROOT = Path(__file__).resolve().parents[1]
CONNECTIONS = ["a.position -> b.left.position", "a.velocity -> b.left.velocity", "b.left.force -> a.force"]


def in_python(code: str) -> str:
    """Return what `code` prints in a process of its own."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    return done.stdout.strip()


def test_the_example_meets_the_exact_solution(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Loads joined between the ends of a step are of order 2: the frequency is off by (ωH)²/12, the phase by ω t times that."""
    monkeypatch.chdir(tmp_path)
    shown = runpy.run_path(str(ROOT / "examples" / "engine_alone.py"))
    log, omega, H, amplitude = shown["log"], np.sqrt(210.0), 1e-3, 0.5
    assert log.unconverged == 0 and log.time[-1] == 1.0
    assert 0.0 < shown["error"] < (omega * H) ** 2 / 12 * omega * amplitude
    assert not list(tmp_path.iterdir())


# -- what it offers, what it needs ------------------------------------------------------------------------------


def test_all_that_is_offered_is_there_and_nothing_else_is_imported_in_its_place() -> None:
    tree = ast.parse(Path(api.__file__).read_text(encoding="utf-8"))
    imported = {n.asname for node in tree.body if isinstance(node, ast.ImportFrom) for n in node.names if n.asname}
    assert imported == set(orchestrator.coupling.__all__)
    for name in orchestrator.coupling.__all__:
        assert getattr(orchestrator.coupling, name) is getattr(api, name)
    assert {master.__name__ for master in MASTERS.values()} <= imported
    with pytest.raises(AttributeError, match="no attribute 'Grahp'"):
        orchestrator.coupling.Grahp  # noqa: B018


def test_what_is_offered_says_what_it_is() -> None:
    for name in set(orchestrator.coupling.__all__) - {"MASTERS", "Table"}:
        assert getattr(orchestrator.coupling, name).__doc__, name


def test_importing_it_costs_nothing() -> None:
    code = (
        "import sys, orchestrator.coupling; print([n for n in ('numpy', 'fmpy', 'numba', 'scipy') if n in sys.modules])"
    )
    assert in_python(code) == "[]"


def test_it_needs_nothing_of_the_rest() -> None:
    code = (
        "import sys; from orchestrator.coupling import simulate\n"
        "own = ('orchestrator', 'orchestrator.coupling')\n"
        "ours = {n for n in sys.modules if n.split('.')[0] in ('orchestrator', 'fmus')}\n"
        "print(sorted(n for n in ours if n not in own and not n.startswith('orchestrator.coupling.')))\n"
        "print([n for n in ('pydantic', 'typer', 'matplotlib', 'h5py') if n in sys.modules])"
    )
    assert in_python(code).splitlines() == ["[]", "[]"]


# -- how it is used ---------------------------------------------------------------------------------------------


def pair() -> dict[str, Fmu]:
    a = fmu("link", "one", mass=10.0, ground_stiffness=10.0, initial_position=0.1)
    return {"a": a, "b": fmu("link", "two", mass=10.0, stiffness=100.0, damping=1.0)}


def run(master: object, **options: object) -> Log:
    with Graph(pair(), CONNECTIONS) as graph:
        chosen = master(graph, **options) if options else master  # type: ignore[operator]
        return simulate(graph, chosen, start=0.0, stop=0.1, macro_step=0.01)  # type: ignore[arg-type]


def test_a_master_by_name_by_class_or_made() -> None:
    logs = [run("iqn_ils"), run(IqnIls), run(IqnIls, tolerance=1e-6)]
    assert all(np.array_equal(log.values, logs[0].values) for log in logs)
    assert run(GaussSeidel).iterations_per_step == 1.0
    assert [log.master for log in logs] == ["iqn_ils"] * 3


def test_arrays_with_units() -> None:
    log = run("iqn_ils")
    assert log.time == pytest.approx(np.linspace(0.0, 0.1, 11), rel=1e-15)
    assert (log.units["a.position"], log.units["b.left.force"], log.units["a.velocity"]) == ("m", "N", "m/s")
    assert list(log.units) == log.signals
    assert list(log.table) == ["time", *log.signals]
    assert np.array_equal(log.table["a.position"], log.signal("a.position"))
    with pytest.raises(ValueError, match=r"a\.positoin was not recorded; did you mean a\.position\?"):
        log.signal("a.positoin")


def test_a_unit_that_is_not_declared_is_1() -> None:
    with Graph({"a": fmu("odd", "a")}, []) as graph:
        log = simulate(graph, "jacobi", 0.0, 0.1, 0.1, record=["a.count", "a.y"])
    assert log.units == {"a.count": "1", "a.y": "mm"}


def test_connections_as_text_or_objects() -> None:
    with Graph(pair(), CONNECTIONS) as graph:
        assert graph.connections[0] == Connection("a.position", "b.left.position")
    for text in ("a.position", "a.position -> ", "-> b.left.position", "a.position > b.left.position"):
        with pytest.raises(GraphError, match=r'is not of the form "a\.x -> b\.u"'):
            Connection.parse(text)


def test_with_frees_the_fmus_whatever_happens() -> None:
    components = pair()
    with pytest.raises(ZeroDivisionError), Graph(components, CONNECTIONS) as graph:
        raise ZeroDivisionError
    assert all(part.closed for part in components.values())
    with pytest.raises(ValueError, match="a: has been closed; load the FMU once more"):
        simulate(graph, "jacobi", 0.0, 0.1, 0.1)
    with pytest.raises(ValueError, match="has been closed"):
        Graph(components, CONNECTIONS)
    with pytest.raises(ValueError, match="has been closed"):
        components["a"].read("position")


def test_a_single_fmu_is_a_context_too() -> None:
    with Fmu(build("link"), "alone") as alone:
        alone.enter_initialization(0.0)
        alone.exit_initialization()
        alone.step(0.0, 0.1)
        assert alone.solves == 1
    assert alone.closed


def test_sub_steps() -> None:
    components = pair()
    components["b"].close()
    components["b"] = SubStepped(build("link"), "b", steps=4)
    with Graph(components, CONNECTIONS) as graph:
        log = simulate(graph, "jacobi", 0.0, 0.1, 0.05)
    assert log.solves == {"a": 1, "b": 4}  # without the first macro step


# -- what a stranger is told ------------------------------------------------------------------------------------


def test_a_step_that_does_not_divide() -> None:
    with Graph(pair(), CONNECTIONS) as graph:
        for macro_step, stop, said in (
            (0.3, 1.0, r"macro step 0\.3 s does not divide 1 s; 0\.3333333333333333 s does"),
            (2.0, 1.0, r"macro step 2 s does not divide 1 s; 1 s does"),
            (0.0, 1.0, "must be positive"),
            (0.1, -1.0, "stop time -1 s: must be after the start at 0 s"),
        ):
            with pytest.raises(ValueError, match=said):
                simulate(graph, "jacobi", 0.0, stop, macro_step)


def test_a_master_that_is_none() -> None:
    with Graph(pair(), CONNECTIONS) as graph, Graph(pair(), CONNECTIONS) as other:
        with pytest.raises(ValueError, match=r"master 'iqnils': choose jacobi, .*; did you mean iqn_ils\?"):
            simulate(graph, "iqnils", 0.0, 0.1, 0.1)
        with pytest.raises(ValueError, match="master jacobi: was made for another graph"):
            simulate(graph, MASTERS["jacobi"](other), 0.0, 0.1, 0.1)


def test_one_instance_under_two_names() -> None:
    parts = pair()
    with pytest.raises(GraphError, match="components a and c are one instance; load the FMU once for each"):
        Graph({**parts, "c": parts["a"]}, CONNECTIONS)
    for part in parts.values():
        part.close()


def test_fmus_run_once() -> None:
    with Graph(pair(), CONNECTIONS) as graph:
        simulate(graph, "jacobi", 0.0, 0.1, 0.1)
        with pytest.raises(GraphError, match="a has been started before, and FMUs cannot start anew"):
            simulate(graph, "jacobi", 0.0, 0.1, 0.1)


def test_a_failure_can_be_raised() -> None:
    with Graph({"a": fmu("odd", "a", fault=2)}, []) as graph:
        log = simulate(graph, "jacobi", 0.0, 0.2, 0.1)
    assert len(log.time) == 1
    with pytest.raises(FmuError, match="is not a finite number"):
        log.raise_error()
    with oscillator(**MILD) as graph:
        simulate(graph, "jacobi", 0.0, 0.1, 0.1).raise_error()
