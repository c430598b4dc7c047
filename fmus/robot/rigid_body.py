"""Rigid robot with up to four wheels, each fixed to the body or free to spin (kernels).

Vectors are inertial unless said otherwise; `_B` marks components in the body frame.

Rigid-body state (21,)
    x_G 0:3, quaternion (w, x, y, z) of R_IB 3:7, v_G 7:10, w_IB 10:13,
    spin angle of the wheels relative to the body 13:17, spin rate 17:21.
Loads at an instant (4 + 7 n,)
    thrust along z_B at b, torque in B 1:4, then for each wheel force 0:3, moment about the wheel centre 3:6,
    drive torque 6 (of the body on the wheel, about the axle).
Inputs over a macro step (4 + 13 n,)
    the same, and for each wheel the slopes of force 7:10 and moment 10:13.
Module state (25 + 13 n,)
    rigid-body state 0:21; roll, pitch, yaw without jumps 21:24; work of the control 24;
    for each wheel position_mean 0:3, axle_mean 3:6, rotation 6:9, rotation_mean 9:12, work 12.

Equations: README of this folder.
"""

from __future__ import annotations

import math

from fmus.kernels.jit import kernel
from fmus.kernels.rotations import follow_euler, normalize, quaternion_rate, rotate, rotate_back

MAX_WHEELS = 4
RIGID = 21

# Places in the parameters `prm` of all kernels.
MASS, GRAVITY, N_WHEELS = 0, 1, 2
B_FROM_G = 3  # position of b relative to G, in B
INERTIA = 6  # tensor about G in B, wheels included as if fixed: 9 entries, row by row
COMPLIANCE = 15  # inverse of the tensor less the free wheels' spin inertia: 9 entries
WHEELS = 24  # for each wheel:
WHEEL_STRIDE = 8
MOUNT, AXLE, SPIN_INERTIA, FREE = 0, 3, 6, 7  # centre relative to G and axle in B; kg m²; 1 if free to spin
N_PARAMETERS = WHEELS + WHEEL_STRIDE * MAX_WHEELS

# Sizes of what the module keeps, shows and takes.
BODY_LOADS, WHEEL_LOADS, WHEEL_INPUTS = 4, 7, 13
ANGLES, CONTROL_WORK, MEMORY = 21, 24, 25
WHEEL_MEMORY = 13
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
def wheel_motion(prm, state, k, out):
    """Write the motion of wheel k (from 0) to `out` (12,): centre, axle, velocity, angular velocity."""
    q = state[3:7]
    i = WHEELS + WHEEL_STRIDE * k
    rx, ry, rz = rotate(q, prm[i + MOUNT], prm[i + MOUNT + 1], prm[i + MOUNT + 2])
    ax, ay, az = rotate(q, prm[i + AXLE], prm[i + AXLE + 1], prm[i + AXLE + 2])
    wx, wy, wz = state[10], state[11], state[12]
    spin = prm[i + FREE] * state[17 + k]
    out[0] = state[0] + rx
    out[1] = state[1] + ry
    out[2] = state[2] + rz
    out[3] = ax
    out[4] = ay
    out[5] = az
    out[6] = state[7] + wy * rz - wz * ry
    out[7] = state[8] + wz * rx - wx * rz
    out[8] = state[9] + wx * ry - wy * rx
    out[9] = wx + spin * ax
    out[10] = wy + spin * ay
    out[11] = wz + spin * az


@kernel
def body_motion(prm, state, out):
    """Write position and velocity of point b to `out` (6,)."""
    rx, ry, rz = rotate(state[3:7], prm[B_FROM_G], prm[B_FROM_G + 1], prm[B_FROM_G + 2])
    wx, wy, wz = state[10], state[11], state[12]
    out[0] = state[0] + rx
    out[1] = state[1] + ry
    out[2] = state[2] + rz
    out[3] = state[7] + wy * rz - wz * ry
    out[4] = state[8] + wz * rx - wx * rz
    out[5] = state[9] + wx * ry - wy * rx


@kernel
def angular_momentum_B(prm, state, wx, wy, wz):
    """Return the angular momentum about G in B, free wheels included; w_IB is given in B."""
    j = INERTIA
    hx = prm[j] * wx + prm[j + 1] * wy + prm[j + 2] * wz
    hy = prm[j + 3] * wx + prm[j + 4] * wy + prm[j + 5] * wz
    hz = prm[j + 6] * wx + prm[j + 7] * wy + prm[j + 8] * wz
    for k in range(int(prm[N_WHEELS])):
        i = WHEELS + WHEEL_STRIDE * k
        spin = prm[i + FREE] * prm[i + SPIN_INERTIA] * state[17 + k]
        hx += spin * prm[i + AXLE]
        hy += spin * prm[i + AXLE + 1]
        hz += spin * prm[i + AXLE + 2]
    return hx, hy, hz


@kernel
def accelerations(prm, state, force, moment, wheel_torque, out):
    """Write dv_G, dw_IB and the wheels' spin accelerations to `out` (10,).

    Parameters
    ----------
    force : (3,), N, resultant of all external forces, weight included
    moment : (3,), N m, resultant about G of all external loads on body and wheels together
    wheel_torque : (4,), N m, on each wheel about its axle: contact moment and drive; no effect if braked
    """
    q = state[3:7]
    wx, wy, wz = rotate_back(q, state[10], state[11], state[12])
    hx, hy, hz = angular_momentum_B(prm, state, wx, wy, wz)
    mx, my, mz = rotate_back(q, moment[0], moment[1], moment[2])
    mx -= wy * hz - wz * hy
    my -= wz * hx - wx * hz
    mz -= wx * hy - wy * hx
    for k in range(int(prm[N_WHEELS])):
        i = WHEELS + WHEEL_STRIDE * k
        torque = prm[i + FREE] * wheel_torque[k]
        mx -= torque * prm[i + AXLE]
        my -= torque * prm[i + AXLE + 1]
        mz -= torque * prm[i + AXLE + 2]
    c = COMPLIANCE
    bx = prm[c] * mx + prm[c + 1] * my + prm[c + 2] * mz
    by = prm[c + 3] * mx + prm[c + 4] * my + prm[c + 5] * mz
    bz = prm[c + 6] * mx + prm[c + 7] * my + prm[c + 8] * mz
    for i in range(3):
        out[i] = force[i] / prm[MASS]
    out[3], out[4], out[5] = rotate(q, bx, by, bz)
    for k in range(MAX_WHEELS):
        out[6 + k] = 0.0
    for k in range(int(prm[N_WHEELS])):
        i = WHEELS + WHEEL_STRIDE * k
        if prm[i + FREE] > 0.0:
            along = prm[i + AXLE] * bx + prm[i + AXLE + 1] * by + prm[i + AXLE + 2] * bz
            out[6 + k] = wheel_torque[k] / prm[i + SPIN_INERTIA] - along


@kernel
def resultants(prm, state, loads, force, moment, wheel_torque):
    """Write what `accelerations` takes, from the loads at an instant and the weight."""
    q = state[3:7]
    fx, fy, fz = rotate(q, 0.0, 0.0, loads[0])
    rx, ry, rz = rotate(q, prm[B_FROM_G], prm[B_FROM_G + 1], prm[B_FROM_G + 2])
    mx, my, mz = rotate(q, loads[1], loads[2], loads[3])
    force[0] = fx
    force[1] = fy
    force[2] = fz - prm[MASS] * prm[GRAVITY]
    moment[0] = mx + ry * fz - rz * fy
    moment[1] = my + rz * fx - rx * fz
    moment[2] = mz + rx * fy - ry * fx
    for k in range(int(prm[N_WHEELS])):
        i = WHEELS + WHEEL_STRIDE * k
        j = BODY_LOADS + WHEEL_LOADS * k
        rx, ry, rz = rotate(q, prm[i + MOUNT], prm[i + MOUNT + 1], prm[i + MOUNT + 2])
        ax, ay, az = rotate(q, prm[i + AXLE], prm[i + AXLE + 1], prm[i + AXLE + 2])
        fx, fy, fz = loads[j], loads[j + 1], loads[j + 2]
        force[0] += fx
        force[1] += fy
        force[2] += fz
        moment[0] += loads[j + 3] + ry * fz - rz * fy
        moment[1] += loads[j + 4] + rz * fx - rx * fz
        moment[2] += loads[j + 5] + rx * fy - ry * fx
        wheel_torque[k] = loads[j + 6] + ax * loads[j + 3] + ay * loads[j + 4] + az * loads[j + 5]


@kernel
def control_power(prm, state, loads):
    """Return the power (W) of thrust, control torque and wheel drives at an instant."""
    q = state[3:7]
    _, _, vz = rotate_back(q, state[7], state[8], state[9])
    wx, wy, wz = rotate_back(q, state[10], state[11], state[12])
    v_b = vz + wx * prm[B_FROM_G + 1] - wy * prm[B_FROM_G]
    power = loads[0] * v_b + loads[1] * wx + loads[2] * wy + loads[3] * wz
    for k in range(int(prm[N_WHEELS])):
        free = prm[WHEELS + WHEEL_STRIDE * k + FREE]
        power += free * loads[BODY_LOADS + WHEEL_LOADS * k + 6] * state[17 + k]
    return power


@kernel
def kinetic_energy(prm, state):
    """Return the kinetic energy (J) of body and wheels."""
    wx, wy, wz = rotate_back(state[3:7], state[10], state[11], state[12])
    hx, hy, hz = angular_momentum_B(prm, state, wx, wy, wz)
    energy = 0.5 * prm[MASS] * (state[7] ** 2 + state[8] ** 2 + state[9] ** 2)
    energy += 0.5 * (wx * hx + wy * hy + wz * hz)
    for k in range(int(prm[N_WHEELS])):
        i = WHEELS + WHEEL_STRIDE * k
        along = prm[i + AXLE] * wx + prm[i + AXLE + 1] * wy + prm[i + AXLE + 2] * wz
        spin = state[17 + k]
        energy += 0.5 * prm[i + FREE] * prm[i + SPIN_INERTIA] * spin * (along + spin)
    return energy


@kernel
def loads_at(inputs, n_wheels, since_middle, loads):
    """Write the loads at `since_middle` (s) after the middle of the macro step."""
    for i in range(BODY_LOADS):
        loads[i] = inputs[i]
    for k in range(n_wheels):
        i = BODY_LOADS + WHEEL_INPUTS * k
        j = BODY_LOADS + WHEEL_LOADS * k
        for c in range(6):
            loads[j + c] = inputs[i + c] + inputs[i + WHEEL_LOADS + c] * since_middle
        loads[j + 6] = inputs[i + 6]


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
    quaternion_rate(y[3:7], y[10], y[11], y[12], dy[3:7])
    for i in range(3):
        dy[i] = y[7 + i]
        dy[7 + i] = out[i]
        dy[10 + i] = out[3 + i]
    for k in range(MAX_WHEELS):
        dy[13 + k] = y[17 + k]
        dy[17 + k] = out[6 + k]
    for k in range(n_wheels):
        i = WHEELS + WHEEL_STRIDE * k
        spin = prm[i + FREE] * y[17 + k]
        ax, ay, az = rotate(y[3:7], prm[i + AXLE], prm[i + AXLE + 1], prm[i + AXLE + 2])
        dy[ROTATION + 3 * k] = y[10] + spin * ax
        dy[ROTATION + 3 * k + 1] = y[11] + spin * ay
        dy[ROTATION + 3 * k + 2] = y[12] + spin * az
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
    normalize(trial[3:7])
    rates(prm, inputs, since_middle + 0.5 * h, trial, k2, work)
    for i in range(EXTENDED):
        trial[i] = y[i] + 0.5 * h * k2[i]
    normalize(trial[3:7])
    rates(prm, inputs, since_middle + 0.5 * h, trial, k3, work)
    for i in range(EXTENDED):
        trial[i] = y[i] + h * k3[i]
    normalize(trial[3:7])
    rates(prm, inputs, since_middle + h, trial, k4, work)
    for i in range(EXTENDED):
        y[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
    normalize(y[3:7])


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
            memory[m + i] += weight * motion[i] + rate_weight * motion[6 + i]
            memory[m + 9 + i] += weight * y[ROTATION + 3 * k + i] + rate_weight * motion[9 + i]
        memory[m + 3] += weight * ax + rate_weight * (wy * az - wz * ay)
        memory[m + 4] += weight * ay + rate_weight * (wz * ax - wx * az)
        memory[m + 5] += weight * az + rate_weight * (wx * ay - wy * ax)


@kernel
def book_work(prm, inputs, start, y, step_size, memory, motion):
    """Write each wheel's rotation and add the work of its contact wrench over the macro step.

    By parts, W = F·Δx + Ḟ·(H/2 (x0 + x1) - H x̄) is the integral of (F + Ḟ (tau - t - H/2))·v; moments alike.
    """
    for k in range(int(prm[N_WHEELS])):
        wheel_motion(prm, y, k, motion)
        m = MEMORY + WHEEL_MEMORY * k
        j = BODY_LOADS + WHEEL_INPUTS * k
        for i in range(3):
            x0, x1, mean = start[3 * k + i], motion[i], memory[m + i]
            angle, angle_mean = y[ROTATION + 3 * k + i], memory[m + 9 + i]
            memory[m + 6 + i] = angle
            memory[m + 12] += inputs[j + i] * (x1 - x0) + inputs[j + 3 + i] * angle
            memory[m + 12] += inputs[j + 7 + i] * step_size * (0.5 * (x0 + x1) - mean)
            memory[m + 12] += inputs[j + 10 + i] * step_size * (0.5 * angle - angle_mean)


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
        for i in range(12):
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
        if h * h * (y[10] ** 2 + y[11] ** 2 + y[12] ** 2) > 1.0:
            return TURNS_TOO_FAST
        runge_kutta(prm, inputs, i * h - 0.5 * step_size, h, work)
        follow_euler(y[3:7], memory[ANGLES:CONTROL_WORK])
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
        out[9 + i] = state[10 + i]
    out[12] = kinetic_energy(prm, state)
    out[13] = prm[MASS] * prm[GRAVITY] * state[2]
    out[14] = state[CONTROL_WORK]
    for k in range(int(prm[N_WHEELS])):
        o = BODY_OUTPUTS + WHEEL_OUTPUTS * k
        wheel_motion(prm, state, k, out[o : o + 12])
        for i in range(WHEEL_MEMORY):
            out[o + 12 + i] = state[MEMORY + WHEEL_MEMORY * k + i]
