"""Dwells to groups: what belongs together, and every refusal by its text."""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
import pytest

from fit_cases import SEVEN, TABLE_TEMPS, cubic_truth, readings, with_checks
from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.grouping import (
    GROUP_GAP_DEGC,
    check_position_dwells,
    group_dwells,
    grouped_readings,
)
from triaxcal.readings.measurements import MeasurementSet


def measured(temps=TABLE_TEMPS, **options) -> MeasurementSet:
    return readings(cubic_truth(), temps, **options)


def changed(measurements: MeasurementSet, row: int, **changes) -> MeasurementSet:
    dwells = tuple(replace(d, **changes) if d.row == row else d for d in measurements.dwells)
    return MeasurementSet(measurements.source, dwells)


def refusal(measurements: MeasurementSet, t0_degc: float = 20.0) -> str:
    with pytest.raises(RefusedError) as caught:
        group_dwells(measurements, t0_degc)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_groups_rise_and_hold_the_positions_in_order():
    shuffled = list(measured(SEVEN, spread_degc=0.1).dwells)
    random.Random(1).shuffle(shuffled)
    groups = group_dwells(MeasurementSet("m.csv", tuple(shuffled)), 20.0)
    assert [round(g.temp_degc) for g in groups] == list(SEVEN)
    for group in groups:
        assert [d.position for d in group.dwells] == ["TP1", "TP2", "TP3", "TP4", "TP5", "TP6"]
        # Mean of six within 0.1 degC of each other: rounding of a sum of six, no more.
        mean = np.mean([d.temp_degc for d in group.dwells])
        assert group.temp_degc == pytest.approx(mean, abs=1e-13)


@pytest.mark.parametrize("temp", [20.1, -39.97, 0.1, 1 / 3])
def test_equal_temperatures_have_exactly_that_mean(temp):
    group = group_dwells(measured([temp]), temp)[0]
    assert group.temp_degc == temp


def test_check_positions_are_not_grouped():
    both = with_checks(measured(), cubic_truth(), (20.0, 30.0))
    assert len(group_dwells(both, 20.0)) == 3
    assert [d.position for d in check_position_dwells(both)] == [f"CP{i}" for i in range(1, 7)] * 2


@pytest.mark.parametrize("row", range(2, 20))
def test_a_missing_position_is_named_with_its_temperature(row):
    full = measured()
    gone = full.dwells[row - 2]
    rest = MeasurementSet(full.source, tuple(d for d in full.dwells if d.row != row))
    message = refusal(rest)
    assert message.startswith(
        f"measurements.csv: {gone.position} missing at {gone.temp_degc:g} degC, "
        "where there is only TP"
    )


def test_several_missing_positions_are_all_named():
    full = measured()
    rest = MeasurementSet(full.source, full.dwells[3:])
    message = refusal(rest)
    assert "TP1, TP2, TP3 missing at -40 degC, where there is only TP4 (row 5)" in message


def test_a_doubled_position_names_both_rows():
    message = refusal(changed(measured(), 4, position="TP1"))
    assert message.startswith("measurements.csv, rows 2 and 4: TP1 twice at one temperature")
    assert "-40 and -40 degC" in message


def test_a_wrong_temperature_shows_where_it_is_odd():
    message = refusal(changed(measured(), 10, temp_degc=200.0))
    assert "TP1, TP2, TP4, TP5, TP6 missing at 200 degC" in message
    assert "only TP3 (row 10)" in message


def test_no_dwells_at_t0_lists_the_temperatures():
    message = refusal(measured((-40.0, 17.9, 70.0)))
    assert "no dwells at T0 = 20 degC; temperatures found: -40, 17.9, 70 degC" in message
    group_dwells(measured((-40.0, 18.1, 70.0)), 20.0)  # within the tolerance


def test_no_dwells_at_all():
    checks = with_checks(MeasurementSet("m.csv", ()), cubic_truth(), (20.0,))
    assert refusal(checks).startswith("m.csv: no dwell in a test position")


def test_the_gap_parts_groups():
    near, far = GROUP_GAP_DEGC - 0.01, GROUP_GAP_DEGC + 0.01
    (one,) = group_dwells(measured((20.0, 20.0 + near)), 20.0)
    assert [len(run) for run in one.runs] == [6, 6]
    assert len(group_dwells(measured((20.0, 20.0 + far)), 20.0)) == 2


def test_arrays_carry_the_statistics_only_when_every_dwell_has_them():
    full = measured(sd_v=1e-6, count=100)
    arrays = grouped_readings(group_dwells(full, 20.0), volts_per_code=1e-9)
    assert arrays.variance_v2 is not None
    # (1e-6 sqrt(100))^2 / 100 with three roundings.
    np.testing.assert_allclose(arrays.variance_v2, 1e-12, rtol=4 * np.finfo(float).eps)
    arrays = grouped_readings(group_dwells(changed(full, 7, count=None), 20.0), 1e-9)
    assert arrays.variance_v2 is None


def test_a_quiet_channel_has_the_rounding_of_its_codes_whatever_the_count():
    code_v = 3e-7
    for sd_codes, rounding in ((0.0, 1.0), (0.49, 1.0), (0.51, 0.0)):
        data = measured(sd_v=sd_codes * code_v / np.sqrt(50), count=50)
        arrays = grouped_readings(group_dwells(data, 20.0), volts_per_code=code_v)
        assert arrays.variance_v2 is not None
        expected = (sd_codes * code_v) ** 2 / 50 + rounding * code_v**2 / 12.0
        np.testing.assert_allclose(arrays.variance_v2, expected, rtol=8 * np.finfo(float).eps)


def test_a_drifting_temperature_is_refused():
    temps = [20.0, 20.8, 21.6, 22.4, 23.2, 24.0]
    base = measured((20.0,))
    dwells = tuple(replace(d, temp_degc=t) for d, t in zip(base.dwells, temps, strict=True))
    message = refusal(replace(base, dwells=dwells))
    assert "4 degC between dwells that belong to one temperature (20 to 24 degC)" in message
    assert "leave out temperatures that are too near to each other" in message


@pytest.mark.parametrize(("count", "pooled"), [(3, True), (9, True), (10, False)])
def test_the_deviations_of_few_readings_are_pooled(count: int, pooled: bool) -> None:
    """GUM H.3.6: one deviation an output, weighted by the degrees of freedom."""
    measurements = measured(count=count)
    random_sd = np.random.default_rng(3).uniform(1e-6, 9e-6, (len(measurements.dwells), 3))
    dwells = tuple(
        replace(d, sd_v=sd, count=count + (k == 0) * 4)
        for k, (d, sd) in enumerate(zip(measurements.dwells, random_sd, strict=True))
    )
    groups = group_dwells(MeasurementSet("m.csv", dwells), 20.0)
    found = grouped_readings(groups, 1e-9)
    by_group = [d for g in groups for d in g.dwells]
    counts = np.array([d.count for d in by_group])
    assert found.pooled == pooled
    assert found.variance_v2 is not None
    if not pooled:
        assert found.variance_dof == count - 1
        own = np.array([d.sd_v**2 / d.count for d in by_group])
        np.testing.assert_array_equal(found.variance_v2.reshape(-1, 3), own)
        return
    dof = sum(d.count - 1 for d in by_group)
    assert found.variance_dof == dof
    together = sum((d.count - 1) * d.sd_v**2 for d in by_group) / dof
    # Sums of eighteen in another order.
    np.testing.assert_allclose(
        found.variance_v2.reshape(-1, 3), together / counts[:, None], rtol=1e-13
    )
