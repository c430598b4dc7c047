"""Runs on a Dask cluster: made and guarded as on one machine; no crash and no hang reaches its workers."""

import os
from pathlib import Path

import pytest

from orchestrator.coupling.errors import InputError
from orchestrator.runs import cluster
from orchestrator.runs.batch import Batches, make_elsewhere
from orchestrator.runs.job import Job, code_version
from orchestrator.studies.sweep import solve, write
from orchestrator.studies.sweep.study import load_study
from tests.faulty import CRASHES, HANGS, study_in
from tests.fmus import needs_compiler

PATIENCE = 15.0


@needs_compiler
def test_a_cluster_leaves_what_one_machine_leaves_and_stays_alive(tmp_path: Path):
    dask = pytest.importorskip("distributed", reason="Dask is not installed: pip install 'line-landing[cluster]'")
    study = load_study(study_in(tmp_path, 4, 2, PATIENCE))
    options = {"n_workers": 1, "threads_per_worker": 2, "dashboard_address": None}
    with dask.LocalCluster(**options) as machines, dask.Client(machines) as client:
        before = client.run(os.getpid)
        found = swept(study, tmp_path / "cluster", machines.scheduler_address)
        assert client.run(os.getpid) == before, "the worker is the one that it was"
    swept(study, tmp_path / "here")
    assert [o.row.inputs["components.q.parameters.fault"] for o in found.failed] == [CRASHES, CRASHES, HANGS, HANGS]
    tables = [(tmp_path / place / "table.csv").read_bytes() for place in ("cluster", "here")]
    assert tables[0] == tables[1]


def swept(study, folder: Path, dask: str | None = None):
    return solve.sweep(study, folder / write.STORE, lambda found: write.save(folder, found), 2, dask=dask)


def test_a_cluster_of_another_kind_is_said():
    job = Job("oscillator", {"simulation.stop_time": 0.1}, solver="coupled")
    assert "another version" in make_elsewhere(job, job.key, "other", None)[1]
    assert "other files under the same paths" in make_elsewhere(job, "other", code_version(), None)[1]
    missing = Job("nowhere.toml", solver="coupled")
    assert "no such" in make_elsewhere(missing, "other", code_version(), None)[1]


def test_where_there_is_no_scheduler_nothing_is_touched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("distributed", reason="Dask is not installed: pip install 'line-landing[cluster]'")
    monkeypatch.setattr(cluster, "PATIENCE", "1 s")
    with pytest.raises(InputError, match="no scheduler answers"), Batches(tmp_path / "store", dask="tcp://127.0.0.1:9"):
        pass
    assert not (tmp_path / "store").exists()
