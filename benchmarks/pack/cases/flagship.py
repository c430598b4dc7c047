"""The landing of the paper: 38 kg on a 200 m span, 20 m from the tower, 25 s."""

from benchmarks.pack.case import Case
from benchmarks.pack.solutions import monolithic

CASE = Case(
    name="flagship",
    title="landing on a 200 m span",
    stresses="A stiff, damped, one-sided contact on a flexible line over a long time: errors and energy add up.",
    signals=("robot.body.position.z", "robot.roll"),
    expensive="cable",
    stop=25.0,
    grid=0.02,
    implicit=(0.01, 0.005, 0.0025),
    explicit=(0.002, 0.001),
    others=(0.002, 0.001),
    quick=0.5,
    solution=monolithic,
)
