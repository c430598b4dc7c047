"""The robot within a step: its states at the stages and at the end, from its accelerations there.

The orientation within a step is exp(θ) times that at its start, θ' = T(θ)⁻¹ ω.
"""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.kernels.rotations import rotation_vector_rate, turn
from fmus.kernels.time_integration import accept, stage, to_end, to_stage
from fmus.robot import rigid_body as rb
from orchestrator.landing.monolithic.state import SPIN, TURN

POSITION, VELOCITY, TURN_RATE = rb.POSITION, rb.VELOCITY, rb.TURN_RATE


@kernel
def stages(method, start, b, h, space):
    """Write the robot's states at the stages, from its accelerations `b` (2, 10) there, to ``space.stage``."""
    x0, v0 = start[POSITION : POSITION + 3], start[VELOCITY : VELOCITY + 3]
    angle0, spin0 = start[rb.SPIN_ANGLE : rb.SPIN], start[rb.SPIN : rb.RIGID]
    for j in range(2):
        y = space.stage[j]
        x, v = y[POSITION : POSITION + 3], y[VELOCITY : VELOCITY + 3]
        stage(method, j, h, x0, v0, b[0, 0:TURN], b[1, 0:TURN], x, v)
        angle, spin = y[rb.SPIN_ANGLE : rb.SPIN], y[rb.SPIN : rb.RIGID]
        stage(method, j, h, angle0, spin0, b[0, SPIN:], b[1, SPIN:], angle, spin)
        for i in range(3):
            y[TURN_RATE + i] = start[TURN_RATE + i] + h * to_stage(method, j, b[0, TURN + i], b[1, TURN + i])
            space.theta[j, i] = method.c[j] * h * start[TURN_RATE + i]
    _rotation_vectors(method, h, space)
    for j in range(2):
        attitude = space.stage[j, rb.ATTITUDE : rb.VELOCITY]
        turn(start[rb.ATTITUDE : rb.VELOCITY], space.theta[j], space.quaternions[2], attitude)


@kernel
def _rotation_vectors(method, h, space):
    """Solve for the rotation vectors at the stages by iteration; where it starts stands in ``space.theta``."""
    rate = space.quaternions
    for _ in range(8):
        for j in range(2):
            rotation_vector_rate(space.theta[j], space.stage[j, TURN_RATE : TURN_RATE + 3], rate[j])
        change = 0.0
        for j in range(2):
            for i in range(3):
                new = h * to_stage(method, j, rate[0, i], rate[1, i])
                change = max(change, abs(new - space.theta[j, i]))
                space.theta[j, i] = new
        if change < 1e-16:
            break


@kernel
def end(method, r, b, h, space):
    """Move the robot's state `r` (21,) to the end of the step whose stages stand in ``space``."""
    rate, theta = space.quaternions, space.theta[0]
    for j in range(2):
        rotation_vector_rate(space.theta[j], space.stage[j, TURN_RATE : TURN_RATE + 3], rate[j])
    accept(method, h, r[POSITION : POSITION + 3], r[VELOCITY : VELOCITY + 3], b[0, 0:TURN], b[1, 0:TURN])
    accept(method, h, r[rb.SPIN_ANGLE : rb.SPIN], r[rb.SPIN : rb.RIGID], b[0, SPIN:], b[1, SPIN:])
    for i in range(3):
        r[TURN_RATE + i] += h * to_end(method, b[0, TURN + i], b[1, TURN + i])
        theta[i] = h * to_end(method, rate[0, i], rate[1, i])
    attitude = space.probe[rb.ATTITUDE : rb.VELOCITY]
    turn(r[rb.ATTITUDE : rb.VELOCITY], theta, rate[2], attitude)
    for i in range(4):
        r[rb.ATTITUDE + i] = attitude[i]


@kernel
def perturb(robot, column, step, rate, probe, scratch):
    """Write the robot state with its coordinate (or, if `rate`, its velocity) number `column` changed by `step`."""
    for i in range(rb.RIGID):
        probe[i] = robot[i]
    if rate:
        probe[(VELOCITY if column < SPIN else rb.SPIN - SPIN) + column] += step
    elif column < TURN:
        probe[POSITION + column] += step
    elif column < SPIN:
        for i in range(3):
            scratch[0, i] = step if i == column - TURN else 0.0
        turn(robot[rb.ATTITUDE : rb.VELOCITY], scratch[0, 0:3], scratch[1], probe[rb.ATTITUDE : rb.VELOCITY])
    else:
        probe[rb.SPIN_ANGLE - SPIN + column] += step
