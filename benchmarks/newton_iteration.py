"""CPU time of one Newton iteration of a cable of 20 elements: residual, and solution with a kept factorisation.

    python -m benchmarks.newton_iteration [ROUNDS]

Generalized-alpha has one real stage, collocation two stages and one complex solution. All take turns; printed are µs
(medians), and what collocation costs by generalized-alpha (median of the ratios within a round).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.clock import ratio, spent, turns
from fmus.cable.assembly import constrain_vector, iteration_matrix, residual
from fmus.cable.module import Cable
from fmus.cable.state import make_work
from fmus.kernels import banded
from fmus.kernels.jit import kernel
from fmus.module.variables import Value

NUMBER = 500
TARGET = 15.0
"""Microseconds of a real iteration that are aimed at."""
INTEGRATORS = ("collocation", "generalized_alpha")


@kernel
def residuals(model, q, v, work, number):
    """Evaluate the residual of one stage a number of times."""
    for _ in range(number):
        residual(model, q, v, work.a[0], work.external, work.residual[0], work.element)
        constrain_vector(model, work.residual[0])


@kernel
def solutions(band, x, number):
    """Solve a number of times."""
    for _ in range(number):
        for i in range(x.size):
            x[i] = 1.0
        banded.solve(band, x)


def contestants() -> dict[str, Callable[[], object]]:
    """Return what is measured; each call does it NUMBER times."""
    cable = Cable()
    cable.table.assign(cable.values, {"n_elements": 20})
    cable.initialize(0.0)
    model, work = cable.model, make_work(cable.model.weight.size, cable.state.size)
    n, h = model.weight.size, 0.0025
    q, v = cable.state[:n].copy(), np.zeros(n)
    z = h * (0.25 + 0.14j)
    iteration_matrix(model, q, v, 1.0, 0.5 * h, 0.25 * h * h, work.real_band, work.real_matrix, work.element)
    iteration_matrix(model, q, v, 1.0 + 0.0j, z, z * z, work.band, work.matrix, work.element)
    banded.factorise(work.real_band)
    banded.factorise(work.band)
    real, other = work.real_band.copy(), work.real_band.copy()

    def matrices() -> None:
        for _ in range(NUMBER):
            iteration_matrix(model, q, v, 1.0, 1e-3, 1e-6, other, work.real_matrix, work.element)
            banded.factorise(other)

    return {
        "residual of a stage": lambda: residuals(model, q, v, work, NUMBER),
        "solution, real": lambda: solutions(real, work.increment, NUMBER),
        "solution, complex": lambda: solutions(work.band, work.mode, NUMBER),
        "iteration matrix, real": matrices,
        **{f"macro step, {name}": Swing(name) for name in INTEGRATORS},
    }


class Swing:
    """A cable that swings; a call makes NUMBER macro steps of 5 ms with two inner steps and all outputs, from Python."""

    def __init__(self, integrator: str):
        self.cable, self.k = Cable(), 0
        load: dict[str, Value] = {"port[1].s": 60.0, "port[1].force.z": -372.0}
        settings = load | {"integrator": integrator, "n_elements": 20}
        self.cable.table.assign(self.cable.values, settings)
        self.cable.initialize(0.0)

    def __call__(self) -> None:
        for _ in range(NUMBER):
            self.cable.step(0.005 * self.k, 0.005)
            self.k += 1


def main(rounds: int = 20) -> None:
    """Print the table."""
    made = contestants()
    for call in made.values():
        call()  # compiles
    times = {name: 1e6 * values / NUMBER for name, values in turns(_clocked(made), rounds).items()}
    stage = times["residual of a stage"]
    times["iteration, generalized-alpha"] = stage + times["solution, real"]
    times["iteration, collocation"] = 2.0 * stage + times["solution, complex"]
    for name, values in times.items():
        print(f"{name:32}{np.median(values):8.2f} µs")
    print(f"aim of an iteration, generalized-alpha: {TARGET:g} µs")
    print(f"collocation by generalized-alpha: an iteration {_by(times, 'iteration, collocation')}", end=", ")
    print(f"a macro step {ratio(times, *(f'macro step, {name}' for name in INTEGRATORS)):.2f}")


def _clocked(made: dict[str, Callable[[], object]]) -> dict[str, Callable[[], float]]:
    return {name: partial(spent, call) for name, call in made.items()}


def _by(times: dict[str, np.ndarray], name: str) -> str:
    return f"{ratio(times, name, 'iteration, generalized-alpha'):.2f}"


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
