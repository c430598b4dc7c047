"""The cable as a module: variable table, initialisation, outputs."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fmus.cable import dynamics, ports
from fmus.cable.assembly import Model
from fmus.cable.diagnosis import diagnose
from fmus.cable.mesh import MOST, TOLERANCE, Line, automatic, nodes, spread
from fmus.cable.state import N_PORTS, NOT_FINITE, OFF_CABLE, OK, factorise_mass, make_work, state_size
from fmus.cable.statics import catenary, equilibrium, mesh_model
from fmus.cable.stringing import Stringing
from fmus.kernels.time_integration import collocation, generalized_alpha
from fmus.module.variables import (
    NON_NEGATIVE,
    POSITIVE,
    Bounds,
    ModuleError,
    Variable,
    VariableTable,
    check_bounds,
    parameter,
    vector,
)

N_SHAPE = 41
"""Points at which the shape of the cable is shown, equally spaced in unstretched arc length."""
N_NODES = 64
"""Nodes that are shown, with their slopes: all of a mesh that has no more, else as many of them, spread evenly."""
N_CATENARY = 401
"""Points of the catenary on which landing points are found: to 1e-5 of the length, a mesh asks for no more."""
REMEMBERED = 16
"""Lines at rest that are kept: those of a run, and of runs that differ in what does not touch them."""


_PARAMETERS = [
    parameter("span", "m", 200.0, "horizontal distance of the supports", POSITIVE),
    parameter("level_difference", "m", 0.0, "height of the right support above the left one"),
    parameter("unstretched_length", "m", 200.0, "unstretched length of the cable", POSITIVE),
    parameter(
        "sag",
        "m",
        0.0,
        "sag at midspan wanted; 0: given by unstretched_length, else that is found from the sag",
        NON_NEGATIVE,
    ),
    Variable(
        "n_elements",
        "parameter",
        "1",
        0,
        "number of elements; 0: found from mesh_tolerance, together with their lengths",
        kind="integer",
        bounds=Bounds(ge=0, le=MOST),
    ),
    parameter(
        "mesh_tolerance",
        "1",
        TOLERANCE,
        "error of the motion, by its range, that a mesh found by itself may leave",
        Bounds(gt=0.0, le=0.1),
    ),
    *(
        parameter(
            f"landing[{k + 1}].position",
            "m",
            -1.0,
            "horizontal distance from the left support at which a wheel lands, for a mesh found by itself; negative: none",
        )
        for k in range(N_PORTS)
    ),
    parameter("landing_load", "N", 0.0, "weight of what lands, for a mesh found by itself", NON_NEGATIVE),
    parameter(
        "grading",
        "1",
        1.0,
        "ratio of the longest to the shortest of n_elements; 1: equal elements",
        Bounds(ge=1.0),
    ),
    parameter(
        "grading_position",
        "m",
        -1.0,
        "arc length of a refined point besides the supports (and where wheels land); negative: none",
    ),
    parameter("axial_stiffness", "N", 8.12e7, "EA", POSITIVE),
    parameter("bending_stiffness", "N.m2", 6580.0, "EI", NON_NEGATIVE),
    parameter("linear_density", "kg/m", 0.91, "mass per unstretched length", POSITIVE),
    parameter("damping_time", "s", 0.005, "Kelvin-Voigt damping: ratio of viscosity to stiffness", NON_NEGATIVE),
    parameter("mass_damping", "1/s", 0.0, "damping in proportion to mass: force by mass and velocity", NON_NEGATIVE),
    parameter("diameter", "m", 0.0, "outer diameter, for the drag of the air; 0: not given", NON_NEGATIVE),
    parameter(
        "drag_coefficient", "1", 0.0, "drag of the air by its dynamic pressure and diameter; 0: none", NON_NEGATIVE
    ),
    parameter("air_density", "kg/m3", 1.225, "density of the air, for its drag", NON_NEGATIVE),
    parameter("gravity", "m/s2", 9.8, "acceleration of gravity, towards -z", NON_NEGATIVE),
    Variable("clamped", "parameter", "1", False, "supports hold the transverse slope too", kind="boolean"),
    parameter("integration_step", "s", 0.0025, "longest inner step", POSITIVE),
    parameter(
        "newton_tolerance",
        "m",
        1e-12,
        "estimated error of a coordinate at which Newton's method ends, for a cable of 200 m; proportional to the length",
        Bounds(ge=1e-13, le=1e-6),
    ),
    parameter(
        "spectral_radius",
        "1",
        0.9,
        "spectral radius of the time integration at infinite frequency, 0 to 1",
        Bounds(ge=0.0, le=1.0),
    ),
    Variable(
        "integrator",
        "parameter",
        "1",
        "collocation",
        "time integration: two-stage collocation (order 3, 4 at spectral radius 1) or generalized-alpha (order 2)",
        kind="string",
        choices=("collocation", "generalized_alpha"),
    ),
]


_OUTPUTS = (
    ("tension_left", "N", "magnitude of the force of the left support"),
    ("tension_mid", "N", "tension in the middle of the cable: force of the cross-section along the tangent"),
    ("tension_right", "N", "magnitude of the force of the right support"),
    ("kinetic_energy", "J", "kinetic energy"),
    ("strain_energy", "J", "elastic energy of stretching and bending"),
    ("gravitational_energy", "J", "potential energy of gravity, zero at z = 0"),
    ("dissipated_energy", "J", "energy dissipated by all kinds of damping"),
    ("reaction_left.x", "N", "force of the left support on the cable, x"),
    ("reaction_left.y", "N", "force of the left support on the cable, y"),
    ("reaction_left.z", "N", "force of the left support on the cable, z"),
    ("reaction_right.x", "N", "force of the right support on the cable, x"),
    ("reaction_right.y", "N", "force of the right support on the cable, y"),
    ("reaction_right.z", "N", "force of the right support on the cable, z"),
    ("dissipated_energy_material", "J", "part of dissipated_energy: Kelvin-Voigt damping of the material"),
    ("dissipated_energy_mass", "J", "part of dissipated_energy: damping in proportion to mass"),
    ("dissipated_energy_drag", "J", "part of dissipated_energy: drag of the air"),
)
"""Name, unit and meaning of the outputs besides ports and shape, in the order of `diagnose`."""


def _port(k: int) -> tuple[list[Variable], list[Variable]]:
    """Return the inputs and the outputs of port k, each in the order that the kernels use."""
    p = f"port[{k}]"
    s = Variable(
        f"{p}.s",
        "input",
        "m",
        0.0,
        "unstretched arc length of the contact point, at the start of a step",
        discrete=True,
    )
    inputs = [s]
    inputs += vector(f"{p}.force", "input", "N", "force on the cable, mean over the macro step")
    inputs += vector(f"{p}.moment", "input", "N.m", "moment on the cable about the contact point, mean")
    inputs += vector(f"{p}.force_rate", "input", "N/s", "slope of the force within the macro step")
    inputs += vector(f"{p}.moment_rate", "input", "N.m/s", "slope of the moment within the macro step")
    inputs.append(
        Variable(f"{p}.s_rate", "input", "m/s", 0.0, "rate at which s moves on within the macro step", discrete=True)
    )
    f = (f"{p}.s",)
    outputs = vector(f"{p}.position", "output", "m", "contact point on the centreline", feedthrough=f)
    outputs += vector(f"{p}.tangent", "output", "1", "dr/ds there, not normalised", feedthrough=f)
    outputs += vector(f"{p}.velocity", "output", "m/s", "velocity of the contact point", feedthrough=f)
    outputs += vector(f"{p}.tangent_rate", "output", "1/s", "rate of dr/ds", feedthrough=f)
    # before the first step the means are the values, hence their dependence on s
    over = "over the last macro step"
    outputs += vector(f"{p}.position_mean", "output", "m", f"time mean of position {over}", feedthrough=f)
    outputs += vector(f"{p}.tangent_mean", "output", "1", f"time mean of tangent {over}", feedthrough=f)
    outputs.append(Variable(f"{p}.work", "output", "J", 0.0, "work done on the cable through this port"))
    outputs += vector(f"{p}.curvature", "output", "1/m", "d²r/ds² there", feedthrough=f)
    outputs += vector(f"{p}.tangent_rate_mean", "output", "1/s", f"time mean of tangent_rate {over}")
    return inputs, outputs


def _table() -> VariableTable:
    rows_of = [_port(k + 1) for k in range(N_PORTS)]
    rows = list(_PARAMETERS)
    for inputs, _ in rows_of:
        rows += inputs
    for _, outputs in rows_of:
        rows += outputs
    rows += [Variable(name, "output", unit, 0.0, description) for name, unit, description in _OUTPUTS]
    for i in range(N_SHAPE):
        rows += vector(f"shape[{i + 1}].position", "output", "m", f"centreline at {i}/{N_SHAPE - 1} of its length")
        rows.append(
            Variable(
                f"shape[{i + 1}].tension",
                "output",
                "N",
                0.0,
                "tension there: force of the cross-section along the tangent",
            )
        )
    for i in range(N_NODES):
        rows += vector(f"node[{i + 1}].position", "output", "m", "a node; the last one again where the mesh has fewer")
        rows += vector(f"node[{i + 1}].slope", "output", "1", "dr/ds there: the centreline is cubic between nodes")
    return VariableTable(rows)


class Cable:
    """The ANCF cable between two supports; see the module's README for equations and sources."""

    NAME = "cable"
    TITLE = "Sagging cable: gradient-deficient ANCF Euler-Bernoulli elements between two supports"
    table = _table()

    def __init__(self) -> None:
        self.values = self.table.defaults()
        self.state = np.zeros(0)
        self._ports = self._rows("port[1].s", N_PORTS, ports.N_INPUTS)
        self._shown_ports = self._rows("port[1].position.x", N_PORTS, ports.N_SHOWN)
        self._shape = self._rows("shape[1].position.x", N_SHAPE, 4)
        self._nodes_shown = self._rows("node[1].position.x", N_NODES, 6)
        self._shown = self._rows("tension_left", 1, len(_OUTPUTS))[0]

    def _rows(self, first: str, n: int, width: int) -> np.ndarray:
        """Return a view (n, width) of the values from the variable `first` on."""
        start = self.table.index[first]
        return self.values[start : start + n * width].reshape(n, width)

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.table.index[name]])

    def initialize(self, t: float) -> None:
        """Mesh the cable, find its static equilibrium, start the state there; raises `ModuleError`."""
        check_bounds(self.table, self.values, "cable")
        if self["drag_coefficient"] > 0.0 and self["diameter"] == 0.0:
            raise ModuleError(
                "cable: drag_coefficient: the drag of the air needs the line's diameter; set diameter, in m"
            )
        self.values[self.table.index["unstretched_length"]], self.model, q = self._settled()
        n = q.size
        self.state = np.zeros(state_size(n))
        self.state[:n] = q
        self._collocation = collocation(self["spectral_radius"])
        self._alpha = generalized_alpha(self["spectral_radius"])
        self._use_alpha = self["integrator"] == 1.0
        self._work = make_work(n, self.state.size)
        shown = spread(self.model.s.size, N_NODES)
        self._nodes_at = np.pad(shown, (0, N_NODES - shown.size), mode="edge")
        factorise_mass(self.model, q, self._work)
        self.refresh()
        self._diagnose(np.zeros_like(self._ports))  # at rest, before any load
        self._shown_ports[:, ports.MEANS : ports.PORT_WORK] = self._shown_ports[:, :6]
        self._shown_ports[:, ports.PORT_WORK] = 0.0

    def _settled(self) -> tuple[float, Model, np.ndarray]:
        """Return unstretched length, cable and equilibrium (n,): solved once in a process for equal parameters."""
        length, model, q = _equilibrium_of(self.values[self.table.indices(self.table.names("parameter"))].tobytes())
        own = {name: value.copy() for name, value in model._asdict().items() if isinstance(value, np.ndarray)}
        return length, model._replace(**own), q.copy()

    def _rest(self, length: float) -> tuple[Model, np.ndarray]:
        """Return the cable of the given unstretched length and its equilibrium (n,)."""
        model = self._model(self._nodes(length))
        return model, equilibrium(model, self["span"], self["level_difference"])

    def _model(self, s: np.ndarray) -> Model:
        """Return the cable with nodes at the arc lengths `s`, m."""
        return mesh_model(
            s,
            span=self["span"],
            level_difference=self["level_difference"],
            ea=self["axial_stiffness"],
            ei=self["bending_stiffness"],
            damping=self["damping_time"],
            density=self["linear_density"],
            gravity=self["gravity"],
            clamped=bool(self["clamped"]),
            mass_damping=self["mass_damping"],
            drag=0.5 * self["air_density"] * self["drag_coefficient"] * self["diameter"],
        )

    def _nodes(self, length: float) -> np.ndarray:
        """Return the arc lengths of the nodes (n_elements + 1,) of the cable of the given unstretched length."""
        if self["n_elements"] >= 1.0:
            return nodes(length, int(self["n_elements"]), self["grading"], self["grading_position"])
        if self["grading"] > 1.0:
            raise ModuleError("cable: grading: needs n_elements; without both the mesh is found by itself")
        return automatic(self._line(length), self._landing_arcs(length), self["landing_load"], self["mesh_tolerance"])

    @property
    def line(self) -> Line:
        """The cable as far as its mesh depends on it, once its unstretched length is known."""
        return self._line(self["unstretched_length"])

    def _line(self, length: float) -> Line:
        weight = self["linear_density"] * self["gravity"]
        ea, ei = self["axial_stiffness"], self["bending_stiffness"]
        return Line(self["span"], self["level_difference"], length, ea, ei, weight, bool(self["clamped"]))

    def _landing_arcs(self, length: float) -> np.ndarray:
        """Return the arc lengths (m) at which wheels land, on the catenary, and of the refined point besides."""
        wanted = np.array([self[f"landing[{k + 1}].position"] for k in range(N_PORTS)])
        model = self._model(np.linspace(0.0, length, N_CATENARY))
        y = catenary(model, self["span"], self["level_difference"])[1::6]
        besides = self["grading_position"]
        return np.append(np.interp(wanted[wanted >= 0.0], y, model.s), [besides] if besides >= 0.0 else [])

    def stringing(self) -> Stringing:
        """Return the line whatever its length; the shares of its mesh are those of a line as long as its chord."""
        chord = float(np.hypot(self["span"], self["level_difference"]))
        shares = self._nodes(chord) / chord  # held: what jumps by an element has no root
        return Stringing(lambda length: self._model(shares * length), self["span"], self["level_difference"])

    def step(self, t: float, h: float) -> None:
        """Advance from `t` by the macro step `h`; raises `ModuleError` where Newton's method fails."""
        status = dynamics.macro_step(
            self.model,
            self._collocation,
            self._alpha,
            self._use_alpha,
            self.state,
            h,
            self["integration_step"],
            self["newton_tolerance"],
            self._ports,
            self._shown_ports,
            self._shown,
            self._shape,
            self._work,
        )
        if status != OK:
            raise ModuleError(self._failure(status, t, h))
        self._show_nodes()

    def _failure(self, status: int, t: float, h: float) -> str:
        """Return what to say of a step that was not made."""
        if status == NOT_FINITE:
            return f"cable: an input at a port is not a finite number at t = {t:g} s"
        if status == OFF_CABLE:
            length = self.model.s[-1]
            ends = self._ports[:, [ports.S]] + self._ports[:, [ports.S_RATE]] * [0.0, h]
            k, i = np.argwhere((ends < 0.0) | (ends > length))[0]
            return (
                f"cable: port[{k + 1}].s = {ends[k, i]:g} m is off the cable (0 to {length:g} m) at "
                f"t = {t + i * h:g} s: the wheel has run past a support; stop the run earlier, or brake the robot"
            )
        shortest = min(h, self["integration_step"]) / 2**dynamics.MAX_HALVINGS
        return (
            f"cable: Newton's method does not converge at t = {t:g} s, even with inner steps of {shortest:.3g} s; "
            "check the loads at the ports"
        )

    def refresh(self) -> None:
        """Write the motion of the ports at the present state and arc lengths; all else stays as it is."""
        ports.show_ports(self.model, self.state, self._ports, self._shown_ports, self._work)

    def show(self) -> None:
        """Write all outputs but means and work at the present state, whoever has put it there."""
        self.refresh()
        here = self._ports.copy()
        here[:, ports.S_RATE] = 0.0  # they act where the ports stand now
        self._diagnose(here)

    def _diagnose(self, loads: np.ndarray) -> None:
        """Write tensions, energies, reactions and the shape; `loads` (N_PORTS, 14) act at the ports."""
        diagnose(
            self.model,
            self._collocation,
            self._use_alpha,
            self.state,
            loads,
            self._shown,
            self._shape,
            self._work,
        )
        self._show_nodes()

    def _show_nodes(self) -> None:
        """Write position and slope of the nodes that are shown."""
        self._nodes_shown[:] = self.nodes_at(self.state)

    def nodes_at(self, state: np.ndarray) -> np.ndarray:
        """Return position and slope of the nodes that are shown, (N_NODES, 6), in a `state` of the kernels."""
        return state[: self.model.weight.size].reshape(-1, 6)[self._nodes_at]


@lru_cache(maxsize=REMEMBERED)
def _equilibrium_of(parameters: bytes) -> tuple[float, Model, np.ndarray]:
    """Return unstretched length, cable and equilibrium (n,) with these parameters, in the order of the table."""
    cable = Cable()
    cable.values[cable.table.indices(cable.table.names("parameter"))] = np.frombuffer(parameters)
    length = cable.stringing().length_for_sag(cable["sag"]) if cable["sag"] > 0.0 else cable["unstretched_length"]
    return length, *cable._rest(length)
