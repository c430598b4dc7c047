"""Two masses that meet: a touch and a parting inside a macro step."""

from benchmarks.pack.case import Case
from benchmarks.pack.solutions import impact

CASE = Case(
    name="oscillator_impact",
    title="two masses that meet",
    stresses="Touch and parting inside a macro step: the impact lasts 10 ms, the force is zero before and after.",
    signals=("left.position", "right.position"),
    expensive="left",
    stop=1.0,
    grid=0.01,
    implicit=(0.01, 0.005, 0.0025, 0.00125),
    explicit=(0.00025, 0.000125),
    others=(0.00025, 0.000125),
    quick=0.3,
    solution=impact,
)
