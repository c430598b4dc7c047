"""The cables of the studies, as parameters of the module and as independent beams."""

from __future__ import annotations

import numpy as np

from fmus.cable.assembly import Model, add_load, interpolate
from fmus.cable.module import Cable
from fmus.cable.statics import equilibrium, mesh_model
from fmus.module.variables import Value
from verification.cable.beam import Beam

Settings = dict[str, Value]
TABLE1: Settings = {
    "span": 200.0,
    "unstretched_length": 200.0,
    "axial_stiffness": 8.12e7,
    "bending_stiffness": 6580.0,
    "linear_density": 0.91,
}
PHYSICAL = TABLE1 | {"axial_stiffness": 8.12e7 / 4, "bending_stiffness": 6580.0 / 16}
RIG: Settings = {
    "span": 10.0,
    "unstretched_length": 10.0,
    "axial_stiffness": 2.111e7,
    "bending_stiffness": 337.8,
    "linear_density": 0.707,
}
ROBOT_WEIGHT = 38.0 * 9.8
"""N; a dead load of the robot's mass."""


def cable(*settings: Settings, **more: Value) -> Cable:
    """Return an initialised cable."""
    made = Cable()
    for group in (*settings, more):
        made.table.assign(made.values, group)
    made.initialize(0.0)
    return made


def beam(settings: Settings, green_lagrange: bool = True) -> Beam:
    """Return the independent model of a cable."""
    names = ("axial_stiffness", "bending_stiffness", "linear_density", "unstretched_length")
    return Beam(*(float(settings[name]) for name in names), green_lagrange=green_lagrange)


def loaded_equilibrium(
    settings: Settings,
    loads: tuple[tuple[float, float], ...] = (),
    *,
    n_elements: int = 20,
    grading: float = 1.0,
    grading_position: float = -1.0,
    clamped: bool = False,
    level_difference: float = 0.0,
) -> tuple[Model, np.ndarray]:
    """Return the meshed cable and its equilibrium under gravity and dead loads (arc length m, force down N)."""
    span = float(settings["span"])
    model = mesh_model(
        span=span,
        level_difference=level_difference,
        unstretched_length=float(settings["unstretched_length"]),
        n_elements=n_elements,
        grading=grading,
        grading_position=grading_position,
        ea=float(settings["axial_stiffness"]),
        ei=float(settings["bending_stiffness"]),
        damping=0.0,
        density=float(settings["linear_density"]),
        gravity=9.8,
        clamped=clamped,
    )
    straight = np.zeros(model.weight.size)
    straight[4::6] = 1.0
    load = np.zeros(model.weight.size)
    for s, weight in loads:
        add_load(model, straight, s, np.array([0.0, 0.0, -weight]), np.zeros(3), np.zeros(8), load)
    return model, equilibrium(model, span, level_difference, load)


def point(model: Model, q: np.ndarray, s: float) -> np.ndarray:
    """Return position and slope r_x at arc length `s`: (6,)."""
    out = np.zeros(6)
    interpolate(model, q, s, np.zeros(8), out)
    return out


def support_forces(model: Model, q: np.ndarray) -> np.ndarray:
    """Return the forces of the left and of the right support on the cable: (2, 3) N."""
    from fmus.cable.assembly import element_work, internal_force

    force = np.zeros(q.size)
    internal_force(model, q, np.zeros(q.size), force, element_work())
    force -= model.weight
    return np.stack([force[:3], force[-6:-3]])
