"""What unit.toml may state to be checked: nominal sensitivities, latitude and height."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fit_cases import TABLE_TEMPS, cubic_truth, readings, unit
from triaxcal.base.errors import RefusedError
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.description import unit_of_text
from triaxcal.unit.gravity import normal_gravity_m_per_s2

TOML = """format = 1
serial = "N"
[adc]
bits = 24
full_scale_v = 2.5
[temperature_sensor]
degc_per_code = 0.01
[site]
local_gravity_m_per_s2 = {gravity}
{site}
[thermal]
t0_degc = 20
[sensor]
{sensor}
"""


def described(sensor="", site="", gravity=9.80665):
    return unit_of_text("N", TOML.format(sensor=sensor, site=site, gravity=gravity), "unit.toml")


def scaled(factors):
    """Readings of a unit of -0.55 V/g, each output times a factor."""
    data = readings(cubic_truth(), TABLE_TEMPS, sd_v=1e-7)
    dwells = tuple(replace(d, voltage_v=d.voltage_v * np.array(factors)) for d in data.dwells)
    return MeasurementSet(data.source, dwells)


def refusal(own, data):
    with pytest.raises(RefusedError) as caught:
        calibrate(own, data)
    return str(caught.value)


def test_one_number_or_three():
    assert described("nominal_v_per_g = -0.55").nominal_v_per_g == (-0.55, -0.55, -0.55)
    own = described("nominal_v_per_g = [0.5, -0.5, 0.6]")
    assert own.nominal_v_per_g == (0.5, -0.5, 0.6)
    assert own.polarity == (1, -1, 1)
    assert own.nominal_tolerance == 0.2
    assert described().nominal_v_per_g is None
    for wrong in ("0", "[0.5, 0.5]", "[0.5, 0.0, 0.5]", '"0.5"'):
        with pytest.raises(RefusedError, match="a number that is not zero, or a list of three"):
            described(f"nominal_v_per_g = {wrong}")


def test_signs_that_contradict_the_stated_polarity_are_refused():
    with pytest.raises(RefusedError, match=r"the signs of nominal_v_per_g, \[1, -1, 1\]"):
        described("nominal_v_per_g = [1.0, -1.0, 1.0]\npolarity = [1, 1, 1]")
    described("nominal_v_per_g = [1.0, -1.0, 1.0]\npolarity = [1, -1, 1]")


def test_keys_that_this_kind_of_unit_does_not_use_are_refused():
    with pytest.raises(RefusedError, match=r"\[firmware\] terms.*own-squares"):
        described('\n[firmware]\nterms = "quadratic"')
    assert described('\n[firmware]\nterms = "own-squares"').firmware_terms == "own-squares"
    recorded = """format = 1
serial = "N"
[site]
local_gravity_m_per_s2 = 9.8
[recording]
file = "log.csv"
rows = "poses"
acceleration = ["ax", "ay", "az"]
acceleration_unit = "g"
[sensor]
"""
    unit_of_text("N", recorded, "unit.toml")
    with pytest.raises(RefusedError, match=r"nominal_v_per_g.*remove it"):
        unit_of_text("N", recorded + "nominal_v_per_g = 1.0", "unit.toml")


def test_a_unit_of_its_nominal_sensitivity_passes():
    own = described("nominal_v_per_g = -0.5")  # 10 % below, within 20 %
    assert calibrate(own, scaled((1, 1, 1))).serial == "N"


def test_a_wrong_full_scale_is_named_with_its_factor():
    own = described("nominal_v_per_g = -0.55")
    message = refusal(own, scaled((2, 2, 2)))
    assert "Ux 1.102, Uy 1.096, Uz 1.097 V/g, 2 times the nominal one" in message
    assert "[adc] full_scale_v, bits or a gain before the converter is off by the factor 2" in (
        message
    )
    assert "by the factor 1/2" in refusal(own, scaled((0.5, 0.5, 0.5)))
    assert "by the factor 1.5" in refusal(own, scaled((1.5, 1.5, 1.5)))


def test_one_wrong_gain_is_named():
    message = refusal(described("nominal_v_per_g = -0.55"), scaled((1, 1.3, 1)))
    assert "check gain and wiring of Uy" in message
    wide = described("nominal_v_per_g = -0.55\nnominal_tolerance = 0.4")
    assert calibrate(wide, scaled((1, 1.3, 1))).serial == "N"


def test_a_unit_turned_over_throughout_is_seen_by_its_signs():
    """Without a nominal sensitivity nothing tells all positions upside down from a polarity."""
    data = scaled((1, 1, 1))
    over = {p: q for p in TEST_POSITIONS for q in TEST_POSITIONS
            if tuple(-v for v in TEST_POSITIONS[p]) == TEST_POSITIONS[q]}  # fmt: skip
    dwells = tuple(replace(d, position=over[d.position]) for d in data.dwells)
    turned = MeasurementSet(data.source, dwells)
    assert calibrate(unit(), turned).serial == "T-1"
    message = refusal(described("nominal_v_per_g = -0.55"), turned)
    assert message.startswith("measurements.csv: Kxx and Kyy and Kzz have the wrong sign")
    assert "expected those of [sensor] nominal_v_per_g = -0.55" in message
    assert "set nominal_v_per_g = 0.55 under [sensor]" in message
    assert "polarity =" not in message


@pytest.mark.parametrize(
    ("latitude", "height", "expected"),
    [
        # NIMA TR8350.2, table 3.4: gravity at the equator and at the poles.
        (0.0, 0.0, 9.7803253359),
        (90.0, 0.0, 9.8321849378),
        # Somigliana at 45 deg, by hand; 3.0855e-6 /s^2 less per metre there.
        (45.0, 0.0, 9.8061978),
        (45.0, 1000.0, 9.8061978 - 3.0855e-3),
    ],
)
def test_normal_gravity_is_that_of_the_standard(latitude, height, expected):
    assert normal_gravity_m_per_s2(latitude, height) == pytest.approx(expected, abs=1e-6)


def test_local_gravity_is_checked_against_the_place():
    kyiv = "latitude_deg = 50.45\nheight_m = 180"
    assert calibrate(described(site=kyiv, gravity=9.81054), scaled((1, 1, 1))).notes == ()
    (note,) = calibrate(described(site=kyiv, gravity=9.8125), scaled((1, 1, 1))).notes
    assert note.startswith("local gravity is +0.0020")
    with pytest.raises(RefusedError, match=r"local_gravity_m_per_s2: 9.78 m/s\^2, 0.03"):
        described(site=kyiv, gravity=9.78)
    # Without a height any is allowed: 9.80665 is that of 1400 m at 50.45 deg.
    described(site="latitude_deg = 50.45", gravity=9.80665)
    with pytest.raises(RefusedError, match="at any height"):
        described(site="latitude_deg = 0", gravity=9.81)
