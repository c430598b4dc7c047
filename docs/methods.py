"""Measure what the methods note shows, draw its pictures and fill its tables.

python docs/methods.py                 measures (some minutes); writes docs/methods.json, the pictures, the tables
python docs/methods.py limits energy   measures these parts alone
python docs/methods.py --fill          pictures and tables from the file alone
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
FILE, FIGURES, NOTE = ROOT / "docs" / "methods.json", ROOT / "docs" / "figures", ROOT / "docs" / "methods"
PAGES = (NOTE / "prediction.md", NOTE / "energy.md")
BLOCK = re.compile(r"(<!-- measured: (\w+) -->\n).*?(<!-- end -->)", re.S)
FLAGSHIP, UNDAMPED, DROP = "landing_200m_point9", "landing_200m_point9_undamped", "drop_5cm"
STEP, LONGEST = 0.005, 6
"""s, macro step of the pictures; macro steps that a load is remembered at most."""
LIMITS = (
    ("flagship, 10 s", FLAGSHIP, 10.0, None, (0.0025, 0.005, 0.01, 0.02)),
    ("drop of 5 cm, 1 s, k = 1e8", DROP, 1.0, 1e8, (0.005, 0.01)),
    ("drop of 5 cm, 1 s, k = 1e10", DROP, 1.0, 1e10, (0.005, 0.01)),
)
"""Name, scenario, s, stiffness of the contact, macro steps."""
TOLERANCES, BUDGETS = (1e-6, 1e-4, 1e-2), ("none", "dissipated", 0)
Found = dict[str, Any]


# -- measuring ----------------------------------------------------------------------------------------------------


def memories() -> list[Found]:
    """Return the solves by the steps that a load is remembered."""
    return [solves(FLAGSHIP, 10.0, STEP, {"master.memory": lags * STEP}) for lags in range(LONGEST + 1)]


def limits() -> list[Found]:
    """Return the solves of each case and step with both predictions."""
    return [
        {"case": name, "step": step, **{kind: limit(one, stop, k, step, kind) for kind in ("model", "polynomial")}}
        for name, one, stop, k, steps in LIMITS
        for step in steps
    ]


def energies() -> list[Found]:
    """Return what is made by tolerance and budget."""
    return [energy(tolerance, budget) for tolerance in TOLERANCES for budget in BUDGETS]


def limit(scenario: str, stop: float, stiffness: float | None, step: float, prediction: str) -> Found:
    """Return the solves of a case with one prediction."""
    changes: Found = {"master.prediction": prediction}
    return solves(
        scenario, stop, step, changes | ({} if stiffness is None else {"contact.parameters.stiffness": stiffness})
    )


def solves(scenario: str, stop: float, step: float, changes: Found) -> Found:
    """Return cable solves a macro step (what is measured once included), and the shares of steps with one, and by models."""
    from orchestrator.api import load_scenario
    from orchestrator.runs.coupled import run_coupled

    log = run_coupled(load_scenario(scenario, stop=stop, macro_step=step, set=changes)).log
    steps, n = log.steps, len(log.reports)
    return {
        "solves": log.solves["cable"] / (n - 1),
        "one": float(np.mean(steps.column("iterations") == 1)),
        "by_model": float(np.mean(steps.column("by_model"))),
    }


def energy(tolerance: float, budget: str | float) -> Found:
    """Return the most that the coupling had made at any time, by the energy exchanged, and the solves, on an undamped line."""
    from orchestrator.api import load_scenario
    from orchestrator.runs.coupled import run_coupled

    changes = {"master.tolerance": tolerance, "master.energy_budget": budget}
    run = run_coupled(load_scenario(UNDAMPED, stop=10.0, macro_step=STEP, set=changes))
    made = np.cumsum(run.log.steps.column("energy_made"))
    assert run.energy is not None
    return {
        "tolerance": tolerance,
        "budget": str(budget),
        "made": float(np.max(made)) / run.energy.exchanged,
        "last": float(made[-1]) / run.energy.exchanged,
        "solves": run.log.solves["cable"] / (len(made) - 1),
    }


def free_response(scenario: str, stop: float) -> Found:
    """Return, step by step, what the line shows beyond constant velocity, and what is left of it when loads are explained."""
    from orchestrator.api import load_scenario
    from orchestrator.coupling.run.simulate import simulate
    from orchestrator.runs.components import master_of, opened, recorded
    from orchestrator.runs.systems import resolve

    changes = {"master.memory": LONGEST * STEP}
    system = resolve(load_scenario(scenario, stop=stop, macro_step=STEP, set=changes))
    past: list[Any] = []
    with opened(system) as graph:
        master: Any = master_of(system.scenario, graph)
        model = next(one for one in master.models if one.node.name == "cable")

        def keep(_: Any) -> None:
            past.append(model.free.past[STEP][0])

        simulate(graph, master, 0.0, stop, STEP, recorded(graph, system.scenario), keep)
        free, names = model.free, model.node.outputs.names
        start, end, x = (np.array([getattr(one, key) for one in past]) for key in ("start", "end", "x"))
        unknowns = model.node.inputs.names
        responses = np.concatenate([model.jacobians[STEP], free.pulses[STEP]], axis=1)
    i, m = names.index("port[1].position.z"), len(unknowns)
    seen = (end - start @ free.still.T - STEP * start @ free.moving.T)[:, i]
    rests = [seen - explained(x, responses[i], lags, m) for lags in (0, 1, 2, 4, 6)]
    return {
        "load": rounded(x[:, unknowns.index("port[1].force.z")]),
        "seen": rounded(seen),
        "rest": {str(lags): rounded(rest) for lags, rest in zip((0, 1, 2, 4, 6), rests, strict=True)},
        "moved": rounded(x @ responses[i, :m]),
    }


def explained(x: np.ndarray, responses: np.ndarray, lags: int, m: int) -> np.ndarray:
    """Return what the loads `x` (n, m) of a step and of the `lags` before it explain of one output, (n,)."""
    total = x @ responses[:m]
    for j in range(1, lags + 1):
        total[j:] += x[:-j] @ responses[j * m : (j + 1) * m]
    return total


def rounded(values: np.ndarray) -> list[float]:
    """Return numbers to eight digits: the file is read by people too."""
    return [float(f"{value:.8g}") for value in values]


PARTS: dict[str, Callable[[], Any]] = {
    "free": lambda: free_response(FLAGSHIP, 4.0),
    "memory": memories,
    "limits": limits,
    "energy": energies,
}


def measured(parts: list[str]) -> Found:
    """Return all numbers of the note, those of `parts` measured anew, all where none is named."""
    from orchestrator import __version__

    before = json.loads(FILE.read_text(encoding="utf-8")) if parts else {}
    return before | {"version": __version__} | {name: PARTS[name]() for name in parts or PARTS}


# -- drawing ------------------------------------------------------------------------------------------------------


def foretold(values: np.ndarray, degree: int) -> np.ndarray:
    """Return the error of extrapolating by one step with the polynomial of a degree through the last values, (n,)."""
    n = len(values)
    error = np.full(n, np.nan)
    error[degree + 1 :] = np.diff(values, degree + 1)  # value less what the polynomial says
    return np.abs(error)


def running(values: np.ndarray, n: int = 9) -> np.ndarray:
    """Return the root mean square of `n` neighbours, (len(values),)."""
    return np.sqrt(np.convolve(values**2, np.full(n, 1.0 / n), mode="same"))


def draw(found: Found) -> None:
    """Draw all pictures of the note."""
    sys.path.insert(0, str(ROOT))
    draw_free(found["free"], FIGURES / "prediction_free.png")
    draw_memory(found["memory"], FIGURES / "prediction_memory.png")
    draw_limits(found["limits"], FIGURES / "prediction_limits.png")


def draw_free(free: Found, path: Path) -> None:
    """Draw what is extrapolated: the load, the motion, what is left of it, and how well each is foretold."""
    from orchestrator.report.style import BLACK, BLUE, GREEN, VERMILION, saved

    shown = slice(0, 300)
    t = 1e3 * STEP * np.arange(1, len(free["load"]) + 1)[shown]
    seen, rest0, rest4 = (np.array(v) for v in (free["seen"], free["rest"]["0"], free["rest"]["4"]))
    with saved(path, (6.6, 5.6)) as figure:
        top, middle, bottom = figure.subplots(3, 1, sharex=True)
        top.step(t, np.array(free["load"])[shown], where="pre", color=BLACK)
        top.set_ylabel("load on the line, N")
        for values, colour, label in (
            (seen, BLACK, "motion beyond constant velocity"),
            (rest0, VERMILION, "less this step's load"),
            (rest4, BLUE, "less the last four loads too: what is extrapolated"),
        ):
            middle.plot(t, 1e3 * values[shown], color=colour, label=label)
        middle.set(ylabel="vertical, mm", ylim=(-0.5, 8.5))
        middle.legend(loc="upper right")
        moved = np.ptp(np.array(free["moved"]))
        for values, degree, colour, label in (
            (np.array(free["moved"]), 3, GREEN, "loads extrapolated (cubic)"),
            (rest0, 4, VERMILION, "free motion, without memory"),
            (rest4, 4, BLUE, "free motion, four steps of memory"),
        ):
            bottom.semilogy(t, (running(foretold(values, degree)) / moved)[shown], color=colour, label=label)
        bottom.set(xlabel="time, ms", ylabel="error of what is foretold,\nby what loads move", ylim=(1e-6, 1e-1))
        bottom.legend(loc="upper right")


def draw_memory(rows: list[Found], path: Path) -> None:
    """Draw why the memory matters: solves and the share of steps with one, by the steps that a load is remembered."""
    from orchestrator.report.style import BLUE, VERMILION, saved

    lags = np.arange(len(rows))
    with saved(path, (6.6, 2.6)) as figure:
        left, right = figure.subplots(1, 2)
        left.plot(lags, [row["solves"] for row in rows], "o-", color=VERMILION)
        left.set(xlabel="steps that a load is remembered, L", ylabel="cable solves a step", ylim=(1.0, None))
        right.plot(lags, [100.0 * row["one"] for row in rows], "o-", color=BLUE)
        right.set(xlabel="steps that a load is remembered, L", ylabel="steps with one solve, %", ylim=(0.0, 100.0))


def draw_limits(rows: list[Found], path: Path) -> None:
    """Draw the limits: solves from the models' beginning and from the polynomial's, and how often models were used."""
    from orchestrator.report.style import BLUE, GREY, saved

    place, width = np.arange(len(rows)), 0.38
    with saved(path, (6.6, 3.0)) as figure:
        axes = figure.subplots()
        for offset, kind, colour in ((-0.5, "polynomial", GREY), (0.5, "model", BLUE)):
            heights = [row[kind]["solves"] for row in rows]
            axes.bar(place + offset * width, heights, width, color=colour, label=f'prediction = "{kind}"')
        for i, row in enumerate(rows):
            text = f"{100.0 * row['model']['by_model']:.0f} %"
            axes.text(i + 0.5 * width, row["model"]["solves"] + 0.06, text, ha="center", fontsize=7, color=BLUE)
        words = [f"{short(row['case'])}\n{1e3 * row['step']:g} ms" for row in rows]
        axes.set_xticks(place, words, fontsize=7.5)
        axes.set(ylabel="cable solves a step", ylim=(0.0, 1.25 * max(row["model"]["solves"] for row in rows)))
        axes.grid(axis="x", visible=False)
        axes.legend(loc="upper left", ncols=2)


def short(case: str) -> str:
    """Return the name of a case as an axis has room for it."""
    return re.sub(r"drop of 5 cm, 1 s, k = ", "drop, ", case).replace(", 10 s", "")


# -- filling ------------------------------------------------------------------------------------------------------


def memory_table(found: Found) -> str:
    """Return the table of the memory."""
    lines = ["| steps remembered, L | cable solves a step | steps with one solve |", "|---|---|---|"]
    for lags, row in enumerate(found["memory"]):
        lines.append(f"| {lags} | {row['solves']:.2f} | {100 * row['one']:.0f} % |")
    return "\n".join(lines) + "\n"


def limits_table(found: Found) -> str:
    """Return the table of the limits."""
    lines = [
        "| case | macro step | solves, polynomial | solves, models offered | begun from the models |",
        "|---|---|---|---|---|",
    ]
    for row in found["limits"]:
        model, polynomial = row["model"], row["polynomial"]
        cells = f"{polynomial['solves']:.2f} | {model['solves']:.2f} | {100 * model['by_model']:.0f} %"
        lines.append(f"| {row['case']} | {1e3 * row['step']:g} ms | {cells} |")
    return "\n".join(lines) + "\n"


def energy_table(found: Found) -> str:
    """Return the table of the energy made."""
    lines = [
        "| tolerance | `energy_budget` | made, the most at any time | made, at the end | cable solves a step |",
        "|---|---|---|---|---|",
    ]
    for row in found["energy"]:
        numbers = f"{plain(row['made'])} | {plain(row['last'])} | {row['solves']:.2f}"
        lines.append(f"| {plain(row['tolerance'])} | `{row['budget']}` | {numbers} |")
    return "\n".join(lines) + "\n"


def plain(value: float) -> str:
    """Return a number with few digits and a short exponent."""
    return re.sub(r"e([-+])0(\d)", r"e\1\2", f"{value:.0e}" if abs(value) < 1e-300 else f"{value:.1e}")


BLOCKS = {"memory": memory_table, "limits": limits_table, "energy": energy_table}


def filled(text: str, found: Found) -> str:
    """Return `text` with every measured block as the numbers say."""
    return BLOCK.sub(lambda m: m[1] + BLOCKS[m[2]](found) + m[3], text)


def main() -> None:
    """Measure, unless only filling is asked for; draw, and fill the pages."""
    if "--fill" not in sys.argv:
        FILE.write_text(json.dumps(measured(sys.argv[1:])) + "\n", encoding="utf-8")
    found = json.loads(FILE.read_text(encoding="utf-8"))
    draw(found)
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8"), found), encoding="utf-8")


if __name__ == "__main__":
    main()
