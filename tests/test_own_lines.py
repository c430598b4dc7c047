"""The three lines of our own, and the studies of which robots may land on them."""

import pytest

from orchestrator.catalogue.conductor_spec import load_conductor
from orchestrator.landing.limits import limits_of
from orchestrator.landing.resolve import resolve
from orchestrator.scenario.read import load
from orchestrator.studies.sweep import design
from orchestrator.studies.sweep.study import load_study, path_of

LINES = {
    "line_110kv": ("jl_g1a_240_30", 250.0, 0.0),
    "line_220kv": ("jl_g1a_400_35", 400.0, 15.0),
    "crossing_opgw": ("opgw_105", 600.0, 40.0),
}


@pytest.mark.parametrize("name", LINES)
def test_a_line_hangs_as_it_was_strung(name: str):
    """At 20 % of the rated strength, as deep as a parabola of that tension: w l c/(8 H), c the chord, to (sag/span)².

    The middle of the line is beyond the middle of the span by the sag times the slope of the chord, and so much higher.
    """
    conductor, span, level = LINES[name]
    landing, spec = resolve(load(name)), load_conductor(conductor)
    rest = landing.rest
    assert rest is not None and spec.rated_strength is not None
    assert rest.horizontal_tension == pytest.approx(0.2 * spec.rated_strength.value, rel=1e-7)
    weight, chord = 9.81 * spec.linear_density.value, (span**2 + level**2) ** 0.5
    assert rest.sag == pytest.approx(
        weight * span * chord / (8.0 * rest.horizontal_tension) * (1.0 - (level / span) ** 2),
        rel=4.0 * (rest.sag / span) ** 2,
    )
    assert rest.share_of_strength is not None and 0.2 < rest.share_of_strength < 0.21
    known = limits_of(landing).known
    assert {"roll", "yaw", "pitch", "z", "tension"} <= set(known) and known["z"].value > 1.0


@pytest.mark.parametrize("name", ["robots_110kv", "robots_220kv", "robots_crossing"])
def test_the_studies_of_robots_on_lines(name: str):
    study = load_study(path_of(name))
    assert len(design.groups(study)) == 4 and study.sample is not None
    law = study.sample.distributions["landing.position"].uniform
    span = LINES[study.scenario][1]
    assert law is not None and list(law) == [10.0, span - 10.0]
