"""The file of a sweep: a scenario, what is set for all runs, what varies, and what is drawn at random.

title = "Where may it land?"
scenario = "landing_200m_point9_physical"
solver = "monolithic"

[vary]
"landing.position" = { from = 20.0, to = 100.0, count = 9 }
robot = ["fptlir", "miniature"]

[sample]
method = "sobol"
count = 640
"cable.parameters.mass_damping" = { uniform = [0.01, 0.5] }
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, ValidationError, model_validator

from orchestrator.catalogue.documents import is_quantity, is_whole, read
from orchestrator.catalogue.quantities import complaints
from orchestrator.coupling.errors import InputError, nearest
from orchestrator.coupling.run.results import plain
from orchestrator.landing.safety import UNITS
from orchestrator.scenario.types import Count, Positive, Section
from orchestrator.studies.documents import StudyFile
from orchestrator.studies.reading import shipped
from orchestrator.studies.sweep.distributions import WORDS, Distribution

Settings = dict[str, Any]
FEWEST_SCRAMBLES = 10
"""Of which a t interval is taken."""
EXTREMES = ("robot.roll", "robot.pitch", "robot.yaw", "robot.body.position.z", "cable.tension_mid")
OWN_KEYS = {
    "sample": (("method", "count", "seed", "scrambles", "stop_when"), "distributions"),
    "refine": (("outline",), "widths"),
}
"""Table → its keys that are no parameters, and by which name those go that are."""


class Range(Section):
    """`count` values from `low` to `high`, both included, in `unit`."""

    model_config = Section.model_config | {"populate_by_name": True}

    low: Annotated[float, Field(alias="from")]
    high: Annotated[float, Field(alias="to")]
    count: Annotated[int, Field(ge=2)]
    scale: Literal["linear", "log"] = "linear"
    unit: str = ""

    @property
    def values(self) -> list[Any]:
        """The values, as a scenario takes them; digits that only rounding has made are left out."""
        space = np.geomspace if self.scale == "log" else np.linspace
        numbers = [float(f"{x:.12g}") for x in space(self.low, self.high, self.count)]
        return [{"value": x, "unit": self.unit} for x in numbers] if self.unit else numbers

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"from {self.low:g} must lie below to {self.high:g}")
        if self.scale == "log" and self.low <= 0.0:
            raise ValueError(f'from {self.low:g} must be above 0 where scale = "log"')
        return self


Varied = Annotated[list[Any], Field(min_length=1)] | Range


class Stop(Section):
    """When enough is known: the interval is no wider than `half_width` to either side.

    `of`: the probability that is meant: ``all`` limits, or one by its name.
    """

    half_width: Annotated[float, Field(gt=0.0, lt=0.5)]
    of: str = "all"

    @model_validator(mode="after")
    def _known(self) -> Self:
        if self.of not in ("all", *UNITS):
            raise ValueError(f"of: no limit {self.of!r}{nearest(self.of, UNITS)}; there are all, {', '.join(UNITS)}")
        return self


class Refine(Section):
    """Where runs are added: between those that differ, until they are as near to each other as wanted.

    Attributes
    ----------
    widths : key that varies → how near, in the unit of its values
    outline : what differs: the verdict alone, or the verdict or the limit that binds
    """

    outline: Literal["verdict", "limit"] = "limit"
    widths: Annotated[dict[str, Positive], Field(min_length=1, max_length=2)]


class Sample(Section):
    """What is drawn at random, and how.

    Attributes
    ----------
    count : runs, at most, for each combination of what varies
    scrambles : independent repetitions that Sobol and Latin hypercube consist of
    stop_when : None: all are made
    """

    method: Literal["random", "latin_hypercube", "sobol"] = "random"
    count: Count
    seed: Annotated[int, Field(ge=0)] = 1
    scrambles: Annotated[int, Field(ge=FEWEST_SCRAMBLES)] = FEWEST_SCRAMBLES
    stop_when: Stop | None = None
    distributions: Annotated[dict[str, Distribution], Field(min_length=1)]

    @property
    def block(self) -> int:
        """Runs of one scramble."""
        return 1 if self.method == "random" else self.count // self.scrambles

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.method == "random":
            return self
        if self.count % self.scrambles or self.block < 2:
            cure = self.scrambles * max(2, round(self.count / self.scrambles))
            raise ValueError(f"count = {self.count} is not {self.scrambles} scrambles of equal size; take {cure}")
        if self.method == "sobol" and self.block & (self.block - 1):
            low = 2 ** (self.block.bit_length() - 1)
            few, many = self.scrambles * low, 2 * self.scrambles * low
            raise ValueError(
                f"count = {self.count} is not {self.scrambles} scrambles of a power of two; take {few} or {many}"
            )
        return self


class Sensitivity(Section):
    """How many points the indices of Sobol' are estimated from; each takes two runs, and one for each parameter."""

    count: Annotated[int, Field(ge=8)]

    @model_validator(mode="after")
    def _balanced(self) -> Self:
        if self.count & (self.count - 1):
            low = 2 ** (self.count.bit_length() - 1)
            raise ValueError(f"count = {self.count} is not a power of two; take {low} or {2 * low}")
        return self


class Study(StudyFile):
    """A sweep, as it is read.

    Attributes
    ----------
    set : values for all runs, by their keys
    vary : of these, every combination is run; the keys ``scenario`` and ``robot`` are names of the catalogue, or paths
    sample : None: nothing is drawn at random
    sensitivity : None: it is not asked for
    refine : None: what varies has the values that it is given, and no others
    interval, tolerance, estimate : of the monolithic solver, see `Job`
    extremes : signals whose least and largest value are columns of the table; None: those of `EXTREMES` that there are
    record : runs whose signals are kept: none, all, or their numbers
    timeout : s that a run may take
    """

    title: str = ""
    scenario: str = ""
    solver: Literal["coupled", "monolithic"] = "coupled"
    set: Settings = Field(default_factory=dict)
    vary: dict[str, Varied] = Field(default_factory=dict)
    sample: Sample | None = None
    sensitivity: Sensitivity | None = None
    refine: Refine | None = None
    interval: Positive = 0.02
    tolerance: Positive = 1e-5
    estimate: bool = True
    extremes: list[str] | None = None
    record: Literal["none", "all"] | list[Count] = "none"
    timeout: Positive | None = None

    @property
    def values(self) -> dict[str, list[Any]]:
        """What varies: key → all its values."""
        return {key: v.values if isinstance(v, Range) else v for key, v in self.vary.items()}

    @property
    def hash(self) -> str:
        """What it is known by: a hash of all that it says."""
        text = json.dumps(plain(self.model_dump()), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if not self.scenario and "scenario" not in self.vary:
            raise ValueError('has no scenario; add scenario = "NAME" (see `orchestrator list`)')
        if not self.vary and self.sample is None:
            raise ValueError('has nothing that varies; add [vary], for instance "landing.position" = [20.0, 60.0]')
        sampled = self.sample.distributions if self.sample is not None else {}
        groups = (("set", self.set), ("vary", self.vary), ("sample", sampled))
        for i, (name, keys) in enumerate(groups):
            for other, theirs in groups[:i]:
                if both := sorted(keys.keys() & theirs.keys()):
                    raise ValueError(f"{both[0]} stands in [{other}] and in [{name}]; leave one of them out")
        if named := sorted({"robot", "scenario"} & {*self.set, *sampled}):
            raise ValueError(f"{named[0]} can stand in [vary] alone; a list of one value will do")
        if self.sensitivity is not None and self.sample is None:
            raise ValueError("has [sensitivity] without [sample]; say there how its parameters are distributed")
        self._can_be_refined()
        return self

    def _can_be_refined(self) -> None:
        if self.refine is None:
            return
        if self.sample is not None:
            raise ValueError(
                "has [refine] and [sample]; an outline is refined where nothing is drawn: take two studies"
            )
        for key in self.refine.widths:
            if key not in self.vary:
                raise ValueError(f"refine: {key} does not vary{nearest(key, self.vary)}; give its values in [vary]")
            numbers = [v["value"] if is_quantity(v) else v for v in self.values[key]]
            if len(numbers) < 2 or any(isinstance(v, bool) or not isinstance(v, int | float) for v in numbers):
                raise ValueError(f"refine: {key} needs two numbers at least in [vary], to add others between them")
            if len({str(v.get("unit", "")) if is_quantity(v) else "" for v in self.values[key]}) > 1:
                raise ValueError(f"refine: {key} has values in several units; give them in one")


# -- reading ----------------------------------------------------------------------------------------------------


def path_of(name: str) -> Path:
    """Return the path of a study: that of a file, or of one that is shipped."""
    folder = shipped().parent
    beside = folder / f"{name}.toml"
    if not name.endswith(".toml") and not Path(name).exists() and beside.is_file():
        return beside
    if not Path(name).is_file():
        known = sorted(path.stem for path in folder.glob("*.toml"))
        raise InputError(f"{name}: no such study{nearest(name, known)}; give a TOML file, or {', '.join(known)}")
    return Path(name)


def load_study(path: Path) -> Study:
    """Read the study at `path`; `InputError` says all that is wrong with it."""
    return study_of(read(path), path)


def study_of(document: Mapping[str, Any], path: Path) -> Study:
    """Return the study that `document` says, with paths relative to that of `path`."""
    try:
        study = Study.model_validate(_flattened(document))
    except ValidationError as error:
        problems = (_in_the_file(str(one)) for one in complaints(error, Study))
        raise InputError(f"{path}: {_readable(problem)}" for problem in problems) from None
    study._path = path
    return study


def _in_the_file(problem: str) -> str:
    """Return what is wrong with the keys as they stand in the file."""
    for name, (_, rest) in OWN_KEYS.items():
        problem = problem.replace(f"{name}.{rest}", name)
    return problem


def _readable(problem: str) -> str:
    """Return what is wrong without the names of our types."""
    return problem.replace(".Range", "").replace(".list[any]", "").replace(".constrained-list", "")


def _flattened(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the document with keys in one piece: ``landing.position = …`` as ``"landing.position" = …``."""
    found = dict(document)
    for name in ("set", "vary"):
        if isinstance(found.get(name), Mapping):
            found[name] = dict(_leaves(found[name]))
    for name, (own_keys, rest) in OWN_KEYS.items():
        table = found.get(name)
        if isinstance(table, Mapping):
            own = {key: value for key, value in table.items() if key in own_keys}
            parameters = {key: value for key, value in table.items() if key not in own_keys}
            found[name] = {**own, rest: dict(_leaves(parameters))}
    return found


def _leaves(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, Mapping) and not _is_value(value):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def _is_value(table: Mapping[str, Any]) -> bool:
    """Whether a table stands for one value, a range or a distribution, and is no table of names."""
    return is_whole(dict(table)) or any(key in table for key in ("from", "to", "count", *WORDS))
