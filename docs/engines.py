"""Hold our explicit master against other engines that run our exports; write docs/engines.json and the page's table.

python docs/engines.py            measures (extra `engines`; a few minutes)
python docs/engines.py --fill     fills the page from the file alone
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
FILE, PAGE = ROOT / "docs" / "engines.json", ROOT / "docs" / "notebook" / "engines.md"
BLOCK = re.compile(r"(<!-- measured: engines -->\n).*?(<!-- end -->)", re.S)
ENGINES = {"FMPy": "fmpy_ssp", "libcosim": "cosim_osp", "ecos": "ecos_ssp"}
CASES: dict[str, dict[str, Any]] = {
    "two oscillators, 1 s": {
        "scenario": "oscillator", "stop": 1.0, "steps": (4e-3, 2e-3, 1e-3), "signal": "left.position", "set": {},
    },
    "rig, a fall of 1 mm, 0.05 s": {
        "scenario": "rig_10m", "stop": 0.05, "steps": (4e-4, 2e-4, 1e-4), "signal": "robot.body.position.z",
        "set": {"landing.height": 0.001},
    },
}  # fmt: skip


def measured() -> list[dict[str, Any]]:
    """Return a row for each case and step."""
    return [row(name, case, step) for name, case in CASES.items() for step in case["steps"]]


def row(name: str, case: dict[str, Any], step: float) -> dict[str, Any]:
    """Return the largest difference of each engine from `jacobi`, as a share of the signal's range."""
    import orchestrator
    from orchestrator.export.write import export
    from tests.engines import by_engine

    changes = {"macro_step": step, "stop": case["stop"], "set": case["set"], "master": "jacobi"}
    ours = orchestrator.run(case["scenario"], estimate="none", **changes)[case["signal"]].values
    with tempfile.TemporaryDirectory() as folder:
        ssp, osp = Path(folder, "model.ssp"), Path(folder, "osp")
        export(orchestrator.load_scenario(case["scenario"], **changes), ssp_file=ssp, osp_folder=osp)
        found = {}
        for engine, runner in ENGINES.items():
            place = osp if runner.endswith("osp") else ssp
            theirs = by_engine(runner, place, step, len(ours) - 1, case["signal"])[:, 0]
            found[engine] = float(np.max(np.abs(theirs - ours[1:])) / np.ptp(ours))
    return {"case": name, "step": step, "difference": found}


def table(rows: list[dict[str, Any]]) -> str:
    """Return the table of the page."""
    head = f"| | step | {' | '.join(ENGINES)} |\n|---|---|{'---|' * len(ENGINES)}\n"
    lines = []
    for one in rows:
        numbers = " | ".join(f"{one['difference'][engine]:.1e}" for engine in ENGINES)
        lines.append(f"| {one['case']} | {1e3 * one['step']:g} ms | {numbers} |\n")
    return head + re.sub(r"e([-+])0(\d)", r"e\1\2", "".join(lines))


def filled(text: str, rows: list[dict[str, Any]]) -> str:
    """Return the page with the table of these rows."""
    return BLOCK.sub(lambda m: m[1] + table(rows) + m[2], text)


def main() -> None:
    """Measure, unless only filling is asked for, and fill the page."""
    sys.path.insert(0, str(ROOT))
    if "--fill" not in sys.argv:
        FILE.write_text(json.dumps(measured(), indent=1) + "\n", encoding="utf-8")
    rows = json.loads(FILE.read_text(encoding="utf-8"))
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), rows), encoding="utf-8")


if __name__ == "__main__":
    main()
