"""A term in dT/dt of a recording over half-cycles: shipped into the C where it wins alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from family_cases import COLUMNS, RATE_HZ, U0, K, directions, log, write_unit
from test_recordings import calibrated, symmetric_part

from triaxcal.delivery.saved import calibration_json
from triaxcal.delivery.unit import deliver
from triaxcal.model.types import FloatArray
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


def slow_ramp() -> FloatArray:
    """Up and down by 10 degC twice, at 1 K/min with a pose a minute; the bias sees T and dT/dt."""
    rows = log(directions(40, seed=4), 59.0, sd=0.01, seed=4)[:: round(RATE_HZ / 10)]
    phase = rows[:, 0] / 60.0 % 20.0
    temp = np.minimum(phase, 20.0 - phase)
    rate = np.where(phase < 10.0, 1.0, -1.0) / 60.0
    rows[:, 1:] += 5e-3 * temp[:, None] + rate[:, None] * (30.0 * PER_RATE)
    return np.column_stack([rows, temp])


def test_a_slow_ramp_is_fitted_over_temperature_with_its_rate(tmp_path: Path) -> None:
    """Poses 1 degC apart are at many temperatures, not at one."""
    more = '[thermal]\nmodel = "polynomial"\norder = 1\nt0_degc = 5\n'
    folder = write_unit(tmp_path / "U", slow_ramp(), WITH_T, header="t,ax,ay,az,T", more=more)
    calibration = calibrated(folder)
    assert {c.shape.order for c in calibration.candidates} == {1}
    assert "4 half-cycles held out in turn" in calibration.selection_reason
    rate = calibration.terms.rate
    assert rate is not None
    expected = -np.linalg.solve(symmetric_part(K), 30.0 * PER_RATE)
    # Poses at the turns have half a rate in their window, two of forty; 590 samples of 0.01 m/s^2
    # are 0.04 mg a pose: 0.04 / (1/60) / sqrt(40 / 3) g for 1 K/s, three times.
    assert np.abs(rate.offset_g_s_per_k - expected).max() < 0.05 * np.abs(expected).max() + 2e-3


def unit_with(folder: Path, per_rate: FloatArray) -> Path:
    return write_unit(folder, cycle(per_rate), WITH_T, header="t,ax,ay,az,T")


def test_a_term_that_wins_on_half_cycles_left_out_reaches_the_compiled_c(tmp_path: Path) -> None:
    delivery = deliver(unit_with(tmp_path / "U", PER_RATE))
    calibration = delivery.calibration
    assert "and dT/dt" in calibration.selection_reason
    assert "4 half-cycles held out in turn" in calibration.selection_reason
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
            r.error_g
            for r in next(m for m in delivery.methods if m.method.name == method).residuals
        ]
        # r is that of T0: K changes by nothing here; the method's error in two axes, half a code of
        # 1.6e-6 g in three, and half a code of 1/128 degC, over which a bias goes 0.4 mg/K.
        limit = 2.0 * delivery.model_error_g + 1.4e-6 + 1.6e-6
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


@pytest.mark.parametrize("dither", [0.0, 0.1])
def test_plateaus_have_no_rate(tmp_path: Path, dither: float) -> None:
    """Constant, or between two codes: no slope that the thermometer could show."""
    parts, start = [], 0.0
    for n, temp in enumerate((0.0, 20.0, 40.0, 20.0, 0.0, 20.0, 40.0)):
        rows = log(directions(10, seed=n), seed=n)
        rows[:, 0] += start
        start = rows[-1, 0] + 600.0
        codes = dither * np.random.default_rng(n).integers(0, 2, len(rows))
        parts.append(np.column_stack([rows, temp + codes]))
    folder = write_unit(tmp_path / "U", np.concatenate(parts), WITH_T, header="t,ax,ay,az,T")
    calibration = calibrated(folder)
    assert "half-cycles" not in calibration.selection_reason
    assert not any("dT/dt" in c.label for c in calibration.candidates)


def test_nothing_judges_a_rate_where_no_orientation_can_be_spared(tmp_path: Path) -> None:
    """Six faces determine none of each other: single poses are held out, and no half-cycles."""
    rows = log(np.tile(directions(6, seed=4), (8, 1)), HOLD_S, sd=0.01, seed=4)
    half_s = rows[-1, 0] / HALVES
    phase = np.pi * rows[:, 0] / half_s
    rows[:, 1:] += 5.0 * np.pi / half_s * np.sin(phase)[:, None] * PER_RATE
    rows = np.column_stack([rows, 20.0 - 5.0 * np.cos(phase)])[:: round(RATE_HZ / 10)]
    calibration = calibrated(write_unit(tmp_path / "U", rows, WITH_T, header="t,ax,ay,az,T"))
    assert "single poses, those of equal orientation kept" in calibration.selection_reason
    assert "half-cycles" not in calibration.selection_reason
    assert not any("dT/dt" in c.label for c in calibration.candidates)
    assert calibration.terms.rate is None
