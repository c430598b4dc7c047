"""What acts and is seen at the ports: loads over a macro step, the motion there, the work done."""

from __future__ import annotations

import numpy as np

from fmus.cable.assembly import add_load, curvature, interpolate
from fmus.cable.state import N_PORTS, NOT_FINITE, OFF_CABLE, OK, WORK
from fmus.kernels.jit import kernel

# Places in a row of the loads `ports` (N_PORTS, 14); all but the first and the last are those of three components.
# S is where the port stands: at the start of the macro step, in its middle while it is made, at its end afterwards.
S, FORCE, MOMENT, FORCE_RATE, MOMENT_RATE, S_RATE = 0, 1, 4, 7, 10, 13
N_INPUTS = 14

# Places in a row of what is shown (N_PORTS, 25): position, tangent, velocity, tangent rate; then
MEANS, PORT_WORK, CURVATURE, TURN = 12, 18, 19, 22
N_SHOWN = 25
# Places in a row of the means in the workspace (N_PORTS, 12): position, tangent; then, as integrals over the macro step,
# the tangent's moment about its middle, and the material's rate of the tangent.
TILT, TURNED = 6, 9


@kernel
def refusal(model, ports, h):
    """Return OK, or why a macro step `h` under the loads `ports` cannot be made."""
    for k in range(N_PORTS):
        for i in range(N_INPUTS):
            if not abs(ports[k, i]) < np.inf:
                return NOT_FINITE
        end = ports[k, S] + ports[k, S_RATE] * h
        if not 0.0 <= ports[k, S] <= model.s[-1] or not 0.0 <= end <= model.s[-1]:
            return OFF_CABLE
    return OK


@kernel
def move_on(ports, duration):
    """Let every port move along the cable for `duration` seconds."""
    for k in range(N_PORTS):
        ports[k, S] += ports[k, S_RATE] * duration


@kernel
def arc(ports, k, offset):
    """Return where port k stands `offset` seconds from the middle of the macro step, in which S is its place there."""
    return ports[k, S] + ports[k, S_RATE] * offset


@kernel
def port_loads(model, q, ports, offset, work):
    """Write what the ports apply at `offset` seconds from the middle of the macro step to ``work.external``."""
    work.external[:] = 0.0
    for k in range(N_PORTS):
        loaded = False
        for i in range(3):
            work.load[0, i] = ports[k, FORCE + i] + ports[k, FORCE_RATE + i] * offset
            work.load[1, i] = ports[k, MOMENT + i] + ports[k, MOMENT_RATE + i] * offset
            loaded = loaded or work.load[0, i] != 0.0 or work.load[1, i] != 0.0
        if loaded:
            add_load(model, q, arc(ports, k, offset), work.load[0], work.load[1], work.shape, work.external)


@kernel
def moment_work(model, q, v, ports, offset, weight, sums, work):
    """Add to the work of each port what its moment does: `weight` times the power at a stage.

    Of a port that moves along, the material's rate of the tangent is added up besides.
    """
    for k in range(N_PORTS):
        moment = work.load[1]
        loaded = ports[k, S_RATE] != 0.0
        for i in range(3):
            moment[i] = ports[k, MOMENT + i] + ports[k, MOMENT_RATE + i] * offset
            loaded = loaded or moment[i] != 0.0
        if not loaded:
            continue
        s = arc(ports, k, offset)
        interpolate(model, q, s, work.shape, work.point[0])
        interpolate(model, v, s, work.shape, work.point[1])
        g, gd = work.point[0, 3:6], work.point[1, 3:6]
        square = g[0] * g[0] + g[1] * g[1] + g[2] * g[2]
        power = moment[0] * (g[1] * gd[2] - g[2] * gd[1])
        power += moment[1] * (g[2] * gd[0] - g[0] * gd[2])
        power += moment[2] * (g[0] * gd[1] - g[1] * gd[0])
        sums[WORK + k] += weight * power / square
        for i in range(3):
            work.means[k, TURNED + i] += weight * gd[i]


@kernel
def port_motion(model, state, s, shape, out):
    """Write position, tangent, velocity and tangent rate at arc length `s` to `out` (12,)."""
    n = model.weight.size
    interpolate(model, state[:n], s, shape, out[0:6])
    interpolate(model, state[n : 2 * n], s, shape, out[6:12])


@kernel
def _moving_motion(model, state, ports, k, offset, work, out):
    """Write position and tangent of port k at `offset` from the middle of the step, and their rates as it moves, (12,).

    On a port that moves along at the rate ds/dt they change by that times dr/ds and d²r/ds² more than the material does.
    """
    s, rate, n = arc(ports, k, offset), ports[k, S_RATE], model.weight.size
    port_motion(model, state, s, work.shape, out)
    if rate == 0.0:
        return
    curvature(model, state[:n], s, work.shape, work.load[0])
    for i in range(3):
        out[6 + i] += rate * out[3 + i]
        out[9 + i] += rate * work.load[0, i]


@kernel
def restart_means(model, state, ports, h, work):
    """Clear the time means, and remember where the ports are at the start of a macro step `h`."""
    work.means[:, :] = 0.0
    for k in range(N_PORTS):
        _moving_motion(model, state, ports, k, -0.5 * h, work, work.start[k])
        for i in range(6):
            work.first[k, i] = work.start[k, i]


@kernel
def add_to_means(model, state, ports, step, end, h, work):
    """Add an inner step that ends at `end`, from the middle of the macro step `h`, to the means of position and tangent.

    Over each inner step it is (x0 + x1)/2 + step/12 (x0' - x1'), the mean of the cubic through its ends. So is the
    tangent's moment about the middle of the macro step, which the work of a force whose port moves asks for.
    """
    point = work.point.reshape(12)
    for k in range(N_PORTS):
        start = work.start[k]
        _moving_motion(model, state, ports, k, end, work, point)
        for i in range(6):
            mean = 0.5 * (start[i] + point[i]) + step / 12.0 * (start[6 + i] - point[6 + i])
            work.means[k, i] += mean * step / h
            if i >= 3:
                tilt = (point[i] - start[i]) / 10.0 - step / 120.0 * (start[6 + i] + point[6 + i])
                work.means[k, TILT + i - 3] += step * (mean * (end - 0.5 * step) + step * tilt)
        for i in range(12):
            start[i] = point[i]


@kernel
def force_work(ports, h, sums, work):
    """Add to the work of each port what its force has done over the macro step `h`.

    By parts, F·Δx + Ḟ·(h/2 (x0 + x1) - h x̄) is the integral of the power of a force with mean F and slope Ḟ. Where the
    port moves along, its way over the tangent is no motion of the material: it is taken off.
    """
    for k in range(N_PORTS):
        for i in range(3):
            force, rate, along = ports[k, FORCE + i], ports[k, FORCE_RATE + i], ports[k, S_RATE]
            first, end = work.first[k, i], work.start[k, i]
            way = end - first - along * h * work.means[k, 3 + i]
            tilt = h * (0.5 * (first + end) - work.means[k, i]) - along * work.means[k, TILT + i]
            sums[WORK + k] += force * way + rate * tilt


@kernel
def show_ports(model, state, ports, shown, work):
    """Write position, tangent, velocity, tangent rate and d²r/ds² of every port to `shown` (N_PORTS, 25)."""
    n = model.weight.size
    for k in range(N_PORTS):
        port_motion(model, state, ports[k, S], work.shape, shown[k, 0:MEANS])
        curvature(model, state[:n], ports[k, S], work.shape, shown[k, CURVATURE:TURN])


@kernel
def show_step(model, state, ports, h, shown, work):
    """Write what is shown of every port after a macro step `h`: motion, time means, work."""
    show_ports(model, state, ports, shown, work)
    for k in range(N_PORTS):
        for i in range(6):
            shown[k, MEANS + i] = work.means[k, i]
        for i in range(3):
            turned = work.means[k, TURNED + i] if ports[k, S_RATE] != 0.0 else shown[k, 3 + i] - work.first[k, 3 + i]
            shown[k, TURN + i] = turned / h
        shown[k, PORT_WORK] = state[4 * model.weight.size + WORK + k]
