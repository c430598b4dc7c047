"""The mesh that the cable finds by itself, and whether a mesh resolves a landing.

Expected values: Irvine's shallow line against the equilibrium of the cable itself, the sizes by their definition, finer
meshes.
"""

import numpy as np
import pytest

from fmus.cable import mesh
from fmus.cable.mesh import Line, automatic
from fmus.cable.module import Cable
from fmus.module.variables import ModuleError
from orchestrator.landing.mesh import Mesh
from orchestrator.runs.coupled import run_coupled
from orchestrator.runs.errors import differences, range_of
from orchestrator.runs.estimate import estimate_error, solved
from orchestrator.runs.summary import result
from orchestrator.runs.systems import LandingSystem, resolve
from orchestrator.scenario.read import load
from tests.scenarios import LANDING
from verification.cable.setups import PHYSICAL, RIG, ROBOT_WEIGHT, TABLE1, Settings, loaded_equilibrium, point

OWN = (
    "cable.parameters.span=300.0", "cable.parameters.sag=6.0", "cable.parameters.level_difference=12.0",
    "cable.parameters.linear_density=0.964", "cable.parameters.axial_stiffness=2.11e7",
    "cable.parameters.bending_stiffness=821.0",
)  # fmt: skip


def line(settings: Settings, clamped: bool = False) -> Line:
    names = ("span", "unstretched_length", "axial_stiffness", "bending_stiffness")
    span, length, ea, ei = (float(settings[name]) for name in names)
    return Line(span, 0.0, length, ea, ei, 9.8 * float(settings["linear_density"]), clamped)


def landing(*settings: str, robot: str | None = None) -> LandingSystem:
    system = resolve(load(LANDING, settings, robot))
    assert isinstance(system, LandingSystem)
    return system


@pytest.mark.parametrize("settings", [TABLE1, PHYSICAL, RIG], ids=["table1", "physical", "rig"])
@pytest.mark.parametrize("load_n", [0.0, ROBOT_WEIGHT])
def test_tension_is_that_of_the_equilibrium(settings: Settings, load_n: float):
    """The shallow line leaves out squares of the slope (0.08 at most here) and the bending stiffness.

    That carries π² EI/(L² T) of the weight, and rounds the kink under a load over a layer of √(EI/T).
    """
    shallow = line(settings)
    at = 0.3 * shallow.span
    model, q = loaded_equilibrium(settings, ((0.3 * shallow.length, load_n),), n_elements=80)
    slope = point(model, q, 0.0)[3:]
    stretch = float(np.linalg.norm(slope))
    tension = shallow.ea * stretch * (stretch**2 - 1.0) / 2.0
    layer = np.sqrt(shallow.ei / tension) / shallow.span
    left_out = 0.08**2 + (np.pi * layer) ** 2 + (layer if load_n else 0.0)
    assert shallow.tension(load_n, at) == pytest.approx(tension * slope[1] / stretch, rel=2.0 * left_out)


def test_a_taut_line_without_weight_and_a_slack_one():
    """EA times the strain of the chord; nothing stretches a slack one, its layer is endless and its elements are equal."""
    taut, slack = (Line(100.0, 0.0, length, 1e6, 100.0, 0.0, False) for length in (99.0, 101.0))
    assert taut.tension(0.0, 50.0) == pytest.approx(1e6 / 99.0)
    assert slack.tension(0.0, 50.0) == 0.0 and slack.layer(0.0, 50.0) == np.inf
    s = automatic(slack, np.array([50.0]), 0.0, mesh.TOLERANCE)
    assert np.diff(s) == pytest.approx(np.full(s.size - 1, 100.0 / (s.size - 1)), rel=0.05)


@pytest.mark.parametrize("clamped", [False, True])
@pytest.mark.parametrize("wheels", [(20.0,), (3.0, 3.4), (99.8, 100.2), (199.0,)])
def test_sizes_are_those_asked_for(clamped: bool, wheels: tuple[float, ...]):
    one = line(TABLE1, clamped)
    s = automatic(one, np.array(wheels), ROBOT_WEIGHT, mesh.TOLERANCE)
    size, layer = np.diff(s), one.layer(ROBOT_WEIGHT, float(np.mean(wheels)))
    assert s[0] == 0.0 and s[-1] == one.length and np.all(size > 0.0)
    assert np.max(size[1:] / size[:-1]) < np.e and np.max(size[:-1] / size[1:]) < np.e
    assert np.max(size) <= one.length / 30.0 * (1.0 + 1e-9)
    found = Mesh(s, layer, wheels)
    # an element from the finest point on, where sizes grow as h + g s, is h (e^g - 1)/g long
    slow, fast = ((np.exp(g) - 1.0) / g for g in (mesh.SLOW_GROWTH, mesh.FAST_GROWTH))
    assert np.all(found.size_at(np.array(wheels)) <= mesh.AT_WHEEL * layer * slow * (1.0 + 1e-6))
    support = mesh.AT_CLAMP * slow if clamped else mesh.AT_PIN * fast
    assert found.size_at(np.array([1e-3]))[0] <= support * layer * (1.0 + 1e-6)


def test_a_mirrored_landing_has_the_mirrored_mesh():
    one = line(TABLE1)
    left, right = (automatic(one, np.array([at]), ROBOT_WEIGHT, mesh.TOLERANCE) for at in (20.0, 180.0))
    assert left == pytest.approx(one.length - right[::-1], abs=1e-9)


def test_elements_shrink_with_the_fourth_root_of_the_tolerance():
    one = line(PHYSICAL)
    counts = [automatic(one, np.array([20.0]), ROBOT_WEIGHT, mesh.TOLERANCE / 16.0**k).size - 1 for k in (0, 1, 2)]
    assert counts[1] == pytest.approx(2 * counts[0], abs=1.0) and counts[2] == pytest.approx(4 * counts[0], abs=3.0)


def test_the_cable_alone_takes_landing_points_as_distances():
    """A line that hangs deep is longer than its span: the arc length under 60 m is not 60 m."""
    cable = Cable()
    settings = {"sag": 20.0, "n_elements": 0, "landing[1].position": 60.0, "landing_load": 400.0}
    cable.table.assign(cable.values, settings)
    cable.initialize(0.0)
    size = np.diff(cable.model.s)
    finest = cable.model.s[np.argmin(size)]
    y = np.interp(finest, cable.model.s, cable.state[1 : cable.model.s.size * 6 : 6])
    assert abs(y - 60.0) < 1.0 and finest > 60.5


def test_grading_alone_is_refused():
    cable = Cable()
    cable.table.assign(cable.values, {"grading": 30.0})
    with pytest.raises(ModuleError, match="grading: needs n_elements; without both the mesh is found by itself"):
        cable.initialize(0.0)


@pytest.mark.parametrize("position", [2.0, 7.0, 60.0, 150.0, 298.0])
@pytest.mark.parametrize("robot", ["fptlir", "hybrid_robot_2", "linedrone"])
def test_the_mesh_follows_the_wheels(position: float, robot: str):
    found = landing(*OWN, f"landing.position={position}", robot=robot).landing.mesh
    assert found is not None and not found.is_coarse and 40 <= found.n_elements <= 110
    assert list(found.notes(np.array([s]) for s in found.wheels)) == []


def test_the_flagships_mesh_leaves_what_it_says():
    """Held against four times as many elements: z, roll and tension within 5e-4, and no more than 50 elements."""
    system = landing()
    finer = system.meshed(4.0)
    assert finer is not None and system.landing.mesh is not None and system.landing.mesh.n_elements <= 50
    times = np.linspace(0.0, 2.0, 401)
    one, other = (solved(s, times, lambda _: None, 1e-8) for s in (system, finer.system))
    names = ("robot.body.position.z", "robot.roll", "cable.tension_mid")
    for name, error in differences(one, other, names).items():
        assert error < 5e-4 * range_of(other[name])


def test_a_smaller_tolerance_asks_for_a_finer_mesh():
    """Half of the smallest tolerance is left to the mesh: (5e-4 / 5e-5)^(1/4) = 1.78 times the elements."""
    meshes = [landing(f"simulation.tolerances.robot.roll={t}").landing.mesh for t in (1e-2, 1e-4)]
    assert meshes[0] is not None and meshes[1] is not None
    assert meshes[1].n_elements == pytest.approx(10**0.25 * meshes[0].n_elements, abs=1.0)


def test_a_mesh_of_ones_own_that_does_not_fit_is_said_and_misses():
    """Twenty equal elements of 15 m under a wheel 2 m from the support: the roll is wrong by a factor of five."""
    wrong = ("landing.position=298.0", "landing.height=1.0", "robot.parameters.mass=60", "simulation.stop_time=1.0")
    coupled = run_coupled(landing(*OWN, *wrong, "cable.parameters.n_elements=20"))
    estimate_error(coupled)
    run = result(coupled)
    assert run.verdict == "missed" and run.exit_status == 1
    said = next(line for line in run.warnings if "wheel 1 lands on an element of 15 m" in line)
    assert "leave out n_elements" in said
    parts = run.error_parts["robot.body.position.z"]
    assert (
        parts.largest == "mesh"
        and parts.mesh is not None
        and parts.mesh > 0.1 * range_of(run.table["robot.body.position.z"])
    )


def test_a_wheel_that_leaves_the_fine_part_is_said():
    found = landing().landing.mesh
    assert found is not None
    (said,) = found.notes([np.array([20.0, 35.0])])
    assert "wheel 1 leaves the fine part of the mesh" in said and "n_elements" in said
