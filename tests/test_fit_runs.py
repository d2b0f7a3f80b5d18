"""Several complete runs of one unit in one file: used together, compared, never mixed up."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fit_cases import SEVEN, cubic_truth, readings, unit
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.judgement import judge
from triaxcal.fitting.core.grouping import group_dwells
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.metrological import voltage_from_force
from triaxcal.model.positions import specific_force_g
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.uncertainty.evaluate import uncertainty

G_V = 0.5485
"""V/g of the outputs, to a per cent."""


def together(*runs):
    dwells = [d for run in runs for d in run.dwells]
    return MeasurementSet("m.csv", tuple(replace(d, row=k + 2) for k, d in enumerate(dwells)))


def offset(run, bias_g, degc=0.3):
    """A run whose biases differ, measured a little warmer."""
    truth, dwells = cubic_truth(), []
    for d in run.dwells:
        change = truth(d.temp_degc + degc) - truth(d.temp_degc)
        warmer = voltage_from_force(change, specific_force_g(d.position, 1.0))
        volts = d.voltage_v + warmer + bias_g * G_V
        dwells.append(replace(d, temp_degc=d.temp_degc + degc, voltage_v=volts))
    return MeasurementSet("m.csv", tuple(dwells))


def test_two_runs_are_one_calibration_of_their_mean():
    first = readings(cubic_truth(), SEVEN, sd_v=1e-6, count=100, seed=1)
    second = offset(first, 1e-4)
    calibration = calibrate(unit(), together(first, second))
    assert len(calibration.points) == 7
    alone = calibrate(unit(), first).thermal.constants_at(20.0)
    both = calibration.thermal.constants_at(20.0)
    # Half the difference of the biases; 0.3 degC / 2 is taken off along the curves.
    np.testing.assert_allclose((both - alone)[9:], 0.5e-4 * G_V, atol=0.03e-4)
    runs = calibration.runs
    assert (runs.runs, runs.temperatures, runs.dof) == (2, 7, 7)
    # Two runs +-0.05 mg about their mean have a standard deviation of 0.1 / sqrt(2) mg.
    assert runs.bias_g == pytest.approx(1e-4 / math.sqrt(2.0), rel=0.03)
    assert runs.scale_ratio < 2e-6
    assert runs.cross_ratio < 2e-6
    assert any("one run repeats its biases to 0.07" in note for note in calibration.notes)


def test_the_mean_of_two_runs_has_the_variance_of_a_mean():
    first = readings(cubic_truth(), (20.0,), sd_v=2e-6, count=64, seed=1)
    second = readings(cubic_truth(), (20.0,), sd_v=2e-6, count=16, seed=2)
    (group,) = group_dwells(together(first, second), 20.0)
    for d, a, b in zip(group.dwells, *group.runs, strict=True):
        assert d.position == a.position == b.position
        expected = (a.variance_of_mean_v2 + b.variance_of_mean_v2) / 4.0
        np.testing.assert_allclose(d.variance_of_mean_v2, expected, rtol=1e-12)


def test_repeatability_is_in_the_uncertainty():
    first = readings(cubic_truth(), SEVEN, sd_v=1e-6, count=100, seed=1)
    data = together(first, offset(first, 1e-4))
    calibration = calibrate(unit(), data)
    (source,) = [s for s in uncertainty(unit(), data, calibration, None).sources if s.key == "runs"]
    # The next run against the mean of two: sqrt(1 + 1/2) of one run's 0.0707 mg.
    assert source.sd == pytest.approx(1e-4 / math.sqrt(2.0) * math.sqrt(1.5), rel=0.03)
    assert source.dof == 21
    alone = calibrate(unit(), first)
    assert "runs" not in [s.key for s in uncertainty(unit(), first, alone, None).sources]


def test_runs_that_contradict_each_other_are_refused():
    """-20 degC that lost its sign looks like a second run at +20 degC."""
    temps = (-40.0, -20.0, 20.0, 70.0)
    data = readings(cubic_truth(), temps, sd_v=1e-7, count=100)
    lost = tuple(replace(d, temp_degc=20.0) if d.temp_degc == -20.0 else d for d in data.dwells)
    own, spoiled = unit(), MeasurementSet("m.csv", lost)
    found = judge(Fitted(own, spoiled, "", calibrate(own, spoiled)))
    assert not found.passed
    assert "2 runs at 20 degC contradict each other" in str(found.refusal)


def test_an_incomplete_second_run_is_refused_as_before():
    first = readings(cubic_truth(), (20.0,))
    part = MeasurementSet("m.csv", first.dwells[:4])
    with pytest.raises(RefusedError, match="TP1 twice at one temperature"):
        calibrate(unit(), together(first, part))
