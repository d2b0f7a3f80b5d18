"""Exchanged positions and mistaken units: all of them found and named, none imagined."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fit_cases import (
    SEVEN,
    TABLE_TEMPS,
    Truth,
    cubic_truth,
    random_constants,
    readings,
    tables_truth,
    with_checks,
)
from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.grouping import group_dwells
from triaxcal.fitting.tilter.outputs import refuse_mistaken_units
from triaxcal.fitting.tilter.plausibility import refuse_exchanged_positions
from triaxcal.readings.measurements import MeasurementSet

POSITIONS = ("TP1", "TP2", "TP3", "TP4", "TP5", "TP6")
TRANSPOSITIONS = list(combinations(POSITIONS, 2))
ON_ONE_AXIS = {("TP5", "TP6"): "x", ("TP2", "TP4"): "y", ("TP1", "TP3"): "z"}


def exchanged(measurements: MeasurementSet, pair, temps: Iterable[float]) -> MeasurementSet:
    """The same readings with two positions' labels exchanged at these temperatures."""
    other = {pair[0]: pair[1], pair[1]: pair[0]}
    temps = set(temps)
    dwells = tuple(
        replace(d, position=other.get(d.position, d.position)) if d.temp_degc in temps else d
        for d in measurements.dwells
    )
    return MeasurementSet(measurements.source, dwells)


def check(measurements: MeasurementSet, polarity=None, t0=20.0) -> None:
    refuse_exchanged_positions(measurements.source, group_dwells(measurements, t0), polarity)


def refusal(measurements: MeasurementSet, polarity=None, t0=20.0) -> str:
    with pytest.raises(RefusedError) as caught:
        check(measurements, polarity, t0)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def rows_of(measurements: MeasurementSet, pair, temp: float) -> tuple[int, int]:
    rows = sorted(d.row for d in measurements.dwells if d.position in pair and d.temp_degc == temp)
    return rows[0], rows[1]


def cross_truth(cross: float, seed: int = 4) -> Truth:
    """A simulated unit: cross terms up to `cross` of K, biases of 2 K, all over temperature."""
    random = np.random.default_rng(seed)
    constants = random_constants(random, 2.0 * cross)
    change = 1.0 + 0.02 * random.uniform(-1, 1, 12)
    return lambda temp: constants * change ** ((np.asarray(temp) - 20.0)[..., None] / 50.0)


UNITS = {
    "tables of P1": (tables_truth, TABLE_TEMPS),
    "cross terms of a tenth": (cross_truth(0.1), SEVEN),
    "one temperature": (cross_truth(0.1, seed=8), (20.0,)),
}


@pytest.mark.parametrize("name", UNITS)
@pytest.mark.parametrize("pair", TRANSPOSITIONS, ids="-".join)
def test_every_exchange_at_one_temperature_is_named(name, pair):
    truth, temps = UNITS[name]
    clean = readings(truth, temps)
    for temp in temps:
        spoiled = exchanged(clean, pair, [temp])
        message = refusal(spoiled)
        first, second = rows_of(spoiled, pair, temp)
        assert message.startswith(f"measurements.csv, rows {first} and {second}")
        assert f"{pair[0]} and {pair[1]}" in message
        assert f"{temp:g} degC" in message
        if len(temps) > 1:
            assert f"look exchanged at {temp:g} degC" in message
            assert "polarity" not in message


@pytest.mark.parametrize("name", UNITS)
@pytest.mark.parametrize("pair", TRANSPOSITIONS, ids="-".join)
def test_every_exchange_at_all_temperatures_is_named(name, pair):
    truth, temps = UNITS[name]
    message = refusal(exchanged(readings(truth, temps), pair, temps))
    assert f"{pair[0]} and {pair[1]}" in message
    if pair in ON_ONE_AXIS:
        axis = ON_ONE_AXIS[pair]
        assert f"K{axis}{axis} has the wrong sign at every temperature" in message
        assert "the readings cannot tell " in message
        assert " exchanged throughout" in message
        assert "set polarity = [" in message
    else:
        assert ", ".join(f"{t:g}" for t in temps) + " degC" in message


@pytest.mark.parametrize("pair", TRANSPOSITIONS, ids="-".join)
def test_every_exchange_at_some_temperatures_is_named(pair):
    temps = SEVEN[1:5]  # more than half
    message = refusal(exchanged(readings(cross_truth(0.1), SEVEN), pair, temps))
    assert f"{pair[0]} and {pair[1]} look exchanged at -20, 0, 20, 40 degC" in message


@pytest.mark.parametrize("polarity", [(1, -1, 1), (-1, -1, 1), (-1, 1, 1), (1, 1, 1)])
@pytest.mark.parametrize("pair", TRANSPOSITIONS, ids="-".join)
def test_with_polarity_declared(polarity, pair):
    signs = np.repeat(polarity, 3).astype(float) * -1.0  # the rows of the tables are negative

    def truth(temp):
        constants = tables_truth(temp).copy()
        constants[..., :9] *= signs
        return constants

    clean = readings(truth, TABLE_TEMPS)
    check(clean, polarity)
    for temps in ([-40.0], TABLE_TEMPS):
        message = refusal(exchanged(clean, pair, temps), polarity)
        assert f"{pair[0]} and {pair[1]}" in message


def test_signs_that_differ_need_polarity():
    def truth(temp):
        constants = tables_truth(temp).copy()
        constants[..., 3:6] *= -1.0
        return constants

    clean = readings(truth, TABLE_TEMPS)
    message = refusal(clean)
    assert "Kyy has the wrong sign at every temperature" in message
    assert "expected signs of Kxx, Kyy, Kzz all alike" in message
    assert "set polarity = [-1, 1, -1] under [sensor] in unit.toml" in message
    check(clean, (-1, 1, -1))
    message = refusal(clean, (1, 1, 1))
    assert "expected those of [sensor] polarity = [1, 1, 1]" in message
    assert "polarity = [-1, 1, -1]" in message


def test_two_exchanges_at_once_are_both_named():
    clean = readings(tables_truth, TABLE_TEMPS)
    spoiled = exchanged(exchanged(clean, ("TP1", "TP3"), [70.0]), ("TP5", "TP2"), [70.0])
    message = refusal(spoiled)
    assert "TP1 and TP3" in message
    assert "TP2 and TP5" in message


def test_outputs_in_each_others_columns_are_refused():
    clean = readings(tables_truth, TABLE_TEMPS)
    dwells = tuple(replace(d, voltage_v=d.voltage_v[[1, 0, 2]]) for d in clean.dwells)
    message = refusal(MeasurementSet(clean.source, dwells))
    assert "put the columns of Ux, Uy, Uz in order" in message


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.2))
def test_no_false_alarm_on_sound_units(seed, cross):
    # Six cross terms of at most 0.2 of the smallest K: correlations of 0.96 and more.
    random = np.random.default_rng(seed)
    constants = random_constants(random, cross)
    check(readings(lambda _: constants, (20.0,), sd_v=1e-4 * np.abs(constants).max(), seed=seed))


def test_a_dead_output_is_left_to_the_condition_number():
    for axis in range(3):
        constants = tables_truth(np.array(20.0)).copy()
        constants[3 * axis : 3 * axis + 3] = 0.0
        check(readings(lambda _, c=constants: c, (20.0,), sd_v=1e-6, seed=axis))


# Units.


def scaled(measurements: MeasurementSet, factor: float, wrong) -> MeasurementSet:
    dwells = tuple(
        replace(d, voltage_v=d.voltage_v * factor) if wrong(d) else d for d in measurements.dwells
    )
    return MeasurementSet(measurements.source, dwells)


@pytest.mark.parametrize(("factor", "text"), [(1e3, "1000 times"), (1e-3, "1/1000 of")])
@pytest.mark.parametrize("row", [2, 9, 19, 21])
def test_one_row_in_another_unit(factor, text, row):
    clean = with_checks(readings(tables_truth, TABLE_TEMPS), cubic_truth(), (30.0,))
    with pytest.raises(RefusedError) as caught:
        refuse_mistaken_units(scaled(clean, factor, lambda d: d.row == row))
    assert str(caught.value).startswith(f"measurements.csv, row {row}: ")
    assert f"are about {text} those of the other rows" in str(caught.value)


@pytest.mark.parametrize("factor", [1e3, 1e-3])
@pytest.mark.parametrize("temp", TABLE_TEMPS)
def test_one_temperature_in_another_unit(factor, temp):
    clean = readings(tables_truth, TABLE_TEMPS)
    rows = ", ".join(str(d.row) for d in clean.dwells if d.temp_degc == temp)
    with pytest.raises(RefusedError) as caught:
        refuse_mistaken_units(scaled(clean, factor, lambda d: d.temp_degc == temp))
    assert str(caught.value).startswith(f"measurements.csv, rows {rows}: readings at {temp:g} degC")


def test_half_the_rows_in_another_unit():
    clean = readings(cubic_truth(), (20.0, 70.0))
    for factor in (1e3, 1e-3):
        with pytest.raises(RefusedError, match=r"row.* degC are about"):
            refuse_mistaken_units(scaled(clean, factor, lambda d: d.temp_degc > 30.0))


@given(st.integers(0, 2**32 - 1))
def test_no_false_alarm_about_units(seed):
    constants = random_constants(np.random.default_rng(seed), 0.2)
    refuse_mistaken_units(readings(lambda _: constants, (20.0, 70.0)))
