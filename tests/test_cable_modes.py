"""Small vibrations of the cable: frequencies and damping ratios against theory, and the command that shows them."""

import csv

import numpy as np
import pytest
from typer.testing import CliRunner

from orchestrator.cli.commands import app
from orchestrator.landing.modes import modes, sample
from verification.cable import vibration
from verification.cable.setups import PHYSICAL, RIG, TABLE1, cable
from verification.cable.taut import SETTINGS as TAUT
from verification.cable.taut import taut

pytestmark = pytest.mark.portable


@pytest.mark.parametrize(("name", "settings"), [("table1", TABLE1), ("physical", PHYSICAL), ("rig", RIG)])
def test_against_rayleigh_ritz(name, settings):
    """80 equal elements: 5e-8 for the 200 m spans, 9e-7 for the sixth mode of the rig (measured, order 4)."""
    for row in vibration.ritz_rows(name, settings, 80, 2e-6):
        assert row.passed, row


def test_twenty_elements():
    for row in vibration.ritz_rows("table1", TABLE1, 20, 2e-5):
        assert row.passed, row


def test_irvine():
    """Theory, λ² = 24: 0.38936, 0.77873 Hz out of plane, 0.66231 Hz in plane; ours differ by the square of the sag."""
    out, plane = vibration.irvine(TABLE1, 4)
    assert out[:2] == pytest.approx([0.38936, 0.77873], abs=1e-5) and plane[0] == pytest.approx(0.66231, abs=1e-5)
    for row in [*vibration.direct_irvine_rows(), *vibration.irvine_rows(60)]:
        assert row.passed, row


def test_tensioned_beam():
    for row in vibration.beam_rows():
        assert row.passed, row


def test_clamped_beam_without_tension():
    """cos βL cosh βL = 1 (Euler–Bernoulli, clamped at both ends): βL = 4.730041, 7.853205, 10.995608."""
    settings = RIG | {"gravity": 0.0, "clamped": True, "n_elements": 40}
    found = modes(cable(settings), 3)
    expected = (
        np.array([4.730040745, 7.853204624, 10.995607838]) ** 2 * np.sqrt(337.8 / 0.707) / 10.0**2 / (2.0 * np.pi)
    )
    assert found.out_of_plane.frequency == pytest.approx(expected, rel=1e-5)
    assert found.in_plane.frequency == pytest.approx(expected, rel=1e-5)


def test_axial_modes_and_their_damping():
    """A straight cable also vibrates along itself: f_n = n/(2L) √(EA/ρA), damping ratio c ω/2."""
    settings = RIG | {"gravity": 0.0, "bending_stiffness": 1e-3, "n_elements": 16, "damping_time": 1e-6}
    found = modes(cable(settings), 34).in_plane
    along = np.array([np.abs(shape[1::3]).max() > np.abs(shape[2::3]).max() for shape in found.shape])
    first = found.frequency[along][0]
    omega = np.pi / 10.0 * np.sqrt(2.111e7 / 0.707)
    assert first == pytest.approx(omega / (2.0 * np.pi), rel=1e-6)
    assert found.damping_ratio[along][0] == pytest.approx(1e-6 * omega / 2.0, rel=1e-5)


def test_shapes_of_the_taut_cable_are_sines():
    made = cable(TAUT, n_elements=30)
    shape = sample(made.model, modes(made, 3).out_of_plane.shape[2])[:, 0]
    expected = np.sin(taut(TAUT).wave_numbers(3)[2] * np.linspace(0.0, 199.8, shape.size))
    # unit modal mass: amplitude √(2/(ρA L))
    amplitude = np.sqrt(2.0 / (0.91 * 199.8))
    # between the nodes a cubic is off by (β l)⁴/384
    interpolation = (taut(TAUT).wave_numbers(3)[2] * 199.8 / 30) ** 4 / 384.0
    assert np.abs(np.abs(shape) - amplitude * np.abs(expected)).max() < interpolation * amplitude


def test_many_unknowns_take_the_sparse_way():
    """200 elements (sparse) and 60 (dense) agree to the error of the mesh."""
    many, few = modes(cable(TABLE1, n_elements=200), 4), modes(cable(TABLE1, n_elements=60), 4)
    assert many.in_plane.frequency == pytest.approx(few.in_plane.frequency, rel=1e-6)
    assert many.out_of_plane.frequency == pytest.approx(few.out_of_plane.frequency, rel=1e-6)


def test_command(tmp_path):
    out = tmp_path / "modes"
    result = CliRunner().invoke(
        app, ["modes", "scenarios/rig_10m.toml", "--without-robot", "--count", "3", "--out", str(out)]
    )
    assert result.exit_code == 0, result.output
    with (out / "modes.csv").open() as file:
        rows = list(csv.reader(file))
    assert len(rows) == 7 and float(rows[1][2]) == pytest.approx(2.397, abs=1e-3)
    assert (out / "modes.png").stat().st_size > 10_000
    assert f"{float(rows[1][2]):.6g}" in result.output


def test_command_wants_a_positive_count():
    result = CliRunner().invoke(app, ["modes", "scenarios/rig_10m.toml", "--without-robot", "--count", "0"])
    assert result.exit_code == 2
