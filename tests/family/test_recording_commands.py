"""The commands that look at a recording, as a user types them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from family_cases import COLUMNS, directions, log, write_unit
from test_doubtful import FACES, LABELS, labelled

from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main


def run(*arguments: str) -> str:
    result = CliRunner().invoke(main, list(arguments), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def test_poses_are_listed_with_the_reasons_of_refusals(tmp_path: Path) -> None:
    hold = [3.0] * 12
    hold[3] = 1.7
    folder = write_unit(tmp_path / "U", log(directions(12), hold), COLUMNS + "\nstill_s = 2")
    output = run("poses", str(folder), "--picture", str(tmp_path / "p.svg"))
    assert "s at rest, needs 2.0" in output
    assert output.rstrip().endswith("11 poses; 1 stretches at rest refused")
    assert (tmp_path / "p.svg").read_text().startswith("<svg")


def test_labelled_faces_are_listed_without_a_clock(tmp_path: Path) -> None:
    """As the calibration takes them: five rows a face, and no still stretch is searched."""
    columns = COLUMNS.replace('\ntime = "t"', "")
    folder = write_unit(tmp_path / "U", labelled(), f"{columns}\n{FACES}")
    output = run("poses", str(folder), "--picture", str(tmp_path / "p.svg"))
    rows = [line.split() for line in output.splitlines()]
    rows = [row for row in rows if len(row) == 14 and row[0].isdigit()]
    assert [[row[0], row[-1]] for row in rows] == [
        [str(k + 1), label] for k, label in enumerate(LABELS)
    ]
    assert output.rstrip().endswith("6 poses; 0 stretches at rest refused")
    assert (tmp_path / "p.svg").read_text().startswith("<svg")
    folder = write_unit(tmp_path / "V", labelled(labels=tuple("abcdef")), f"{columns}\n{FACES}")
    with pytest.raises(RefusedError, match="no section is a pose; sections found: a, b, c, d"):
        run("poses", str(folder))


def test_drift_names_the_hysteresis_and_a_term_that_wins(tmp_path: Path) -> None:
    """A bias in T and dT/dt by exact sums; the cycle goes up, down and up."""
    t = np.arange(0.0, 3600.0, 2.0)
    temp = 25.0 + 30.0 * np.sin(2.0 * np.pi * t / 2400.0)
    rate = np.gradient(temp, t)
    noise = 1e-4 * np.random.default_rng(1).standard_normal((len(t), 3))
    z = 9.8 + 1e-3 * temp + 0.5 * rate
    rows = np.column_stack([t, 0 * t, 0 * t, z, temp])
    rows[:, 1:4] += noise
    recording = COLUMNS + '\ntemperature = "T"'
    folder = write_unit(tmp_path / "U", rows, recording, header="t,ax,ay,az,T")
    output = run("drift", str(folder))
    # At the middle the rate is +-30 * 2 pi / 2400 = 0.0785 K/s: 0.0785 m/s^2 apart, 8.0 mg.
    assert "z 8.0" in output or "z 7.9" in output
    assert "and dT/dt: " in output
    # 0.5 m/s^2 for 1 K/s is 51 mg.
    assert "51 mg per K/s" in output or "50.9 mg per K/s" in output


def test_drift_without_a_temperature_is_refused(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "U", log(directions(2)))
    with pytest.raises(RefusedError, match="no temperature column; expected"):
        run("drift", str(folder))


@pytest.mark.parametrize("count", [1, 2, 63])
def test_drift_of_too_few_samples_is_refused(tmp_path: Path, count: int) -> None:
    rows = np.column_stack([np.arange(count), np.zeros((count, 2)), np.full(count, 9.8)])
    rows = np.column_stack([rows, np.linspace(20.0, 60.0, count)])
    recording = COLUMNS + '\ntemperature = "T"'
    folder = write_unit(tmp_path / "U", rows, recording, header="t,ax,ay,az,T")
    with pytest.raises(RefusedError, match=rf": {count} samples?; expected 64 at least"):
        run("drift", str(folder))


def test_crosscoupling_prints_the_coefficients(tmp_path: Path) -> None:
    theta = np.radians(5.0 + 13.0 * np.arange(28))
    a = -np.cos(theta) - 5e-5 * np.sin(theta) * np.cos(theta)
    b = np.sin(theta) + 8e-5 * np.sin(theta) * np.cos(theta)
    lines = [f"{d:.12g},{x:.15g},{y:.15g}" for d, x, y in zip(np.degrees(theta), a, b, strict=True)]
    (tmp_path / "pair.csv").write_text("theta_deg,a_g,b_g\n" + "\n".join(lines) + "\n")
    output = run("crosscoupling", str(tmp_path / "pair.csv"), "--picture", str(tmp_path / "p.svg"))
    values = {line.split()[0]: float(line.split()[1]) for line in output.splitlines()[1:8]}
    # What (9) leaves out is of second order: 8e-5 squared.
    assert values["KipA"] == pytest.approx(5e-5, abs=1e-8)
    assert values["KipB"] == pytest.approx(8e-5, abs=1e-8)
    assert (tmp_path / "p.svg").read_text().startswith("<svg")


def test_a_unit_without_a_recording_is_told(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "U", "", 'acceleration = [1, 2, 3]\nacceleration_unit = "g"')
    text = (folder / "unit.toml").read_text().split("[recording]")[0]
    (folder / "unit.toml").write_text(
        text + "[adc]\nbits = 24\nfull_scale_v = 2.5\n[temperature_sensor]\ndegc_per_code = 0.01\n"
        "[thermal]\nt0_degc = 20\n"
    )
    with pytest.raises(RefusedError, match=r"no table \[recording\]"):
        run("poses", str(folder))
