"""What a referee asks for beside the paper's claims: tables of one thing varied at a time, and what they say."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from orchestrator.coupling.run.results import Table
from orchestrator.runs.job import Done
from orchestrator.studies.book import Book, measured
from orchestrator.studies.markdown import filled, number, table

Z, ROLL, PITCH, YAW, FORCE = (
    "robot.body.position.z", "robot.roll", "robot.pitch", "robot.yaw", "contact1.radial_force",
)  # fmt: skip
AIR_DENSITY, DRAG, DIAMETER, LINE = 1.225, 1.0, 0.018, 0.91
"""kg/m³ at sea level; C_d of a cylinder below the drag crisis (Hoerner 1965); m and kg/m of the paper's line."""
DIGITS = 4
"""Of a number in a table."""
STILL_SPEED, WIND = 1.0, 10.0
"""m/s: how fast the line moves near the robot in a landing; the wind."""


@dataclass(frozen=True)
class Asked:
    """A column of the tables: a measure of a signal, in a unit."""

    title: str
    measure: str
    signal: str
    unit: str

    def of(self, run: Table) -> float:
        """Return it for a run."""
        return measured(run, self.measure, self.signal, self.unit)[0]


Z_PEAK = Asked("relative peak of Z [m]", "peak", Z, "m")
ROLL_PEAK = Asked("peak of roll [°]", "largest", ROLL, "deg")
SETTLING = Asked("Z settles [s]", "settling_time", Z, "s")
FORCE_PEAK = Asked("peak force [N]", "highest", FORCE, "N")
SINKS = Asked("sinks in [mm]", "settled", "contact1.penetration", "mm")
YAW_END = Asked("yaw at the end [°]", "end", YAW, "deg")
PITCH_PEAK = Asked("largest pitch [°]", "largest", PITCH, "deg")
USUAL = (Z_PEAK, ROLL_PEAK, SETTLING)
SENSITIVE = (Z_PEAK, ROLL_PEAK, FORCE_PEAK)


def still_air(speed: float = STILL_SPEED) -> float:
    """Return which alpha (1/s) does as much work in a cycle as the quadratic drag of still air on a line that swings with
    the velocity amplitude `speed` (m/s): 8/(3 π) · ½ ρ_air C_d d v / ρA."""
    return 8.0 / (3.0 * math.pi) * 0.5 * AIR_DENSITY * DRAG * DIAMETER * speed / LINE


def windy(wind: float = WIND) -> tuple[float, float]:
    """Return the alpha (1/s) of drag linearised about a cross wind (m/s), for motion across it and along it:
    ½ ρ_air C_d d U / ρA and twice that."""
    along = AIR_DENSITY * DRAG * DIAMETER * wind / LINE
    return 0.5 * along, along


def sections(book: Book) -> Iterator[str]:
    """Yield the sections of the page: one for each series that the study has, and the sensitivity."""
    writers = {
        "damping": _damping,
        "mesh": _mesh,
        "area": _area,
        "contact": _contact,
        "yaw": _yaw,
        "set_down": _set_down,
    }
    yield "## What a referee asks for"
    for name, write in writers.items():
        if name in book.documents.landings.series:
            yield write(book)
    if book.sensitivity:
        yield _sensitivity(book)


def tables_of(book: Book, series: str) -> list[tuple[str, float | None, Table | None]]:
    """Return name, number and signals of every run of a series; None where it failed."""
    variants = book.documents.landings.series[series].variants
    return [(v.name, v.value, _table(book.series.get((series, v.name)))) for v in variants]


def _table(done: Done | None) -> Table | None:
    return None if done is None or done.failure is not None else done.table


def _damping(book: Book) -> str:
    low, high = windy()
    words = (
        "Drag per length is ½ ρ_air C_d d |v_n| v_n. In still air a line that swings with the velocity amplitude v loses "
        f"as much in a cycle as alpha = 8/(3 π) · ½ ρ_air C_d d v / ρA takes: {still_air():.2g} 1/s at {STILL_SPEED:g} m/s. "
        "About a cross wind U the same force is linear, alpha = ½ ρ_air C_d d U / ρA for motion across it and twice that "
        f"along it: {low:.2g} and {high:.2g} 1/s at {WIND:g} m/s. The last row is a run with that drag of still air "
        "itself, in the place of alpha. The paper's 1.0 1/s is beyond both: that all landings are safe rests on it."
    )
    return _section(book, "Where the damping comes from", "damping", "alpha [1/s]", USUAL, words, "damping")


def _mesh(book: Book) -> str:
    words = (
        "The line bends under the wheel over a length of sqrt(EI/T), 0.17 m; elements that are longer make it stiffer. The "
        "paper's 20 equal elements are 10 m long. Steps are half of what the rows are apart; the judged runs have 10 ms."
    )
    rows = tables_of(book, "mesh")
    finest = next((one for name, _, one in rows if "eighth" in name), None)
    extra = [("off in Z", Z_PEAK), ("off in roll", ROLL_PEAK)] if finest is not None else []
    head = ("mesh and step", *(asked.title for asked in USUAL), *(title for title, _ in extra))
    lines = []
    for name, _, found in rows:
        off = [_share(asked.of(found), asked.of(finest)) if found and finest else "–" for _, asked in extra]
        lines.append((name, *_cells(found, USUAL), *off))
    return "\n\n".join(["### Mesh and time step", filled(words), table(head, lines)])


def _share(value: float, of: float) -> str:
    return f"{100.0 * (value / of - 1.0):+.2f} %"


def _area(book: Book) -> str:
    words = (
        "E A for 125 to 1018 mm² at the paper's 79.8 GPa: 1.54e7 N is the metal of a stranded conductor, 2.03e7 N the solid "
        "rod, 8.12e7 N what Table 1 prints. The unstretched length stays that of the span."
    )
    return _section(book, "Axial stiffness", "area", "EA [N]", USUAL, words, "area")


def _contact(book: Book) -> str:
    words = (
        "The paper gives no stiffness of the contact. ADAMS' default, 1e5 N/mm, is 1e8 N/m at an exponent of 1 alone; at the "
        "paper's 2.5 it is 3.16e12, and 38 kg sink 0.2 mm in place of half the line's diameter. With the line damped the "
        "choice moves Z by a few per cent. Undamped, bounce and pendulum are near resonance, and roll answers to it."
    )
    title, asked = "Stiffness and damping of the contact", (Z_PEAK, ROLL_PEAK, FORCE_PEAK, SINKS)
    return _section(book, title, "contact", "contact", asked, words)


def _yaw(book: Book) -> str:
    words = (
        "A symmetric robot on a straight line neither yaws nor pitches. An axle that is misaligned turns the robot by as much, "
        "as the groove aligns with the line: it swings about that angle, and comes to rest there. A "
        "centre of mass to the side makes it lean, and hardly turn; one ahead makes it roll."
    )
    return _section(
        book, "What yaw and pitch come from", "yaw", "robot", (YAW_END, PITCH_PEAK, ROLL_PEAK), words, "yaw"
    )


def _set_down(book: Book) -> str:
    words = (
        "Let go, the robot's weight is on the line at once, and the force overshoots. Set down by a thrust that falls from its "
        "weight to zero, it hardly does: the experiment's peak of 400 N is that of a robot that was set down."
    )
    asked = (FORCE_PEAK, Asked("Z by that in the end", "overshoot", Z, "1"))
    return _section(book, "Set down or let go", "set_down", "", asked, words, "set_down")


def _section(
    book: Book, title: str, series: str, first: str, asked: Sequence[Asked], words: str, picture: str = ""
) -> str:
    rows = ((name, *_cells(found, asked)) for name, _, found in tables_of(book, series))
    head = (first or "run", *(one.title for one in asked))
    shown = [f"![{title}](figures/reproduction/{picture}.png)"] if picture else []
    return "\n\n".join([f"### {title}", filled(words), table(head, rows), *shown])


def _cells(found: Table | None, asked: Iterable[Asked]) -> list[str]:
    return [number([one.of(found)], DIGITS) if found is not None else "failed" for one in asked]


# -- sensitivity ----------------------------------------------------------------------------------------------


def base_table(book: Book) -> Table | None:
    """Return the signals of the run about which the assumed numbers are varied."""
    return book.table("point9", book.judged_by)


def effects(book: Book) -> list[tuple[str, list[tuple[float, float]]]]:
    """Return for each number assumed by how much its lower and its upper bound change `SENSITIVE`, as parts of the base."""
    base, found = base_table(book), []
    for assumed in book.documents.landings.assumed:
        tables = [_table(book.sensitivity.get((assumed.name, end))) for end in ("low", "high")]
        if base is None or None in tables:
            continue
        found.append((assumed.name, [tuple(_change(one, t, base) for t in tables if t) for one in SENSITIVE]))
    return found  # type: ignore[return-value]


def _change(asked: Asked, table: Table, base: Table) -> float:
    return asked.of(table) / asked.of(base) - 1.0


def _sensitivity(book: Book) -> str:
    words = (
        "Every number that the paper leaves open, at the lower and the upper end of what it may be, the others as in the "
        "judged set, point 9, 38 kg. Shares of the base's value, lower bound / upper bound."
    )
    bounds = {one.name: one for one in book.documents.landings.assumed}
    rows = (
        (name, f"{bounds[name].low:g} … {bounds[name].high:g}", *(_both(pair) for pair in pairs), bounds[name].reason)
        for name, pairs in effects(book)
    )
    head = ("number", "from … to", *(one.title.split(" [")[0] for one in SENSITIVE), "reason")
    shown = "![Sensitivity](figures/reproduction/sensitivity.png)"
    return "\n\n".join(["### Sensitivity to every assumed number", filled(words), table(head, rows), shown])


def _both(pair: tuple[float, float]) -> str:
    return " / ".join(f"{100.0 * share:+.1f} %" for share in pair)
