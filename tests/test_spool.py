"""Rows that go to disk as they come: what is there is whole, whenever the writing ends, and is what memory would hold."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.coupling.run import columns, spool
from orchestrator.coupling.run.columns import Columns, Rows, pieces_of, some_of
from orchestrator.coupling.run.spool import Saving, Spool
from orchestrator.coupling.run.steps import NAMES, Steps, add
from orchestrator.coupling.stepping.report import StepReport

NUMBERS = np.random.default_rng(1).standard_normal((3000, 5))
A_TO_E = list("abcde")


def filled(path: Path | None) -> Rows:
    rows = Rows(A_TO_E, path)
    rows.extend(NUMBERS)
    return rows


@pytest.mark.parametrize("limit", [2**26, 1000], ids=["held", "on disk"])
def test_rows_are_those_that_were_added(tmp_path: Path, monkeypatch, limit: int):
    monkeypatch.setattr(columns, "HELD", limit)
    monkeypatch.setattr(columns, "PIECE", 40 * 100)
    rows = filled(tmp_path / "rows")
    assert len(rows) == 3000 and rows.is_held == (limit > 1000)
    assert np.array_equal(rows.array(), NUMBERS)
    assert all(np.array_equal(rows.column(name), NUMBERS[:, i]) for i, name in enumerate(A_TO_E))
    assert np.array_equal(rows.row(-1), NUMBERS[-1]) and np.array_equal(rows.row(101), NUMBERS[101])
    with pytest.raises(IndexError):
        rows.row(3000)


def test_without_a_file_all_is_held(monkeypatch):
    monkeypatch.setattr(columns, "HELD", 1000)
    assert np.array_equal(filled(None).array(), NUMBERS)


@given(st.integers(0, 25000), st.lists(st.integers(1, 300), min_size=1, max_size=8))
@settings(max_examples=40, deadline=None)
def test_a_file_cut_anywhere_has_its_whole_pieces(tmp_path_factory, cut: int, counts: list[int]):
    path = tmp_path_factory.mktemp("cut") / "rows"
    written, ends, first = Spool(path, A_TO_E), [], 0
    start = path.stat().st_size
    for count in counts:
        written.append(NUMBERS[first : first + count])
        first += count
        ends.append((path.stat().st_size, first))
    written.close()
    os.truncate(path, min(start + cut, path.stat().st_size))
    whole = max((rows for end, rows in ends if end <= start + cut), default=0)
    found = Rows.read(path)
    assert len(found) == whole and found.names == A_TO_E
    assert np.array_equal(found.array().reshape(-1, 5), NUMBERS[:whole])


def test_numpy_alone_reads_the_file(tmp_path: Path):
    filled(tmp_path / "rows").flush()
    with open(tmp_path / "rows", "rb") as file:
        names, first = np.load(file), np.load(file)
    assert names.tolist() == A_TO_E and np.array_equal(first, NUMBERS.T)


def test_no_file_of_rows_is_said(tmp_path: Path):
    (tmp_path / "rows").write_bytes(b"not one")
    with pytest.raises(OSError, match="no names of columns"):
        Rows.read(tmp_path / "rows")


def test_what_has_come_is_written_meanwhile(tmp_path: Path, monkeypatch):
    """Even while the next row takes for ever."""
    monkeypatch.setattr(spool, "INTERVAL", 0.02)
    rows = Rows(A_TO_E, tmp_path / "rows")
    with Saving(rows):
        rows.extend(NUMBERS[:3])
        end = time.monotonic() + 10.0
        while len(Rows.read(tmp_path / "rows")) < 3 and time.monotonic() < end:
            time.sleep(0.01)
        assert len(Rows.read(tmp_path / "rows")) == 3
        rows.extend(NUMBERS[3:5])
    assert np.array_equal(Rows.read(tmp_path / "rows").array(), NUMBERS[:5])


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO])
def test_a_disk_that_fails_leaves_what_was_written(tmp_path: Path, monkeypatch, number: int):
    """The writing itself is made to fail, half way through a piece, as a full disk does."""
    rows = Rows(A_TO_E, tmp_path / "rows")
    rows.extend(NUMBERS[:7])
    rows.flush()
    write = spool.write_all

    def fails(file, content):
        write(file, content[: content.nbytes // 2])
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(spool, "write_all", fails)
    rows.extend(NUMBERS[7:9])
    rows.flush()
    with pytest.raises(OSError, match="rows") as error:
        rows.extend(NUMBERS[9:10])
    assert error.value.errno == number
    assert np.array_equal(Rows.read(tmp_path / "rows").array(), NUMBERS[:7])


KILLED = """
import os, signal, sys
import numpy as np
from pathlib import Path
from orchestrator.coupling.run.columns import Rows
rows = Rows(["k", "square"], Path(sys.argv[1]))
for k in range(10**9):
    rows.extend(np.array([[k, float(k) ** 2]]))
    if k % 10 == 0:
        rows.flush()
        print(k, flush=True)
"""


@pytest.mark.skipif(os.name == "nt", reason="no kill -9 there")
def test_kill_9_leaves_all_that_was_flushed(tmp_path: Path):
    with subprocess.Popen(
        [sys.executable, "-c", KILLED, tmp_path / "rows"], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        flushed = [int(process.stdout.readline()) for _ in range(300)][-1]
        process.send_signal(signal.SIGKILL)
    found = Rows.read(tmp_path / "rows")
    assert len(found) > flushed
    assert np.array_equal(found.column("k"), np.arange(len(found))) and np.array_equal(
        found.column("square"), np.arange(len(found)) ** 2.0
    )


def test_reports_are_what_they_were():
    rows = Rows([*NAMES, "power_residual.a"])
    reports = [StepReport(0.1 * k, k, 1e-9 * k, k % 2, 0, 3, k == 3, k != 2, float(k), -1.0, 2.0) for k in range(1, 5)]
    for report in reports:
        add(rows, report, [7.0])
    steps = Steps(rows)
    assert list(steps) == reports and steps[-1] == reports[-1] and steps[1:3] == reports[1:3] and len(steps) == 4
    assert steps.column("converged").tolist() == [True, False, True, True] and steps.column("converged").dtype == bool
    assert steps.column("iterations").dtype == int


def test_columns_are_a_table():
    table = Columns(filled(None), {"x": "a", "n": "c"}, {"n": bool})
    assert list(table) == ["x", "n"] and "a" not in table and table.get("a") is None and len(table) == 2
    assert np.array_equal(table["x"], NUMBERS[:, 0]) and table["n"].dtype == bool
    assert list(some_of(table, ["n"])) == ["n"] and isinstance(some_of(table, ["n"]), Columns)
    for of in (table, table.loaded()):
        pieces = list(pieces_of(of))
        assert np.array_equal(np.concatenate([piece["x"] for piece in pieces]), NUMBERS[:, 0])
        assert pieces[0]["n"].dtype == bool


@pytest.mark.skipif(os.name == "nt", reason="no `resource` there")
def test_memory_does_not_grow_with_the_rows(tmp_path: Path):
    """A quarter of a gigabyte of rows adds what is held, a piece, and one column: 64 + 0.5 + 2.6 MB, and what NumPy leaves."""
    code = """
import resource, sys
import numpy as np
from pathlib import Path
from orchestrator.coupling.run.columns import Rows
some = np.random.default_rng(0).random((1024, 100))
used = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
start = used()
rows = Rows([str(i) for i in range(100)], Path(sys.argv[1]))
for _ in range(320):
    rows.extend(some)
assert rows.column("3").shape == (len(rows),) and not rows.is_held
print(used() - start)
"""
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "rows"], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 128 and (tmp_path / "rows").stat().st_size > 2.5e8
