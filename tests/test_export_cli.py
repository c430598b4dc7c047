"""The command `export`, and what other commands say of a system structure."""

from __future__ import annotations

from tests.command import orchestrate


def test_export_writes_and_says_what_is_lost(tmp_path):
    done = orchestrate("export", "oscillator", "--stop", 0.1, "--ssp", tmp_path / "a.ssp", "--osp", tmp_path / "a")
    assert done.returncode == 0, done.stderr
    assert f"{tmp_path / 'a.ssp'}: 2 FMUs, 3 connections" in done.stdout
    assert "iqn_ils iterates within a step" in done.stdout and "macro step 0.01 s" in done.stdout
    assert {path.name for path in (tmp_path / "a").iterdir()} == {
        "OspSystemStructure.xml", "README.md", "left.fmu", "right.fmu",
    }  # fmt: skip
    valid = orchestrate("validate", tmp_path / "a.ssp")
    assert valid.returncode == 0 and "valid; 2 FMUs, 3 connections" in valid.stdout


def test_wrong_input_ends_with_status_2(tmp_path):
    (tmp_path / "broken.ssp").write_text("no archive")
    done = orchestrate("run", tmp_path / "broken.ssp")
    assert done.returncode == 2 and "no SSP" in done.stderr
