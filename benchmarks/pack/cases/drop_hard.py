"""The same drop onto a contact a hundred times as stiff."""

from benchmarks.pack.case import Case
from benchmarks.pack.solutions import monolithic

CASE = Case(
    name="drop_hard",
    title="drop from 5 cm, hard contact",
    stresses="The same with 1e10 N/m^2.5: the contact is far too stiff for any step that a line would need.",
    signals=("robot.body.position.z", "robot.roll"),
    expensive="cable",
    stop=2.0,
    grid=0.02,
    implicit=(0.01, 0.005, 0.0025),
    explicit=(0.0005, 0.00025),
    others=(0.00025, 0.000125),
    quick=0.3,
    solution=monolithic,
)
