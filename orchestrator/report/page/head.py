"""The head of a page: what scripts read of it. Numbers in SI; what is shown in other units says by which factor."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from orchestrator.coupling.run.results import plain
from orchestrator.report.page.blob import Place

FORMAT = 1
Kind = Literal["run", "comparison", "sweep", "graph"]
Triple = list[float]


@dataclass(frozen=True)
class Span:
    """Horizontal `length` (m), and both supports (m)."""

    length: float
    left: Triple
    right: Triple


@dataclass(frozen=True)
class Wheel:
    """A wheel in the frame b; its axle lies along x, turned by `axle_tilt` about y, then by `axle_yaw` about z.

    `axle` is that of an axle that does not lie along x.
    """

    mount: Triple
    radius: float
    groove_angle: float
    width: float
    axle_yaw: float
    axle_tilt: float
    axle: Triple
    braked: bool


@dataclass(frozen=True)
class Robot:
    """A robot to draw, in the frame b; lengths are null where the robot does not say them.

    `rotor_plane` is the height of the rotors over b, `line` that of the line where it lies in the grooves; `thrust`: whether
    the rotors have an input.
    """

    name: str
    layout: Literal["top", "bottom"]
    across: float | None
    along: float | None
    height: float | None
    below_line: float | None
    rotor_plane: float
    line: float
    wheels: list[Wheel]
    centre_of_mass: Triple
    thrust: bool


@dataclass(frozen=True)
class PlotSignal:
    """A signal of a plot: its `name` among the arrays, `label`, `colour` "1" to "8", `dash` in pixels."""

    name: str
    label: str
    colour: str
    dash: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class PlotLimit:
    """A limit of a plot, in the unit that is shown."""

    at: float
    name: str


@dataclass(frozen=True)
class Plot:
    """Signals on one axis; what is shown is `factor` times the signal, from its start if `from_start`."""

    title: str
    unit: str
    factor: float
    digits: int
    from_start: bool
    signals: list[PlotSignal]
    limits: list[PlotLimit] = field(default_factory=list)


@dataclass(frozen=True)
class Hud:
    """A number beside the picture: of a signal, or of the expression ``clearance``: the gap of rotor plane and line."""

    label: str
    unit: str
    digits: int
    factor: float = 1.0
    from_start: bool = False
    name: str | None = None
    expr: str | None = None


@dataclass(frozen=True)
class Verdict:
    """On the safety of a landing: a word, and the class by which it is coloured."""

    word: str
    class_: Literal["safe", "unsafe", "unclear", "none"]


@dataclass(frozen=True)
class Shown:
    """A run of a page that has several: its arrays' `prefix`; `full` if more than the plots' signals are there."""

    label: str
    prefix: str
    full: bool
    verdict: Verdict
    safety: str


@dataclass(frozen=True)
class Axis:
    """An axis of a map: its `values`, and `labels` where they are words."""

    label: str
    unit: str
    values: list[Any]
    labels: list[str] | None = None


@dataclass(frozen=True)
class Measure:
    """What a map can show of its cells: the key of a cell, and how people read it."""

    key: str
    label: str
    unit: str
    factor: float
    digits: int
    kind: Literal["margin", "probability"]


@dataclass(frozen=True)
class Map:
    """The map of a sweep; `cells` have x, y (places on the axes) and, where the outline was refined, their `box`."""

    title: str
    text: str
    x: Axis
    y: Axis | None
    measures: list[Measure]
    limits: list[str]
    limit_names: dict[str, str]
    cells: list[dict[str, Any]]


@dataclass(frozen=True)
class Landing:
    """A landing of a sweep that a page holds: the prefix of its arrays, and what its head says instead."""

    prefix: str
    head: dict[str, Any]


@dataclass(frozen=True)
class LinePlace:
    """The line's arrays: their prefix, and whether they are the nodes of the mesh."""

    prefix: str
    exact: bool
    note: str = ""


@dataclass(frozen=True)
class Head:
    """All of it; see docs/reference/files.md."""

    kind: Kind
    title: str
    complete: bool
    error: str | None
    arrays: dict[str, Place]
    verdict: Verdict
    line: LinePlace | None = None
    span: Span | None = None
    cable_diameter: float | None = None
    landing_position: float | None = None
    robot: Robot | None = None
    plots: list[Plot] = field(default_factory=list)
    hud: list[Hud] = field(default_factory=list)
    limits: dict[str, Any] = field(default_factory=dict)
    runs: list[Shown] = field(default_factory=list)
    reference: str | None = None
    thinned: str = ""
    safety: str = ""
    whatif: Any = None
    map: Map | None = None
    landings: dict[str, Landing] = field(default_factory=dict)

    def content(self) -> dict[str, Any]:
        """Return it in JSON's types."""
        content = {"format": FORMAT, "packed": "gzip", **asdict(self)}
        return plain(_plain_names(content))


def _plain_names(content: Any) -> Any:
    """Return `content` with ``class`` in the place of a name that Python allows."""
    if isinstance(content, dict):
        return {("class" if key == "class_" else key): _plain_names(value) for key, value in content.items()}
    return [_plain_names(one) for one in content] if isinstance(content, list) else content
