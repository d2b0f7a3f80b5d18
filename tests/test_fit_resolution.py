"""Coarse converters: the C is judged between codes, and one code is said beside the limits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import triaxcal
from fit_cases import TABLE_TEMPS, cubic_truth, readings, unit
from triaxcal.codegen.tryout import run_on_dwells
from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.judgement import judge
from triaxcal.delivery.unit import deliver
from triaxcal.fitting.tilter.acceptance import dwell_errors_g, dwells_in_range
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.adc import Adc

TWELVE = Adc(12, 2.5, -(2**11), 2**11 - 1)
CODE_MG = 1e3 * TWELVE.volts_per_code / np.hypot(0.5485, 0.0147)
"""K_zz and K_zx of the tables: the output's sensitivity along its own axis, however turned."""

TOML = """format = 1
serial = "COARSE"
[adc]
bits = 12
full_scale_v = 2.5
[temperature_sensor]
degc_per_code = 0.25
[site]
local_gravity_m_per_s2 = 9.80665
[thermal]
t0_degc = 20
"""


def dithered():
    """Means of 400 readings that scatter by 1.5 codes: their rounding has averaged out."""
    code = TWELVE.volts_per_code
    data = readings(cubic_truth(), TABLE_TEMPS, sd_v=1.5 * code / 20.0, count=400, seed=4)
    dwells = tuple(replace(d, sd_v=np.full(3, 1.5 * code)) for d in data.dwells)
    return MeasurementSet(data.source, dwells)


def rounded():
    """Readings without noise: all of a dwell show one code, and so does the mean."""
    code = TWELVE.volts_per_code
    data = readings(cubic_truth(), TABLE_TEMPS)
    dwells = tuple(replace(d, voltage_v=np.rint(d.voltage_v / code) * code) for d in data.dwells)
    return MeasurementSet(data.source, dwells)


def test_the_compiled_c_has_the_residuals_of_the_fit(tmp_path: Path):
    """One code is 2.2 mg; the residual of the C is that of the model, to its own proven error."""
    folder = tmp_path / "COARSE"
    folder.mkdir()
    (folder / "unit.toml").write_text(TOML, encoding="utf-8")
    head = "position,temp_degc,ux_v,uy_v,uz_v,count,sd_ux_v,sd_uy_v,sd_uz_v"
    rows = [
        ",".join([d.position, f"{d.temp_degc:.3f}", *map(repr, d.voltage_v.tolist()), "400",
                  *map(repr, d.sd_v.tolist())])
        for d in dithered().dwells
    ]  # fmt: skip
    text = "\n".join([head, *rows]) + "\n"
    (folder / "measurements.csv").write_text(text, encoding="utf-8")
    delivery = deliver(folder)
    dwells = dwells_in_range(delivery.unit, delivery.calibration.range_degc, delivery.measurements)
    model = dwell_errors_g(delivery.unit, delivery.calibration, dwells)
    compiled = np.abs([r.error_g for r in delivery.chosen.residuals])
    bound_g = (
        np.linalg.norm(delivery.bound.per_axis_lsb) * 2.0**-24 + delivery.model_error_g * 3**0.5
    )
    np.testing.assert_allclose(compiled, model, rtol=0, atol=bound_g)
    assert compiled.max() < 0.2 * CODE_MG / 1e3
    (note,) = delivery.calibration.notes
    assert note.startswith(f"one code is {CODE_MG:.3g} mg: one reading is rounded by up to")
    assert "0.3 mg (limits.at_t0_g)" in note


def test_the_c_is_interpolated_between_its_answers():
    """A routine that is linear in its codes is judged exactly, at any mean."""
    own = unit(adc=TWELVE, output_q=8)
    data = dithered()
    calibration = calibrate(own, data)
    slope = np.array([3.0, -5.0, 7.0])

    def routine(temp, raw):
        return (raw * slope + temp[:, None]).astype(np.int32), np.ones(len(temp), np.uint32)

    _, own_method = run_on_dwells(
        own, calibration.thermal, "m.csv", data.dwells, {"matrix": routine}
    )
    temps = np.array([d.temp_degc for d in data.dwells]) / 0.01
    codes = np.array([d.voltage_v for d in data.dwells]) / TWELVE.volts_per_code
    expected = np.linalg.norm(codes * slope + temps[:, None], axis=1) / 256.0 - 1.0
    found = [r.error_g for r in own_method.residuals]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_limit_below_half_a_code_is_refused_where_the_means_are_whole_codes():
    own = unit(adc=TWELVE)
    data = rounded()
    found = judge(Fitted(own, data, "", calibrate(own, data)))
    assert not found.passed
    message = str(found.refusal)
    assert "unit.toml, [limits] at_t0_g: one code is 2.2" in message
    assert "the readings of a dwell show one code alone" in message
    wide = replace(own, limits=replace(own.limits, at_t0_g=2e-3, over_range_g=3e-3))
    assert judge(Fitted(wide, data, "", calibrate(wide, data))).refusal is None


def test_little_scatter_is_rounded_whatever_the_printed_mean_is():
    own, code = unit(adc=TWELVE), TWELVE.volts_per_code
    dwells = tuple(replace(d, sd_v=np.full(3, 0.1 * code)) for d in dithered().dwells)
    data = MeasurementSet("m.csv", dwells)
    refusal = judge(Fitted(own, data, "", calibrate(own, data))).refusal
    assert isinstance(refusal, triaxcal.RefusedError)
    assert "half a code at least" in str(refusal)


def test_a_fine_converter_has_no_note():
    assert calibrate(unit(), readings(cubic_truth(), TABLE_TEMPS, sd_v=1e-7)).notes == ()
