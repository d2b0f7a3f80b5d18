"""Vibration rectification: exact means against direct integration, and the compiled C on both."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import triaxcal
from triaxcal.base.errors import RefusedError
from triaxcal.performance.known import known
from triaxcal.performance.nonlinear import nonlinear
from triaxcal.performance.rectification import beyond, cube_shift, odd_shift, square_shift
from triaxcal.performance.shaken import SAMPLES, block, shaken
from triaxcal.performance.vibration import clipped_share, predicted, sensor_of, vibration_chapter
from triaxcal.unit.description import unit_of_text
from triaxcal.unit.reporting import Nonlinearity
from triaxcal.unit.vibration import Vibration, area

UNITS = Path(__file__).parent.parent / "units"
TOML = (UNITS / "AT-SIM" / "unit.toml").read_text(encoding="utf-8")


def integrated(function: object, static: float, variance: float, amplitude: float) -> float:
    """E f(static + n) - f(static) by the rectangle rule over density and turn, 2001 by 2000 points.

    The densities end at 12 standard deviations. A kink costs the rule at most half a step squared
    times the slope's jump: 2 * (24 sd / 2000)^2 / 8 < 1e-4 sd^2, far below in the mean over turns.
    """
    turns = 2.0 * np.pi * (np.arange(2000) + 0.5) / 2000
    sine = amplitude * np.sin(turns)
    f = function
    assert callable(f)
    if variance == 0.0:
        return float(np.mean(f(static + sine)) - f(np.array(static)))
    sd = math.sqrt(variance)
    z = np.linspace(-12.0, 12.0, 2001)
    weight = np.exp(-0.5 * z**2)
    mean = [float(np.sum(weight * f(static + s + sd * z)) / weight.sum()) for s in sine[::8]]
    return float(np.mean(mean) - f(np.array(static)))


@pytest.mark.parametrize("static", [0.0, 0.3, -1.0, 4.0])
@pytest.mark.parametrize(("variance", "amplitude"), [(1.0, 0.0), (0.0, 2.0), (0.25, 1.5)])
def test_the_means_are_those_of_direct_integration(
    static: float, variance: float, amplitude: float
) -> None:
    for function, shift in (
        (lambda a: a**2, square_shift(variance, amplitude)),
        (lambda a: a * np.abs(a), odd_shift(static, variance, amplitude)),
        (lambda a: a**3, cube_shift(static, variance, amplitude)),
    ):
        expected = integrated(function, static, variance, amplitude)
        # The bound in `integrated`, at most 1e-4 of the mean square here.
        assert shift == pytest.approx(expected, abs=1e-4 * (variance + amplitude**2))


def test_the_share_beyond_a_limit_is_that_of_direct_integration() -> None:
    for variance, amplitude in ((1.0, 0.0), (0.25, 1.5)):
        found = beyond(0.4, variance, amplitude, 1.7)
        step = integrated(lambda a: (a > 1.7).astype(float), 0.4, variance, amplitude)
        # A step is off by at most the density times half a step: 0.4 / sd * 24 sd / 2000 / 2.
        assert found == pytest.approx(step, abs=0.0025)


def test_the_mean_square_of_a_density_is_its_integral() -> None:
    points = ((20.0, 0.01), (80.0, 0.04), (350.0, 0.04), (2000.0, 0.007))
    f = np.geomspace(20.0, 2000.0, 400001)
    d = np.exp(np.interp(np.log(f), np.log([p[0] for p in points]), np.log([p[1] for p in points])))
    expected = float(np.sum(0.5 * (d[1:] + d[:-1]) * np.diff(f)))
    assert area(points) == pytest.approx(expected, rel=1e-6)
    assert area(((1.0, 1.0), (10.0, 0.1))) == pytest.approx(math.log(10.0), rel=1e-12)


def test_generated_vibration_has_the_stated_density() -> None:
    points = ((100.0, 0.002), (400.0, 0.002), (1000.0, 0.0005))
    vibration = Vibration(direction=(0.0, 0.0, 1.0), psd=points, sine_g=0.5, sine_hz=2000.0)
    random = np.random.default_rng(1)
    blocks = np.stack([block(vibration, random) for _ in range(40)])
    assert np.abs(blocks.mean(axis=1)).max() < 1e-12  # no coefficient at 0 Hz
    power = (np.abs(np.fft.rfft(blocks, axis=1)) ** 2).mean(axis=0) * 2.0 / SAMPLES**2
    f = np.fft.rfftfreq(SAMPLES, 1.0 / (4.0 * 2000.0))
    for low, high in ((100.0, 400.0), (400.0, 1000.0)):
        inside = (low <= f) & (f < high)
        cut = tuple((x, float(np.exp(np.interp(np.log(x), *np.log(np.array(points).T)))))
                    for x in (low, high))  # fmt: skip
        # Gaussian lines: relative standard deviation 1 / sqrt(40 lines); five of them.
        lines = 40 * inside.sum()
        assert power[inside].sum() == pytest.approx(area(cut), rel=5.0 / math.sqrt(lines) + 0.01)
    assert np.sqrt(power[f > 1100.0].sum() * 2.0) == pytest.approx(0.5, rel=1e-6)


STATED = Nonlinearity(
    how="centrifuge",
    own_square=(20.0, -30.0, 40.0),
    own_square_sd=(1.0, 1.0, 1.0),
    odd_square=(3.0, 5.0, -4.0),
    odd_square_sd=(0.1, 0.1, 0.1),
    cube=(2.0, 1.0, 3.0),
    cube_sd=(0.1, 0.1, 0.1),
)
SHAKES = {
    "random": Vibration(direction=(0.0, 0.0, 1.0), grms=0.7),
    "sine": Vibration(direction=(0.6, 0.0, 0.8), sine_g=1.5),
    "both": Vibration(direction=(0.0, 1.0, 0.0), grms=0.4, sine_g=1.0, static_g=(0.0, 0.5, 0.8)),
}


def test_a_band_narrower_than_the_steps_of_frequency_is_generated() -> None:
    """A rotor's sine far above the random part: no frequency of the block is within the band."""
    vibration = Vibration(
        direction=(1.0, 0.0, 0.0), grms=1.0, band_hz=(5.0, 10.0), sine_g=1e-6, sine_hz=50e3
    )
    random = np.random.default_rng(1)
    each = np.array([np.mean(block(vibration, random) ** 2) for _ in range(400)])
    # One complex Gaussian coefficient a block: its square is exponential, of the standard
    # deviation 1. Five standard errors.
    assert abs(each.mean() - 1.0) < 5.0 / np.sqrt(400.0)


@pytest.mark.long
def test_the_compiled_c_shifts_as_predicted() -> None:
    calibration = triaxcal.fit(triaxcal.read_unit(UNITS / "AT-SIM"))
    done = calibration.fitted
    known_unit, terms = known(done.unit, done.measurements, done.calibration), nonlinear(
        done.calibration, STATED
    )  # fmt: skip
    firmware = triaxcal.firmware(calibration)
    sensor = sensor_of(known_unit, terms)
    code = round(done.unit.t0_degc / done.unit.temperature_sensor.degc_per_code)
    with firmware.compiled() as compiled:
        for vibration in SHAKES.values():
            static = np.array(vibration.static_g or (0.0, 0.0, done.unit.gravity_g))
            ran = shaken(
                vibration, static, sensor, lambda raw: compiled.apply(raw, code), firmware.lsb_g,
                seed=5,
            )  # fmt: skip
            assert ran.flagged == 0.0
            assert not ran.clipped.any()
            for axis in range(3):
                expected = predicted(vibration, static, terms, axis).compensated[0]
                # Arithmetic and method of the C at both ends, what squares the square of the cross
                # terms makes (3 % of 40 micro-g/g^2 times 1 g^2), and the statistical interval
                # widened to four standard deviations.
                slack = 2.0 * firmware.error_g + 0.03**2 * 40e-6 + 2.0 * float(ran.expanded_g[axis])
                assert abs(float(ran.shift_g[axis]) - expected) < slack


def test_squares_in_the_c_leave_their_error_alone() -> None:
    """Of K2 that the C removes, the prediction is the uncertainty of K2 and 2 K2 Q of a cube."""
    done = triaxcal.fit(triaxcal.read_unit(UNITS / "AT-SIM")).fitted
    terms = nonlinear(done.calibration, replace(STATED, odd_square=None, odd_square_sd=None,
                                                cube=None, cube_sd=None))  # fmt: skip
    in_c = np.zeros((3, 6))
    in_c[range(3), range(3)] = -np.array(STATED.own_square or ()) * 1e-6
    removed = replace(terms, in_c=in_c)
    vibration, static = SHAKES["random"], np.array([0.0, 0.0, 1.0])
    shift = predicted(vibration, static, removed, 2)
    mean_square = 0.49
    assert shift.linear[0] == pytest.approx(40e-6 * mean_square)
    assert shift.compensated[0] == pytest.approx(-2.0 * (40e-6) ** 2 * 3.0 * mean_square)
    assert shift.compensated[1] == pytest.approx(1.96e-6 * mean_square, rel=1e-3)
    assert shift.linear[1] == pytest.approx(1.96e-6 * mean_square, rel=1e-3)


def test_clipping_is_reported() -> None:
    done = triaxcal.fit(triaxcal.read_unit(UNITS / "AT-SIM")).fitted
    known_unit = known(done.unit, done.measurements, done.calibration)
    terms = nonlinear(done.calibration, STATED)
    hard = Vibration(direction=(1.0, 0.0, 0.0), grms=2.5)
    sensor = sensor_of(known_unit, terms)
    share = clipped_share(hard, np.array([0.0, 0.0, 1.0]), sensor, 0)
    # 2.5 V of range at 0.5506 V/g, and an offset of 4.5 mV and 16 mV of 1 g along z.
    limits = ((2.5 - 0.0209) / 0.5506, (2.5 + 0.0209) / 0.5506)
    expected = sum(0.5 * math.erfc(v / 2.5 / math.sqrt(2.0)) for v in limits)
    assert share == pytest.approx(expected, rel=0.01)
    chapter = vibration_chapter(known_unit, terms, {"hard": hard}, None, "no compiler")
    (clipped,) = (f for f in chapter.figures if f.key == "vibration_clipped")
    assert clipped.value == pytest.approx(100.0 * share)
    assert "[vibration.hard]: output x clips at the codes" in " ".join(chapter.notes)
    assert "no compiler" in chapter.notes


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('[vibration.a]\ndirection = "z"\n', "[vibration.a]: no vibration; expected psd, grms or"),
        ('[vibration.a]\ngrms = 1\n', "missing: [vibration.a] direction"),
        ('[vibration.a]\ndirection = "w"\ngrms = 1\n', "direction: found 'w'"),
        ('[vibration.a]\ndirection = [0, 0, 0]\ngrms = 1\n', "direction: found [0, 0, 0]"),
        ('[vibration.a]\ndirection = "z"\npsd = [[80, 1], [20, 1]]\n', "frequencies rising"),
        ('[vibration.a]\ndirection = "z"\npsd = [[20, 1], [80, 0]]\n', "densities above 0"),
        ('[vibration.a]\ndirection = "z"\ngrms = nan\n', "grms: found NaN"),
        ('[vibration]\ngrms = 1\n', "a table [vibration."),
        ('[nonlinearity]\nhow = "x"\n', "no term; expected own_square, odd_square or cube"),
        ('[nonlinearity]\nhow = "x"\ncube = [1, 2, 3]\n', "cube_sd: missing"),
        ('[nonlinearity]\nhow = "x"\ncube = [1, 2]\ncube_sd = [1, 2, 3]\n', "cube: found [1, 2]"),
    ],
)  # fmt: skip
def test_a_wrong_statement_is_refused_in_one_line(text: str, found: str) -> None:
    with pytest.raises(RefusedError) as refusal:
        unit_of_text("AT-SIM", f"{TOML}\n{text}", "unit.toml")
    assert found in str(refusal.value)
    assert "\n" not in str(refusal.value)
