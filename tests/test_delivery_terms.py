"""A unit whose calibration carries terms goes the whole road, whoever fitted them."""

from __future__ import annotations

import ctypes
import re
from dataclasses import replace

import numpy as np
import pytest

from builds import UNITS
from triaxcal.delivery import fitted
from triaxcal.delivery.unit import Delivery, deliver
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.terms import EXAMPLE_RATE, EXAMPLE_TERMS, Terms
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.report.a2l_words import calib_words
from triaxcal.unit.description import UnitDescription

assert EXAMPLE_TERMS.quadratic_per_g is not None
SMALL = Terms(EXAMPLE_TERMS.quadratic_per_g / 100, EXAMPLE_RATE)
"""The unit's dwells have no such terms: they must stay below its limits of | |a| - g |."""


@pytest.fixture(scope="module")
def made() -> Delivery:
    """AT-CHERNIAK with terms that its readings do not have."""

    def with_terms(
        unit: UnitDescription, measurements: MeasurementSet, _pair: object
    ) -> Calibration:
        return replace(calibrate(unit, measurements), terms=SMALL)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitted, "calibrate", with_terms)
        return deliver(UNITS / "AT-CHERNIAK")


def test_terms_reach_plan_proof_and_cross_check(made: Delivery) -> None:
    assert made.plan.shape.quadratic
    assert made.plan.shape.rate
    assert made.bound.lsb <= 1.0
    assert 0.8 * made.bound.lsb <= made.check.largest_error_lsb <= made.bound.lsb
    assert b"triax_set_temperature_rate" in made.files["triax_comp.h"]
    others = [m.method for m in made.methods[1:] if not m.refusal]
    assert len(others) == 5


def test_residuals_are_those_of_the_compensated_force(made: Delivery) -> None:
    """| |a| - g | of l + Q p(l) at 1 g along an axis is |Q_ii| g^2 to first order."""
    assert SMALL.quadratic_per_g is not None
    chosen = next(m for m in made.methods if m.method.name == made.unit.method)
    axis = {"TP6": (0, 1), "TP5": (0, -1), "TP4": (1, 1), "TP2": (1, -1), "TP1": (2, 1)}
    compared = 0
    for residual in chosen.residuals:
        if residual.dwell.position in axis:
            i, sign = axis[residual.dwell.position]
            expected = sign * SMALL.quadratic_per_g[i, i] * made.unit.gravity_g**2
            # Functions and arithmetic; the raw code of 0.3 micro-g; some 1e-10 of second order.
            assert abs(residual.error_g - expected) < made.firmware.error_g + 0.31e-6
            compared += 1
    assert compared == 15


def test_the_header_lists_the_terms_as_the_c_has_them(made: Delivery) -> None:
    header = made.files["triax_calib.h"].decode()
    assert "with quadratic terms and a term in dT/dt, fitted to " in header
    assert " * a = l + Q p(l), l = K^-1 (U - U0) + r dT/dt, " in header
    listed = {m[1]: float(m[2]) for m in re.finditer(r"(Q[xyz]\.[xyz]{2}) ([+-][.\d]+)", header)}
    constants = made.files["triax_calib.c"].decode()
    in_c = re.findall(r"/\* Q([xyz])([xyz]{2}): (\S+) g/g\^2", constants)
    assert len(in_c) == len(listed) == 18
    for axis, product, value in in_c:
        # Five digits of a mg are listed.
        assert listed[f"Q{axis}.{product}"] == pytest.approx(1e3 * float(value), abs=0.6e-5)


def test_the_a2l_words_stand_where_the_compiler_puts_them(made: Delivery) -> None:
    words = {w.name: w for w in calib_words(made.firmware)}
    order, segments = made.plan.shape.order, made.plan.shape.segments

    class Segment(ctypes.Structure):
        _fields_ = (
            ("head", ctypes.c_int32 * 3), ("coefficient", ctypes.c_int32 * (12 * (order + 1)))
        )  # fmt: skip

    class Calib(ctypes.Structure):
        _fields_ = (
            ("range", ctypes.c_int32 * 2), ("segment", Segment * segments),
            ("quadratic", ctypes.c_int32 * 18), ("rate_min", ctypes.c_int32),
            ("rate_max", ctypes.c_int32), ("rate_gain", ctypes.c_int32), ("r", ctypes.c_int32 * 3),
        )  # fmt: skip

    assert words["TRIAX_Qxxx"].offset == Calib.quadratic.offset
    assert words["TRIAX_Qzyz"].offset == Calib.quadratic.offset + 17 * 4
    assert words["TRIAX_rate_max"].offset == Calib.rate_max.offset
    assert words["TRIAX_rz"].offset == Calib.r.offset + 8
    plan = made.plan
    assert plan.quadratic is not None
    assert plan.rate is not None
    q = words["TRIAX_Qxxx"].method.slope * int(plan.quadratic[0, 0])
    r = words["TRIAX_rx"].method.slope * int(plan.rate.words[0])
    # Half a word.
    assert abs(q - SMALL.quadratic_per_g[0, 0]) <= words["TRIAX_Qxxx"].method.slope / 2
    assert abs(r - EXAMPLE_RATE.offset_g_s_per_k[0]) <= words["TRIAX_rx"].method.slope / 2
    fastest = words["TRIAX_rate_max"].method.slope * plan.rate.max_code
    assert np.isclose(fastest, EXAMPLE_RATE.range_k_per_s[1], rtol=1e-4)


def test_the_image_is_of_version_2(made: Delivery) -> None:
    image = made.files["triax_calib.bin"]
    assert int.from_bytes(image[4:8], "little") == 2
    assert int.from_bytes(image[60:64], "little") == 3
