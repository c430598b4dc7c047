"""A driven wheel rolls along the 10 m rig: the contact travels over the mesh."""

from benchmarks.pack.case import Case
from benchmarks.pack.solutions import monolithic

CASE = Case(
    name="rig_driving",
    title="driving along the 10 m rig",
    stresses="A load that moves: 2 N m drive a wheel along the line, over element after element; it slides, then rolls.",
    signals=("robot.body.position.z", "robot.body.position.y", "robot.roll"),
    expensive="cable",
    stop=1.0,
    grid=0.01,
    implicit=(0.01, 0.005, 0.0025, 0.00125),
    explicit=(0.0005, 0.00025),
    others=(0.0002, 0.0001),
    quick=0.2,
    solution=monolithic,
)
