"""Who writes the modes of a cable: a table, and the shapes."""

from __future__ import annotations

import csv

import numpy as np

from orchestrator.coupling.run.results import replacing
from orchestrator.landing.modes import CableModes, Modes, sample
from orchestrator.runs.directory import RunDirectory

HEAD = ("plane", "mode", "frequency [Hz]", "damping ratio [1]")
UNITS = {"equilibrium": "m", "out": "m", "in": "m", "out.frequency": "Hz", "in.frequency": "Hz"}


def write_modes(directory: RunDirectory, found: CableModes) -> None:
    """Write ``modes.csv``, a row a mode, and ``modes.h5``, what `shapes` returns."""
    planes = {"out": found.out_of_plane, "in": found.in_plane}
    with replacing(directory.path / "modes.csv") as temporary, temporary.open("w", newline="") as file:
        csv.writer(file).writerows([HEAD, *(row for plane, group in planes.items() for row in _rows(plane, group))])
    directory.write_fields("modes.h5", shapes(found), UNITS)


def _rows(plane: str, group: Modes) -> list[tuple[str, int, str, str]]:
    pairs = zip(group.frequency.tolist(), group.damping_ratio.tolist(), strict=True)
    return [(plane, k, repr(frequency), repr(damping)) for k, (frequency, damping) in enumerate(pairs, start=1)]


def shapes(found: CableModes) -> dict[str, np.ndarray]:
    """Return the equilibrium (m, 3), and the frequencies (n,) and sampled shapes (n, m, 3) of either plane."""
    planes = {"out": found.out_of_plane, "in": found.in_plane}
    sampled = {name: np.array([sample(found.model, x) for x in group.shape]) for name, group in planes.items()}
    return {"equilibrium": found.equilibrium, **sampled, **{f"{n}.frequency": g.frequency for n, g in planes.items()}}
