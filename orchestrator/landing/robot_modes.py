"""Small vibrations of the line with the robot on it: frequencies, damping, shapes about the rest of both.

M x'' + C x' + K x = 0 comes from the monolithic solver's forces (`monolithic.linear`), with the damping of line and
contacts. Its complex eigenvalues λ are those of the first-order system of twice the size: ``|λ|/(2π)`` is the natural
frequency, ``-Re λ/|λ|`` the damping ratio. A positive real part grows: the robot topples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from fmus.cable.assembly import Model
from fmus.module.variables import ModuleError
from orchestrator.coupling.errors import InputError
from orchestrator.landing import build
from orchestrator.landing.modes import free_directions, sample
from orchestrator.landing.monolithic.linear import Linear, at_rest
from orchestrator.landing.monolithic.state import N_ROBOT, SPIN
from orchestrator.landing.resolve import cable_module, resolve
from orchestrator.scenario.types import LandingScenario, Scenario

SHARES = ("across", "along", "vertical", "roll", "pitch", "yaw", "line")
"""What the kinetic energy of a mode is split into: the robot's translations and turns, and the line."""
ACROSS, ALONG, VERTICAL, ROLL, PITCH, YAW, LINE = range(7)
KINDS = {"bounce": (VERTICAL,), "pendulum": (ALONG, ROLL), "sway": (ACROSS, PITCH), "yaw": (YAW,)}
MOSTLY = 0.8
"""Share of the line beyond which a mode is the line's."""
CLOSE = 0.05
"""Distance of two frequencies, by their mean, below which they are said to be close."""
APART = 1e-3
"""Share of bounce in the swing, and of swing in the bounce, below which they are two separate motions."""
SEARCHED = 24
"""Modes among which bounce and pendulum are looked for."""
GROWS = 0.1
"""Growth, 1/s, that topples. A free wheel rolls along the line against hardly any stiffness, some 0.1 N/m, and the mesh
makes as much; a robot that stands on the line topples within a second."""


@dataclass(frozen=True)
class SystemModes:
    """Modes in ascending order of frequency, those that topple first.

    Attributes
    ----------
    linear : the system about its rest
    growth : (count,) real part of the eigenvalue, 1/s
    frequency : (count,) natural frequency, Hz; 0 of what topples
    damping_ratio : (count,)
    shares : (count, 7) of the kinetic energy, in the order of `SHARES`
    shape : (count, n + 10) complex, of 1 kg modal mass and real where the robot moves most
    kinds : what moves in each mode, in a word or two
    bounce_and_pendulum : which of all modes are the robot's bounce and its swing; None where there are no two such
    """

    linear: Linear
    growth: np.ndarray
    frequency: np.ndarray
    damping_ratio: np.ndarray
    shares: np.ndarray
    shape: np.ndarray
    kinds: tuple[str, ...]
    bounce_and_pendulum: tuple[int, int] | None

    @property
    def equilibrium(self) -> np.ndarray:
        """The line at rest under the robot: (m, 3), m."""
        return sample(self.linear.model, self.linear.q)

    @property
    def line(self) -> np.ndarray:
        """Motion of the line in each mode: (count, m, 3) complex."""
        n = self.linear.q.size
        return np.array([_sampled(self.linear.model, x[:n]) for x in self.shape])

    @property
    def robot(self) -> np.ndarray:
        """Motion of the robot in each mode, of its centre of mass m and its turn rad: (count, 6) complex."""
        n = self.linear.q.size
        return self.shape[:, n : n + SPIN]

    def first(self, count: int) -> SystemModes:
        """Return the first `count` modes alone."""
        names = ("growth", "frequency", "damping_ratio", "shares", "shape", "kinds")
        return replace(self, **{name: getattr(self, name)[:count] for name in names})

    @property
    def warnings(self) -> list[str]:
        """What to say of them: what topples or slides, and a resonance of bounce and pendulum."""
        found = [
            f"the robot topples: {kind.removesuffix(', topples')} grows e-fold in {1.0 / growth:.3g} s"
            for kind, growth in zip(self.kinds, self.growth, strict=True)
            if growth > GROWS
        ]
        if self.linear.slides:
            found.append("friction does not hold the robot where it lands; it slides along the line")
        return found + ([resonance] if (resonance := self._resonance()) else [])

    def _resonance(self) -> str:
        pair = self.bounce_and_pendulum
        if pair is None:
            return ""
        (f, g), (z, y) = self.frequency[list(pair)], self.damping_ratio[list(pair)]
        apart = abs(f - g) / (0.5 * (f + g))
        if apart >= CLOSE:
            return ""
        text = f"bounce ({f:.4g} Hz) and pendulum ({g:.4g} Hz) are {100.0 * apart:.2g} % apart"
        if self.shares[pair[0], ROLL] + self.shares[pair[1], VERTICAL] < APART:
            return f"{text}, but the line does not slope there and nothing couples them"
        text += (
            f": on a sloping line the bounce of a landing goes over into the swing, within {0.5 / abs(f - g):.3g} s; "
        )
        text += f"their damping, {100.0 * z:.2g} and {100.0 * y:.2g} %, "
        return text + ("is stronger than that" if z + y > apart else "does not prevent it: the roll grows large")


def of_scenario(scenario: Scenario, count: int = SEARCHED) -> SystemModes:
    """Return the first modes, `count` or more, of the scenario's line with its robot at rest on it, and what topples."""
    if count < 1:
        raise InputError(f"--count {count}: must be 1 or more")
    if not isinstance(scenario, LandingScenario):
        raise InputError(f"{scenario.path}: cable: there is none; modes are those of a landing")
    landing = resolve(scenario)
    if not build.has_monolithic(landing):
        raise InputError(
            f"{scenario.path}: the forces of a foreign FMU are not known at an instant; use our modules, or "
            "--without-robot"
        )
    try:
        return modes(at_rest(build.problem(landing)), max(count, SEARCHED))
    except ModuleError as error:
        raise InputError(f"{scenario.path}: {error}") from None


def modes(linear: Linear, count: int) -> SystemModes:
    """Return the first `count` modes, and what topples."""
    values, vectors = _eigenvalues(linear)
    chosen = _chosen(values, count)
    values, vectors = values[chosen], vectors[:, chosen]
    n = linear.q.size
    shares, masses = _energies(linear, vectors)
    main = np.argmax(np.abs(vectors[n : n + SPIN] * np.sqrt(np.diag(linear.inertia))[:, None]), axis=0) + n
    phase = np.exp(-1j * np.angle(vectors[main, np.arange(chosen.size)]))
    vectors = vectors * phase / np.sqrt(masses)
    growth, ratio = np.real(values), -np.real(values) / np.abs(values)
    frequency = np.where(np.imag(values) > 0.0, np.abs(values) / (2.0 * np.pi), 0.0)
    pair = _bounce_and_pendulum(frequency, shares)
    kinds = _kinds(shares, growth, pair)
    return SystemModes(linear, growth, frequency, ratio, shares, vectors.T, kinds, pair)


def _bounce_and_pendulum(frequency: np.ndarray, shares: np.ndarray) -> tuple[int, int] | None:
    """Return which modes are the robot's bounce and its swing.

    A mode answers to a force at the robot in proportion to its share by the square of its frequency. Where slope
    couples bounce and swing, two neighbours have both; the one that swings less is the bounce.
    """
    vibrates = np.flatnonzero(frequency > 0.0)
    if vibrates.size < 2:
        return None
    frequency, answer = frequency[vibrates], shares[vibrates] / frequency[vibrates, None] ** 2
    pendulum, vertical = int(np.argmax(answer[:, ROLL])), answer[:, VERTICAL].copy()
    close = np.abs(frequency / frequency[pendulum] - 1.0) < CLOSE
    neighbour = close & (vertical + vertical[pendulum] > 0.5 * vertical.max())
    neighbour[pendulum], vertical[pendulum] = False, -np.inf
    bounce = int(np.argmax(np.where(neighbour, vertical, -np.inf) if neighbour.any() else vertical))
    return int(vibrates[bounce]), int(vibrates[pendulum])


def _kinds(shares: np.ndarray, growth: np.ndarray, pair: tuple[int, int] | None) -> tuple[str, ...]:
    """Return what moves in each mode; bounce and swing are called so, however much of the line or each other they have."""
    named = dict(zip(pair, ("bounce", "pendulum"), strict=True)) if pair is not None else {}
    return tuple(named.get(k, _kind(share, growth[k] > GROWS)) for k, share in enumerate(shares))


def _eigenvalues(linear: Linear) -> tuple[np.ndarray, np.ndarray]:
    """Return all eigenvalues, 1/s, and the shapes (n + 10, …) that belong to them.

    Those of the inverse of the first-order matrix: what is slow is then large, and found to its own round-off and not
    to that of the line's fastest waves.
    """
    basis = _basis(linear)
    mass, damping, stiffness = (basis.T @ one @ basis for one in (linear.mass, linear.damping, linear.stiffness))
    size, factors = mass.shape[0], lu_factor(stiffness)
    upper = np.hstack([-lu_solve(factors, damping), -lu_solve(factors, mass)])
    inverse, vectors = np.linalg.eig(np.vstack([upper, np.eye(size, 2 * size)]))
    moves = np.abs(inverse) > 0.0
    return 1.0 / inverse[moves], basis @ vectors[:size, moves]


def _basis(linear: Linear) -> np.ndarray:
    """Return orthonormal columns (n + 10, m) of what neither supports nor brakes hold."""
    n, line = linear.q.size, [one.toarray() for one in free_directions(linear.model)]
    robot = np.eye(N_ROBOT)[:, np.concatenate([np.full(SPIN, True), linear.free_wheels])]
    columns = np.hstack([*line, np.zeros((n, robot.shape[1]))])
    return np.vstack([columns, np.hstack([np.zeros((N_ROBOT, columns.shape[1] - robot.shape[1])), robot])])


def _chosen(values: np.ndarray, count: int) -> np.ndarray:
    """Return the places of what topples, then of the `count` slowest vibrations, one of each pair."""
    topples = np.flatnonzero((np.imag(values) == 0.0) & (np.real(values) > GROWS))
    vibrates = np.flatnonzero(np.imag(values) > 0.0)
    slowest = vibrates[np.argsort(np.abs(values[vibrates]))][:count]
    return np.concatenate([topples[np.argsort(-np.real(values[topples]))], slowest])


def _energies(linear: Linear, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the shares (count, 7) of the kinetic energy, and its whole (count,): the modal masses, kg."""
    n = linear.q.size
    line, robot = vectors[:n], vectors[n : n + SPIN]
    parts = np.real(robot.conj() * (linear.inertia @ robot))
    whole = np.vstack([parts, np.sum(np.real(line.conj() * (linear.mass[:n, :n] @ line)), axis=0)])
    masses = whole.sum(axis=0)
    return (whole / masses).T, masses


def _sampled(model: Model, x: np.ndarray) -> np.ndarray:
    return sample(model, np.ascontiguousarray(np.real(x))) + 1j * sample(model, np.ascontiguousarray(np.imag(x)))


def _kind(share: np.ndarray, topples: bool) -> str:
    if share[LINE] > MOSTLY:
        kind = "line"
    else:
        kind = max(KINDS, key=lambda name: share[list(KINDS[name])].sum())
    return f"{kind}, topples" if topples else kind


# -- over the landing position --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Positions:
    """Bounce and pendulum over the landing position; nan where the robot has no rest.

    Attributes
    ----------
    position : (n,) m
    frequency, damping_ratio : (n, 2) of bounce and pendulum, Hz and 1
    """

    position: np.ndarray
    frequency: np.ndarray
    damping_ratio: np.ndarray


def over_positions(scenario: LandingScenario, count: int) -> Positions:
    """Return bounce and pendulum at `count` landing positions from tower to tower, a 40th of the span away from them."""
    span = cable_module(resolve(scenario).cable)["span"]
    position = np.linspace(0.025, 0.975, count) * span
    rows = np.full((count, 2, 2), np.nan)
    for row, y in zip(rows, position, strict=True):
        landing = scenario.landing.model_copy(update={"position": float(y)})
        try:
            found = of_scenario(scenario.model_copy(update={"landing": landing}))
        except InputError:
            continue
        if (pair := found.bounce_and_pendulum) is not None:
            row[:] = found.frequency[list(pair)], found.damping_ratio[list(pair)]
    return Positions(position, rows[:, 0], rows[:, 1])
