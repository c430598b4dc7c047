"""What is said of a landing's geometry, for who draws it: the robot of the catalogue, as it was placed."""

import numpy as np
import pytest

import orchestrator
from orchestrator.catalogue.robot_spec import load_robot
from orchestrator.landing.geometry import geometry
from orchestrator.landing.limits import landing_only
from orchestrator.landing.resolve import resolve


@pytest.mark.parametrize(("robot", "layout", "above"), [("fptlir", "top", 0.162), ("hybrid_robot_1", "bottom", -0.353)])
def test_the_robot_is_that_of_the_catalogue(robot: str, layout: str, above: float):
    """The line lies 0.0532 m under the centre of a wheel: below the rotors of a robot that stands on it, above the others'."""
    spec = load_robot(robot)
    found = geometry(resolve(landing_only(orchestrator.load_scenario("landing_200m_point9", robot=robot))))
    assert (found["span"], found["cable_length"], found["landing_position"]) == (200.0, 200.0, 20.0)
    drawn = found["robot"]
    assert (drawn["name"], drawn["layout"]) == (robot, layout) and drawn["line_above_rotors"] == pytest.approx(
        above, abs=1e-3
    )
    assert [wheel["mount"] for wheel in drawn["wheels"]] == [list(wheel.mount.value) for wheel in spec.wheel]
    assert all(
        wheel["radius"] == 0.075 and wheel["groove_angle"] == pytest.approx(np.radians(100.0))
        for wheel in drawn["wheels"]
    )
    assert spec.size is not None and drawn["size"]["along"] == spec.size.along.value
    assumed = {key for key, one in drawn["quantities"].items() if one["source"] == "assumed"}
    assert assumed == set(spec.assumptions()) and "body.mass" in drawn["quantities"]


def test_values_of_the_scenario_win(recwarn: pytest.WarningsRecorder):
    changed = {"robot.parameters.mass": 40.0, "robot.parameters.wheel[1].mount.z": 0.25}
    drawn = geometry(resolve(landing_only(orchestrator.load_scenario("landing_200m_point9", set=changed))))["robot"]
    assert drawn["weight"] == pytest.approx(40.0 * 9.8) and drawn["wheels"][0]["mount"] == [0.0, 0.0, 0.25]
