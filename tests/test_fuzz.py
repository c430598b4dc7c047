"""Whatever stands in a scenario, a setting, an archive, a description or a run folder: a message and a status.

The small tests take the same few cases each time; `make verify` takes many more, others each time. What was found is kept
as an example of its own, the smallest there is.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import orchestrator
from orchestrator.coupling.errors import InputError
from orchestrator.runs.components import opened
from orchestrator.runs.files import load_comparison, load_run
from tests.fmus import compiled, needs_compiler
from tests.fuzzing import (
    FMUS,
    MEMBERS,
    command,
    damaged,
    descriptions,
    harmed,
    in_time,
    place,
    repacked,
    scenario_texts,
    settings_texts,
    with_members,
)
from tests.scenarios import OSCILLATOR

pytestmark = needs_compiler
DESCRIBED = ("lag1", "lag2", "lag3", "field3")
SIZES = [pytest.param(0, id="few"), pytest.param(1, id="many", marks=pytest.mark.slow)]
QUIET = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example, HealthCheck.filter_too_much]
GRAPH = """title = "p' = q, q' = -p"
connections = ["p.y -> q.u", "q.y -> p.u"]
[simulation]
stop_time = 0.1
macro_step = 0.01
tolerances = {{ "p.y" = 0.01 }}
[components.p]
fmu = "{0}"
parameters.start = 1.0
[components.q]
fmu = "{0}"
parameters = {{ gain = -1.0 }}
"""
ONE = """title = "one"
simulation = {{ stop_time = 0.1, macro_step = 0.01, master = "jacobi" }}
components.p.fmu = "{}"
"""


def every(size: int, numbers: tuple[int, int], cases: st.SearchStrategy[Any], check: Callable[[Any], None]) -> None:
    """Check as many cases as the size asks for: the same ones in the small tests."""
    repeatable = size == 0
    chosen = settings(
        max_examples=numbers[size], derandomize=repeatable, deadline=None, suppress_health_check=QUIET, database=None,
        phases=[Phase.generate, Phase.shrink],
    )  # fmt: skip

    @chosen
    @given(cases)
    def each(case: Any) -> None:
        check(case)

    each()


@pytest.fixture(scope="module", autouse=True)
def built() -> None:
    """The FMUs and kernels of the cases, made before anybody looks at the clock, or at what is left in temporary folders."""
    for name in DESCRIBED:
        compiled(name)
    for scenario in ("drop_5cm", "oscillator"):
        with opened(orchestrator.load_scenario(scenario)):
            pass


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run."""
    out = tmp_path_factory.mktemp("fuzz") / "run"
    orchestrator.run(OSCILLATOR, stop=0.1, estimate="none", out=out, pictures=False)
    return out


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished comparison."""
    out = tmp_path_factory.mktemp("fuzz") / "comparison"
    orchestrator.compare(OSCILLATOR, stop=0.1, out=out, pictures=False)
    return out


@pytest.mark.parametrize("size", SIZES)
def test_scenarios(size: int):
    def check(text: str) -> None:
        with place() as folder:
            path = folder / "odd.toml"
            path.write_text(text, encoding="utf-8", errors="replace")
            command("validate", path)

    every(size, (50, 3500), scenario_texts(GRAPH.format(compiled("lag2"))), check)


@pytest.mark.parametrize("size", SIZES)
def test_settings(size: int):
    def check(texts: list[str]) -> None:
        with place() as folder:
            (folder / "graph.toml").write_text(GRAPH.format(compiled("lag2")), encoding="utf-8")
            command("validate", folder / "graph.toml", *(option for text in texts for option in ("--set", text)))

    every(size, (50, 2500), settings_texts, check)


def looked_at(content: bytes) -> None:
    """Check an FMU, validate a graph of it, and run that if it is valid."""
    with place() as folder:
        (folder / "odd.fmu").write_bytes(content)
        (folder / "one.toml").write_text(ONE.format("odd.fmu"), encoding="utf-8")
        command("check", folder / "odd.fmu")
        if command("validate", folder / "one.toml") == 0:
            command("run", folder / "one.toml", "--out", folder / "out", "--no-pictures", "--quiet", "--stop", "0.02")


@pytest.mark.parametrize("size", SIZES)
def test_archives(size: int):
    content = compiled("lag2").read_bytes()
    more = MEMBERS.map(lambda members: with_members(content, members))
    every(size, (30, 1500), damaged(content) | more | st.binary(max_size=60), looked_at)


@pytest.mark.parametrize("size", SIZES)
def test_model_descriptions(size: int):
    texts = {name: (FMUS / f"{name}.xml").read_text(encoding="utf-8") for name in DESCRIBED}
    cases = st.sampled_from([*texts]).flatmap(lambda name: st.tuples(st.just(name), descriptions(texts[name])))
    every(size, (30, 1500), cases, lambda case: looked_at(repacked(compiled(case[0]).read_bytes(), case[1])))


@pytest.mark.parametrize("size", SIZES)
def test_run_folders(size: int, whole: Path, compared: Path):
    def check(data: st.DataObject) -> None:
        kind = data.draw(st.sampled_from(["run", "comparison"]))
        with place() as folder:
            odd = harmed(data, whole if kind == "run" else compared, folder)
            try:
                with in_time():
                    load_run(odd) if kind == "run" else load_comparison(odd)
            except InputError as error:
                assert str(odd) in str(error)
            if data.draw(st.integers(0, 9)) == 0:
                command("report", odd)

    every(size, (20, 1000), st.data(), check)
