"""The outline refined: known to the width that is asked for, with few runs, none of them twice; the map has no gaps."""

from collections.abc import Hashable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from swept import ALONG, MASSES, Margins, hump, outcome_of, swept

from orchestrator.coupling.errors import InputError
from orchestrator.studies.sweep import atlas
from orchestrator.studies.sweep.boxes import Box, Place, areas, divided
from orchestrator.studies.sweep.outcome import Outcome
from orchestrator.studies.sweep.ranges import all_ranges
from orchestrator.studies.sweep.refine import more_rows
from orchestrator.studies.sweep.solve import Swept
from orchestrator.studies.sweep.study import Study, study_of

CIRCLE = ([0.0, 25.0, 50.0, 75.0, 100.0], [0.0, 1.0, 2.0, 3.0, 4.0])


def refined(margins: Margins, vary: dict, **refine: object) -> tuple[Study, list[Outcome], int]:
    """Return a study refined until nothing is added, and in how many rounds."""
    study, outcomes = swept(vary, margins, refine=refine)
    rounds = 0
    while added := more_rows(study, outcomes):
        outcomes += [outcome_of(study, row, margins) for row in added]
        rounds += 1
    return study, outcomes, rounds


def within(place: Place) -> bool:
    """Whether a place is within the ellipse around the middle of `CIRCLE`."""
    return ((place[0] - 50.0) / 35.0) ** 2 + ((place[1] - 2.0) / 1.3) ** 2 < 1.0


def circle(widths: list[float]) -> tuple[list[Box], dict[Place, Hashable]]:
    known: dict[Place, Hashable] = {}
    while True:
        boxes, wanted = divided(CIRCLE, known, widths)
        if not wanted:
            return boxes, known
        known |= {place: within(place) for place in wanted}


def test_an_edge_along_one_axis_is_found_by_halving():
    edge = 43.21
    study, outcomes, rounds = refined(lambda x, _: {"z": edge - x}, ALONG, **{"landing.position": 0.1})
    at = sorted((o.row.inputs["landing.position"], o.safe) for o in outcomes)
    last, first = max(x for x, safe in at if safe), min(x for x, safe in at if not safe)
    assert last < edge < first and first - last <= 0.1 and rounds == 7, "10 m, halved seven times, is 0.08 m"
    assert len(outcomes) == 7 + 7 and len({x for x, _ in at}) == 14, "none twice"
    assert [o.row.number for o in outcomes] == list(range(1, 15))
    assert outcomes[-1].row.varied["landing.position"]["unit"] == "m"
    assert all_ranges(study, outcomes) == [f"landing.position: safe from 20 to {last:g} m (14 values)"]


def test_where_the_limit_that_binds_changes_is_refined_too_unless_the_verdict_alone_is_asked_for():
    both = lambda x, _: {"z": 1.0 - x / 100.0, "roll": x / 100.0}  # noqa: E731  they meet at 50 m, and are kept
    assert len(refined(both, ALONG, **{"landing.position": 1.0})[1]) > 7
    assert len(refined(both, ALONG, outline="verdict", **{"landing.position": 1.0})[1]) == 7


def test_each_line_is_refined_by_itself():
    _, outcomes, _ = refined(hump, ALONG | MASSES, outline="verdict", **{"landing.position": 1.0})
    for mass in (10.0, 38.0):
        mine = sorted(
            (o.row.inputs["landing.position"], bool(o.safe))
            for o in outcomes
            if o.row.inputs["robot.parameters.mass"] == mass
        )
        changes = [(a, b) for (a, one), (b, other) in pairwise(mine) if one != other]
        edges = [37.5, 62.5] if mass == 10.0 else [25.0, 37.5, 62.5]
        assert len(changes) == len(edges)
        assert all(a <= edge <= b and b - a <= 1.0 for (a, b), edge in zip(changes, edges, strict=True))


def test_what_failed_has_no_outline():
    margins = lambda x, _: None if x == 50.0 else {"z": 1.0}  # noqa: E731
    assert len(refined(margins, ALONG, **{"landing.position": 0.1})[1]) == 7


def test_a_curve_is_known_to_the_width_that_is_asked_for():
    boxes, known = circle([2.0, 0.1])
    angles = np.linspace(0.0, 2.0 * np.pi, 2000)
    for x, y in zip(50.0 + 35.0 * np.cos(angles), 2.0 + 1.3 * np.sin(angles), strict=True):
        around = [b for b in boxes if b.low[0] <= x <= b.high[0] and b.low[1] <= y <= b.high[1]]
        assert any(b.high[0] - b.low[0] <= 2.0 and b.high[1] - b.low[1] <= 0.1 for b in around)
    fine = (100.0 / 1.5625 + 1) * (4.0 / 0.0625 + 1)
    assert len(known) < 0.2 * fine, "a grid as fine as that has 4,225 places"


def test_places_share_the_map_among_them():
    boxes, known = circle([2.0, 0.1])
    shown = areas(boxes)
    assert set(shown) == set(known), "every place is seen"
    sizes = [np.prod([b - a for a, b in part]) for parts in shown.values() for part in parts]
    assert sum(sizes) == pytest.approx(100.0 * 4.0), "no gaps, no overlaps"
    safe = sum(np.prod([b - a for a, b in part]) for place, parts in shown.items() if within(place) for part in parts)
    ellipse = np.pi * 35.0 * 1.3
    assert safe == pytest.approx(ellipse, abs=2.0 * 4.0 * (35.0 * 0.1 + 1.3 * 2.0)), "known to a box on its outline"


def test_a_grid_is_shared_out_half_way():
    study, outcomes = swept(ALONG | MASSES, hump)
    content = atlas.content(Swept(study, 1, outcomes, complete=True))
    assert [axis["range"] for axis in content["axes"]] == [[15.0, 85.0], [-4.0, 52.0]]
    (only,) = content["maps"]
    assert only["where"] == {} and len(only["cells"]) == 14
    assert only["cells"][0]["areas"] == [[[15.0, 25.0], [-4.0, 24.0]]]


def test_what_map_json_says_of_a_place():
    vary = ALONG | MASSES | {"robot": ["fptlir", "miniature"]}
    study, outcomes = swept(vary, hump)
    content = atlas.content(Swept(study, 1, outcomes, complete=True))
    position, mass = content["axes"]
    assert (position["label"], position["unit"], mass["key"]) == ("Landing position", "m", "robot.parameters.mass")
    assert [one["where"] for one in content["maps"]] == [{}, {"robot": "fptlir"}, {"robot": "miniature"}]
    first = content["maps"][0]["cells"][1]
    assert first["at"] == [20.0, 38.0] and first["runs"] == [3, 4] and first["run"] == 3
    assert (first["verdict"], first["binding"], first["failed"]) == ("unsafe", "roll", 0)
    assert first["margin"] == pytest.approx(-0.125) and first["margins"]["z"] == pytest.approx(0.7)
    assert first["probability"] is None and first["folder"] is None and first["recorded"] is False


def test_words_stand_side_by_side():
    study, outcomes = swept({"robot": ["fptlir", "miniature"]} | ALONG, hump)
    content = atlas.content(Swept(study, 1, outcomes, complete=True))
    robot = content["axes"][0]
    assert robot["numeric"] is False and robot["range"] == [-0.5, 1.5]
    assert content["maps"][0]["cells"][-1]["areas"] == [[[0.5, 1.5], [75.0, 85.0]]]


def test_a_refined_map_ends_with_its_values_and_has_no_gaps():
    study, outcomes, _ = refined(hump, ALONG | MASSES, **{"landing.position": 2.0})
    content = atlas.content(Swept(study, 1, outcomes, complete=True))
    assert content["axes"][0]["range"] == [20.0, 80.0] and content["refined"] == {"landing.position": 2.0}
    parts = [part for cell in content["maps"][0]["cells"] for part in cell["areas"]]
    assert sum((x[1] - x[0]) * (y[1] - y[0]) for x, y in parts) == pytest.approx(60.0 * 56.0)


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({"refine": {"landing.positon": 1.0}}, "did you mean"),
        ({"refine": {"robot": 1.0}}, "two numbers"),
        ({"refine": {"landing.position": 0.0}}, "refine.landing.position"),
        ({"refine": {}}, "refine"),
        ({"refine": {"landing.position": 1.0}, "sample": {"count": 9, "a.b": {"uniform": [0.0, 1.0]}}}, "two studies"),
    ],
)
def test_what_cannot_be_refined_is_said(document: dict, said: str):
    vary = {"landing.position": [20.0, 60.0], "robot": ["fptlir", "miniature"]}
    with pytest.raises(InputError, match=said):
        study_of({"scenario": "drop_5cm", "vary": vary, **document}, Path("study.toml"))
