"""The file of an identification: what is looked for, between which bounds and why, and by which data.

title = "Damping of my line"
scenario = "rig_10m"

[parameters."cable.parameters.mass_damping"]
from = 0.01
to = 3.0
unit = "1/s"
scale = "log"
reason = "still air to a storm"

[[measurement]]
file = "landing_3.csv"
signals.roll = { signal = "robot.roll", unit = "deg", uncertainty = 0.05 }
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from orchestrator.catalogue.documents import read
from orchestrator.catalogue.quantities import complaints
from orchestrator.coupling.errors import InputError, nearest
from orchestrator.scenario.types import Count, Positive, Section
from orchestrator.studies.documents import StudyFile
from orchestrator.studies.fit import Parameter
from orchestrator.studies.reading import shipped

Settings = dict[str, Any]


class Target(Section):
    """Where a parameter goes: `key` of the scenario becomes `offset` + `factor` times the parameter.

    Attributes
    ----------
    landing : of the study of the paper; empty: all landings, and all measurements
    """

    key: str
    landing: str = ""
    offset: float = 0.0
    factor: float = 1.0


class Sought(Section):
    """A parameter, its bounds in `unit`, and the reason for them.

    `applies` says where it goes; without it its name is the key of the scenario that it stands for.
    """

    model_config = Section.model_config | {"populate_by_name": True}

    low: Annotated[float, Field(alias="from")]
    high: Annotated[float, Field(alias="to")]
    unit: str = ""
    scale: Literal["linear", "log"] = "linear"
    reason: Annotated[str, Field(min_length=1)]
    applies: list[Target] = Field(default_factory=list)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"from {self.low:g} must lie below to {self.high:g}")
        if self.scale == "log" and self.low <= 0.0:
            raise ValueError(f'from {self.low:g} must be above 0 where scale = "log"')
        return self


class Claims(Section):
    """Claims of the paper by their ids: those that are fitted, and those that are only foretold.

    `parameter_set`: of the study of the paper, with which its landings are run.
    """

    parameter_set: str = "physical"
    used: Annotated[list[str], Field(min_length=1)]
    predicted: list[str] = Field(default_factory=list)

    @model_validator(mode="after")
    def _once(self) -> Self:
        every = [*self.used, *self.predicted]
        if twice := sorted({name for name in every if every.count(name) > 1}):
            raise ValueError(f"{', '.join(twice)} stands there twice; a claim is used, or it is foretold")
        return self


class Column(Section):
    """A column of a measurement.

    Attributes
    ----------
    signal : that of the landing which it measures
    unit : the column's
    uncertainty : one standard deviation of a single value, in `unit`
    relative : whether values are changes from the first one
    used : whether it is fitted; otherwise it is only foretold
    """

    signal: str
    unit: str = ""
    uncertainty: Positive
    relative: bool = False
    used: bool = True


class Measurement(Section):
    """A table of time and signals, CSV with a line of names, and the landing that it measures.

    Attributes
    ----------
    file : its path, relative to the study
    scenario : that of the landing; None: the study's
    set : values of this landing alone
    time : the column of times; `time_unit` theirs, `start` the time of the landing at which they begin to count, s
    signals : column → what it measures
    """

    file: str
    scenario: str | None = None
    set: Settings = Field(default_factory=dict)
    time: str = "time"
    time_unit: str = "s"
    start: float = 0.0
    signals: Annotated[dict[str, Column], Field(min_length=1)]


class Search(Section):
    """How hard to look: `population` times the number of parameters in each of the `generations`."""

    population: Count = 8
    generations: Count = 25
    intervals: bool = True


class Study(StudyFile):
    """An identification, as it is read."""

    title: str
    scenario: str = ""
    seed: Annotated[int, Field(ge=0)] = 1
    set: Settings = Field(default_factory=dict)
    search: Search = Search()
    parameters: Annotated[dict[str, Sought], Field(min_length=1)]
    claims: Claims | None = None
    measurement: list[Measurement] = Field(default_factory=list)

    @property
    def sought(self) -> list[Parameter]:
        """The parameters as a fit takes them, in their units."""
        return [Parameter(name, one.low, one.high, one.scale == "log") for name, one in self.parameters.items()]

    def targets(self, name: str) -> list[Target]:
        """Return where a parameter goes."""
        return self.parameters[name].applies or [Target(key=name)]

    @model_validator(mode="after")
    def _has_data(self) -> Self:
        if self.claims is None and not any(c.used for m in self.measurement for c in m.signals.values()):
            raise ValueError("has no data to fit: name [claims] used = […], or a [[measurement]] with signals")
        if any(m.scenario is None for m in self.measurement) and not self.scenario:
            raise ValueError('has a measurement without a scenario; add scenario = "…"')
        return self


def path_of(name: str) -> Path:
    """Return the path of a study: that of a file, or of one that is shipped with the study of the paper."""
    folder = shipped() / "identify"
    beside = folder / f"{name}.toml"
    if name.endswith(".toml") or Path(name).exists() or not beside.is_file():
        if not Path(name).is_file():
            known = sorted(path.stem for path in folder.glob("*.toml"))
            raise InputError(f"{name}: no such study{nearest(name, known)}; give a TOML file, or {', '.join(known)}")
        return Path(name)
    return beside


def load_study(path: Path) -> Study:
    """Read the study at `path`; `InputError` says all that is wrong with it."""
    try:
        study = Study.model_validate(read(path))
    except ValidationError as error:
        raise InputError(f"{path}: {one}" for one in complaints(error, Study)) from None
    study._path = path
    return study
