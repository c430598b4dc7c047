"""Two masses, stiff coupling: stability at steps that do not resolve the coupling."""

from benchmarks.pack.case import Case
from benchmarks.pack.solutions import linear

CASE = Case(
    name="oscillator_stiff",
    title="two masses, stiff coupling",
    stresses="Stability: the coupling's own period of 16 ms is shorter than a macro step, the motion that counts is slow.",
    signals=("left.position", "right.position"),
    expensive="left",
    stop=2.0,
    grid=0.02,
    implicit=(0.02, 0.01, 0.005),
    explicit=(0.0002, 0.0001),
    others=(0.0002, 0.0001),
    quick=0.4,
    solution=linear,
)
