"""The grid that the error estimate is calibrated on, written down before it was run: where, and coupled how."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle, islice, zip_longest
from typing import Any

import numpy as np

from orchestrator.coupling.run.compare import communication_times
from orchestrator.scenario.read import load
from orchestrator.scenario.types import LandingScenario, Scenario
from verification.coupling.landings import FOLDER

SIGNALS = ("robot.body.position.z", "robot.body.position.y", "robot.roll")
"""Besides the peak contact force of every wheel, which is always judged."""
GROUPS = ("touch", "drops", "rolling", "lines and robots", "adaptive", "explicit", "oscillator")
COUNT, BRIEF, LONG = 120, 0.4, 2.0
"""How many macro steps a landing is run, but not less or more than so many s."""


@dataclass(frozen=True)
class Place:
    """A landing: its group, scenario file, robot (None: the file's), and settings in place of the file's."""

    group: str
    file: str
    settings: Mapping[str, Any]
    robot: str | None = None


@dataclass(frozen=True)
class Coupling:
    """A master, its macro step (s), and settings in place of its defaults."""

    master: str
    step: float
    settings: Mapping[str, Any]


@dataclass(frozen=True)
class Spec:
    """One run of the grid."""

    group: str
    place: str
    coupling: Coupling

    @property
    def words(self) -> str:
        """What it is, for people and for the file."""
        c = self.coupling
        said = "".join(f", {name.rpartition('.')[2]} {value}" for name, value in c.settings.items())
        return f"{self.place}, {c.master}, {1e3 * c.step:g} ms{said}"


def _place(group: str, file: str, robot: str | None = None, **settings: Any) -> Place:
    return Place(group, file, {name.replace("__", "."): value for name, value in settings.items()}, robot)


def _rolling(file: str, torque: float, **settings: Any) -> Place:
    place = _place("rolling", file, **settings)
    drive = {"robot.parameters.wheel[1].braked": "false", "robot.inputs.wheel[1].drive_torque": torque}
    return Place(place.group, file, dict(place.settings) | drive)


K = "contact__parameters__stiffness"
PLACES = {
    "point 9": _place("touch", "landing_200m_point9"),
    "point 9, physical": _place("touch", "landing_200m_point9_physical"),
    "point 9, undamped": _place("touch", "landing_200m_point9_undamped"),
    "point 9, metallic": _place("touch", "landing_200m_point9_metallic"),
    "midspan": _place("touch", "landing_200m_midspan"),
    "rig": _place("touch", "rig_10m"),
    "rig, inclined": _place("touch", "rig_10m_inclined"),
    "rig, k = 1e10": _place("touch", "rig_10m", **{K: 1e10}),
    "rig, half carried by its rotors": _place("touch", "rig_10m", robot__inputs__thrust=200.0),
    "rig, set down by a controller": _place("touch", "rig_10m_controlled", landing__height=0.01),
    "5 cm": _place("drops", "drop_5cm"),
    "5 cm, k = 1e10": _place("drops", "drop_5cm", **{K: 1e10}),
    "2 cm, k = 1e7": _place("drops", "landing_200m_midspan", landing__height=0.02, **{K: 1e7}),
    "30 cm, k = 1e9": _place("drops", "landing_200m_point9_undamped", landing__height=0.3, **{K: 1e9}),
    "5 cm on the rig, k = 1e9": _place("drops", "rig_10m", landing__height=0.05, **{K: 1e9}),
    "5 cm, damping of ADAMS": _place("drops", "landing_200m_point9_impact", landing__height=0.05),
    "driving on the rig": _rolling("rig_10m", 2.0, landing__position=4.0),
    "driving on the rig, backwards, k = 1e9": _rolling("rig_10m", -1.0, landing__position=6.0, **{K: 1e9}),
    "driving on the inclined rig": _rolling("rig_10m_inclined", 3.0),
    "driving at point 9": _rolling("landing_200m_point9", 2.0),
    "rolling down at point 9, physical": _rolling("landing_200m_point9_physical", 0.0),
    "driving on a 110 kV line": _rolling("line_110kv", 1.5),
    "110 kV, 250 m": _place("lines and robots", "line_110kv"),
    "220 kV, 400 m, two wheels": _place("lines and robots", "line_220kv", "hybrid_robot_2", landing__position=150.0),
    "ground wire, 600 m, four wheels": _place("lines and robots", "crossing_opgw", "linedrone"),
    "Drake, 300 m, slack": _place(
        "lines and robots", "line_110kv", "fptlir_55kg",
        cable__conductor="'drake'", cable__parameters__span=300.0, cable__state__tension_share=0.12,
    ),
    "Linnet, 120 m, tight, three wheels": _place(
        "lines and robots", "line_110kv", "hybrid_robot_1",
        cable__conductor="'linnet'", cable__parameters__span=120.0, cable__state__tension_share=0.3,
        landing__position=20.0,
    ),
    "Aster 570, 450 m, from 10 cm": _place(
        "lines and robots", "line_220kv",
        cable__conductor="'aster_570'", cable__parameters__span=450.0, landing__position=225.0, landing__height=0.1,
    ),
    "10 kg": _place("lines and robots", "landing_200m_point9", "fptlir_10kg"),
    "100 kg, at 40 m": _place(
        "lines and robots", "landing_200m_point9_undamped", "fptlir_100kg", landing__position=40.0
    ),
    "two wheels": _place("lines and robots", "landing_200m_point9", "hybrid_robot_2"),
    "four wheels": _place("lines and robots", "rig_10m", "linedrone"),
}  # fmt: skip
"""Landings by their names."""

OWN, LEARNT = "interface_jacobian", "iqn_ils"
STEPS = (0.005, 0.01, 0.0025, 0.02, 0.005, 0.01, 0.00125)
"""s; macro steps of the default master, one after the other over the landings."""
TOLERANCE = "master.tolerance"
LOOSE = (1e-4, 1e-8, 1e-5, 1e-6, 1e-7, 1e-4, 1e-5)
OTHERS = (
    Coupling(LEARNT, 0.005, {}),
    Coupling("anderson", 0.005, {}),
    Coupling(LEARNT, 0.01, {TOLERANCE: 1e-5}),
    Coupling(LEARNT, 0.0025, {TOLERANCE: 1e-8}),
    Coupling("aitken", 0.0025, {}),
    Coupling(LEARNT, 0.02, {}),
    Coupling(OWN, 0.005, {"master.prediction": "'polynomial'"}),
    Coupling(LEARNT, 0.005, {"master.energy_budget": "'none'", TOLERANCE: 1e-4}),
    Coupling(OWN, 0.01, {"simulation.exchange": "'point'"}),
    Coupling(OWN, 0.005, {"master.energy_budget": 0}),
    Coupling("fixed_point", 0.0025, {}),
)
"""Other masters and options, one after the other over every second landing."""
RARE = {
    "adaptive": tuple(Coupling(OWN, 0.02, {"master.local_tolerance": tolerance}) for tolerance in (1e-4, 1e-5)),
    "explicit": (Coupling("gauss_seidel", 0.0005, {}), Coupling("jacobi", 0.0005, {}), Coupling("nepce", 0.0005, {})),
}
"""Group → couplings of their own kind, one after the other over every fifth landing."""
ON_OSCILLATOR = ("jacobi", "gauss_seidel", "nepce", "semi_implicit", LEARNT, OWN)
OSCILLATOR_STEPS = (0.02, 0.01, 0.005, 0.0025)


def specs() -> Iterator[Spec]:
    """Yield the grid: of every landing the default master twice, of every second one another, of some a rarer one."""
    steps, others = cycle(STEPS), cycle(OTHERS)
    loose = zip(cycle(LOOSE), islice(cycle(STEPS), 3, None), strict=False)
    for number, (name, place) in enumerate(PLACES.items()):
        yield Spec(place.group, name, Coupling(OWN, next(steps), {}))
        tolerance, step = next(loose)
        yield Spec(place.group, name, Coupling(OWN, step, {TOLERANCE: tolerance}))
        if number % 2 == 0:
            yield Spec(place.group, name, next(others))
    for offset, (group, couplings) in enumerate(RARE.items()):
        for name, coupling in zip(list(PLACES)[offset::5], cycle(couplings), strict=False):
            yield Spec(group, name, coupling)
    for master in ON_OSCILLATOR:
        for step in OSCILLATOR_STEPS:
            yield Spec("oscillator", "oscillator", Coupling(master, step, {}))


def in_turn() -> list[str]:
    """Return all places, those of each group in turn: a grid that is measured in part has something of every group."""
    groups = {group: [name for name, place in PLACES.items() if place.group == group] for group in GROUPS}
    return ["oscillator", *(name for names in zip_longest(*groups.values()) for name in names if name is not None)]


def stop_of(step: float) -> float:
    """Return how long a landing is run with macro steps of `step`, s."""
    return min(max(COUNT * step, BRIEF), LONG)


def times_at(place: str) -> np.ndarray:
    """Return the communication points of all runs of a landing, each once: (n,) s."""
    steps = sorted({spec.coupling.step for spec in specs() if spec.place == place})
    times = np.sort(np.concatenate([communication_times(stop_of(step), [step]) for step in steps]))
    return times[np.append(True, np.diff(times) > 1e-9)]


def scenario(spec: Spec) -> Scenario:
    """Return the scenario of one run."""
    coupling = spec.coupling
    if spec.place == "oscillator":
        return load(FOLDER / "oscillator.toml", [f"simulation.macro_step={coupling.step}"], master=coupling.master)
    place = PLACES[spec.place]
    times = {"simulation.macro_step": coupling.step, "simulation.stop_time": stop_of(coupling.step)}
    settings = dict(place.settings) | times
    settings |= coupling.settings
    one = load(FOLDER / f"{place.file}.toml", assignments(settings), place.robot, coupling.master)
    assert isinstance(one, LandingScenario)
    return one.changed(tolerances=dict.fromkeys(SIGNALS, 1e-3))


def assignments(settings: Mapping[str, Any]) -> Sequence[str]:
    """Return settings as they are given on the command line."""
    return [f"{name}={value}" for name, value in settings.items()]
