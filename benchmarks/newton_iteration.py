"""Time of one Newton iteration of a cable of 20 elements: residual, and solution with a kept factorisation.

Generalized-alpha has one real stage, collocation two stages and one complex solution. Prints microseconds, each the
least of several repetitions.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np

from fmus.cable.assembly import Model, constrain_vector, iteration_matrix, residual
from fmus.cable.module import Cable
from fmus.cable.state import Work, make_work
from fmus.kernels import banded
from fmus.kernels.jit import kernel
from fmus.module.variables import Value

REPEAT, NUMBER = 20, 500
TARGET = 15.0
"""Microseconds of a real iteration that are aimed at."""


@kernel
def residuals(model, q, v, work, number):
    """Evaluate the residual of one stage a number of times."""
    for _ in range(number):
        residual(model, q, v, work.a[0], work.external, work.residual[0], work.axial, work.element)
        constrain_vector(model, work.residual[0])


@kernel
def solutions(band, x, number):
    """Solve a number of times."""
    for _ in range(number):
        for i in range(x.size):
            x[i] = 1.0
        banded.solve(band, x)


def microseconds(call: Callable[[], object]) -> float:
    """Return the least time of `call`, which repeats what is measured NUMBER times, for one of them."""
    call()
    times = []
    for _ in range(REPEAT):
        start = perf_counter()
        call()
        times.append(perf_counter() - start)
    return 1e6 * min(times) / NUMBER


def main() -> None:
    cable = Cable()
    cable.initialize(0.0)
    model, work = cable.model, make_work(cable.model.weight.size, cable.state.size)
    n, h = model.weight.size, 0.0025
    q, v = cable.state[:n].copy(), np.zeros(n)
    z = h * (0.25 + 0.14j)
    iteration_matrix(model, q, v, 1.0, 0.5 * h, 0.25 * h * h, work.real_band, work.real_matrix, work.element)
    iteration_matrix(model, q, v, 1.0 + 0.0j, z, z * z, work.band, work.matrix, work.element)
    banded.factorise(work.real_band)
    banded.factorise(work.band)
    stage = microseconds(lambda: residuals(model, q, v, work, NUMBER))
    real = microseconds(lambda: solutions(work.real_band, work.increment, NUMBER))
    both = microseconds(lambda: solutions(work.band, work.mode, NUMBER))
    print(f"residual of a stage          {stage:6.2f} µs")
    print(f"solution, real / complex     {real:6.2f} / {both:.2f} µs")
    print(f"iteration, generalized-alpha {stage + real:6.2f} µs (aim: {TARGET:g} µs)")
    print(f"iteration, collocation       {2 * stage + both:6.2f} µs (two stages)")
    print(f"iteration matrix, real       {_matrix_time(model, q, v, work):6.2f} µs, made anew once a macro step")
    for integrator in ("collocation", "generalized_alpha"):
        print(f"macro step of 5 ms, 2 inner  {_macro_step_time(integrator):6.1f} µs ({integrator}, all outputs)")


def _matrix_time(model: Model, q: np.ndarray, v: np.ndarray, work: Work) -> float:
    """Return the time to assemble and factorise the real iteration matrix, µs."""

    def make() -> None:
        for _ in range(NUMBER):
            iteration_matrix(model, q, v, 1.0, 1e-3, 1e-6, work.real_band, work.real_matrix, work.element)
            banded.factorise(work.real_band)

    return microseconds(make)


def _macro_step_time(integrator: str) -> float:
    """Return the mean time of a macro step of a cable that swings, µs; called from Python."""
    cable = Cable()
    settings: dict[str, Value] = {"integrator": integrator, "port[1].s": 60.0, "port[1].force.z": -372.0}
    cable.table.assign(cable.values, settings)
    cable.initialize(0.0)
    cable.step(0.0, 0.005)
    start = perf_counter()
    for k in range(1, NUMBER + 1):
        cable.step(0.005 * k, 0.005)
    return 1e6 * (perf_counter() - start) / NUMBER


if __name__ == "__main__":
    main()
