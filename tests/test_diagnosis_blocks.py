"""Mistakes that strike at some temperatures and not at the others, each named with its place."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis_units import Bench, read, rotation
from test_diagnosis import described
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import fit_folder, refuse_beyond_limits
from triaxcal.diagnosis import Diagnosis, diagnose
from triaxcal.diagnosis.causes.block_temperature import _read
from triaxcal.diagnosis.core.readings import readings_of
from triaxcal.readings.measurements import Dwell, MeasurementSet
from triaxcal.unit.description import UnitDescription, read_unit

TEMPS = (-40.0, -15.0, 5.0, 20.0, 40.0, 60.0)
CHECKS = (-25.0, 12.0, 50.0)
Unit = tuple[UnitDescription, MeasurementSet]
Change = Callable[[Dwell], Dwell]


def made(
    seed: int, before: Callable[[Bench], None] = lambda _b: None, *, checks: bool = True,
    more: str = "", temps: tuple[float, ...] = TEMPS,
) -> Unit:  # fmt: skip
    """A sound unit, tests heating and checks cooling; `before` changes its rows."""
    bench = Bench(np.random.default_rng([seed, 77]), temps, CHECKS if checks else ())
    before(bench)
    return read(bench, more)


def changed(unit: Unit, change: Change, *temps_degc: float) -> Unit:
    """The same with the dwells in test positions at some temperatures read in another way."""
    description, measurements = unit
    dwells = tuple(
        change(d)
        if d.position[0] == "T" and min(abs(d.temp_degc - t) for t in temps_degc) < 2
        else d
        for d in measurements.dwells
    )
    return description, replace(measurements, dwells=dwells)


def found(unit: Unit) -> Diagnosis:
    return diagnose(*unit)


def times(factors: object) -> Change:
    return lambda d: replace(d, voltage_v=d.voltage_v * np.array(factors))


def in_order(order: list[int]) -> Change:
    return lambda d: replace(d, voltage_v=d.voltage_v[order])


def named(names: dict[str, str]) -> Change:
    return lambda d: replace(d, position=names.get(d.position, d.position))


@pytest.mark.parametrize(
    ("change", "temps", "cause", "words"),
    [
        (times(2.0), (5.0,), "block_gain", "all outputs at 5.0"),
        (times(0.5), (-40.0, -15.0), "block_gain", "0.5 times the others'"),
        (times((1, 4, 1)), (60.0,), "block_gain", "output y at"),
        (times(1.01), (40.0,), "block_gain", "all outputs at"),
        (in_order([1, 0, 2]), (20.0,), "block_columns", "x as y, y as x at"),
        (in_order([0, 2, 1]), (40.0, 60.0), "block_columns", "y as z, z as y at"),
        (in_order([1, 2, 0]), (-15.0,), "block_columns", "x as z"),
        (times((1, 1, -1)), (5.0,), "block_polarity", "output z at"),
        (times((-1, -1, 1)), (-40.0, -15.0), "block_polarity", "outputs x and y at"),
        (times((1, 0, 1)), (5.0,), "dead", "output y at"),
        (named({"TP1": "TP4", "TP4": "TP1"}), (5.0, 20.0), "exchanged", "TP1 and TP4 at"),
        (named({"TP1": "TP2", "TP2": "TP6", "TP6": "TP1"}), (60.0,), "exchanged", "TP1 for TP2"),
    ],
)  # fmt: skip
def test_a_block_read_in_another_way_is_named_with_its_temperatures(
    change: Change, temps: tuple[float, ...], cause: str, words: str
) -> None:
    best = found(changed(made(1), change, *temps)).answer[0]
    assert best.cause == cause
    assert words in best.name
    assert len(best.rows) >= 2 * len(temps)


def test_a_block_seated_a_quarter_turn_round_is_named() -> None:
    def seated(bench: Bench) -> None:
        for row in bench.of_block(2):
            row["force"] = rotation(np.array([0.0, 0.0, np.pi / 2])) @ row["force"]

    best = found(made(2, seated)).answer[0]
    assert best.cause == "other_seat"
    assert "90 deg about (+0.00, +0.00, +1.00) at" in best.name


@pytest.mark.parametrize("checks", [False, True])
def test_two_cold_blocks_that_lost_their_sign_are_both_named(checks: bool) -> None:
    def lost(bench: Bench) -> None:
        for row in bench.rows:
            if row["true"] < 0.0:
                row["temp"] = -row["true"]

    best = found(made(3, lost, checks=checks)).answer[0]
    assert best.cause == "block_temperature"
    assert "the sign lost" in best.name
    assert len(best.rows) == (18 if checks else 12)


NOMINAL = "[sensor]\nnominal_v_per_g = 0.5\n"


@pytest.mark.parametrize(
    ("factors", "words"), [((2, 2, 2), "all outputs, 2 times"), ((1, 0.5, 1), "output y, 0.5")]
)
def test_a_gain_that_is_not_the_nominal_one_is_named_first(
    factors: tuple[float, ...], words: str
) -> None:
    best = found(changed(made(4, more=NOMINAL, checks=False), times(factors), *TEMPS)).answer[0]
    assert best.cause == "gain"
    assert words in best.name


def test_the_nominal_sensitivity_tells_which_blocks_have_another_gain() -> None:
    unit = changed(made(5, checks=False), times(2.0), *TEMPS[:4])
    few = found(unit).answer[0]
    assert "0.5 times" in few.name
    assert len(few.rows) == 12  # four of six temperatures are the others
    description, measurements = changed(made(5, checks=False, more=NOMINAL), times(2.0), *TEMPS[:4])
    many = found((description, measurements)).answer[0]
    assert "2 times" in many.name
    assert len(many.rows) == 24


def test_the_key_of_a_wrong_sign_is_the_one_that_is_stated() -> None:
    description, measurements = made(6, more="[sensor]\nnominal_v_per_g = -0.5\n")
    best = found((description, measurements)).answer[0]
    assert best.cause == "polarity"
    assert "(nominal_v_per_g = [0.5, 0.5, 0.5] under [sensor])" in best.name


def test_converters_at_both_ends_are_one_answer() -> None:
    description, measurements = made(7)
    clip = 0.93 * 0.5
    dwells = tuple(
        replace(d, voltage_v=np.clip(d.voltage_v, -clip, clip)) for d in measurements.dwells
    )
    best = found((description, replace(measurements, dwells=dwells))).answer[0]
    assert best.cause == "saturated"
    assert best.name.count("output") == 6


@pytest.mark.parametrize("settled", [False, True])
def test_a_thermometer_that_lags_in_all_dwells_is_named(settled: bool) -> None:
    def lags(bench: Bench) -> None:
        for row in bench.rows:
            sign = 1.0 if row["name"][0] == "T" else -1.0
            row["true"] += 0.0 if settled and row["block"] == 0 else sign * 8.0

    answer = found(made(12, lags)).answer
    assert "lag" in [s.cause for s in answer[:2]]


def test_an_end_of_the_converter_is_refused_though_squares_fit_it(tmp_path: Path) -> None:
    """Six positions cannot tell it from an own-axis square; that it is one level tells."""
    description, measurements = made(9, checks=False)
    level = min(d.voltage_v[1] for d in measurements.dwells if d.position == "TP4") - 0.01
    dwells = tuple(
        replace(d, voltage_v=np.minimum(d.voltage_v, (9.0, level, 9.0)))
        for d in measurements.dwells
    )
    folder = described(tmp_path, description, replace(measurements, dwells=dwells))
    done = fit_folder(read_unit(folder), folder)
    assert done.calibration.squares is not None
    assert done.calibration.squares.included
    with pytest.raises(RefusedError, match="saturation inside the range, output y at"):
        refuse_beyond_limits(done)


def test_three_temperatures_with_a_lost_sign_are_refused(tmp_path: Path) -> None:
    """A curve through all three leaves nothing, so that only the causes can tell."""

    def lost(bench: Bench) -> None:
        for row in bench.of_block(0):
            row["temp"] = -row["true"]

    description, measurements = made(10, lost, checks=False, temps=(-40.0, 20.0, 65.0))
    folder = described(tmp_path, description, measurements)
    done = fit_folder(read_unit(folder), folder)
    with pytest.raises(RefusedError, match="the sign lost, rows 2-7"):
        refuse_beyond_limits(done)


@pytest.mark.parametrize("degrees", [45, 90])
@pytest.mark.parametrize("temps", [TEMPS, (-40.0, 20.0, 65.0)])
def test_a_turned_sensor_is_said_and_not_taken_for_a_coarse_one(
    tmp_path: Path, degrees: int, temps: tuple[float, ...]
) -> None:
    def turned(bench: Bench) -> None:
        for row in bench.rows:
            row["force"] = rotation(np.array([np.radians(degrees), 0.0, 0.0])) @ row["force"]

    description, measurements = made(11, turned, checks=False, temps=temps)
    folder = described(tmp_path, description, measurements)
    done = fit_folder(read_unit(folder), folder)
    refuse_beyond_limits(done)
    (note,) = done.calibration.notes
    assert f"turned by {degrees}" in note or f"turned by {degrees - 1}" in note


def test_of_many_temperatures_the_first_and_the_last_are_named() -> None:
    """A line of 64 temperatures, twice, hid what was wrong."""
    readings = readings_of(*made(1, temps=tuple(np.arange(-40.0, 81.0, 5.0)), checks=False))
    mended, old = _read(readings, np.array(readings.blocks), lambda t: -t).split(" for ")
    assert re.fullmatch(r"(\+[\d.]+, ){6}\.\.\., -[\d.]+", mended)
    assert old == mended.translate(str.maketrans("+-", "-+"))
