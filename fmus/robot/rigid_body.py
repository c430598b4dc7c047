"""Rigid robot with up to four wheels, each fixed to the body or free to spin, at an instant (kernels).

Vectors are inertial unless said otherwise; `_B` marks components in the body frame.

Rigid-body state (21,)
    x_G 0:3, quaternion (w, x, y, z) of R_IB 3:7, v_G 7:10, w_IB 10:13,
    spin angle of the wheels relative to the body 13:17, spin rate 17:21.
Loads at an instant (4 + 7 n,)
    thrust along z_B at b, torque in B 1:4, then for each wheel force 0:3, moment about the wheel centre 3:6,
    drive torque 6 (of the body on the wheel, about the axle).

Equations: README of this folder.
"""

from __future__ import annotations

from fmus.kernels.jit import kernel
from fmus.kernels.rotations import rotate, rotate_back

MAX_WHEELS = 4

# Places in the rigid-body state.
POSITION, ATTITUDE, VELOCITY, TURN_RATE, SPIN_ANGLE, SPIN = 0, 3, 7, 10, 13, 17
RIGID = 21

# Places in the loads; those of a wheel behind the body's, `WHEEL_LOADS` each.
THRUST, TORQUE, BODY_LOADS = 0, 1, 4
FORCE, MOMENT, DRIVE, WHEEL_LOADS = 0, 3, 6, 7

# Places in the parameters `prm` of all kernels.
MASS, GRAVITY, N_WHEELS = 0, 1, 2
B_FROM_G = 3  # position of b relative to G, in B
INERTIA = 6  # tensor about G in B, wheels included as if fixed: 9 entries, row by row
COMPLIANCE = 15  # inverse of the tensor less the free wheels' spin inertia: 9 entries
WHEELS = 24  # for each wheel:
WHEEL_STRIDE = 8
MOUNT, AXLE, SPIN_INERTIA, FREE = 0, 3, 6, 7  # centre relative to G and axle in B; kg m²; 1 if free to spin
N_PARAMETERS = WHEELS + WHEEL_STRIDE * MAX_WHEELS


@kernel
def wheel_motion(prm, state, k, out):
    """Write the motion of wheel k (from 0) to `out` (12,): centre, axle, velocity, angular velocity."""
    q = state[ATTITUDE:VELOCITY]
    i = WHEELS + WHEEL_STRIDE * k
    rx, ry, rz = rotate(q, prm[i + MOUNT], prm[i + MOUNT + 1], prm[i + MOUNT + 2])
    ax, ay, az = rotate(q, prm[i + AXLE], prm[i + AXLE + 1], prm[i + AXLE + 2])
    wx, wy, wz = state[TURN_RATE], state[TURN_RATE + 1], state[TURN_RATE + 2]
    spin = prm[i + FREE] * state[SPIN + k]
    out[0] = state[POSITION] + rx
    out[1] = state[POSITION + 1] + ry
    out[2] = state[POSITION + 2] + rz
    out[3] = ax
    out[4] = ay
    out[5] = az
    out[6] = state[VELOCITY] + wy * rz - wz * ry
    out[7] = state[VELOCITY + 1] + wz * rx - wx * rz
    out[8] = state[VELOCITY + 2] + wx * ry - wy * rx
    out[9] = wx + spin * ax
    out[10] = wy + spin * ay
    out[11] = wz + spin * az


@kernel
def body_motion(prm, state, out):
    """Write position and velocity of point b to `out` (6,)."""
    rx, ry, rz = rotate(state[ATTITUDE:VELOCITY], prm[B_FROM_G], prm[B_FROM_G + 1], prm[B_FROM_G + 2])
    wx, wy, wz = state[TURN_RATE], state[TURN_RATE + 1], state[TURN_RATE + 2]
    out[0] = state[POSITION] + rx
    out[1] = state[POSITION + 1] + ry
    out[2] = state[POSITION + 2] + rz
    out[3] = state[VELOCITY] + wy * rz - wz * ry
    out[4] = state[VELOCITY + 1] + wz * rx - wx * rz
    out[5] = state[VELOCITY + 2] + wx * ry - wy * rx


@kernel
def angular_momentum_B(prm, state, wx, wy, wz):
    """Return the angular momentum about G in B, free wheels included; w_IB is given in B."""
    j = INERTIA
    hx = prm[j] * wx + prm[j + 1] * wy + prm[j + 2] * wz
    hy = prm[j + 3] * wx + prm[j + 4] * wy + prm[j + 5] * wz
    hz = prm[j + 6] * wx + prm[j + 7] * wy + prm[j + 8] * wz
    for k in range(int(prm[N_WHEELS])):
        i = WHEELS + WHEEL_STRIDE * k
        spin = prm[i + FREE] * prm[i + SPIN_INERTIA] * state[SPIN + k]
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
    q = state[ATTITUDE:VELOCITY]
    wx, wy, wz = rotate_back(q, state[TURN_RATE], state[TURN_RATE + 1], state[TURN_RATE + 2])
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
    q = state[ATTITUDE:VELOCITY]
    fx, fy, fz = rotate(q, 0.0, 0.0, loads[THRUST])
    rx, ry, rz = rotate(q, prm[B_FROM_G], prm[B_FROM_G + 1], prm[B_FROM_G + 2])
    mx, my, mz = rotate(q, loads[TORQUE], loads[TORQUE + 1], loads[TORQUE + 2])
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
        fx, fy, fz = loads[j + FORCE], loads[j + FORCE + 1], loads[j + FORCE + 2]
        mx, my, mz = loads[j + MOMENT], loads[j + MOMENT + 1], loads[j + MOMENT + 2]
        force[0] += fx
        force[1] += fy
        force[2] += fz
        moment[0] += mx + ry * fz - rz * fy
        moment[1] += my + rz * fx - rx * fz
        moment[2] += mz + rx * fy - ry * fx
        wheel_torque[k] = loads[j + DRIVE] + ax * mx + ay * my + az * mz


@kernel
def control_power(prm, state, loads):
    """Return the power (W) of thrust, control torque and wheel drives at an instant."""
    q = state[ATTITUDE:VELOCITY]
    _, _, vz = rotate_back(q, state[VELOCITY], state[VELOCITY + 1], state[VELOCITY + 2])
    wx, wy, wz = rotate_back(q, state[TURN_RATE], state[TURN_RATE + 1], state[TURN_RATE + 2])
    v_b = vz + wx * prm[B_FROM_G + 1] - wy * prm[B_FROM_G]
    power = loads[THRUST] * v_b
    power += loads[TORQUE] * wx
    power += loads[TORQUE + 1] * wy
    power += loads[TORQUE + 2] * wz
    for k in range(int(prm[N_WHEELS])):
        free = prm[WHEELS + WHEEL_STRIDE * k + FREE]
        power += free * loads[BODY_LOADS + WHEEL_LOADS * k + DRIVE] * state[SPIN + k]
    return power


@kernel
def kinetic_energy(prm, state):
    """Return the kinetic energy (J) of body and wheels."""
    wx, wy, wz = rotate_back(state[ATTITUDE:VELOCITY], state[TURN_RATE], state[TURN_RATE + 1], state[TURN_RATE + 2])
    hx, hy, hz = angular_momentum_B(prm, state, wx, wy, wz)
    energy = 0.5 * prm[MASS] * (state[VELOCITY] ** 2 + state[VELOCITY + 1] ** 2 + state[VELOCITY + 2] ** 2)
    energy += 0.5 * (wx * hx + wy * hy + wz * hz)
    for k in range(int(prm[N_WHEELS])):
        i = WHEELS + WHEEL_STRIDE * k
        along = prm[i + AXLE] * wx + prm[i + AXLE + 1] * wy + prm[i + AXLE + 2] * wz
        spin = state[SPIN + k]
        energy += 0.5 * prm[i + FREE] * prm[i + SPIN_INERTIA] * spin * (along + spin)
    return energy
