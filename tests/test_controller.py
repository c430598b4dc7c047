"""The set-down controller alone and with a free robot: held against closed forms, its bounds, its replay."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.controller import law
from fmus.controller.module import Setdown
from fmus.module.variables import ModuleError
from fmus.robot.module import Robot

MASS, GRAVITY, INERTIA = 38.0, 9.8, 5.42
WEIGHT = MASS * GRAVITY
SHARED = (
    "roll",
    "pitch",
    "yaw",
    *(f"body.{n}.{a}" for n in ("position", "velocity", "angular_velocity") for a in "xyz"),
)
COMMANDS = ("thrust", "torque.x", "torque.y", "torque.z")


def controller(t: float = 0.0, inputs: dict[str, float] | None = None, **parameters: float) -> Setdown:
    """A controller that has sampled for the first time; ``__`` stands for a dot."""
    one = Setdown()
    one.table.assign(
        one.values, {name.replace("__", "."): value for name, value in parameters.items()} | (inputs or {})
    )
    one.initialize(t)
    return one


def robot(**start: float) -> Robot:
    one = Robot(1)
    one.table.assign(one.values, {f"initial.{name.replace('__', '.')}": value for name, value in start.items()})
    one.initialize(0.0)
    return one


def fly(flown: Robot, flying: Setdown, stop: float, h: float) -> dict[str, np.ndarray]:
    """Step both from instant to instant, `h` s apart; return what the robot does, and when."""
    times = h * np.arange(round(stop / h) + 1)
    rows = []
    for k, t in enumerate(times):
        for name in SHARED:
            flying.values[flying.table.index[name]] = flown.values[flown.table.index[name]]
        flying.initialize(0.0) if k == 0 else flying.step(times[k - 1], t - times[k - 1])
        rows.append([t, *(flown.values[flown.table.index[n]] for n in ("body.position.z", "body.velocity.z", "roll"))])
        for name in COMMANDS:
            flown.values[flown.table.index[name]] = flying[name]
        flown.step(t, h)
    return dict(zip(("t", "z", "v", "roll"), np.array(rows).T, strict=True))


def sampled(x: np.ndarray, frequency: float, ratio: float, h: float, n: int) -> np.ndarray:
    """Return (n + 1, 2) error and rate of a free mass under sampled feedback, held between: powers of a matrix."""
    free, push = np.array([[1.0, h], [0.0, 1.0]]), np.array([0.5 * h * h, h])
    step = free - np.outer(push, [frequency**2, 2.0 * ratio * frequency])
    return np.array([np.linalg.matrix_power(step, k) @ x for k in range(n + 1)])


# -- in free flight ----------------------------------------------------------------------------------------------


def test_a_level_robot_hovers():
    found = fly(robot(position__z=3.0), controller(descent_speed=0.0), 1.0, 0.02)
    assert controller(descent_speed=0.0)["thrust"] == MASS * GRAVITY
    assert np.max(np.abs(found["z"] - 3.0)) < 1e-14 and np.max(np.abs(found["v"])) < 1e-14


def test_the_way_down_is_that_of_the_sampled_loop():
    """The error of height follows e'' = -2 ζ ω e' - ω² e, held between instants; the robot is exact under a constant force."""
    h, v = 0.02, 0.3
    found = fly(robot(), controller(descent_speed=v, sample_time=h), 4.0, h)
    error = sampled(np.array([0.0, -v]), 2.0, 1.0, h, found["t"].size - 1)
    assert np.max(np.abs(-v * found["t"] - found["z"] - error[:, 0])) < 1e-12
    assert np.max(np.abs(-v - found["v"] - error[:, 1])) < 1e-12
    assert found["v"][-1] == pytest.approx(-v, abs=v * 8.0 * math.exp(-8.0))  # v (1 - (1 - ω t) e^-ωt), ω t = 8


def test_the_way_down_comes_to_the_continuous_loop_with_the_first_order_of_the_sample_time():
    def miss(h: float) -> float:
        found = fly(robot(), controller(descent_speed=0.3, sample_time=h), 2.0, h)
        lag = 0.3 * found["t"] * np.exp(-2.0 * found["t"])
        return float(np.max(np.abs(found["z"] + 0.3 * found["t"] - lag)))

    errors = [miss(h) for h in (0.02, 0.01, 0.005)]
    assert [np.log2(a / b) for a, b in pairwise(errors)] == pytest.approx([1.0, 1.0], abs=0.1)


def test_roll_goes_back_as_a_damped_oscillator():
    """Against the sampled closed form to the order of the robot's integration, against the continuous one to the first
    order of the sample time."""
    errors = []
    for h in (0.01, 0.005):
        found = fly(robot(roll=0.05), controller(descent_speed=0.0, sample_time=h), 1.5, h)
        exact = sampled(np.array([0.05, 0.0]), 5.0, 0.7, h, found["t"].size - 1)[:, 0]
        assert np.max(np.abs(found["roll"] - exact)) < 1e-11
        w = 5.0 * math.sqrt(1.0 - 0.7**2)
        t = found["t"]
        smooth = 0.05 * np.exp(-3.5 * t) * (np.cos(w * t) + 3.5 / w * np.sin(w * t))
        errors.append(float(np.max(np.abs(found["roll"] - smooth))))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("axis", ["pitch", "yaw"])
def test_pitch_and_yaw_go_back_too(axis):
    flown = robot(**{axis: 0.02})
    fly(flown, controller(descent_speed=0.0), 8.0, 0.02)
    assert abs(flown.values[flown.table.index[axis]]) < 1e-4


def test_a_tilted_robot_is_still_carried():
    """Thrust over the cosine of the tilt: its vertical part is the weight."""
    one = controller(inputs={"roll": 0.3, "pitch": -0.2}, descent_speed=0.0)
    assert one["thrust"] * math.cos(0.3) * math.cos(0.2) == pytest.approx(WEIGHT, rel=1e-15)


# -- bounds ------------------------------------------------------------------------------------------------------

ANGLE = st.floats(-3.0, 3.0)
RATE = st.floats(-20.0, 20.0)


@settings(max_examples=200, deadline=None)
@given(st.tuples(ANGLE, ANGLE, ANGLE), st.tuples(RATE, RATE, RATE), st.floats(-50.0, 50.0), st.floats(10.0, 80.0))
def test_rotors_push_and_no_more_than_they_can(angles, rates, v, mass):
    """Two sides at the lever of the rotors: neither pulls, none gives more than half of the largest thrust."""
    names = ("roll", "pitch", "yaw", *(f"body.angular_velocity.{a}" for a in "xyz"), "body.velocity.z")
    one = controller(inputs=dict(zip(names, (*angles, *rates, v), strict=True)), mass=mass)
    assert 0.0 <= one["thrust"] <= 820.0
    for axis, arm in (("x", 0.31), ("y", 0.31), ("z", 0.02)):
        sides = [0.5 * (one["thrust"] + sign * one[f"torque.{axis}"] / arm) for sign in (1.0, -1.0)]
        assert all(-1e-10 <= side <= 410.0 + 1e-10 for side in sides)


def test_the_largest_torque_holds():
    one = controller(inputs={"roll": 1.0, "body.angular_velocity.x": 9.0}, max_torque=3.0)
    assert one["torque.x"] == -3.0


def test_a_mirrored_robot_is_turned_the_other_way():
    plus, minus = (controller(inputs={"roll": s * 0.1, "pitch": s * 0.05, "yaw": s * 0.02}) for s in (1.0, -1.0))
    assert [plus[n] for n in COMMANDS[1:]] == [-minus[n] for n in COMMANDS[1:]]
    assert plus["thrust"] == minus["thrust"]


# -- touch-down --------------------------------------------------------------------------------------------------


def pressed(one: Setdown, t: float, h: float, *forces: float) -> None:
    for k, force in enumerate(forces, start=1):
        one.values[one.table.index[f"contact[{k}].normal_force"]] = force
    one.step(t - h, h)


def test_touch_down_counts_after_its_delay_and_a_short_touch_does_not():
    one, h = controller(), 0.02
    enough = 0.1 * WEIGHT * 1.001
    for k, force in enumerate([0.0, enough, enough, 0.0, enough, enough, enough], start=1):
        pressed(one, h * k, h, 0.5 * force, 0.5 * force)  # two wheels together
        assert one["phase"] == (1 if k == 7 else 0)
    assert one["touch_time"] == pytest.approx(0.14)


def test_the_thrust_ramps_down_smoothly_and_stays():
    one, h = controller(descent_speed=0.0, touch_delay=0.0, ramp_time=1.0, final_share=0.25), 0.02
    pressed(one, h, h, 400.0)
    for k in range(2, 80):
        pressed(one, h * k, h)  # lifted off again: the ramp goes on
        x = min(1.0, h * (k - 1))
        assert one["thrust"] == pytest.approx(WEIGHT * (1.0 - 0.75 * x * x * (3.0 - 2.0 * x)), rel=1e-12)
        assert one["phase"] == (1 if k < 51 else 2)
    assert one["thrust"] == pytest.approx(0.25 * WEIGHT, rel=1e-15)


@pytest.mark.parametrize(("kept", "torque"), [(True, -INERTIA * 25.0 * 0.01), (False, 0.0)])
def test_the_torque_after_touch_down(kept, torque):
    one = controller(inputs={"roll": 0.01}, touch_delay=0.0, torque_after_touch=kept)
    assert one["torque.x"] == pytest.approx(-INERTIA * 25.0 * 0.01)
    pressed(one, 0.02, 0.02, 400.0)
    assert one["torque.x"] == pytest.approx(torque)


def test_without_thrust_there_is_no_torque():
    one = controller(inputs={"roll": 0.1}, touch_delay=0.0, ramp_time=0.0)
    pressed(one, 0.02, 0.02, 400.0)
    assert one["thrust"] == 0.0 and one["torque.x"] == 0.0


# -- sampling, state ---------------------------------------------------------------------------------------------


def test_between_instants_nothing_moves():
    one = controller()
    before = [one[n] for n in COMMANDS]
    one.table.assign(one.values, {"roll": 0.2, "body.velocity.z": -1.0})
    for k in range(1, 4):
        one.step(0.005 * (k - 1), 0.005)
        assert [one[n] for n in COMMANDS] == before
    one.step(0.015, 0.005)
    assert one["torque.x"] < 0.0 and one["thrust"] > WEIGHT


def test_at_an_instant_the_outputs_follow_the_inputs_until_a_step_is_made():
    one = controller()
    rolled = []
    for roll in (0.1, 0.2, 0.1):
        one.values[one.table.index["roll"]] = roll
        one.refresh()
        rolled.append(one["torque.x"])
    assert rolled[0] == rolled[2] != rolled[1]
    one.values[one.table.index["roll"]] = 0.3
    one.step(0.0, 0.005)
    assert one["torque.x"] == rolled[0]


def test_many_macro_steps_make_each_instant_once():
    """0.005 and 0.02 are no binary fractions: instants are neither missed nor doubled by round-off."""
    one = controller()
    for k in range(40_000):
        one.step(0.005 * k, 0.005)
        assert one.state[law.NOW + law.NEXT] == (k + 1) // 4 + 1


def test_a_copy_of_values_and_state_replays_to_the_bit():
    one, other = controller(), Setdown()
    other.initialize(0.0)
    rng = np.random.default_rng(1)
    for k in range(30):
        saved = one.values.copy(), one.state.copy()
        inputs = rng.normal(size=law.N_INPUTS) * np.repeat([1.0, 200.0], [law.FORCES, law.MAX_WHEELS])
        outcomes = []
        for _ in range(2):
            one.values[:], one.state[:] = saved
            one.values[one._INPUTS] = inputs
            one.step(0.02 * k, 0.02)
            outcomes.append((one.values.tobytes(), one.state.tobytes()))
        other.values[:], other.state[:] = saved
        other.values[other._INPUTS] = inputs
        other.step(0.02 * k, 0.02)
        assert outcomes == [(other.values.tobytes(), other.state.tobytes())] * 2


# -- what makes no sense -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"mass": 100.0}, "max_thrust = 820 N is less than the weight, 980 N"),
        ({"attitude_frequency": 30.0}, "attitude_frequency = 30 rad/s is too fast for sample_time = 0.02 s"),
        ({"sample_time": 0.0}, "sample_time = 0 s must be greater than 0"),
        ({"final_share": 1.5}, "final_share = 1.5 must be at least 0 and at most 1"),
    ],
)
def test_wrong_parameters_are_refused(parameters, said):
    with pytest.raises(ModuleError, match=f"setdown: {said}"):
        controller(**parameters)
