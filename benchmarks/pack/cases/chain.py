"""A chain of six masses: what one end does reaches the other through five interfaces."""

from benchmarks.pack.case import Case
from benchmarks.pack.solutions import linear

CASE = Case(
    name="chain",
    title="a chain of six masses",
    stresses="Many interfaces in a row: a master that moves values once a step delays a wave at each of them.",
    signals=("m1.position", "m6.position"),
    expensive="m1",
    stop=2.0,
    grid=0.04,
    implicit=(0.04, 0.02, 0.01),
    explicit=(0.002, 0.001, 0.0005),
    others=(0.002, 0.001, 0.0005),
    quick=0.4,
    solution=linear,
)
