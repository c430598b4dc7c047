"""Maps of a sweep: the worst of all runs at a place, stretches that are safe, pictures that can be read."""

from pathlib import Path

import numpy as np
import pytest
from swept import ALONG, MASSES, hump, outcome_of, swept

from orchestrator.coupling.errors import InputError
from orchestrator.studies.sweep import design, maps, odds
from orchestrator.studies.sweep.outcome import Chances, chances
from orchestrator.studies.sweep.ranges import all_ranges, cell, safe_ranges, stretches
from orchestrator.studies.sweep.refine import more_rows
from orchestrator.studies.sweep.study import Study, study_of


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
    assert axis.get_xlabel() == "Landing position [m]" and bar.get_ylabel() == "Least margin [% of the limit]"
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


def test_a_refined_map_has_its_outline_where_it_is_and_a_marker_a_run():
    study, outcomes = swept(ALONG | MASSES, hump, refine={"landing.position": 1.0, "outline": "verdict"})
    while added := more_rows(study, outcomes):
        outcomes += [outcome_of(study, row, hump) for row in added]
    axis, _ = maps.draw(study, outcomes, "landing.position", "robot.parameters.mass").axes
    ends = sorted({x for line in axis.lines if line.get_marker() == "None" for x in np.asarray(line.get_xdata())})
    for edge in (25.0, 37.5, 62.5):
        assert min(abs(x - edge) for x in ends) <= 1.0, "half of the way between places that are 1 m apart"
    markers = [line for line in axis.lines if line.get_marker() != "None"]
    assert sum(len(np.asarray(line.get_xdata())) for line in markers) == len(outcomes)
    assert {line.get_label() for line in markers} == {"z", "roll"}


def test_where_other_keys_vary_runs_of_one_line_are_left_out():
    study, outcomes = swept(ALONG | MASSES, hump, refine={"landing.position": 1.0})
    grid = len(outcomes)
    while added := more_rows(study, outcomes):
        outcomes += [outcome_of(study, row, hump) for row in added]
    assert len(outcomes) > grid
    (axis,) = maps.draw(study, outcomes, "landing.position").axes
    assert "safe at 30 m, from 70 to 80 m (7 values)" in axis.get_xlabel()


# -- probability ------------------------------------------------------------------------------------------------------


def drawn(vary: dict, count: int = 100) -> tuple[Study, list[Chances]]:
    """Return a study in which a drop of up to 0.4 m takes its height from the margins of `hump`."""
    study = study_of(
        {
            "scenario": "landing_200m_point9",
            "vary": vary,
            "sample": {"count": count, "landing.height": {"uniform": [0.0, 0.4]}},
        },
        Path("study.toml"),
    )
    outcomes = []
    for row in design.rows(study, 0, count):
        height = row.inputs["landing.height"]
        outcomes.append(outcome_of(study, row, lambda x, m, h=height: {n: v - h for n, v in hump(x, m).items()}))
    return study, chances(study, outcomes)


def test_the_probability_along_the_span():
    study, found = drawn(ALONG)
    assert odds.words(study, found) == [
        "landing.position: limits hold with a probability of 95 % at least at 20 m, at 80 m (7 values)"
    ]
    (axis,) = odds.draw(study, found, "landing.position").axes
    (bars,) = [line for line in axis.lines if line.get_marker() == "o"]
    assert np.asarray(bars.get_ydata()) == pytest.approx([np.mean(one.of["all"].estimate) for one in found])
    assert 0.6 < np.asarray(bars.get_ydata())[1] < 0.9, "at 30 m a margin of 0.3 is left, and 3/4 of the drops keep it"


def test_a_map_of_the_probability_has_the_interval_in_its_cells(tmp_path: Path):
    study, found = drawn(ALONG | MASSES)
    axis, _ = odds.draw(study, found, "landing.position", "robot.parameters.mass").axes
    shown = np.asarray(axis.images[0].get_array())
    assert shown.shape == (2, 7) and shown[0, 0] == 1.0 and shown[1, 0] == 0.0
    assert axis.texts[0].get_text() == f"1\n{found[0].of['all'].interval[0]:.2f} to 1.00"
    assert [path.name for path in odds.write(tmp_path, study, found)] == ["probability.png", "probability.pdf"]


def test_of_a_study_that_draws_nothing_there_is_no_probability():
    study, outcomes = swept(ALONG, hump)
    assert odds.words(study, []) == [] and odds.write(Path("nowhere"), study, chances(study, outcomes)) == []
    with pytest.raises(InputError, match="add \\[sample\\]"):
        odds.draw(study, [], "landing.position")
