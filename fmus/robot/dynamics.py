"""One macro step of the robot: inner steps of Runge–Kutta, and what is remembered of the step (kernels).

Inputs over a macro step (8 + 14 n,)
    thrust and torque and their slopes 4:8; for each wheel the loads at an instant as in rigid_body.py, and the slopes of
    force 7:10, moment 10:13 and drive torque 13.
Module state (25 + 13 n,)
    rigid-body state 0:21; roll, pitch, yaw without jumps 21:24; work of the control 24;
    for each wheel position_mean 0:3, axle_mean 3:6, rotation 6:9, rotation_mean 9:12, work 12.

Equations: README of this folder.
"""

from __future__ import annotations

import math

from fmus.kernels.jit import kernel
from fmus.kernels.rotations import follow_euler, normalize, quaternion_rate, rotate
from fmus.robot.rigid_body import (
    ATTITUDE,
    AXLE,
    BODY_LOADS,
    DRIVE,
    FORCE,
    FREE,
    GRAVITY,
    MASS,
    MAX_WHEELS,
    MOMENT,
    N_WHEELS,
    POSITION,
    RIGID,
    SPIN,
    SPIN_ANGLE,
    TURN_RATE,
    VELOCITY,
    WHEEL_LOADS,
    WHEEL_STRIDE,
    WHEELS,
    accelerations,
    body_motion,
    control_power,
    kinetic_energy,
    resultants,
    wheel_motion,
)

# Places and sizes of what the module takes, keeps and shows; those of a wheel are counted from its first.
BODY_RATES, BODY_INPUTS = BODY_LOADS, 2 * BODY_LOADS
FORCE_RATE, MOMENT_RATE, DRIVE_RATE, WHEEL_INPUTS = 7, 10, 13, 14
ANGLES, CONTROL_WORK, MEMORY = 21, 24, 25
POSITION_MEAN, AXLE_MEAN, TURNED, TURNED_MEAN, WHEEL_WORK, WHEEL_MEMORY = 0, 3, 6, 9, 12, 13
BODY_OUTPUTS, WHEEL_OUTPUTS = 15, 25

# The inner integration adds the running integrals of the wheels' angular velocities and the control's work.
ROTATION, WORK = RIGID, RIGID + 3 * MAX_WHEELS
EXTENDED = WORK + 1

# Places in the workspace of `step`.
_Y, _TRIAL, _K1, _K2, _K3, _K4 = (i * EXTENDED for i in range(6))
_LOADS = 6 * EXTENDED
_FORCE = _LOADS + BODY_LOADS + WHEEL_LOADS * MAX_WHEELS
_MOMENT = _FORCE + 3
_TORQUE = _MOMENT + 3
_ACCELERATIONS = _TORQUE + MAX_WHEELS
_MOTION = _ACCELERATIONS + 6 + MAX_WHEELS
_START = _MOTION + 12
_MEMORY = _START + 3 * MAX_WHEELS
WORKSPACE = _MEMORY + MEMORY + WHEEL_MEMORY * MAX_WHEELS

DONE, TURNS_TOO_FAST, NOT_FINITE = 0, 1, 2
"""Status of `step`."""


@kernel
def loads_at(inputs, n_wheels, since_middle, loads):
    """Write the loads at `since_middle` (s) after the middle of the macro step."""
    for i in range(BODY_LOADS):
        loads[i] = inputs[i] + inputs[BODY_RATES + i] * since_middle
    for k in range(n_wheels):
        i = BODY_INPUTS + WHEEL_INPUTS * k
        j = BODY_LOADS + WHEEL_LOADS * k
        for c in range(6):
            loads[j + c] = inputs[i + c] + inputs[i + FORCE_RATE + c] * since_middle
        loads[j + DRIVE] = inputs[i + DRIVE] + inputs[i + DRIVE_RATE] * since_middle


@kernel
def rates(prm, inputs, since_middle, y, dy, work):
    """Write the time derivative of the extended state y (34,) to `dy`."""
    n_wheels = int(prm[N_WHEELS])
    loads = work[_LOADS:_FORCE]
    force = work[_FORCE:_MOMENT]
    moment = work[_MOMENT:_TORQUE]
    wheel_torque = work[_TORQUE:_ACCELERATIONS]
    out = work[_ACCELERATIONS:_MOTION]
    loads_at(inputs, n_wheels, since_middle, loads)
    resultants(prm, y, loads, force, moment, wheel_torque)
    accelerations(prm, y, force, moment, wheel_torque, out)
    quaternion_rate(y[ATTITUDE:VELOCITY], y[TURN_RATE], y[TURN_RATE + 1], y[TURN_RATE + 2], dy[ATTITUDE:VELOCITY])
    for i in range(3):
        dy[i] = y[VELOCITY + i]
        dy[VELOCITY + i] = out[i]
        dy[TURN_RATE + i] = out[3 + i]
    for k in range(MAX_WHEELS):
        dy[SPIN_ANGLE + k] = y[SPIN + k]
        dy[SPIN + k] = out[6 + k]
    for k in range(n_wheels):
        i = WHEELS + WHEEL_STRIDE * k
        spin = prm[i + FREE] * y[SPIN + k]
        ax, ay, az = rotate(y[ATTITUDE:VELOCITY], prm[i + AXLE], prm[i + AXLE + 1], prm[i + AXLE + 2])
        dy[ROTATION + 3 * k] = y[TURN_RATE] + spin * ax
        dy[ROTATION + 3 * k + 1] = y[TURN_RATE + 1] + spin * ay
        dy[ROTATION + 3 * k + 2] = y[TURN_RATE + 2] + spin * az
    for i in range(ROTATION + 3 * n_wheels, WORK):
        dy[i] = 0.0
    dy[WORK] = control_power(prm, y, loads)


@kernel
def runge_kutta(prm, inputs, since_middle, h, work):
    """Advance the extended state in the workspace by the classical Runge–Kutta method of order 4.

    The stages' quaternions are scaled to unit length too: else their lengths, which differ from 1 by O(h²),
    would make the result depend on how the inertial axes lie.
    """
    y = work[_Y : _Y + EXTENDED]
    trial = work[_TRIAL : _TRIAL + EXTENDED]
    k1 = work[_K1 : _K1 + EXTENDED]
    k2 = work[_K2 : _K2 + EXTENDED]
    k3 = work[_K3 : _K3 + EXTENDED]
    k4 = work[_K4 : _K4 + EXTENDED]
    rates(prm, inputs, since_middle, y, k1, work)
    for i in range(EXTENDED):
        trial[i] = y[i] + 0.5 * h * k1[i]
    normalize(trial[ATTITUDE:VELOCITY])
    rates(prm, inputs, since_middle + 0.5 * h, trial, k2, work)
    for i in range(EXTENDED):
        trial[i] = y[i] + 0.5 * h * k2[i]
    normalize(trial[ATTITUDE:VELOCITY])
    rates(prm, inputs, since_middle + 0.5 * h, trial, k3, work)
    for i in range(EXTENDED):
        trial[i] = y[i] + h * k3[i]
    normalize(trial[ATTITUDE:VELOCITY])
    rates(prm, inputs, since_middle + h, trial, k4, work)
    for i in range(EXTENDED):
        y[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
    normalize(y[ATTITUDE:VELOCITY])


@kernel
def add_to_means(prm, y, weight, rate_weight, memory, motion):
    """Add a node of the corrected trapezoidal rule to the means of every wheel.

    The mean over an inner step of a motion known at its ends is (x0 + x1)/2 + h/12 (v0 - v1), of order 4;
    in their sum the velocities cancel but at the two ends of the macro step.
    """
    for k in range(int(prm[N_WHEELS])):
        wheel_motion(prm, y, k, motion)
        ax, ay, az = motion[3], motion[4], motion[5]
        wx, wy, wz = motion[9], motion[10], motion[11]
        m = MEMORY + WHEEL_MEMORY * k
        for i in range(3):
            memory[m + POSITION_MEAN + i] += weight * motion[i] + rate_weight * motion[6 + i]
            memory[m + TURNED_MEAN + i] += weight * y[ROTATION + 3 * k + i] + rate_weight * motion[9 + i]
        memory[m + AXLE_MEAN] += weight * ax + rate_weight * (wy * az - wz * ay)
        memory[m + AXLE_MEAN + 1] += weight * ay + rate_weight * (wz * ax - wx * az)
        memory[m + AXLE_MEAN + 2] += weight * az + rate_weight * (wx * ay - wy * ax)


@kernel
def book_work(prm, inputs, start, y, step_size, memory, motion):
    """Write each wheel's rotation and add the work of its contact wrench over the macro step.

    By parts, W = F·Δx + Ḟ·(H/2 (x0 + x1) - H x̄) is the integral of (F + Ḟ (tau - t - H/2))·v; moments alike.
    """
    for k in range(int(prm[N_WHEELS])):
        wheel_motion(prm, y, k, motion)
        m = MEMORY + WHEEL_MEMORY * k
        j = BODY_INPUTS + WHEEL_INPUTS * k
        for i in range(3):
            x0, x1, mean = start[3 * k + i], motion[i], memory[m + POSITION_MEAN + i]
            angle, angle_mean = y[ROTATION + 3 * k + i], memory[m + TURNED_MEAN + i]
            memory[m + TURNED + i] = angle
            memory[m + WHEEL_WORK] += inputs[j + FORCE + i] * (x1 - x0) + inputs[j + MOMENT + i] * angle
            memory[m + WHEEL_WORK] += inputs[j + FORCE_RATE + i] * step_size * (0.5 * (x0 + x1) - mean)
            memory[m + WHEEL_WORK] += inputs[j + MOMENT_RATE + i] * step_size * (0.5 * angle - angle_mean)


@kernel
def restart_means(prm, state, work):
    """Load the extended state; clear the means; remember where the wheels are."""
    y = work[_Y : _Y + EXTENDED]
    memory = work[_MEMORY:WORKSPACE]
    motion = work[_MOTION:_START]
    for i in range(RIGID):
        y[i] = state[i]
    for i in range(ROTATION, WORK):
        y[i] = 0.0
    y[WORK] = state[CONTROL_WORK]
    for i in range(RIGID, state.size):
        memory[i] = state[i]
    for k in range(int(prm[N_WHEELS])):
        wheel_motion(prm, state, k, motion)
        for i in range(3):
            work[_START + 3 * k + i] = motion[i]
        for i in range(WHEEL_WORK):
            memory[MEMORY + WHEEL_MEMORY * k + i] = 0.0


@kernel
def step(prm, inputs, state, step_size, n_inner, work):
    """Advance the module state by `step_size` in `n_inner` equal inner steps; return the status.

    Nothing is changed unless the status is `DONE`.
    """
    h = step_size / n_inner
    y = work[_Y : _Y + EXTENDED]
    memory = work[_MEMORY:WORKSPACE]
    motion = work[_MOTION:_START]
    restart_means(prm, state, work)
    for i in range(n_inner):
        if i == 0:
            add_to_means(prm, y, 0.5 / n_inner, h / (12.0 * n_inner), memory, motion)
        else:
            add_to_means(prm, y, 1.0 / n_inner, 0.0, memory, motion)
        if h * h * (y[TURN_RATE] ** 2 + y[TURN_RATE + 1] ** 2 + y[TURN_RATE + 2] ** 2) > 1.0:
            return TURNS_TOO_FAST
        runge_kutta(prm, inputs, i * h - 0.5 * step_size, h, work)
        follow_euler(y[ATTITUDE:VELOCITY], memory[ANGLES:CONTROL_WORK])
    add_to_means(prm, y, 0.5 / n_inner, -h / (12.0 * n_inner), memory, motion)
    book_work(prm, inputs, work[_START:_MEMORY], y, step_size, memory, motion)
    for i in range(RIGID):
        memory[i] = y[i]
    memory[CONTROL_WORK] = y[WORK]
    for i in range(state.size):
        if not math.isfinite(memory[i]):
            return NOT_FINITE
    for i in range(state.size):
        state[i] = memory[i]
    return DONE


@kernel
def outputs(prm, state, out):
    """Write the outputs (15 + 25 n,) in the order of the variable table."""
    body_motion(prm, state, out[0:6])
    for i in range(3):
        out[6 + i] = state[ANGLES + i]
        out[9 + i] = state[TURN_RATE + i]
    out[12] = kinetic_energy(prm, state)
    out[13] = prm[MASS] * prm[GRAVITY] * state[POSITION + 2]
    out[14] = state[CONTROL_WORK]
    for k in range(int(prm[N_WHEELS])):
        o = BODY_OUTPUTS + WHEEL_OUTPUTS * k
        wheel_motion(prm, state, k, out[o : o + 12])
        for i in range(WHEEL_MEMORY):
            out[o + 12 + i] = state[MEMORY + WHEEL_MEMORY * k + i]
