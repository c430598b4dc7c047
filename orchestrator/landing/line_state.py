"""The line as the scenario's ``[cable.state]`` leaves it: unstretched length and mass now; and what it is like at rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import pi
from typing import Any

from fmus.cable.module import Cable
from fmus.cable.stringing import Stringing, sag
from fmus.module.variables import Value, check_bounds
from orchestrator.scenario.types import LandingScenario, StateSection


@dataclass(frozen=True)
class Rest:
    """The line at rest, before the robot comes.

    Attributes
    ----------
    unstretched_length, sag : m; the sag is that of the middle, below half way between the supports' heights
    horizontal_tension, tension_left, tension_right : N
    linear_density : kg/m, with the ice
    share_of_strength : the larger of the supports' tensions by the rated strength; None where that is not known
    temperature : °C; None where no state says it
    ice_thickness : m
    """

    unstretched_length: float
    sag: float
    horizontal_tension: float
    tension_left: float
    tension_right: float
    linear_density: float
    share_of_strength: float | None
    temperature: float | None
    ice_thickness: float

    def content(self) -> dict[str, Any]:
        """Return what ``summary.json`` says of it."""
        return asdict(self)


def rest_words(rest: Mapping[str, Any]) -> str:
    """Return the line at rest in a line of text; `rest` as in ``summary.json``."""
    left, right = (1e-3 * rest[f"tension_{side}"] for side in ("left", "right"))
    share = rest["share_of_strength"]
    words = f"line at rest: sag {rest['sag']:.3f} m, horizontal tension {1e-3 * rest['horizontal_tension']:.3f} kN"
    words += f", at the supports {left:.3f} and {right:.3f} kN"
    words += f" ({100.0 * share:.1f} % of the rated strength)" if share is not None else ""
    words += f", {rest['unstretched_length']:.4f} m long unstretched"
    words += f", at {rest['temperature']:g} °C" if rest["temperature"] is not None else ""
    return words + (f", {1e3 * rest['ice_thickness']:g} mm of ice" if rest["ice_thickness"] else "")


def rest_of(cable: Cable, scenario: LandingScenario) -> Rest:
    """Return what the line of an initialised cable is like at rest."""
    state, strength = scenario.cable.state, scenario.limits.rated_strength
    left, right = cable["tension_left"], cable["tension_right"]
    return Rest(
        cable["unstretched_length"],
        sag(cable.model, cable.state[: cable.model.weight.size], cable["level_difference"]),
        -cable["reaction_left.y"],
        left,
        right,
        cable["linear_density"],
        max(left, right) / strength if strength is not None else None,
        state.now if state is not None else None,
        state.ice_thickness if state is not None else 0.0,
    )


def parameters_now(scenario: LandingScenario, module: Mapping[str, Value]) -> Mapping[str, Value]:
    """Return the cable's parameters that follow from the scenario's state; none where there is none.

    Parameters
    ----------
    module : the other parameters of our cable, of the bare line

    The line is strung bare, at the temperature of stringing. Then the unstretched length grows with the temperature,
    L = L0 (1 + α (T - T0)), its mass being what it was, and ice of thickness t around the diameter D adds π ρ t (D + t) of
    mass a metre. The ice is weight and inertia; it neither stiffens the line nor changes what a wheel or the air meets.

    Raises
    ------
    ModuleError : no length has that sag or tension
    """
    state = scenario.cable.state
    if state is None:
        return {}
    bare = Cable()
    bare.table.assign(bare.values, {name: value for name, value in module.items() if name in bare.table.index})
    check_bounds(bare.table, bare.values, "cable")
    length = _strung_length(bare.stringing(), state, scenario.limits.rated_strength) * state.growth
    ice = pi * state.ice_density * state.ice_thickness * (bare["diameter"] + state.ice_thickness)
    return {"unstretched_length": length, "linear_density": bare["linear_density"] / state.growth + ice}


def _strung_length(line: Stringing, state: StateSection, strength: float | None) -> float:
    if state.unstretched_length is not None:
        return state.unstretched_length
    if state.sag is not None:
        return line.length_for_sag(state.sag)
    tension = state.horizontal_tension
    if tension is None:
        assert state.tension_share is not None and strength is not None, "the scenario's check sees to it"
        tension = state.tension_share * strength
    return line.length_for_tension(tension)
