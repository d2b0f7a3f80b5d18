"""Own-axis squares from the six positions: found, judged, compensated, left alone if sound."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from fit_cases import TABLES, unit
from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.judgement import judge
from triaxcal.delivery.unit import deliver
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell, MeasurementSet
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.uncertainty.source import Source
from triaxcal.unit.priors import Priors

TEMPS = (-40.0, 20.0, 70.0)
K, U0 = unpack_constants(TABLES[1])
K2 = np.array([5e-3, -4e-3, 2e-3])


def output(force: FloatArray, temp: float, squares: FloatArray) -> FloatArray:
    """U = K (a + K2 a^2) + U0, the bias linear in temperature."""
    return K @ (force + squares * force**2) + U0 + (temp - 20.0) * 1e-5


def measured(
    squares: FloatArray, *, tilt_arcsec: float = 0.0, checks: int = 0, seed: int = 0,
    sd_v: float = 5e-7, along: Sequence[tuple[float, float, float]] = (),
) -> MeasurementSet:  # fmt: skip
    """Six positions, each tilted the same at all temperatures, and check dwells at +20 degC."""
    random = np.random.default_rng(seed)
    tilts = random.normal(size=(6, 3)) * np.radians(tilt_arcsec / 3600.0)
    dwells: list[Dwell] = []

    def add(position: str, temp: float, force: FloatArray) -> None:
        force = force / np.linalg.norm(force)
        volts = output(force, temp, squares) + sd_v * random.normal(size=3)
        dwells.append(Dwell(len(dwells) + 2, position, temp, volts, 100, np.full(3, 10 * sd_v)))

    for temp in TEMPS:
        for (position, up), tilt in zip(TEST_POSITIONS.items(), tilts, strict=True):
            force = np.array(up, dtype=float)
            add(position, temp, force + np.cross(tilt, force))
    for k in range(checks):
        add(f"CP{k % 6 + 1}", 20.0, random.normal(size=3))
    for direction in along:
        add("CP1", 20.0, np.array(direction))
    return MeasurementSet("m.csv", tuple(dwells))


def test_squares_are_found_to_their_stated_uncertainty():
    """60 units with faces out of square by 20 arcsec: errors follow Student's t."""
    z = []
    for seed in range(60):
        found = calibrate(unit(), measured(K2, tilt_arcsec=20.0, seed=seed)).squares
        z.append((-found.per_g - K2) / found.sd_per_g)
    # 3 degrees of freedom at least: half within 0.765; of 180 values 5 sd are 0.19 of them.
    within = float(np.mean(np.abs(z) < 0.765))
    assert 0.31 < within < 0.85
    assert np.abs(np.mean(z)) < 5.0 * np.sqrt(3.0 / 180.0)


@pytest.mark.parametrize("checks", [0, 12])
def test_a_unit_with_squares_is_compensated_in_any_direction(checks):
    data = measured(K2, checks=checks)
    own = unit()
    calibration = calibrate(own, data)
    assert calibration.squares.included
    # Six positions alone do not tell a square from a saturated reading.
    assert judge(Fitted(own, data, "", calibration)).passed == (checks > 0)
    random = np.random.default_rng(1)
    force = random.normal(size=(300, 3))
    force /= np.linalg.norm(force, axis=1)[:, None]
    volts = np.array([output(f, 20.0, K2) for f in force])
    linear = force_from_voltage(calibration.thermal.constants_at(20.0), volts)
    error = calibration.terms.force_g(linear) - force
    # The inverse of the square is cut off after K2^2: 2 K2^2 a^3, of which K takes the part at 1 g;
    # 4 noise sd of 1 micro-g on top.
    assert np.abs(error).max() < 2.0 * (5e-3) ** 2 + 4e-6
    left_out = np.linalg.norm(linear, axis=1) - 1.0
    assert np.abs(left_out).max() > 1e-3


def test_the_note_has_the_rule_and_its_numbers():
    calibration = calibrate(unit(), measured(K2, checks=12))
    note = next(n for n in calibration.notes if "own-axis squares" in n)
    assert "own-axis squares (a = l + Q l^2) Qx.xx -5, Qy.yy +4, Qz.zz -2 mg/g^2" in note
    assert "100 % from the readings, the rest from the prior of 5" in note
    assert "in the C: 5 mg at 1 g against 0.097 mg, the standard uncertainty" in note
    assert "at temperatures held out they leave" in note
    assert "in the check dwells" in note


def test_sound_units_keep_a_linear_c():
    """Faces out of square by 30 arcsec make the same half-sums, but no squares."""
    for seed in range(40):
        calibration = calibrate(unit(), measured(0.0 * K2, tilt_arcsec=30.0, seed=seed))
        assert calibration.terms.quadratic_per_g is None, seed
        assert not any("squares" in n for n in calibration.notes)


def test_check_dwells_have_a_say():
    """Half-sums that look like squares, which the check dwells contradict."""
    data = measured(K2)
    straight = measured(0.0 * K2, checks=12).dwells[18:]
    mixed = MeasurementSet("m.csv", (*data.dwells, *straight))
    calibration = calibrate(unit(), mixed)
    assert calibration.squares.significant
    without, having = calibration.squares.checks_g
    assert having > without
    assert not calibration.squares.included
    assert calibration.terms.quadratic_per_g is None
    assert any("not in the C" in n for n in calibration.notes)


def test_the_firmware_key_decides():
    linear = calibrate(unit(firmware_terms="linear"), measured(K2))
    assert linear.terms.quadratic_per_g is None
    forced = calibrate(unit(firmware_terms="own-squares"), measured(0.0 * K2))
    assert forced.terms.quadratic_per_g is not None
    assert any("in the C by [firmware] terms" in n for n in forced.notes)


def test_a_narrow_prior_holds_the_squares():
    """With noise of the size of the prior the readings determine half."""
    data = measured(K2, sd_v=1e-3)
    wide = calibrate(unit(), data).squares
    narrow = calibrate(unit(priors=Priors(own_square_g_per_g2=1e-5)), data).squares
    assert narrow.data_share < 0.01
    assert np.abs(narrow.per_g).max() < np.abs(wide.per_g).max() / 50.0
    assert narrow.sd_per_g <= 1e-5


def test_the_squares_are_in_the_budget():
    data, own = measured(K2, tilt_arcsec=20.0, seed=3), unit()
    calibration = calibrate(own, data)
    (source,) = [
        s for s in uncertainty(own, data, calibration, None).sources if s.key == "own_squares"
    ]
    assert source.sd == calibration.squares.sd_per_g
    assert source.force.shape[1:] == (30, 30)
    sound = calibrate(own, measured(0.0 * K2, tilt_arcsec=20.0))
    keys = [s.key for s in uncertainty(own, measured(0.0 * K2), sound, None).sources]
    assert "own_squares" not in keys


def saturated(limit_g: float, checks: Sequence[tuple[float, float, float]] = ()) -> MeasurementSet:
    """A linear unit whose x output stops at `limit_g`, at +20 degC; check dwells along `checks`."""
    dwells: list[Dwell] = []

    def add(position: str, along: tuple[float, float, float]) -> None:
        force = np.array(along) / np.linalg.norm(along)
        dwells.append(Dwell(len(dwells) + 2, position, 20.0, stopped(force, limit_g), 100, SD))

    for position, along in TEST_POSITIONS.items():
        add(position, along)
    for along in checks:
        add("CP1", along)
    return MeasurementSet("m.csv", tuple(dwells))


SD = np.full(3, 5e-6)


def stopped(force: FloatArray, limit_g: float) -> FloatArray:
    """Readings of `output` without squares, x no farther than at `limit_g`."""
    volts = output(force, 20.0, 0.0 * K2)
    end = output(np.array([limit_g, 0.0, 0.0]), 20.0, 0.0 * K2)[0]
    volts[0] = max(volts[0], end) if K[0, 0] < 0.0 else min(volts[0], end)
    return volts


def square_form(data: MeasurementSet) -> list[Source]:
    calibration = calibrate(unit(), data)
    sources = uncertainty(unit(), data, calibration, None).sources
    return [s for s in sources if s.key == "square_form"]


@pytest.mark.parametrize("limit_g", [0.95, 0.99])
def test_a_saturated_position_is_not_passed_as_a_square(limit_g):
    """Its error is within the stated uncertainty wherever the output is not saturated."""
    data, own = saturated(limit_g), unit()
    calibration = calibrate(own, data)
    assert calibration.squares.included
    assert not judge(Fitted(own, data, "", calibration)).passed
    assert any("may as well be saturation" in n and "square of x" in n for n in calibration.notes)
    angles = np.linspace(0.0, np.pi, 181)
    force = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    force = force[force[:, 0] < limit_g]
    volts = np.array([stopped(f, limit_g) for f in force])
    found = calibration.terms.force_g(
        force_from_voltage(calibration.thermal.constants_at(20.0), volts)
    )
    error = np.linalg.norm(found, axis=1) - 1.0
    stated = uncertainty(own, data, calibration, None).force_u_in(force)[0, :, 3]
    assert np.abs(error).max() > 0.5 * (1.0 - limit_g)
    assert (np.abs(error) < stated).all()


def test_check_dwells_off_the_faces_tell_a_square():
    around = [(0.0, 0.8, 0.6), (0.0, -0.8, 0.6), (0.0, 0.6, -0.8)]
    assert square_form(measured(K2))
    both = [(0.8, 0.4, 0.4), (-0.8, 0.4, 0.4)]
    assert not square_form(measured(K2, along=[*around, *both]))
    (left,) = square_form(measured(K2, along=around))
    # x has no check dwell: one of three forms, of which one is wrong by 2 Q g^2 at an end.
    assert left.sd == pytest.approx(2.0 * K2[0] / np.sqrt(3.0), rel=0.01)
    note = calibrate(unit(), measured(K2, along=around)).notes[1]
    assert "the square of x may as well be saturation" in note


def write_unit(folder: Path, data: MeasurementSet, more: Callable[[str], str] = str) -> Path:
    folder.mkdir(parents=True)
    toml = (
        'format = 1\nserial = "SQUARES"\n[adc]\nbits = 24\nfull_scale_v = 10\n'
        "[temperature_sensor]\ndegc_per_code = 0.0625\n[site]\nlocal_gravity_m_per_s2 = 9.80665\n"
        "[thermal]\nt0_degc = 20\n"
    )
    (folder / "unit.toml").write_text(more(toml), encoding="utf-8")
    rows = [
        ",".join([d.position, f"{d.temp_degc:g}", *map(repr, d.voltage_v.tolist())])
        for d in data.dwells
    ]
    text = "\n".join(["position,temp_degc,ux_v,uy_v,uz_v", *rows]) + "\n"
    (folder / "measurements.csv").write_text(text, encoding="utf-8")
    return folder


def test_the_c_has_the_squares_and_says_how_far_it_reaches(tmp_path: Path):
    """10 V are 18 g, where 5 mg/g^2 are 9 %: the raw codes are halved."""
    delivery = deliver(write_unit(tmp_path / "SQUARES", measured(K2, checks=12)))
    assert delivery.plan.quadratic is not None
    assert delivery.unit.adc.code_max == 2**22 - 1
    note = next(n for n in delivery.calibration.notes if "the C flags raw codes" in n)
    assert "beyond +-4194304 (9.08 g)" in note
    assert max(abs(r.error_g) for r in delivery.chosen.residuals) < 6e-5
    assert delivery.check.largest_error_lsb <= delivery.bound.lsb
