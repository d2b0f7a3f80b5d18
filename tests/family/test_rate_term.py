"""A term in dT/dt of a recording over half-cycles: shipped into the C where it wins alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from family_cases import COLUMNS, RATE_HZ, U0, K, directions, log, write_unit
from test_recordings import calibrated, symmetric_part

from triaxcal.delivery import deliver
from triaxcal.model.types import FloatArray
from triaxcal.report.results import calibration_json
from triaxcal.uncertainty.evaluate import uncertainty

WITH_T = COLUMNS + '\ntemperature = "T"'
HALVES, POSES, HOLD_S = 4, 22, 7.0
PER_RATE = np.array([0.05, -0.08, 0.12])
"""m/s^2 for 1 K/s, of the outputs."""


def cycle(per_rate: FloatArray) -> FloatArray:
    """Poses held while the temperature swings by 25 degC about 25, half a period a half-cycle."""
    rows = log(directions(HALVES * POSES, seed=4), HOLD_S, sd=0.01, seed=4)
    half_s = rows[-1, 0] / HALVES
    phase = np.pi * rows[:, 0] / half_s
    temp = 25.0 - 25.0 * np.cos(phase)
    rate = 25.0 * np.pi / half_s * np.sin(phase)
    d = temp - 20.0
    rows[:, 1:] += d[:, None] * [2e-3, -3e-3, 4e-3] + rate[:, None] * per_rate
    return np.column_stack([rows, temp])[:: round(RATE_HZ / 10)]


def unit_with(folder: Path, per_rate: FloatArray) -> Path:
    return write_unit(folder, cycle(per_rate), WITH_T, header="t,ax,ay,az,T")


def test_a_term_that_wins_on_half_cycles_left_out_reaches_the_compiled_c(tmp_path: Path) -> None:
    delivery = deliver(unit_with(tmp_path / "U", PER_RATE))
    calibration = delivery.calibration
    assert "and dT/dt" in calibration.selection_reason
    assert "4 half-cycles left out in turn" in calibration.selection_reason
    rate = calibration.terms.rate
    assert rate is not None
    expected = -np.linalg.solve(symmetric_part(K), PER_RATE)
    # A straight line over 60 s of a swing of 352 s has 3 % too small a slope, (w W)^2 / 40. Poses
    # of 0.12 mg at 0.3 K/s, each seeing one of three axes: 0.12 / 0.3 / sqrt(88 / 3), three times.
    assert (np.abs(rate.offset_g_s_per_k - expected) < 0.03 * np.abs(expected) + 0.22e-3).all()
    assert any("a term in dT/dt is fitted" in f for f in calibration.findings)
    assert delivery.plan.rate is not None
    assert b"rate" in calibration_json(delivery)
    # The compiled C is given the rates of the poses, and keeps what the fit has.
    assert calibration.recording is not None
    for method in ("matrix", "inverse"):
        errors = [
            r.error_g for r in next(m for m in delivery.methods if m.method == method).residuals
        ]
        # r is that of T0: K changes by nothing here; rounding, and the method's error in two axes.
        limit = 2.0 * delivery.model_error_g + 2e-6
        assert np.abs(errors - calibration.recording.residual_g).max() < limit
    u = uncertainty(delivery.unit, delivery.measurements, calibration, None)
    stated = next(s for s in u.sources if s.key == "rate").sd
    assert stated is not None
    # A third of the 0.22 above, at the largest rate; how unevenly the poses lie is within a half.
    assert 0.5 < stated / (0.22e-3 / 3.0 * max(np.abs(rate.range_k_per_s))) < 2.0
    still = np.abs(calibration.recording.residual_g).max()
    assert still < 1e-3  # without the term 0.45 K/s leave 5 mg


def test_a_term_that_does_not_win_is_not_shipped(tmp_path: Path) -> None:
    calibration = calibrated(unit_with(tmp_path / "U", np.zeros(3)))
    assert any("and dT/dt" in c.label for c in calibration.candidates)
    assert calibration.terms.rate is None
    assert "dT/dt" not in calibration.selection_reason


def test_two_half_cycles_judge_no_term(tmp_path: Path) -> None:
    """With one of two left out the other's rate is a constant like the bias: it is not offered."""
    rows = cycle(PER_RATE)
    folder = write_unit(tmp_path / "U", rows[: len(rows) // 2], WITH_T, header="t,ax,ay,az,T")
    calibration = calibrated(folder)
    assert not any("dT/dt" in c.label for c in calibration.candidates)


@pytest.mark.parametrize("count", [1, 2])
def test_a_plain_cycle_is_no_worse(tmp_path: Path, count: int) -> None:
    """The same poses in one or two half-cycles still give a calibration over temperature."""
    rows = cycle(np.zeros(3))
    part = rows[: len(rows) * count // HALVES]
    folder = write_unit(tmp_path / "U", part, WITH_T, header="t,ax,ay,az,T")
    found = calibrated(folder).thermal.constants_at(20.0)[9:]
    # Twenty poses of 0.12 mg over temperature: a few times that.
    assert np.abs(found - U0).max() < 1e-2
