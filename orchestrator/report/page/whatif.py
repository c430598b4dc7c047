"""What a page needs to solve landings anew: starts that runs have left, and the kernels as WebAssembly that they fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.coupling.run.results import read_json
from orchestrator.report.page.blob import packed
from orchestrator.report.page.scene import place_of

ABOUT, STARTS = "start.json", "start.bin"
"""What a run leaves in its folder."""
MODULE, MODULE_ABOUT = "landing.wasm", "landing.json"
"""What is built beside the template."""
ARRAY = "whatif.starts"
NOT_BUILT = "the solver was not built into this page (`make page` builds it where wasm-ld is installed)"
OTHER_KERNELS = "the solver in this page is of another version than the run; make the run again"


@dataclass(frozen=True)
class WhatIf:
    """The what-if of a page: its description (null: there is none), the starts as an array, the module to embed."""

    about: dict[str, Any] | None = None
    arrays: Mapping[str, np.ndarray] = field(default_factory=dict)
    module: str = ""


def whatif_of(folder: Path, web: Path) -> WhatIf:
    """Return the what-if of the run in `folder`."""
    if not (folder / ABOUT).is_file():
        return WhatIf()
    about = read_json(folder / ABOUT)
    why = about["reason"] or _unfit(about, web)
    if why:
        return WhatIf({"reason": why, "starts": []})
    starts = [with_scene(start) for start in about["starts"]]
    return WhatIf({**about, "starts": starts}, {ARRAY: words(folder)}, packed((web / MODULE).read_bytes()))


def whatif_of_cells(folders: Mapping[str, Path], web: Path) -> WhatIf:
    """Return the what-if of a sweep: a start for each of `folders` that has left one which fits, by the name of its cell."""
    found = {name: read_json(folder / ABOUT) for name, folder in folders.items() if (folder / ABOUT).is_file()}
    fitting = {name: about for name, about in found.items() if not about["reason"] and not _unfit(about, web)}
    if not fitting:
        return WhatIf()
    cells, blocks = dict[str, Any](), list[np.ndarray]()
    for name, about in fitting.items():
        start = with_scene(about["starts"][0])
        block = words(folders[name])[start["first"] : start["first"] + start["given"]]
        cells[name] = {**start, "first": sum(map(len, blocks)), "end": about["end"]}
        blocks.append(block)
    shared = next(iter(fitting.values()))
    content = {**shared, "starts": [next(iter(cells.values()))], "cells": cells}
    return WhatIf(content, {ARRAY: np.concatenate(blocks)}, packed((web / MODULE).read_bytes()))


def _unfit(about: Mapping[str, Any], web: Path) -> str:
    """Return why starts cannot be solved by the module that was built; empty if they can."""
    if not (web / MODULE).is_file() or not (web / MODULE_ABOUT).is_file():
        return NOT_BUILT
    return "" if read_json(web / MODULE_ABOUT)["kernels"] == about["kernels"] else OTHER_KERNELS


def words(folder: Path) -> np.ndarray:
    """Return the words (n,) float64 of all starts of a run."""
    return np.fromfile(folder / STARTS, "<f8")


def with_scene(start: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is to be known of a start, with the robot to draw in the place of its geometry."""
    kept = {key: value for key, value in start.items() if key != "geometry"}
    return kept | {"scene": place_of(start["geometry"])}
