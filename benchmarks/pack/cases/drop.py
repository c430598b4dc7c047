"""A drop from 5 cm onto the 200 m span."""

from benchmarks.pack.case import Case
from benchmarks.pack.solutions import monolithic

CASE = Case(
    name="drop",
    title="drop from 5 cm",
    stresses="A hard impact on a flexible line, and what bounces after it, with a contact of 1e8 N/m^2.5.",
    signals=("robot.body.position.z", "robot.roll"),
    expensive="cable",
    stop=2.0,
    grid=0.02,
    implicit=(0.01, 0.005, 0.0025),
    explicit=(0.001, 0.0005),
    others=(0.0005, 0.00025),
    quick=0.3,
    solution=monolithic,
)
