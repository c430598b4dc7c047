"""Two masses, soft coupling: whether a master has the order that it claims."""

from benchmarks.pack.case import Case
from benchmarks.pack.solutions import linear

CASE = Case(
    name="oscillator_soft",
    title="two masses, soft coupling",
    stresses="The order of a master and of its exchange, with nothing in the way.",
    signals=("left.position", "right.position"),
    expensive="left",
    stop=2.0,
    grid=0.04,
    implicit=(0.04, 0.02, 0.01),
    explicit=(0.01, 0.005, 0.0025),
    others=(0.01, 0.005, 0.0025),
    quick=1.0,
    solution=linear,
)
