"""FMI to the letter: what an FMU may rely on, and what it may say."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.coupling import simulate
from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.masters import MASTERS
from tests.fmus import compiled, needs_compiler

pytestmark = needs_compiler
H, STOP = 0.1, 2.0


def letter(name: str, **parameters: float) -> Fmu:
    fmu = Fmu(compiled("letter2"), name)
    fmu.set_parameters(parameters)
    return fmu


def pair(**parameters: float) -> Graph:
    """Return two FMUs in a loop, `parameters` being those of the first."""
    parts = {"a": letter("a", **parameters), "b": letter("b", start=0.0)}
    return Graph(parts, ["a.x -> b.u", "b.x -> a.u"])


# -- no state from before the present point ----------------------------------------------------------------


def test_a_step_of_a_master_that_never_goes_back_is_final():
    """x' = -x by 2000 Euler steps of 1 ms: 0.999^2000 = 0.1352; an FMU that took its steps for tentative stays at 0.905."""
    with Graph({"a": letter("a", tentative=1.0)}, []) as graph:
        assert simulate(graph, "jacobi", 0.0, STOP, H).signal("a.x")[-1] == pytest.approx(0.999**2000, rel=1e-12)


@pytest.mark.parametrize("master", MASTERS)
def test_tentative_or_not_makes_no_difference_to_any_master(master: str):
    """States at the beginning of a step are restored to that point, not to one before it: both FMUs do the same steps."""
    ends = []
    for tentative in (0.0, 1.0):
        with pair(tentative=tentative) as graph:
            ends.append(simulate(graph, master, 0.0, STOP, H).values[-1])
    assert np.array_equal(*ends)


def test_while_an_older_state_is_kept_a_step_says_so():
    """Kept at 0.1 s: the step from there may say that none lies before, the next one must not; released, it may again."""
    fmu, said = letter("a"), []
    call = fmu.fmi.do_step
    fmu.fmi.do_step = lambda t, h, none_before: (said.append(none_before), call(t, h, none_before))[1]
    with fmu:
        fmu.enter_initialization(0.0)
        fmu.exit_initialization()
        fmu.step(0.0, H)
        state = fmu.save()
        fmu.step(0.1, H)
        fmu.step(0.2, H)
        fmu.restore(state)
        fmu.step(0.1, H)
        fmu.release(state)
        fmu.step(0.2, H)
    assert said == [True, True, False, True, True]
