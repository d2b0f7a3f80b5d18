"""Mistakes that are named before any fit: temperatures, dead and copied outputs; and a turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fit_cases import TABLE_TEMPS, TABLES, cubic_truth, readings, unit
from triaxcal.base.errors import RefusedError
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.metrological import pack_constants, unpack_constants
from triaxcal.readings.measurements import MeasurementSet

FIVE = (-40.0, -10.0, 20.0, 45.0, 70.0)


def changed(convert, at=None):
    """Temperatures of all dwells, or of those at one, converted."""
    data = readings(cubic_truth(), FIVE, sd_v=1e-7)
    dwells = [
        replace(d, temp_degc=convert(d.temp_degc)) if at in (None, d.temp_degc) else d
        for d in data.dwells
    ]
    return MeasurementSet(data.source, tuple(dwells))


def refusal(data, **keys):
    with pytest.raises(RefusedError) as caught:
        calibrate(unit(**keys), data)
    return str(caught.value)


@pytest.mark.parametrize(
    ("convert", "at", "words"),
    [
        (lambda t: t + 256.0, -40.0, "rows 2 to 7: dwells at 216 degC;"),
        (lambda t: t + 256.0, -10.0, "an unsigned byte: -10 degC"),
        (lambda t: t + 273.15, 45.0, "kelvin: 45 degC"),
        (lambda t: t + 273.15, None, "kelvin: -40, -10, 20, 45, 70 degC"),
        (lambda t: 1.8 * t + 32.0, 70.0, "degrees Fahrenheit: 70 degC"),
        (lambda t: t - 256.0, 70.0, "a byte of the wrong sign: 70 degC"),
    ],
)
def test_unbelievable_temperatures_are_named_before_the_fit(convert, at, words):
    message = refusal(changed(convert, at))
    assert words in message
    assert "expected temperatures from -60 to 130 degC" in message


def test_a_stated_range_makes_a_temperature_believable():
    data = readings(cubic_truth(), (20.0, 100.0, 175.0), sd_v=1e-7)
    assert "dwells at 175 degC" in refusal(data)
    own = unit(range_degc=(20.0, 175.0))
    assert calibrate(own, data).range_degc == (20.0, 175.0)


def test_a_copied_output_is_named():
    data = readings(cubic_truth(), TABLE_TEMPS, sd_v=1e-6)
    for sign, word in ((1.0, "repeats"), (-1.0, "is the negative of")):
        dwells = tuple(
            replace(d, voltage_v=np.array([*d.voltage_v[:2], sign * d.voltage_v[1]]))
            for d in data.dwells
        )
        assert f"Uz {word} Uy in all dwells" in refusal(MeasurementSet("m.csv", dwells))


def test_a_dead_output_is_named_and_no_unit_is_blamed():
    """Its positions have short readings, as mV taken for V have; but every time the same."""
    data = readings(cubic_truth(), TABLE_TEMPS, sd_v=1e-6)
    dwells = tuple(replace(d, voltage_v=d.voltage_v * [1, 1, 0]) for d in data.dwells)
    message = refusal(MeasurementSet("m.csv", dwells))
    assert ": Uz does not respond to gravity: it stays within 0 mV" in message


@pytest.mark.parametrize(("axis", "name"), [(0, "x"), (1, "y"), (2, "z")])
@pytest.mark.parametrize("deg", [30.0, -45.0])
def test_a_turned_sensor_is_said_once_with_the_angle(axis, name, deg):
    a, b = [k for k in range(3) if k != axis]
    if axis == 1:
        a, b = b, a
    turn = np.eye(3)
    c, s = np.cos(np.radians(deg)), np.sin(np.radians(deg))
    turn[[a, a, b, b], [a, b, a, b]] = c, -s, s, c  # takes the case's axes to the sensor's
    sensor = np.diag([0.55, 0.56, 0.545])
    U0 = unpack_constants(TABLES[1])[1]
    constants = pack_constants(sensor @ turn.T, U0)
    calibration = calibrate(unit(), readings(lambda _: constants, (20.0,)))
    (note,) = calibration.notes
    sign = "-" if deg < 0 else ""
    assert note.startswith(f"the sensor is turned by {abs(deg):.1f} deg about {sign}{name} of")


def test_a_straight_sensor_has_no_such_note():
    assert calibrate(unit(), readings(cubic_truth(), TABLE_TEMPS)).notes == ()
