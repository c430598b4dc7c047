"""More moments, and damping of unresolved modes.

A unit mass that is exact under a polynomial force, on a law that is sampled along the motion rebuilt from its ends and
its moments. With n numbers for the force the exchange is the continuous Galerkin method of degree n: Padé (n, n), order
2n. `damped` adds to the waveform's mean force -γ k H times the jump of the rebuilt velocity at the communication point.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.polynomial import Legendre
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from orchestrator.report.style import COLOURS, STYLE
from verification.study import Result, Row, observed_order

TITLE = "More moments, damping"
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)
SIGMA, WEIGHTS = (NODES + 1.0) / 2.0, WEIGHTS / 2.0
GAMMA = 0.1
Law = Callable[[np.ndarray, np.ndarray], np.ndarray]


def basis(n: int) -> list[Legendre]:
    """Return the first n Legendre polynomials on [0, 1]."""
    return [Legendre.basis(j, domain=[0.0, 1.0]) for j in range(n)]


def projected(values: np.ndarray, n: int) -> np.ndarray:
    """Return the coefficients (n,) of the L2 projection of samples (12,) at the Gauss points."""
    return np.array([(2 * j + 1) * WEIGHTS @ (values * p(SIGMA)) for j, p in enumerate(basis(n))])


def motion(y: np.ndarray, force: np.ndarray, H: float) -> tuple[Legendre, Legendre]:
    """Return position and velocity of the unit mass over a step, from (x, v) and the force's coefficients."""
    load = sum((c * p for c, p in zip(force, basis(len(force)), strict=True)), 0.0 * basis(1)[0])
    velocity = H * load.integ(lbnd=0.0) + y[1]
    return H * velocity.integ(lbnd=0.0) + y[0], velocity


def step(law: Law, y: np.ndarray, H: float, n: int, guess: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (x, v) after one macro step with n numbers for the force, and those numbers."""

    def answer(force: np.ndarray) -> np.ndarray:
        _, velocity = motion(y, force, H)
        rate = sum((c * p for c, p in zip(projected(velocity(SIGMA), n), basis(n), strict=True)), 0.0 * basis(1)[0])
        rebuilt = H * rate.integ(lbnd=0.0) + y[0]
        return projected(law(rebuilt(SIGMA), rate(SIGMA)), n) - force

    force = np.asarray(fsolve(answer, guess, xtol=1e-12))
    position, velocity = motion(y, force, H)
    return np.array([position(1.0), velocity(1.0)]), force


def order(n: int) -> float:
    """Return the observed order on x'' = -10 x - 100 x³ - 0.3 x'."""

    def law(x: np.ndarray, v: np.ndarray) -> np.ndarray:
        return -10.0 * x - 100.0 * x**3 - 0.3 * v

    exact = solve_ivp(
        lambda _, y: (y[1], law(y[0], y[1])), (0.0, 1.6), [0.5, 0.0], rtol=1e-13, atol=1e-15, method="DOP853"
    )
    steps, errors = [0.08, 0.04], []
    for H in steps:
        y, force = np.array([0.5, 0.0]), np.zeros(n)
        for _ in range(round(1.6 / H)):
            y, force = step(law, y, H, n, force)
        errors.append(float(np.max(np.abs(y - exact.y[:, -1]))))
    return observed_order(steps, errors)


def waveform(z: float, gamma: float = 0.0) -> np.ndarray:
    """Return the amplification matrix of (x, v H, slope of the rebuilt motion at the end) at z = (omega H)²."""
    columns = []
    for x0, w0, slope in np.eye(3):

        def outcome(mean: float, rate: float, x0=x0, w0=w0, slope=slope) -> tuple[np.ndarray, np.ndarray]:
            x1, middle = x0 + w0 + mean / 2 - rate / 12, x0 + w0 / 2 + mean / 6 - rate / 24
            b = 6.0 * ((x0 + x1) / 2 - middle)
            a = x1 - x0 - b
            wrong = np.array([-z * middle - gamma * z * (a - slope) - mean, -z * (x1 - x0) - rate])
            return wrong, np.array([x1, w0 + mean, a + 2 * b])

        wrong, _ = outcome(0.0, 0.0)
        jacobian = np.stack([outcome(1.0, 0.0)[0] - wrong, outcome(0.0, 1.0)[0] - wrong], axis=1)
        columns.append(outcome(*np.linalg.solve(jacobian, -wrong))[1])
    return np.array(columns).T


def radius(matrix: np.ndarray) -> float:
    """Return the spectral radius."""
    return float(np.max(np.abs(np.linalg.eigvals(matrix))))


def hermite(z: np.ndarray) -> np.ndarray:
    """Return the spectral radius of `hermite` in closed form."""
    s = np.sqrt(np.maximum(0.0, -z * (1 - z / 60) / ((1 - z / 10) * (1 - z / 12)))) / 2.0
    return np.abs((1.0 + s) / (1.0 - s))


def damped_order() -> float:
    """Return the observed order of the damped waveform on x'' = -x."""
    steps, errors = [0.2, 0.1], []
    for H in steps:
        y = np.linalg.matrix_power(waveform(H**2, GAMMA), round(4.0 / H)) @ np.array([1.0, 0.0, 0.0])
        errors.append(abs(y[0] - np.cos(4.0)) + abs(y[1] / H + np.sin(4.0)))
    return observed_order(steps, errors)


def _figure(path: Path) -> None:
    omega_h = np.logspace(-1, 3, 400)
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6.0, 3.4), layout="constrained")
        axes.loglog(omega_h, hermite(omega_h**2), color=COLOURS[1], label="hermite")
        axes.loglog(omega_h, [radius(waveform(v**2)[:2, :2]) for v in omega_h], color=COLOURS[0], label="waveform")
        damped = [radius(waveform(v**2, GAMMA)) for v in omega_h]
        axes.loglog(omega_h, damped, color=COLOURS[2], ls="--", label=f"damped, γ = {GAMMA:g}")
        axes.set(xlabel="ωH", ylabel="spectral radius", ylim=(0.5, 10.0))
        axes.legend()
        figure.savefig(path)
        plt.close(figure)


def run(figures: Path) -> Result:
    """Return orders and spectral radii, and the figure of the latter."""
    omega_h = np.logspace(-1, 3, 81)
    undamped = max(abs(radius(waveform(v**2)[:2, :2]) - 1.0) / (1.0 + v**2) for v in omega_h)
    damped = [radius(waveform(v**2, GAMMA)) for v in omega_h]
    rows = [
        *(Row(f"{n} numbers for the force: order", order(n), 2.0 * n, "Padé (n, n)", 0.2 / (2 * n)) for n in (1, 2, 3)),
        Row("waveform: spectral radius - 1 over 1 + (ωH)²", undamped, 0.0, "Padé (2, 2)", 1e-12, relative=False),
        Row("damped: order", damped_order(), 4.0, "jump is O(H³)", 0.05),
        Row("damped: largest spectral radius - 1", max(0.0, max(damped) - 1.0), 0.0, "stable", 1e-9, relative=False),
    ]
    _figure(figures / "exchange_radius.png")
    smallest = int(np.argmin(damped))
    remark = f"""The damped variant has the spectral radius {min(damped):.2f} at ωH = {omega_h[smallest]:.3g} and
    {damped[-1]:.4f} at 1000: it damps modes near the limit of resolution, and leaves those far beyond as they are."""
    caption = "Spectral radius of a mass on an undamped spring for three exchanges."
    return Result(rows, [("exchange_radius.png", caption)], remark)
