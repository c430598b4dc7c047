"""Do two versions of the program give the same numbers, bit for bit?

    python -m verification.identical --write DIR      with the version before a change
    python -m verification.identical --against DIR    with the version after it

Bits depend on the processor, so that both are made on one machine. A change that only moves or merges code must leave
every table as it was: landings, drops, the rig, the oscillator, robots of several wheels, coupled by several masters,
and the monolithic reference.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from orchestrator.coupling.run.results import read_fields, read_table

MASTERS = ("--masters", "jacobi,gauss_seidel,iqn_ils,semi_implicit", "--macro-steps", "0.005,0.0025", "--stop", "1")
SHORT = {"landing_200m_point9": ("--stop", "5")}
CASES: dict[str, tuple[str, ...]] = {}
for _name in ("landing_200m_point9", "drop_5cm", "rig_10m", "oscillator"):
    CASES[_name] = ("compare", _name, *SHORT.get(_name, ()))
    CASES[f"{_name}-masters"] = ("compare", _name, *MASTERS)
for _robot in ("hybrid_robot_1", "hybrid_robot_2", "linedrone"):
    CASES[f"mid-{_robot}"] = ("run", "landing_200m_midspan", "--robot", _robot, "--stop", "2")
CASES["rig-adaptive"] = ("run", "rig_10m_inclined", "--stop", "2", "--set", "master.local_tolerance=1e-5")


def make(folder: Path, names: list[str]) -> None:
    """Run the cases `names` into `folder`, a directory each."""
    for name in names:
        command, scenario, *options = CASES[name]
        call = [sys.executable, "-m", "orchestrator", command, f"scenarios/{scenario}.toml", *options]
        done = subprocess.run([*call, "--out", str(folder / name), "--quiet"], capture_output=True, text=True)
        print(f"{name}: made, status {done.returncode} {done.stderr.strip()}", flush=True)


def differences(old: Path, new: Path) -> Iterator[str]:
    """Yield a line for each table or field of `old` that `new` has not, bit for bit."""
    for path in sorted([*old.rglob("*.csv"), *old.rglob("*.h5")]):
        place, other = path.relative_to(old), new / path.relative_to(old)
        if not other.is_file():
            yield f"{place}: missing"
            continue
        read = read_table if path.suffix == ".csv" else read_fields
        before, after = read(path), read(other)
        yield from (f"{place}: {name}: missing" for name in before if name not in after)
        for name in (n for n in before if n in after and not _same(before[n], after[n])):
            yield f"{place}: {name}: differs by up to {_largest(before[name], after[name])}"


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    return a.shape == b.shape and a.tobytes() == b.tobytes()


def _largest(a: np.ndarray, b: np.ndarray) -> str:
    return f"{np.nanmax(np.abs(a - b)):.3g}" if a.shape == b.shape else f"shape {a.shape}, now {b.shape}"


def main() -> int:
    """Write or compare; the status is 1 if anything differs."""
    parser = argparse.ArgumentParser(
        prog="python -m verification.identical", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--write", type=Path, help="folder to write the tables to")
    parser.add_argument("--against", type=Path, help="folder with the tables of another version")
    parser.add_argument("--cases", nargs="*", default=list(CASES), choices=list(CASES), metavar="CASE")
    options = parser.parse_args()
    if options.write:
        make(options.write, options.cases)
        return 0
    if not options.against:
        parser.error("give --write DIR or --against DIR")
    with tempfile.TemporaryDirectory() as folder:
        make(Path(folder), options.cases)
        found = [line for name in options.cases for line in differences(options.against / name, Path(folder, name))]
    print("\n".join(found) or f"{len(options.cases)} cases are the same, bit for bit")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
