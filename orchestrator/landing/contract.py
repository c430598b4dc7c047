"""The contract between the FMUs, and whether a given FMU meets it, point by point, as far as it can be read.

It is written here independently of our own modules, because it is what a foreign FMU has to meet;
a test holds our modules against it. Whether an FMU does what its variables promise: `orchestrator.landing.trial`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from fmus.module.variables import Causality, Variable
from orchestrator.catalogue import modules as vocabulary
from orchestrator.coupling.errors import FORWARD, InputError
from orchestrator.coupling.exchange import PARAMETER, suited_to

Standing = Literal["ok", "missing", "wrong", "advice"]


@dataclass(frozen=True)
class Point:
    """One variable, or one vector of three, that a component shows.

    `name` may hold ``[k]`` for every wheel or port; `needed` says whether a landing can do without it.
    """

    name: str
    causality: Causality
    unit: str
    needed: bool = True
    vector: bool = True
    use: str = ""

    def names(self, k: int) -> list[str]:
        """Return the scalar variables of wheel or port `k`."""
        name = self.name.replace("[k]", f"[{k}]")
        return [f"{name}.{axis}" for axis in "xyz"] if self.vector else [name]


def _scalar(name: str, causality: Causality, unit: str, needed: bool = True, use: str = "") -> Point:
    return Point(name, causality, unit, needed, False, use)


INSIDE = "for what happens within a macro step"
CONTROL = "for controlled landings"
"""Use of inputs that are zero where nobody controls."""
ROLLS = "for a wheel that rolls along the cable"
ENERGY_CONJUGATE = f"for {PARAMETER} = {suited_to(implicit=True)}"

ROBOT = (
    Point("wheel[k].force", "input", "N"),
    Point("wheel[k].moment", "input", "N.m"),
    Point("wheel[k].force_rate", "input", "N/s", False, use=ENERGY_CONJUGATE),
    Point("wheel[k].moment_rate", "input", "N.m/s", False, use=ENERGY_CONJUGATE),
    _scalar("thrust", "input", "N", False, CONTROL),
    Point("torque", "input", "N.m", False, use=CONTROL),
    _scalar("thrust_rate", "input", "N/s", False, CONTROL),
    Point("torque_rate", "input", "N.m/s", False, use=CONTROL),
    Point("wheel[k].position", "output", "m"),
    Point("wheel[k].axle", "output", "1"),
    Point("wheel[k].velocity", "output", "m/s"),
    Point("wheel[k].angular_velocity", "output", "rad/s"),
    Point("wheel[k].position_mean", "output", "m", False, use=ENERGY_CONJUGATE),
    Point("wheel[k].axle_mean", "output", "1", False, use=ENERGY_CONJUGATE),
    Point("wheel[k].rotation", "output", "rad", False, use=ENERGY_CONJUGATE),
    Point("wheel[k].rotation_mean", "output", "rad", False, use=ENERGY_CONJUGATE),
    Point("body.position", "output", "m"),
    Point("body.velocity", "output", "m/s"),
    Point("body.angular_velocity", "output", "rad/s"),
    _scalar("roll", "output", "rad"),
    _scalar("pitch", "output", "rad"),
    _scalar("yaw", "output", "rad"),
    _scalar("kinetic_energy", "output", "J", False, "for the energy audit"),
    _scalar("gravitational_energy", "output", "J", False, "for the energy audit"),
    Point("initial.position", "parameter", "m"),
    Point("initial.velocity", "parameter", "m/s", False, use="to start with a velocity"),
    Point("wheel[k].mount", "parameter", "m", False, use="for the monolithic reference"),
    _scalar("mass", "parameter", "kg", False, "for the monolithic reference"),
)
CABLE = (
    _scalar("port[k].s", "input", "m"),
    _scalar("port[k].s_rate", "input", "m/s", False, ROLLS),
    Point("port[k].force", "input", "N"),
    Point("port[k].moment", "input", "N.m"),
    Point("port[k].force_rate", "input", "N/s", False, use=ENERGY_CONJUGATE),
    Point("port[k].moment_rate", "input", "N.m/s", False, use=ENERGY_CONJUGATE),
    Point("port[k].position", "output", "m"),
    Point("port[k].tangent", "output", "1"),
    Point("port[k].velocity", "output", "m/s"),
    Point("port[k].tangent_rate", "output", "1/s"),
    Point("port[k].position_mean", "output", "m", False, use=ENERGY_CONJUGATE),
    Point("port[k].tangent_mean", "output", "1", False, use=ENERGY_CONJUGATE),
    Point("port[k].curvature", "output", "1/m", False, use=ROLLS),
    Point("port[k].tangent_rate_mean", "output", "1/s", False, use=ROLLS),
    _scalar("tension_left", "output", "N"),
    _scalar("tension_mid", "output", "N"),
    _scalar("tension_right", "output", "N"),
    _scalar("kinetic_energy", "output", "J", False, "for the energy audit"),
    _scalar("strain_energy", "output", "J", False, "for the energy audit"),
    _scalar("gravitational_energy", "output", "J", False, "for the energy audit"),
    _scalar("dissipated_energy", "output", "J", False, "for the energy audit"),
    _scalar("span", "parameter", "m"),
)
CONTACT = (
    Point("cable.position", "input", "m"),
    Point("cable.tangent", "input", "1"),
    Point("cable.velocity", "input", "m/s"),
    Point("cable.tangent_rate", "input", "1/s"),
    Point("wheel.position", "input", "m"),
    Point("wheel.axle", "input", "1"),
    Point("wheel.velocity", "input", "m/s"),
    Point("wheel.angular_velocity", "input", "rad/s"),
    Point("cable.position_mean", "input", "m", False, use=ENERGY_CONJUGATE),
    Point("cable.tangent_mean", "input", "1", False, use=ENERGY_CONJUGATE),
    Point("cable.curvature", "input", "1/m", False, use=ROLLS),
    Point("cable.tangent_rate_mean", "input", "1/s", False, use=ROLLS),
    Point("wheel.position_mean", "input", "m", False, use=ENERGY_CONJUGATE),
    Point("wheel.axle_mean", "input", "1", False, use=ENERGY_CONJUGATE),
    Point("wheel.rotation", "input", "rad", False, use=ENERGY_CONJUGATE),
    Point("wheel.rotation_mean", "input", "rad", False, use=ENERGY_CONJUGATE),
    Point("cable.force", "output", "N"),
    Point("cable.moment", "output", "N.m"),
    _scalar("cable.s", "output", "m"),
    _scalar("cable.s_rate", "output", "m/s", False, ROLLS),
    Point("wheel.force", "output", "N"),
    Point("wheel.moment", "output", "N.m"),
    Point("cable.force_rate", "output", "N/s", False, use=ENERGY_CONJUGATE),
    Point("cable.moment_rate", "output", "N.m/s", False, use=ENERGY_CONJUGATE),
    Point("wheel.force_rate", "output", "N/s", False, use=ENERGY_CONJUGATE),
    Point("wheel.moment_rate", "output", "N.m/s", False, use=ENERGY_CONJUGATE),
    _scalar("normal_force", "output", "N"),
    _scalar("friction_force", "output", "N"),
    _scalar("penetration", "output", "m"),
    _scalar("slip_velocity", "output", "m/s"),
    _scalar("contact_length", "output", "m"),
    _scalar("status", "output", "1"),
    _scalar("dissipated_energy", "output", "J", False, "for the energy audit"),
    _scalar("radial_force", "output", "N", False, "what a force sensor in the wheel measures"),
    _scalar("lateral_force", "output", "N", False, "what a force sensor in the wheel measures"),
    _scalar("normal_force_max", "output", "N", False, INSIDE),
    _scalar("penetration_max", "output", "m", False, INSIDE),
    _scalar("slip_velocity_max", "output", "m/s", False, INSIDE),
    _scalar("impulse", "output", "N.s", False, INSIDE),
    _scalar("touch_time", "output", "s", False, INSIDE),
)
CONTROLLER = (
    _scalar("thrust", "output", "N", use="along z_B, into the robot's input of that name"),
    Point("torque", "output", "N.m", False, use="to turn the robot, components in B"),
    Point("body.position", "input", "m", False, use="where the robot is"),
    Point("body.velocity", "input", "m/s", False, use="how fast it goes"),
    Point("body.angular_velocity", "input", "rad/s", False, use="how fast it turns"),
    _scalar("roll", "input", "rad", False, "how it is turned"),
    _scalar("pitch", "input", "rad", False, "how it is turned"),
    _scalar("yaw", "input", "rad", False, "how it is turned"),
    _scalar("contact[k].normal_force", "input", "N", False, "to feel the line"),
    _scalar("sample_time", "parameter", "s", False, "if it samples: macro steps have to divide it"),
)
"""Of its inputs it has those that it needs: any output of the robot by its name, any of contact k as ``contact[k].NAME``."""
CONTRACTS = {"robot": ROBOT, "cable": CABLE, "contact": CONTACT, "controller": CONTROLLER}
ANY = "any"
"""What has no contract: it can be put on trial all the same (`orchestrator.landing.trial`)."""
FEWEST = 2
"""Variables that an FMU shares at least with the contract that it is held against; one may be so named by chance."""
MOST_PORTS = 4
BREAKS = ("missing", "wrong")
"""Verdicts with which a landing cannot run."""


def is_control(name: str) -> bool:
    """Return whether a robot's input is there for control, and zero without it."""
    return any(name in point.names(1) for point in ROBOT if point.use == CONTROL)


def is_unused(name: str, wheels: int) -> bool:
    """Return whether a variable is that of a port beyond the last of the `wheels`."""
    number = re.match(r"(?:port|wheel|contact)\[(\d+)\]", name)
    return bool(number and 0 < wheels < int(number[1]))


@dataclass(frozen=True)
class Finding:
    """One line of the answer: what was looked at, how it stands, and why."""

    what: str
    verdict: Standing
    note: str = ""


def check_fmu(path: Path, kind: str | None = None) -> tuple[str, list[Finding]]:
    """Hold the FMU at `path` against a contract and return the contract's name and the findings.

    Parameters
    ----------
    kind : ``robot``, ``cable``, ``contact``, ``controller`` or ``any``; without it the contract that its variables suit best
    """
    description = vocabulary.description(path)
    known = vocabulary.of_fmu(path)
    kind = kind or best_contract(known)
    if kind not in (*CONTRACTS, ANY):
        raise InputError(f"{kind}: no such contract; choose one of {', '.join(CONTRACTS)}, {ANY}")
    points = [] if kind == ANY else check_variables(kind, known)
    return kind, [*_capabilities(path, description), *points]


def best_contract(known: dict[str, Variable]) -> str:
    """Return the contract of which `known` has the most variables, each an input, output or parameter as there; or `ANY`."""

    def alike(kind: str) -> int:
        names = ((n, p.causality) for p in CONTRACTS[kind] for n in p.names(1))
        return sum(n in known and known[n].causality == causality for n, causality in names)

    best = max(CONTRACTS, key=alike)
    return best if alike(best) >= FEWEST else ANY


def check_variables(kind: str, known: dict[str, Variable]) -> list[Finding]:
    """Hold variables against the contract `kind`: names, causality, type and unit; one finding a point."""
    last = next((k for k in range(MOST_PORTS, 1, -1) if _has_port(kind, known, k)), 1)
    findings = []
    for point in CONTRACTS[kind]:
        for k in range(1, last + 1) if "[k]" in point.name else (1,):
            findings.append(_finding(point, k, known))
    return findings


def is_met(findings: list[Finding]) -> bool:
    """Whether nothing that is needed is missing or wrong."""
    return not any(f.verdict in BREAKS for f in findings)


def _has_port(kind: str, known: dict[str, Variable], k: int) -> bool:
    return any(n in known for p in CONTRACTS[kind] if "[k]" in p.name for n in p.names(k))


def _finding(point: Point, k: int, known: dict[str, Variable]) -> Finding:
    names = point.names(k)
    what = f"{point.causality} {point.name.replace('[k]', f'[{k}]')}{'.{x,y,z}' if point.vector else ''}"
    absent = [name for name in names if name not in known]
    if absent:
        note = f"no {', '.join(absent)}" if len(absent) < len(names) else f"wanted in {point.unit}"
        return Finding(what, "missing" if point.needed else "advice", f"{note} {point.use}".strip())
    for variable in (known[name] for name in names):
        if variable.causality != point.causality:
            return Finding(what, "wrong", f"{variable.name} is a {variable.causality}, not a {point.causality}")
        if variable.kind == "string":
            return Finding(what, "wrong", f"{variable.name} is a string, not a number")
        if variable.unit != point.unit:
            return _unit_finding(what, variable, point.unit)
    return Finding(what, "ok", point.unit)


def _unit_finding(what: str, variable: Variable, wanted: str) -> Finding:
    if variable.unit in ("", "1"):
        return Finding(what, "advice", f"{variable.name} declares no unit; {wanted} is taken")
    return Finding(what, "wrong", f"{variable.name} is in {variable.unit}, wanted in {wanted}")


def _capabilities(path: Path, description: Any) -> list[Finding]:
    from fmpy import platform, supported_platforms

    interface = description.coSimulation
    if interface is None:
        return [Finding("co-simulation", "missing", "the FMU is for model exchange; export it for co-simulation")]
    platforms = supported_platforms(str(path))
    here = platform in platforms
    rollback = bool(interface.canGetAndSetFMUstate)
    variable = bool(interface.canHandleVariableCommunicationStepSize)
    return [
        Finding("co-simulation", "ok", f"FMI {description.fmiVersion}"),
        Finding("binary for this machine", "ok" if here else "missing", platform if here else f"has {platforms}"),
        Finding("state can be saved", *_advised(rollback, f"implicit masters need it; {FORWARD}")),
        Finding("variable macro step", *_advised(variable, "sub-division of a macro step needs it")),
    ]


def _advised(given: bool, why: str) -> tuple[Standing, str]:
    return ("ok", "") if given else ("advice", f"no: {why}")
