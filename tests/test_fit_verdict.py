"""The verdict of a tilter's unit: what is held out decides, and what nothing tests is said."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import triaxcal
from fit_cases import SEVEN, TABLE_TEMPS, TABLES, cubic_truth, readings, unit, with_checks
from triaxcal.delivery.causes import is_certain_fault
from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.judgement import Verdict, judge, limits_that_apply
from triaxcal.diagnosis import diagnose
from triaxcal.diagnosis.answer import Amplitude
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.unit.limits import Limits
from triaxcal.unit.thermal import ThermalChoice

FIVE = (-40.0, -10.0, 20.0, 45.0, 70.0)
NINE = (-40.0, -25.0, -10.0, 5.0, 20.0, 32.5, 45.0, 57.5, 70.0)
ROOT = Path(__file__).parent.parent


def curved(powers):
    """Constants of T0 and biases that change by (mg at 60 degC from T0) * x^n, x = dT / 60."""

    def truth(temp):
        x = (np.asarray(temp, dtype=float) - 20.0)[..., None] / 60.0
        bias = np.array([0.55e-3, -0.4e-3, 0.45e-3])
        change = sum(mg * x ** (n + 1) for n, mg in enumerate(powers)) * bias
        return TABLES[1] + np.concatenate([np.zeros((*x.shape[:-1], 9)), change], axis=-1)

    return truth


def with_temperature(data, old, new):
    dwells = [replace(d, temp_degc=d.temp_degc - old + new) if abs(d.temp_degc - old) < 1 else d
              for d in data.dwells]  # fmt: skip
    return MeasurementSet(data.source, tuple(dwells))


def verdict(data, **keys) -> Verdict:
    own = unit(**keys)
    return judge(Fitted(own, data, "", calibrate(own, data)))


@pytest.mark.parametrize(("temps", "lost"), [(FIVE, 45.0), (NINE, 45.0), (NINE, -25.0)])
def test_a_lost_sign_is_refused(temps, lost):
    """A quadratic that fits to microvolts with the sign is missed by milligrams without it."""
    data = readings(curved((8.0, 4.0)), temps, sd_v=1e-7, count=100, spread_degc=0.05)
    assert verdict(data).words == "passed"
    found = verdict(with_temperature(data, lost, -lost))
    assert not found.passed
    assert found.words == "refused"
    assert found.refusal.expected == "at most 1 mg (limits.over_range_g)"
    assert "held out, by" in found.refusal.found


def test_exchanged_temperatures_are_refused():
    data = readings(curved((8.0, 4.0)), FIVE, sd_v=1e-7, count=100)
    away = with_temperature(data, -10.0, 200.0)
    exchanged = with_temperature(with_temperature(away, 45.0, -10.0), 200.0, 45.0)
    assert not verdict(exchanged).passed


def test_the_outer_temperatures_exchanged_are_refused_though_a_curve_passes_all():
    """They are never held out, and order 7 follows nine temperatures of any kind within 1 mg."""
    data = readings(curved((8.0, 4.0)), NINE, sd_v=1e-5, count=400, spread_degc=0.05)
    away = with_temperature(data, -40.0, 200.0)
    exchanged = with_temperature(with_temperature(away, 70.0, -40.0), 200.0, 70.0)
    assert verdict(data).passed
    found = verdict(exchanged)
    assert not found.passed
    assert "temperatures of two blocks exchanged" in str(found.refusal)


@pytest.mark.parametrize("position", ["TP2", "TP5"])
def test_one_wrong_dwell_at_an_outer_temperature_is_refused(position):
    """5 mg across gravity: |a| does not show it, and the curve at the end follows it."""
    data = readings(curved((8.0, 4.0)), FIVE, sd_v=1e-5, count=400, spread_degc=0.05)
    wrong = [
        replace(d, voltage_v=d.voltage_v + np.array([0.0, 0.0, 5e-3 * 0.55]))
        if d.position == position and d.temp_degc > 60.0
        else d
        for d in data.dwells
    ]
    (row,) = [d.row for d in data.dwells if d.position == position and d.temp_degc > 60.0]
    found = verdict(MeasurementSet(data.source, tuple(wrong)))
    assert not found.passed
    assert f"row {row}" in found.refusal.place
    assert "one wrong dwell" in found.refusal.found


@pytest.mark.parametrize(
    "powers",
    [(8.0, 4.0, 1.0), (8.0, 4.0, 2.0), (-15.0, 8.0, -2.5), (1.0, 20.0, 2.0), (15.0, 8.0, 3.0, 0.5)],
)
@pytest.mark.parametrize("temps", [(-40.0, 0.0, 20.0, 70.0), FIVE])
def test_a_sound_unit_with_few_temperatures_and_much_curvature_passes(temps, powers):
    """Held out, one of few temperatures makes a worse curve than the delivered one: said how much.

    With 4 temperatures the cubic x^3 of 3 mg leaves 3 * 60 * 20 * 50 / 60^3 = 0.83 mg at +20 degC
    by a quadratic through the other three, and the 0.5 mg of x^4 add to it.
    """
    truth = curved(powers)
    data = readings(truth, temps, sd_v=1e-7, count=100, spread_degc=0.05)
    own = unit()
    calibration = calibrate(own, data)
    assert judge(Fitted(own, data, "", calibration)).refusal is None
    between = np.linspace(-40.0, 70.0, 56)
    missed = (calibration.thermal.constants_at(between) - truth(between))[:, 9:] / 0.55
    assert np.abs(missed).max() < 1e-3


@pytest.mark.parametrize(
    "powers", [(8.0, 4.0, 2.0), (20.0, -10.0, 5.0), (1.0, 20.0, 2.0), (15.0, 8.0, -20.0)]
)
@pytest.mark.parametrize("temps", [TABLE_TEMPS, (-40.0, 0.0, 20.0, 70.0), FIVE, SEVEN])
def test_bent_curves_of_the_biases_are_no_fault(temps, powers):
    """Sensitivities that hardly bend, known to 0.2 micro-g, must not say that biases do not."""
    data = readings(curved(powers), temps, sd_v=1e-7, count=100)
    found = diagnose(unit(), data)
    assert not is_certain_fault(found, 1e-3), found.sentence
    assert "step" not in {s.cause for s in found.answer}


@pytest.mark.long
def test_a_fault_is_certain_only_where_each_cause_of_the_answer_spoils_constants():
    data = readings(curved((8.0, 4.0)), NINE, sd_v=1e-5, count=400, spread_degc=0.05)
    away = with_temperature(data, -40.0, 200.0)
    found = diagnose(unit(), with_temperature(with_temperature(away, 70.0, -40.0), 200.0, 70.0))
    assert is_certain_fault(found, 1e-3)
    best = found.answer[0]
    symptom = replace(best, spoils=False, log_evidence=best.log_evidence - 1.0)
    assert not is_certain_fault(replace(found, answer=(*found.answer, symptom)), 1e-3)
    small = replace(best, amplitudes=(Amplitude("step", "mg", 0.5, 0.1, 0.5e-3),))
    assert not is_certain_fault(replace(found, answer=(*found.answer, small)), 1e-3)
    assert not is_certain_fault(replace(found, answer=()), 1e-3)


def test_a_curve_through_all_temperatures_is_taken_where_the_simpler_one_misses_them():
    data = readings(curved((8.0, 4.0, 2.0)), (-40.0, 0.0, 20.0, 70.0), sd_v=1e-7, count=100)
    calibration = calibrate(unit(), data)
    (chosen,) = [c for c in calibration.candidates if c.chosen]
    assert chosen.label == "polynomial of order 3"
    assert calibration.held_out.function == "polynomial of order 2"
    assert 0.0 < calibration.held_out.share < 0.5
    assert "it passes all 4 temperatures; piecewise-linear, knots -40, 20, 70 degC does not" in (
        calibration.selection_reason
    )
    quiet = readings(curved((8.0, 4.0)), (-40.0, 0.0, 20.0, 70.0), sd_v=1e-7, count=100)
    (chosen,) = [c for c in calibrate(unit(), quiet).candidates if c.chosen]
    assert chosen.label == "polynomial of order 2"


@pytest.mark.parametrize("seed", range(8))
def test_the_printed_reason_is_true(seed):
    """The numbers in the sentence are those of the table, and the comparison holds for them."""
    random = np.random.default_rng(seed)
    jumpy = {t: random.normal(size=3) * 3e-4 for t in NINE}

    def truth(temp):
        steps = np.array([jumpy[min(NINE, key=lambda n: abs(n - t))] for t in np.ravel(temp)])
        change = np.concatenate([np.zeros((len(steps), 9)), steps], axis=1)
        return cubic_truth()(temp) + change.reshape(*np.shape(temp), 12)

    calibration = calibrate(unit(), readings(truth, NINE, sd_v=1e-6, count=100, seed=seed))
    (chosen,) = [c for c in calibration.candidates if c.chosen]
    reason = calibration.selection_reason
    own = re.search(r"held-out error ([\d.]+) micro-g", reason)
    quoted = own
    if "it passes all" in reason:
        quoted = re.search(r"held out in turn ([\d.]+) micro-g", reason)
    assert float(quoted[1]) == pytest.approx(chosen.held_out_g * 1e6, rel=1e-3)
    other = re.search(r"\(([\d.]+) %\) of the best, ([\d.]+) micro-g", reason)
    best = min(c.held_out_g for c in calibration.candidates) * 1e6
    if other is None:
        assert "the smallest of" in reason
        assert float(own[1]) <= best * 1.001
    else:
        assert float(own[1]) <= float(other[2]) * (1.0 + float(other[1]) / 100.0) * 1.001


def test_what_nothing_tests_is_said():
    three = readings(cubic_truth(), TABLE_TEMPS, sd_v=1e-7, count=100)
    untested = "between the temperatures not tested"
    wide = {"limits": Limits(0.03, 0.03)}  # exchanged temperatures are 19 mg
    assert verdict(three, **wide).words == f"passed at the dwells; {untested}"
    at_t0 = with_checks(three, cubic_truth(), (20.0,), sd_v=1e-7, count=100)
    assert verdict(at_t0, **wide).words == f"passed at the dwells; {untested}"
    one = readings(cubic_truth(), (20.0,), sd_v=1e-7, count=100)
    assert verdict(one).words == "passed at the dwells; nothing was held out"
    found = verdict(three, **wide)
    assert found.passed
    assert not found.shown
    assert [str(t) for t in found.tested[2:4]] == [
        "held out at T0: not tested",
        "held out over the range: not tested",
    ]


def slanted(temp):
    """Sensitivities that change by 2e-4 a degree: 20 mg over 100 degC."""
    t = (np.asarray(temp, dtype=float) - 20.0)[..., None]
    slope = np.zeros(12)
    slope[[0, 4, 8]] = 2e-4 * TABLES[1][[0, 4, 8]]
    return TABLES[1] + t * slope


@pytest.mark.parametrize("exchanged", [False, True])
def test_exchanged_ends_of_three_temperatures_are_said_to_be_untested(exchanged):
    """No reading can show it: a unit whose constants change the other way reads the same."""
    data = readings(slanted, (-30.0, 20.0, 70.0), sd_v=1e-7, count=100)
    if exchanged:
        away = with_temperature(data, -30.0, 200.0)
        data = with_temperature(with_temperature(away, 70.0, -30.0), 200.0, 70.0)
    found = verdict(data, limits=Limits(0.01, 0.01))
    assert found.words.startswith(
        "passed at the dwells; between the temperatures not tested; which temperature is which not "
        "tested: with two exchanged, a component is up to "
    )
    # 2e-4 * 100 / 0.99: 20.2 mg.
    (stated,) = re.findall(r"up to (\S+) mg wrong", found.words)
    assert float(stated) == 20.0
    assert not any(t.whole for t in found.tested if t.what == "with uncertainty")
    assert verdict(data, limits=Limits(0.03, 0.03)).words == (
        "passed at the dwells; between the temperatures not tested"
    )


def test_four_temperatures_or_checks_show_which_is_which():
    four = readings(slanted, (-30.0, 0.0, 20.0, 60.0), sd_v=1e-7, count=100)
    assert verdict(four, limits=Limits(0.01, 0.01)).words == "passed"
    three = readings(slanted, (-30.0, 20.0, 60.0), sd_v=1e-7, count=100)
    checked = with_checks(three, slanted, (-5.0, 40.0), sd_v=1e-7, count=100)
    assert "which temperature" not in verdict(checked, limits=Limits(0.01, 0.01)).words


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (19.5, 20.5, ("at T0",)),
        (18.0, 22.0, ("at T0",)),
        (-40.0, 70.0, ("at T0", "over the range")),
        (10.0, 23.0, ("at T0", "over the range")),
        (30.0, 70.0, ("over the range",)),
    ],
)
def test_a_limit_counts_where_a_temperature_of_the_range_has_it(low, high, expected):
    assert limits_that_apply(unit(), (low, high)) == expected


def test_checks_between_three_temperatures_test_them():
    data = readings(curved((8.0, 4.0)), TABLE_TEMPS, sd_v=1e-7, count=100)
    data = with_checks(data, curved((8.0, 4.0)), (-10.0, 45.0), sd_v=1e-7, count=100)
    found = verdict(data, thermal=ThermalChoice("polynomial", {"order": 2}))
    assert found.words == "passed"
    assert found.tested[3].dwells == 12


def test_every_limit_is_shown_beside_what_it_is_held_against():
    data = readings(curved((8.0, 4.0)), FIVE, sd_v=1e-7, count=100)
    tested = verdict(data).tested
    both = (("at T0", 3e-4), ("over the range", 1e-3))
    assert [(t.what, t.where, t.limit_g) for t in tested] == [
        *(("residual", *limit) for limit in both),
        *(("held out", *limit) for limit in both),
        ("held out, a component", "over the range", 1e-3),
        *(("with uncertainty", *limit) for limit in both),
    ]
    assert [t.dwells for t in tested] == [6, 24, 0, 18, 18, 6, 24]


def test_an_uncertainty_beyond_a_limit_has_not_passed():
    """All residuals and held-out errors are far within the limit, and the unit is delivered."""
    data = readings(curved((8.0, 4.0)), FIVE, sd_v=1e-7, count=100)
    sure = verdict(data)
    assert (sure.result, sure.passed, sure.shown) == ("passed", True, True)
    reached = [t.largest_g for t in sure.tested if t.what == "with uncertainty"]
    errors = [t.largest_g for t in sure.tested if t.what != "with uncertainty" and t.dwells]
    limit_g = reached[0] * 0.9
    assert max(errors) < limit_g
    found = verdict(data, limits=Limits(limit_g, 1e-3))
    assert (found.result, found.passed, found.refusal) == ("not shown", False, None)
    assert found.words == (
        "not shown to be within the limits: error and uncertainty (95 %) reach "
        f"{reached[0] * 1e3:.3g} mg at T0 (limit {limit_g * 1e3:g} mg)"
    )


def test_an_estimated_held_out_error_is_explained():
    """The share of the smaller function's error that the delivered curve has is said, and why."""
    data = readings(curved((8.0, 4.0, 1.0)), (-40.0, 0.0, 20.0, 70.0), sd_v=1e-7, count=100)
    own = unit()
    calibration = calibrate(own, data)
    found = judge(Fitted(own, data, "", calibration))
    test = calibration.held_out
    (over,) = [t for t in found.tested if (t.what, t.where) == ("held out", "over the range")]
    assert over.largest_g == pytest.approx(test.share * abs(test.worst.error_g))
    assert found.note == (
        "held out: without one temperature only a polynomial of order 2 is determined, and misses "
        f"it by up to {abs(test.worst.error_g) * 1e3:.3g} mg; the delivered polynomial of order 3 "
        f"is estimated to miss by {test.share:.2g} of that, as the error falls from order to order"
    )
    nine = readings(curved((8.0, 4.0)), NINE, sd_v=1e-7, count=100)
    assert verdict(nine).note == ""


def test_a_refusal_leaves_the_earlier_files_and_says_so(tmp_path: Path):
    folder = tmp_path / "units" / "AT-CHERNIAK"
    folder.mkdir(parents=True)
    for name in ("unit.toml", "measurements.csv"):
        (folder / name).write_bytes((ROOT / "units" / "AT-CHERNIAK" / name).read_bytes())
    toml = folder / "unit.toml"
    triaxcal.deliver(folder, tmp_path / "build")
    header = tmp_path / "build" / "AT-CHERNIAK" / "triax_calib.h"
    before = header.read_bytes()
    text = toml.read_text(encoding="utf-8")
    toml.write_text(text.replace("t0_degc = 20", "t0_degc = 45"), encoding="utf-8")
    with pytest.raises(triaxcal.RefusedError) as caught:
        triaxcal.deliver(folder, tmp_path / "build")
    assert f"{tmp_path / 'build' / 'AT-CHERNIAK'} keeps the files of an earlier run" in str(
        caught.value
    )
    assert header.read_bytes() == before
    with pytest.raises(triaxcal.RefusedError) as caught:
        triaxcal.deliver(folder, tmp_path / "elsewhere")
    assert "earlier" not in str(caught.value)
