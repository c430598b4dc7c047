"""The page of a run: what stands in its one file, held against the directory that it was made from."""

import base64
import gzip
import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.coupling.run.results import read_json, read_table, write_json
from orchestrator.landing import workspace
from orchestrator.report.page import line, report, write, write_sweep
from orchestrator.report.page.blob import Place, pack, unpack
from orchestrator.report.page.data import Source, pack_within
from orchestrator.report.page.gap import gap_of
from orchestrator.runs.directory import RunDirectory
from orchestrator.runs.files import write_comparison, write_run
from orchestrator.runs.result import Run
from tests.made_up import TIME, compared_to, geometry, landing, made_up, on_a_line, swept

TEMPLATE = """<!doctype html><html lang="en"><head><meta http-equiv="Content-Security-Policy" content="@@CSP@@">
<title>@@TITLE@@</title><style>@@STYLE@@</style></head><body>@@BODY@@<pre>@@LICENCES@@</pre>
<script type="application/json" id="head">@@HEAD@@</script><script type="text/plain" id="worker">@@WORKER@@</script>
<script type="text/plain" id="wasm">@@WASM@@</script><script type="text/plain" id="blob">@@BLOB@@</script>
<script>@@SCRIPT@@</script></body></html>"""
SCRIPT = "const kept = '@@HEAD@@ @@BODY@@';"
"""Holds what looks like placeholders: what was filled in is not looked through again."""


class Page(HTMLParser):
    """A page read by a parser of the standard library: its elements' texts by id, and all tags with their attributes."""

    def __init__(self, text: str):
        super().__init__(convert_charrefs=True)
        self.tags = list[tuple[str, dict[str, str | None]]]()
        self.texts, self._open = dict[str, str](), list[str]()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._open.append(dict(attrs).get("id") or tag)

    def handle_endtag(self, tag: str) -> None:
        self._open.pop()

    def handle_data(self, data: str) -> None:
        for name in self._open[-1:]:
            self.texts[name] = self.texts.get(name, "") + data

    @property
    def head(self) -> dict[str, Any]:
        """The JSON that scripts read."""
        return json.loads(self.texts["head"])

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays of the blob, by name."""
        return unpack({name: Place(**place) for name, place in self.head["arrays"].items()}, self.texts["blob"])


@pytest.fixture
def web(tmp_path: Path) -> Path:
    """A folder with the smallest template."""
    folder = tmp_path / "dist"
    folder.mkdir()
    files = {
        "page.html": TEMPLATE,
        "page.js": SCRIPT,
        "page.css": "b{color:red}",
        "worker.js": "1",
        "licences.txt": "MIT <x>",
    }
    for name, content in files.items():
        (folder / name).write_text(content, encoding="utf-8")
    return folder


def written(folder: Path, run: Run, web: Path) -> Page:
    """The page of a run, without its pictures."""
    write_run(RunDirectory(folder), run)
    return Page(text_of(folder, web))


def text_of(folder: Path, web: Path) -> str:
    return write(folder, read_json(folder / "manifest.json"), web).read_text(encoding="utf-8")


def test_every_array_of_the_head_is_in_place_and_equals_the_table(tmp_path: Path, web: Path):
    run = on_a_line(2)
    page = written(tmp_path / "run", run, web)
    arrays, head = page.arrays, page.head
    assert head["format"] == 1 and head["kind"] == "run" and head["packed"] == "gzip" and head["complete"] is True
    assert arrays["time"].dtype == np.float64 and np.array_equal(arrays["time"], run.time)
    plotted = {signal["name"] for plot in head["plots"] for signal in plot["signals"]}
    seen = {row["name"] for row in head["hud"] if row["name"]}
    assert plotted | seen <= set(arrays) and {"robot.roll", "contact2.status", "cable.tension_mid"} <= set(arrays)
    for name in plotted | seen | {"robot.yaw", "contact1.status"}:
        assert arrays[name].dtype == np.float32 and np.array_equal(arrays[name], run.table[name].astype(np.float32)), (
            name
        )
    assert all(place["offset"] % 8 == 0 for place in head["arrays"].values())


def test_the_line_is_that_of_the_fields(tmp_path: Path, web: Path):
    run = on_a_line()
    page = written(tmp_path / "run", run, web)
    arrays = page.arrays
    rows = line.frames(run.time, line.FRAME)
    assert (
        np.array_equal(arrays["line.time"], run.time[rows]) and len(rows) == 101 and page.head["line"]["exact"] is False
    )
    assert arrays["line.position"] == pytest.approx(run.fields["position"][rows], abs=line.GRAIN + 200.0 * 2**-24)
    assert "41 points" in page.head["line"]["note"]


def test_a_line_with_nodes_is_exact():
    """A cubic Hermite between nodes with slopes is the element's own shape: that of a cubic is met everywhere."""
    s = np.array([0.0, 1.0, 3.0, 7.0])
    position = np.stack([0.0 * s, s, 0.1 * s**3], axis=-1)[None]
    slope = np.stack([0.0 * s, 1.0 + 0.0 * s, 0.3 * s**2], axis=-1)[None]
    nodes = {"node_arc_length": s, "node_position": position, "node_slope": slope}
    points = {"arc_length": s, "position": position}
    found = line.line_of({"time": np.zeros(1), **points, **nodes})
    assert found is not None and found.exact and np.array_equal(found.slope, slope)
    through = line.line_of({"time": np.zeros(1), **points})
    assert through is not None and not through.exact and line.line_of({}) is None


@pytest.mark.parametrize("step", [0.005, 0.013, 0.3])
def test_frames_are_the_points_nearest_to_every_fiftieth_of_a_second(step: float):
    time = np.cumsum(np.concatenate([[0.0], np.tile([step, 0.5 * step], 40)]))
    rows = line.frames(time, 0.02)
    assert rows[0] == 0 and rows[-1] == len(time) - 1 and np.all(np.diff(rows) > 0)
    wanted = np.arange(0.0, time[-1], 0.02)
    nearest = np.abs(time[None] - wanted[:, None]).min(axis=1)
    assert np.abs(time[rows][None] - wanted[:, None]).min(axis=1) == pytest.approx(nearest, abs=1e-12)


def test_the_policy_allows_this_script_and_nothing_from_anywhere(tmp_path: Path, web: Path):
    page = written(tmp_path / "run", on_a_line(), web)
    (policy,) = [
        a["content"] for tag, a in page.tags if tag == "meta" and a.get("http-equiv") == "Content-Security-Policy"
    ]
    digest = base64.b64encode(hashlib.sha256(page.texts["script"].encode()).digest()).decode()
    assert policy is not None and f"'sha256-{digest}'" in policy and policy.startswith("default-src 'none';")
    assert page.texts["script"] == SCRIPT, "what looks like a placeholder in a script stays"
    assert not re.search(r"https?:", policy) and "unsafe-inline" not in policy.split("script-src")[1].split(";")[0]
    outside = [
        (tag, a)
        for tag, a in page.tags
        for key in ("src", "href")
        if a.get(key) and not str(a[key]).startswith("data:")
    ]
    assert outside == [], "nothing is fetched"


EVIL = '</script><script>alert("x")</script><!-- & "quoted" @@BODY@@'


def test_what_files_say_is_shown_and_not_obeyed(tmp_path: Path, web: Path):
    run = on_a_line()
    resolved = {"title": EVIL, "cable": {"parameters": {EVIL: EVIL}}}
    run = replace(run, manifest={**run.manifest, "resolved": resolved}, summary={**run.summary, "notes": [EVIL]})
    page = written(tmp_path / "run", run, web)
    assert page.head["title"] == EVIL and page.texts["title"] == EVIL and page.texts["h1"] == EVIL
    scripts = [a for tag, a in page.tags if tag == "script"]
    assert [a.get("id") for a in scripts] == ["head", "worker", "wasm", "blob", None], "no script was smuggled in"
    assert page.texts["script"] == SCRIPT


def test_verdict_tiles_and_peaks_are_those_of_the_run(tmp_path: Path, web: Path):
    run = on_a_line(2)
    page = written(tmp_path / "run", run, web)
    assert page.head["verdict"] == {"word": "Safe to land", "class": "safe"} and "Safe to land" in page.texts["verdict"]
    tiles = [a["data-limit"] for tag, a in page.tags if "data-limit" in a]
    assert tiles == list(run.summary["limits"]) == ["roll", "tension"]
    bars = [float(str(a["style"]).removeprefix("width:").rstrip("%")) for tag, a in page.tags if tag == "i"]
    assert bars[:2] == pytest.approx([100.0 * run.summary["limits"][name]["share"] for name in tiles], abs=0.05)
    seeks = [float(str(a["data-seek"])) for tag, a in page.tags if tag == "button"]
    top = run.time[np.argmax(np.abs(run.table["contact2.normal_force"]))]
    assert top in seeks and run.summary["limits"]["roll"]["time"] in seeks and all(t in run.time for t in seeks)


def test_what_is_assumed_is_marked_with_its_reason(tmp_path: Path, web: Path):
    page = written(tmp_path / "run", on_a_line(), web)
    marks = [a for tag, a in page.tags if a.get("class") == "assumed"]
    text = text_of(tmp_path / "run", web)
    assert len(marks) == 2 and "nobody has measured it" in text and "Jia et al. 2025" in text
    assert "2 of 3 values are assumed" in text


def test_scene_of_the_robot_is_that_of_the_summary(tmp_path: Path, web: Path):
    run = on_a_line(2)
    head = written(tmp_path / "run", run, web).head
    geometry = run.summary["geometry"]
    assert head["span"] == {"length": 200.0, "left": [0.0, 0.0, 0.0], "right": [0.0, 200.0, 1.5]}
    assert head["landing_position"] == 20.0 and head["cable_diameter"] == 0.018
    robot = head["robot"]
    assert [wheel["mount"] for wheel in robot["wheels"]] == [wheel["mount"] for wheel in geometry["robot"]["wheels"]]
    assert (robot["along"], robot["layout"], robot["thrust"]) == (1.25, "top", False)


@pytest.mark.parametrize("pitch", [0.0, 0.1])
def test_the_gap_closes_where_the_roll_limit_of_the_paper_is(pitch: float):
    """Over a straight line in the groove the gap at the rim is that of plane geometry: L_c - D/2 tan(roll)."""
    most = workspace.roll(0.162, 1.25).value
    rolls = np.array([0.0, 0.5 * most, most, -most])
    time, zero, s = np.arange(4.0), np.zeros(4), np.array([0.0, 50.0, 200.0])
    position = np.broadcast_to(np.stack([0.0 * s, s, 0.0 * s], axis=1), (4, 3, 3))
    straight = line.Line(s, time, position, np.broadcast_to([0.0, 1.0, 0.0], (4, 3, 3)), True)
    table = {
        "time": time,
        "contact1.cable.s": 20.0 + zero,
        "robot.roll": rolls,
        "robot.pitch": pitch + zero,
        "robot.yaw": zero,
    }
    arm = 0.162 * np.array(
        [-np.sin(pitch) * np.cos(rolls), np.sin(rolls), -np.cos(pitch) * np.cos(rolls)]
    )  # of b from the line
    table |= {f"robot.body.position.{c}": 20.0 * (c == "y") + place for c, place in zip("xyz", arm, strict=True)}
    found = gap_of(geometry(1), table, straight)
    assert found is not None
    if pitch == 0.0:
        assert found.size == pytest.approx(0.162 - 0.625 * np.tan(np.abs(rolls)), abs=1e-12) and found.size[2] < 1e-12
    else:
        assert found.size[0] == pytest.approx(0.162, rel=1e-12)


def test_a_comparison_holds_the_reference_and_the_other_runs(tmp_path: Path, web: Path):
    comparison = compared_to(on_a_line(2), ["jacobi", "iqn_ils"])
    write_comparison(RunDirectory(tmp_path / "all"), comparison)
    page = Page(text_of(tmp_path / "all", web))
    head, arrays = page.head, page.arrays
    assert head["kind"] == "comparison" and [run["prefix"] for run in head["runs"]] == ["", "iqn_ils_0.01s/"]
    assert head["runs"][0]["full"] is True and head["runs"][1]["full"] is False
    for signal in {s["name"] for plot in head["plots"] for s in plot["signals"]}:
        assert {signal, f"reference/{signal}", f"iqn_ils_0.01s/{signal}"} <= set(arrays)
    assert np.array_equal(arrays["reference/time"], TIME) and "reference/line.position" in arrays
    height = "robot.body.position.z"
    exact = comparison.results[0].table[height] - comparison.reference.table[height]
    assert arrays[f"difference/{height}"] == pytest.approx(exact, rel=1e-7), "taken before it is rounded to 32 bits"
    assert "reference/robot.wheel[1].position.z" in arrays and "iqn_ils_0.01s/robot.wheel[1].position.z" not in arrays


def test_a_general_graph_has_a_page_without_a_scene(tmp_path: Path, web: Path):
    table = {"time": TIME, "left.x": np.sin(TIME), "right.x": np.cos(TIME)}
    run = made_up(table, tolerances={"left.x": 1e-3}, units={"left.x": "m", "right.x": "m"})
    page = written(tmp_path / "run", run, web)
    assert page.head["kind"] == "graph" and page.head["robot"] is None and page.head["line"] is None
    assert [s["name"] for plot in page.head["plots"] for s in plot["signals"]] == ["left.x", "right.x"]


def test_a_run_that_was_interrupted_says_so_and_shows_what_is_there(tmp_path: Path, web: Path):
    run = on_a_line()
    run = replace(run, manifest={**run.manifest, "complete": False, "error": "interrupted at t = 2 s"})
    page = written(tmp_path / "run", run, web)
    assert page.head["complete"] is False and page.head["error"] == "interrupted at t = 2 s"
    text = text_of(tmp_path / "run", web)
    assert "interrupted at t = 2 s" in text and "up to 2 s" in text


def test_steps_that_are_not_equal_stay_as_they_are(tmp_path: Path, web: Path):
    rows = np.unique(np.round(200 * (np.arange(60) / 59) ** 2).astype(int))
    run = on_a_line()
    table = {name: values[rows] for name, values in run.table.items()}
    fields = {name: values[rows] if len(values) == len(TIME) else values for name, values in run.fields.items()}
    arrays = written(tmp_path / "run", replace(made_up(table), fields=fields), web).arrays
    assert np.array_equal(arrays["time"], TIME[rows])


def test_a_long_run_is_thinned_and_keeps_its_peaks():
    rng = np.random.default_rng(0)
    time = np.arange(20001) * 0.005
    table = {"time": time, "robot.roll": rng.normal(size=20001), "cable.tension_mid": rng.normal(size=20001)}
    whole = pack_within([Source("", table, {}, ("robot.roll",))], 10**7)
    assert whole.stride == 1 and whole.note == ""
    thinned = pack_within([Source("", table, {}, ("robot.roll",))], 60_000)
    arrays = unpack(thinned.blob.places, thinned.blob.text)
    assert len(thinned.blob.text) <= 60_000 and thinned.stride == 8 and "one in 8 of 20001" in thinned.note
    assert len(arrays["time"]) == pytest.approx(20001 / 8, abs=4)
    roll = table["robot.roll"].astype(np.float32)
    assert (arrays["robot.roll"].min(), arrays["robot.roll"].max()) == (roll.min(), roll.max())
    rows = np.searchsorted(time, arrays["time"])
    assert np.array_equal(arrays["robot.roll"], roll[rows]) and rows[0] == 0 and rows[-1] == 20000


def test_packed_arrays_come_back():
    arrays: Mapping[str, np.ndarray] = {"a": np.arange(3, dtype=np.float32), "b": np.eye(2), "c": np.arange(5)}
    blob = pack(arrays)
    found = unpack(blob.places, blob.text)
    assert [p.type for p in blob.places.values()] == ["f4", "f8", "f4"] and [
        p.offset for p in blob.places.values()
    ] == [0, 16, 48]
    assert all(np.array_equal(found[name], values) for name, values in arrays.items())
    assert pack(arrays).text == blob.text, "the same run gives the same page"


def test_a_run_of_one_point_has_a_page(tmp_path: Path, web: Path):
    run = made_up({name: values[:1] for name, values in landing().items()})
    assert written(tmp_path / "run", run, web).arrays["time"].shape == (1,)


# -- what if ------------------------------------------------------------------------------------------------------


def left_starts(folder: Path, kernels: str, first: float = 0.0) -> None:
    """What a run leaves to be solved anew: two starts of two words each."""
    words = first + np.arange(4.0)
    (folder / "start.bin").write_bytes(words.astype("<f8").tobytes())
    starts = [{"first": 2 * k, "given": 2, "robot": "made_up", "geometry": geometry(1)} for k in range(2)]
    about = {"format": 1, "reason": None, "kernels": kernels, "end": 2.0, "starts": starts}
    write_json(folder / "start.json", about)


def with_solver(web: Path, kernels: str) -> Path:
    (web / "landing.wasm").write_bytes(b"a module")
    write_json(web / "landing.json", {"kernels": kernels})
    return web


def test_starts_are_embedded_with_the_solver_that_they_fit(tmp_path: Path, web: Path):
    folder = tmp_path / "run"
    write_run(RunDirectory(folder), on_a_line())
    left_starts(folder, "abc")
    page = Page(text_of(folder, with_solver(web, "abc")))
    about = page.head["whatif"]
    assert np.array_equal(page.arrays["whatif.starts"], np.arange(4.0)) and about["reason"] is None
    assert gzip.decompress(base64.b64decode(page.texts["wasm"])) == b"a module"
    assert about["starts"][1]["scene"]["robot"]["name"] == "made_up" and "geometry" not in about["starts"][0]


def test_a_comparison_has_the_starts_of_its_folder(tmp_path: Path, web: Path):
    folder = tmp_path / "all"
    write_comparison(RunDirectory(folder), compared_to(on_a_line(), ["jacobi", "iqn_ils"]))
    left_starts(folder, "abc")
    page = Page(text_of(folder, with_solver(web, "abc")))
    assert page.head["kind"] == "comparison" and len(page.head["whatif"]["starts"]) == 2


@pytest.mark.parametrize("built", ["other", "", None])
def test_without_the_right_solver_there_are_no_sliders_and_it_says_why(tmp_path: Path, web: Path, built: str | None):
    folder = tmp_path / "run"
    write_run(RunDirectory(folder), on_a_line())
    if built is not None:
        left_starts(folder, "abc")
    page = Page(text_of(folder, with_solver(web, built) if built else web))
    assert "whatif.starts" not in page.arrays and page.texts.get("wasm", "") == ""
    about = page.head["whatif"]
    words = {"other": "another version", "": "was not built"}
    assert about is None if built is None else (about["starts"] == [] and words[built] in about["reason"])


# -- a sweep ------------------------------------------------------------------------------------------------------


def test_a_sweep_has_its_map_its_runs_and_the_recorded_landings(tmp_path: Path, web: Path):
    folder = swept(tmp_path / "sweep")
    left_starts(folder / "runs" / "run3", "abc", first=10.0)
    page = Page(write_sweep(folder, with_solver(web, "abc")).read_text(encoding="utf-8"))
    head, arrays = page.head, page.arrays
    assert head["kind"] == "sweep" and head["verdict"]["word"] == "3 of 4 landings are safe"
    shown = head["map"]
    assert (shown["x"]["values"], shown["y"]["values"]) == ([20.0, 60.0], [38.0, 80.0])
    assert [(c["x"], c["y"], c["verdict"]) for c in shown["cells"]][-1] == (1, 1, "unsafe")
    assert shown["cells"][3]["margin"] < 0.0 and "not safe; least margin" in shown["cells"][3]["text"]
    assert set(head["landings"]) == {"run-1", "run-2", "run-4"}, "what was recorded can be opened"
    run = read_table(folder / "runs" / "run4" / "results.csv")
    assert np.array_equal(arrays["run-4/robot.roll"], run["robot.roll"].astype(np.float32))
    assert head["landings"]["run-4"]["head"]["landing_position"] == 60.0
    start = head["whatif"]["cells"]["run-3"]
    assert arrays["whatif.starts"][start["first"] : start["first"] + start["given"]].tolist() == [10.0, 11.0]
    assert "table.csv has all columns" in write_sweep(folder, web).read_text(encoding="utf-8")


def test_a_sweep_that_was_interrupted_says_so(tmp_path: Path, web: Path):
    folder = swept(tmp_path / "sweep")
    study = read_json(folder / "study.json")
    write_json(folder / "study.json", study | {"complete": False})
    assert "the same command goes on" in write_sweep(folder, web).read_text(encoding="utf-8")
    (folder / "map.json").unlink()
    assert Page(report(folder, web).read_text(encoding="utf-8")).head["map"] is None
