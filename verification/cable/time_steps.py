"""Time integration: order in the step, energy, damping and waves.

The orders are taken on a soft cable that swings widely under a port that pushes and turns it, with Kelvin–Voigt
damping, errors against a run at a quarter of the shortest step. The loads jump between macro steps, as those of an
explicit master do. Energy is watched over 60 s of free vibration of `table1`, undamped, after a dead load of 38 kg
at 60 m is taken off. Damping and waves are held against the closed form of a weightless taut cable
(`verification/cable/taut.py`).
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from fmus.cable.module import Cable
from fmus.module.variables import Value
from orchestrator.report.style import COLOURS, STYLE
from verification.cable.setups import ROBOT_WEIGHT, TABLE1, Settings, cable, loaded_equilibrium, point
from verification.cable.taut import SETTINGS as TAUT
from verification.cable.taut import taut
from verification.study import Result, Row, observed_order

TITLE = "Time integration"
SOFT: Settings = {
    "span": 10.0,
    "unstretched_length": 10.5,
    "axial_stiffness": 2e3,
    "bending_stiffness": 5.0,
    "linear_density": 0.7,
    "damping_time": 0.01,
    "n_elements": 6,
}
METHODS = {
    "generalized-alpha, ρ = 0.9": ("generalized_alpha", 0.9, 2.0),
    "generalized-alpha, ρ = 0.5": ("generalized_alpha", 0.5, 2.0),
    "collocation, ρ = 0.9": ("collocation", 0.9, 3.0),
    "collocation, ρ = 0": ("collocation", 0.0, 3.0),
    "collocation, ρ = 1": ("collocation", 1.0, 4.0),
}
MACRO_STEP, N_MACRO = 0.08, 5


def swing(integrator: str, spectral_radius: float, step: float) -> np.ndarray:
    """Return the coordinates after some macro steps of the soft cable under jumping loads."""
    made = cable(SOFT, integrator=integrator, spectral_radius=spectral_radius, integration_step=step)
    for k in range(N_MACRO):
        load: dict[str, Value] = {
            "port[1].s": 3.7,
            "port[1].force.x": 4.0 * np.cos(1.7 * k),
            "port[1].force.z": 10.0 * np.sin(2.3 * k + 1.0),
            "port[1].force_rate.z": 30.0 * np.cos(k),
            "port[1].moment.x": 3.0 * np.cos(0.9 * k),
        }
        made.table.assign(made.values, load)
        made.step(k * MACRO_STEP, MACRO_STEP)
    return made.state[: made.model.weight.size].copy()


def order(method: str, counts: tuple[int, ...]) -> tuple[list[float], list[float], float]:
    """Return steps, errors (m) and observed order of a method; `counts` inner steps a macro step."""
    integrator, rho, _ = METHODS[method]
    exact = swing(integrator, rho, MACRO_STEP / (4 * counts[-1]))
    steps = [MACRO_STEP / n for n in counts]
    errors = [float(np.abs(swing(integrator, rho, h) - exact)[1::3].max()) for h in steps]
    return steps, errors, observed_order(steps, errors)


def order_row(method: str, counts: tuple[int, ...] = (16, 32, 64)) -> Row:
    """Return the observed order of a method."""
    source = "Hairer & Wanner 1996, IV.5" if METHODS[method][0] == "collocation" else "Chung & Hulbert 1993"
    label = f"{method}: order in the step, loads jump"
    return Row(label, order(method, counts)[2], METHODS[method][2], source, 0.2, relative=False)


def release(settings: Settings, load_at: float, **more: Value) -> Cable:
    """Return a cable at rest under a dead load of 38 kg, from which it is released."""
    made = cable(settings, **more)
    _, q = loaded_equilibrium(settings, ((load_at, ROBOT_WEIGHT),), n_elements=int(made["n_elements"]))
    made.state[: q.size] = q
    made.show()
    return made


def energies(made: Cable) -> np.ndarray:
    """Return kinetic, strain, gravitational and dissipated energy, J."""
    return np.array([made[f"{name}_energy"] for name in ("kinetic", "strain", "gravitational", "dissipated")])


def energy_history(stop: float, step: float, **more: Value) -> tuple[np.ndarray, np.ndarray]:
    """Return times and energies (n, 4) of the released `table1`."""
    made = release(TABLE1, 60.0, integration_step=step, **more)
    macro = 10.0 * step
    times = np.arange(round(stop / macro) + 1) * macro
    rows = [energies(made)]
    for t in times[:-1]:
        made.step(t, macro)
        rows.append(energies(made))
    return times, np.array(rows)


def drift(history: np.ndarray) -> float:
    """Return the largest change of the total energy over the largest kinetic energy."""
    total = history.sum(axis=1)
    return float(np.abs(total - total[0]).max() / history[:, 0].max())


def decay_rows(count: int = 3) -> list[Row]:
    """Return the damping ratio of each mode from the decay of its free vibration."""
    settings = TAUT | {"span": 10.01, "unstretched_length": 10.0, "bending_stiffness": 337.8, "damping_time": 0.005}
    theory, result = taut(settings), []
    for k in range(count):
        made = cable(settings, n_elements=40, spectral_radius=1.0, integration_step=2e-4)
        n, beta, omega = made.model.weight.size, theory.wave_numbers(count)[k], theory.frequencies(count)[k]
        made.state[:n:6] = 1e-5 * np.sin(beta * made.model.s)
        made.state[3:n:6] = 1e-5 * beta * np.cos(beta * made.model.s)
        period, middle = 2.0 * np.pi / omega, 0.5 * made.model.s[-1] / (k + 1)
        ratio, cycles = theory.damping_ratios(count)[k], 5
        made.step(0.0, cycles * period / np.sqrt(1.0 - ratio**2))
        decay = np.log(1e-5 / point(made.model, made.state[:n], middle)[0]) / (2.0 * np.pi * cycles)
        computed = decay / np.sqrt(1.0 + decay**2)
        label = f"taut cable, 10 m: damping ratio of mode {k + 1}, from its decay"
        result.append(Row(label, computed, ratio, "c EI λ² β⁴/(2 ρA ω)", 1e-3))
    return result


def wave(
    n_elements: int, width: float, stop: float = 0.2, step: float = 5e-4
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return arc lengths, computed and exact lateral displacement of a Gaussian pulse that has split in two."""
    settings = TAUT | {"n_elements": n_elements, "spectral_radius": 1.0, "integration_step": step}
    made, theory = cable(settings), taut(settings)
    n, s = made.model.weight.size, made.model.s
    middle = 0.5 * s[-1]
    pulse = 1e-4 * np.exp(-(((s - middle) / width) ** 2))
    made.state[:n:6], made.state[3:n:6] = pulse, -2.0 * (s - middle) / width**2 * pulse
    made.step(0.0, stop)
    beta, omega = theory.wave_numbers(400), theory.frequencies(400)
    amplitude = 1e-4 * np.sqrt(np.pi) * width * 2.0 / theory.length * np.sin(beta * middle)
    amplitude = amplitude * np.exp(-((beta * width) ** 2) / 4.0) * np.cos(omega * stop)
    return s, made.state[:n:6].copy(), np.sin(np.outer(s, beta)) @ amplitude


def wave_rows(n_elements: int = 200, tolerance: float = 1e-3) -> list[Row]:
    """Return how far a long pulse has travelled, and the largest difference of the whole profile of a short one."""
    stop, theory = 0.2, taut(TAUT)
    s, computed, _ = wave(n_elements, 15.0, stop)
    k = int(np.argmax(np.where(s > 0.5 * s[-1] + 20.0, computed, 0.0)))
    fit = np.polyfit(s[k - 1 : k + 2], computed[k - 1 : k + 2], 2)
    speed = (-0.5 * fit[1] / fit[0] - 0.5 * s[-1]) / stop
    # bending speeds a wave of number β up by 3/2 EI λ² β²/(EA ε); the pulse holds β up to 2/width
    dispersion = 1.5 * theory.ei * (2.0 / 15.0) ** 2 / theory.tension
    _, computed, exact = wave(n_elements, 3.0, stop)
    error = float(np.abs(computed - exact).max() / np.abs(exact).max())
    label = "the same, 3 m wide: largest difference from the exact profile, of its height"
    return [
        Row("taut cable, 200 m: speed of a pulse 15 m wide, m/s", speed, theory.wave_speed, "√(EA ε/ρA)", dispersion),
        Row(label, error, 0.0, "Fourier series", tolerance, False),
    ]


def run(figures: Path) -> Result:
    """Run all, draw the orders and the energy."""
    found = [order_row(method) for method in METHODS]
    _, history = energy_history(60.0, 1e-3, spectral_radius=1.0, damping_time=0.0)
    source = "conservation of energy"
    label = "table1, 60 s at 1 ms, ρ = 1, undamped: energy drift over exchanged energy"
    found.append(Row(label, drift(history), 0.0, source, 1e-6, relative=False))
    times, damped = energy_history(20.0, 1e-3, spectral_radius=1.0)
    label = "table1, 20 s at 1 ms, ρ = 1, c = 5 ms: energy balance with the dissipated part"
    found.append(Row(label, drift(damped), 0.0, source, 1e-5, relative=False))
    found += decay_rows() + wave_rows(400, 1e-4)
    _draw(figures / "cable_time.png", times, damped)
    return Result(found, [("cable_time.png", "Error against the step of the soft cable; energy of the released cable")])


def _draw(path: Path, times: np.ndarray, history: np.ndarray) -> None:
    with plt.rc_context(STYLE):
        figure, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.0))
        counts = (16, 32, 64, 128)
        steps = [MACRO_STEP / n for n in counts]
        for method, colour in zip(METHODS, COLOURS, strict=False):
            _, errors, _ = order(method, counts)
            left.loglog(steps, errors, "o-", markersize=4, color=colour, label=method)
        left.set_xticks(steps, [f"{1e3 * h:g}" for h in steps], minor=False)
        left.minorticks_off()
        left.set_xlabel("Inner step, ms")
        left.set_ylabel("Error of a coordinate, m")
        left.legend(fontsize=6.5)
        for k, name in enumerate(("kinetic", "elastic", "gravitational", "dissipated")):
            right.plot(times, history[:, k] - history[0, k], color=COLOURS[k], label=name, linewidth=0.8)
        right.set_xlabel("Time, s")
        right.set_ylabel("Energy less that at the start, J")
        right.legend(fontsize=6.5)
        figure.savefig(path)
        plt.close(figure)
