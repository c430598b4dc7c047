"""How long an impact of a wheel on the cable lasts: whether a macro step resolves it.

The wheel meets the cable with the approach speed v. What gives way is the cable near it, an infinite beam under tension
that is driven at a point, and, hardly, the robot. At the angular frequency ω the two yield by G(ω) per force,

    G = -(1/κ + i/k) / (2 R) - 1/(m ω²),   R = sqrt(T² + 4 EI ρA ω²),   k² = 2 ρA ω²/(R + T),   κ² = (R + T)/(2 EI),

(k, κ: wave number and decay of the beam's own solutions; string for EI = 0). A contact of the tangent stiffness k_t vibrates
against them at the ω with 1/|G| = k_t, as on the effective mass m_eff = k_t/ω². Its depth is that at which the walls hold
the energy m_eff v²/2. The force rises within about a quarter of the period 2π sqrt(m_eff/k_t) = 2π/ω.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fmus.cable.module import Cable
from fmus.contact import places as at
from fmus.contact.law import law_parameters, walls
from fmus.contact.module import Contact
from fmus.kernels.roots import root
from orchestrator.coupling.run.results import Table
from orchestrator.landing.resolve import Landing, contact_module

OF_CABLE = ("bending_stiffness", "linear_density")
GRAVITY = Cable.table["gravity"].start
SLOWEST = 1e-3
"""m/s; slower approaches are no impacts."""
DIFFERENCE = 1e-4
"""Relative step of the derivative of the wall force by the depth."""


@dataclass(frozen=True)
class Impact:
    """One touch of a wheel that was open before.

    Attributes
    ----------
    contact : its name
    time : communication point before it, s
    speed : m/s, of approach in the wheel's radial direction
    period : s, of the contact against cable and robot at its deepest
    """

    contact: str
    time: float
    speed: float
    period: float


@dataclass(frozen=True)
class Yielding:
    """What gives way under a wheel: tension N, EI N m², ρA kg/m of the cable; mass of the robot on the wheel, kg."""

    tension: float
    bending: float
    density: float
    mass: float = math.inf

    def dynamic_stiffness(self, omega: float) -> float:
        """Return the magnitude of force by displacement at the angular frequency `omega`, N/m."""
        total = math.sqrt(self.tension**2 + 4.0 * self.bending * self.density * omega**2)
        wave = math.sqrt(2.0 * self.density * omega**2 / (total + self.tension))
        decay = math.sqrt(2.0 * self.bending / (total + self.tension))
        return 1.0 / abs(complex(-decay / (2.0 * total) - 1.0 / (self.mass * omega**2), -0.5 / (wave * total)))

    def frequency(self, stiffness: float) -> float:
        """Return the angular frequency (1/s) at which a contact of that tangent stiffness vibrates."""
        low, high = 1e-6, 1.0
        while self.dynamic_stiffness(high) < stiffness:
            high *= 10.0
        return root(lambda omega: self.dynamic_stiffness(omega) - stiffness, low, high, rtol=1e-9)


def impacts(landing: Landing, table: Table) -> list[Impact]:
    """Return the impacts of a run; none where a foreign cable or contact does not say what is needed.

    Parameters
    ----------
    table : signals at the communication points
    """
    known = landing.sources.variables["cable"]
    if landing.contact.foreign is not None or any(name not in known for name in OF_CABLE):
        return []
    contact = contact_module(landing.contact, 0.0)
    under = _yielding(landing, table)
    names = [f"contact{k}" for k in range(1, landing.n_wheels + 1)]
    return [impact for name in names for impact in _of_contact(name, contact, under, table, landing)]


def _yielding(landing: Landing, table: Table) -> Yielding:
    cable: Mapping[str, Any] = {name: Cable.table[name].start for name in OF_CABLE} | dict(landing.cable.module)
    mass = landing.robot.module.get("mass", math.inf)
    bending, density = (float(cable[name]) for name in OF_CABLE)
    return Yielding(float(table["cable.tension_mid"][0]), bending, density, float(mass) / landing.n_wheels)


def _of_contact(name: str, contact: Contact, under: Yielding, table: Table, landing: Landing) -> Iterator[Impact]:
    time, touched = table["time"], table[f"{name}.normal_force_max"] > 0.0
    gap = table[f"{name}.penetration"] / math.sin(0.5 * contact.values[contact.table.index["groove_angle"]])
    for i in np.flatnonzero(touched[1:] & (table[f"{name}.normal_force"][:-1] == 0.0)):
        speed = landing.scenario.landing.velocity if i == 0 else (gap[i] - gap[i - 1]) / (time[i] - time[i - 1])
        if i == 0 and gap[0] < 0.0:  # it falls within the first step
            speed = math.sqrt(speed**2 - 2.0 * float(landing.cable.module.get("gravity", GRAVITY)) * gap[0])
        if speed > SLOWEST:
            yield Impact(name, float(time[i]), float(speed), period(contact, under, float(speed)))


def period(contact: Contact, under: Yielding, speed: float) -> float:
    """Return the period (s) of the contact at the deepest point of an impact with `speed` (m/s)."""
    prm = law_parameters(contact.values, contact.table)

    def missing(depth: float) -> float:
        _, stiffness, energy = _wall(prm, depth)
        return energy - 0.5 * stiffness / under.frequency(stiffness) ** 2 * speed**2

    low, high = 1e-7, 1e-6
    while missing(high) < 0.0 and high < 0.5 * prm[at.APEX]:
        high *= 2.0
    depth = root(missing, low, high, rtol=1e-6) if missing(high) > 0.0 else high
    return 2.0 * math.pi / under.frequency(_wall(prm, depth)[1])


def _wall(prm: np.ndarray, depth: float) -> tuple[float, float, float]:
    """Return force N, tangent stiffness N/m and energy J of a wheel pressed `depth` (m) into a straight cable."""
    (low, _), (force, energy), (high, _) = (
        _pressed(prm, depth * factor) for factor in (1.0 - DIFFERENCE, 1.0, 1.0 + DIFFERENCE)
    )
    return force, (high - low) / (2.0 * DIFFERENCE * depth), energy


def _pressed(prm: np.ndarray, depth: float) -> tuple[float, float]:
    motion, out = np.zeros(at.MOTION_SIZE), np.zeros(at.OUT_SIZE)
    motion[at.TANGENT + 1], motion[at.AXLE] = 1.0, 1.0
    motion[at.CENTRE + 2] = prm[at.APEX] + 0.5 * prm[at.CABLE_DIAMETER] / prm[at.SINE] - depth
    walls(prm, motion, out)
    return float(out[at.RADIAL]), float(out[at.WALL_ENERGY])
