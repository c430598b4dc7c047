"""Maps of a sweep: the worst of all runs at a place, stretches that are safe, pictures that can be read."""

from pathlib import Path

import numpy as np
import pytest
from swept import ALONG, MASSES, hump, swept

from orchestrator.coupling.errors import InputError
from orchestrator.studies.sweep import maps
from orchestrator.studies.sweep.ranges import all_ranges, cell, safe_ranges, stretches


def test_the_worst_of_all_runs_stands_for_a_place():
    _, outcomes = swept(ALONG, hump)
    assert cell(outcomes[:1]).binding == "roll" and cell(outcomes[:1]).margin == pytest.approx(0.5)
    worst = cell(outcomes[:4])
    assert worst.binding == "z" and worst.margin == pytest.approx(-0.5) and worst.safe is False
    nothing = cell([])
    assert nothing.safe is None and np.isnan(nothing.margin)


def test_what_failed_is_never_safe():
    study, outcomes = swept(ALONG, lambda position, mass: None if position == 50.0 else {"z": 0.5})
    assert cell(outcomes).safe is None and cell(outcomes).margin == pytest.approx(0.5)
    assert safe_ranges(study, outcomes, "landing.position").startswith(
        "landing.position: safe from 20 to 40 m, from 60 to 80 m"
    )


def test_where_it_is_safe_in_words():
    study, outcomes = swept(ALONG, hump)
    assert all_ranges(study, outcomes) == ["landing.position: safe from 20 to 30 m, from 70 to 80 m (7 values)"]
    study, outcomes = swept(ALONG | MASSES, hump)
    assert all_ranges(study, outcomes) == [
        "landing.position: safe from 20 to 30 m, from 70 to 80 m (7 values); robot.parameters.mass 10.0",
        "landing.position: safe at 30 m, from 70 to 80 m (7 values); robot.parameters.mass 38.0",
    ]
    study, outcomes = swept(ALONG, lambda position, mass: {"z": -1.0})
    assert all_ranges(study, outcomes) == ["landing.position: safe nowhere (7 values)"]
    study, outcomes = swept({"robot": ["fptlir", "miniature"]}, lambda position, mass: {"z": 1.0})
    assert all_ranges(study, outcomes) == ["robot: safe with fptlir, miniature"]


def test_stretches():
    assert stretches([True, True, False, True]) == [(0, 1), (3, 3)] and stretches([False]) == []


def test_a_map_shows_margins_limits_and_outline(tmp_path: Path):
    study, outcomes = swept(ALONG | MASSES, hump)
    axis, bar = maps.draw(study, outcomes, "landing.position", "robot.parameters.mass").axes
    (image,) = axis.images
    shown = np.asarray(image.get_array())
    expected = [[100.0 * min(hump(20.0 + 10.0 * i, mass).values()) for i in range(7)] for mass in (10.0, 38.0)]
    assert shown == pytest.approx(np.array(expected))
    texts = [text.get_text() for text in axis.texts]
    assert texts[0] == "50\nroll" and texts[3] == "-50\nz" and texts[7] == "-12\nroll"
    edges = {tuple(map(tuple, line.get_xydata())) for line in axis.lines}
    assert ((1.5, -0.5), (1.5, 0.5)) in edges and ((-0.5, 0.5), (0.5, 0.5)) in edges, "between safe and not safe alone"
    assert axis.get_xlabel() == "landing.position [m]" and bar.get_ylabel() == "Least margin [% of the limit]"
    paths = maps.write(tmp_path, study, outcomes)
    assert [path.name for path in paths] == ["map.png", "map.pdf"] and paths[1].read_bytes().startswith(b"%PDF")


def test_a_line_says_where_it_is_safe(tmp_path: Path):
    study, outcomes = swept(ALONG, hump)
    (axis,) = maps.draw(study, outcomes, "landing.position").axes
    assert "safe from 20 to 30 m, from 70 to 80 m" in axis.get_xlabel()
    assert maps.write(tmp_path, study, outcomes)[0].stat().st_size > 5000


def test_a_key_that_does_not_vary_is_said():
    study, outcomes = swept(ALONG, hump)
    with pytest.raises(InputError, match=r"landing\.positon does not vary; did you mean"):
        maps.draw(study, outcomes, "landing.positon")
