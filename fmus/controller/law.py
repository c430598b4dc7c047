"""The law of the set-down controller at a sampling instant, and how its commands are held between two of them (kernels).

Inputs (16,)
    position of b 0:3, its velocity 3:6, roll, pitch, yaw 6:9, angular velocity (inertial) 9:12, normal force of up to
    four contacts 12:16.
Memory (9,)
    number of the next sampling instant, height at the start, since when the wheels press (-1: they do not), time of
    touch-down (-1: not yet), thrust at touch-down, then the commands: thrust, torque in B 6:9.
Module state (19,)
    time 0; the memory up to the last instant 1:10; the memory with what is sampled now, if anything is, 10:19.

Equations: README of this folder.
"""

from __future__ import annotations

import math

from fmus.kernels.jit import kernel
from fmus.kernels.rotations import from_euler, rotate_back

# Places in the inputs.
POSITION, VELOCITY, ANGLES, TURN_RATE, FORCES, N_INPUTS = 0, 3, 6, 9, 12, 16
MAX_WHEELS = N_INPUTS - FORCES

# Places in the memory.
NEXT, START_HEIGHT, PRESSED_SINCE, TOUCH_TIME, TOUCH_THRUST, THRUST, TORQUE, N_MEMORY = 0, 1, 2, 3, 4, 5, 6, 9
NOT_YET = -1.0

# Places in the module's state.
TIME, BEFORE, NOW = 0, 1, 1 + N_MEMORY
N_STATE = NOW + N_MEMORY

# Places in the parameters `prm` of all kernels, in the order of the variable table.
MASS, GRAVITY, INERTIA, SAMPLE_TIME, DESCENT, HEAVE, HEAVE_DAMPING = 0, 1, 2, 5, 6, 7, 8
ATTITUDE, ATTITUDE_DAMPING, MAX_THRUST, ARM, YAW_ARM, MAX_TORQUE = 9, 10, 11, 12, 13, 14
TOUCH_SHARE, TOUCH_DELAY, RAMP_TIME, FINAL_SHARE, KEPT, N_PARAMETERS = 15, 16, 17, 18, 19, 20

APPROACH, RAMP, DOWN = 0, 1, 2
"""Phases."""
STEEPEST = 0.5
"""Least cosine of the tilt that the thrust makes up for: of 60 degrees."""
SAME_TIME = 1e-6
"""Part of the sample time by which an instant may be missed through round-off."""


@kernel
def is_due(prm, t, memory):
    """Return whether the next sampling instant has come at the time `t`."""
    return t >= (memory[NEXT] - SAME_TIME) * prm[SAMPLE_TIME]


@kernel
def ramp(x):
    """Return the smooth step from 0 to 1 over 0 <= x <= 1, its slope 0 at both ends."""
    x = min(1.0, max(0.0, x))
    return x * x * (3.0 - 2.0 * x)


@kernel
def phase(prm, t, memory):
    """Return the phase at the time `t`."""
    if memory[TOUCH_TIME] < 0.0:
        return APPROACH
    return RAMP if t - memory[TOUCH_TIME] < prm[RAMP_TIME] * (1.0 - SAME_TIME) else DOWN


@kernel
def feel(prm, inputs, t, memory):
    """Find touch-down: the wheels together have pressed with a share of the weight for a time."""
    if memory[TOUCH_TIME] >= 0.0:
        return
    force = 0.0
    for k in range(MAX_WHEELS):
        force += inputs[FORCES + k]
    if force <= prm[TOUCH_SHARE] * prm[MASS] * prm[GRAVITY]:
        memory[PRESSED_SINCE] = NOT_YET
        return
    if memory[PRESSED_SINCE] < 0.0:
        memory[PRESSED_SINCE] = t
    if t - memory[PRESSED_SINCE] >= prm[TOUCH_DELAY] - SAME_TIME * prm[SAMPLE_TIME]:
        memory[TOUCH_TIME], memory[TOUCH_THRUST] = t, memory[THRUST]


@kernel
def climb(prm, inputs, t, memory):
    """Return the acceleration upwards (m/s²) that brings b back to its way down."""
    reference = memory[START_HEIGHT] - prm[DESCENT] * t
    too_low, too_slow = reference - inputs[POSITION + 2], -prm[DESCENT] - inputs[VELOCITY + 2]
    return prm[HEAVE] * (prm[HEAVE] * too_low + 2.0 * prm[HEAVE_DAMPING] * too_slow)


@kernel
def thrust(prm, inputs, t, memory):
    """Return the thrust (N): on the way down it carries the robot, after touch-down it goes to its last value."""
    weight = prm[MASS] * prm[GRAVITY]
    if memory[TOUCH_TIME] >= 0.0:
        share = ramp((t - memory[TOUCH_TIME]) / prm[RAMP_TIME]) if prm[RAMP_TIME] > 0.0 else 1.0
        return memory[TOUCH_THRUST] + share * (prm[FINAL_SHARE] * weight - memory[TOUCH_THRUST])
    upright = math.cos(inputs[ANGLES]) * math.cos(inputs[ANGLES + 1])
    wanted = (weight + prm[MASS] * climb(prm, inputs, t, memory)) / max(upright, STEEPEST)
    return min(max(wanted, 0.0), prm[MAX_THRUST])


@kernel
def torque_bound(prm, total, arm):
    """Return the largest torque (N m) of rotors at a lever `arm` that push, and together with the force `total`."""
    return max(0.0, min(prm[MAX_TORQUE], arm * min(total, prm[MAX_THRUST] - total)))


@kernel
def torque(prm, inputs, total, memory, q):
    """Write the torque (3,) in B that brings roll, pitch and yaw back to zero, as far as the rotors can; q (4,) is room."""
    on = memory[TOUCH_TIME] < 0.0 or prm[KEPT] > 0.0
    from_euler(inputs[ANGLES], inputs[ANGLES + 1], inputs[ANGLES + 2], q)
    rates = rotate_back(q, inputs[TURN_RATE], inputs[TURN_RATE + 1], inputs[TURN_RATE + 2])
    for i in range(3):
        wanted = prm[ATTITUDE] * inputs[ANGLES + i] + 2.0 * prm[ATTITUDE_DAMPING] * rates[i]
        wanted *= -prm[INERTIA + i] * prm[ATTITUDE]
        most = torque_bound(prm, total, prm[YAW_ARM] if i == 2 else prm[ARM]) if on else 0.0
        memory[TORQUE + i] = min(max(wanted, -most), most)


@kernel
def evaluate(prm, inputs, state, q):
    """Write the memory as it is with the `inputs` at the time of the state; where no instant has come nothing changes.

    It may be called again with other inputs at the same time: what was before the instant is kept until the next `move`.
    """
    before, now, t = state[BEFORE:NOW], state[NOW:N_STATE], state[TIME]
    for i in range(N_MEMORY):
        now[i] = before[i]
    if not is_due(prm, t, before):
        return
    if before[NEXT] <= 0.0:
        now[START_HEIGHT] = inputs[POSITION + 2] + prm[DESCENT] * t
    feel(prm, inputs, t, now)
    now[THRUST] = thrust(prm, inputs, t, now)
    torque(prm, inputs, now[THRUST], now, q)
    now[NEXT] = math.floor(t / prm[SAMPLE_TIME] + SAME_TIME) + 1.0


@kernel
def move(state, t):
    """Go on to the time `t`: what was sampled stands."""
    for i in range(N_MEMORY):
        state[BEFORE + i] = state[NOW + i]
    state[TIME] = t
