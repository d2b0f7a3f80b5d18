"""The order of the device's functions: by the share of the unit's uncertainty that the C takes."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import triaxcal
from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.order import (
    ERROR_SHARE,
    Functions,
    allowed_error_g,
    choose_functions,
    compensation_of,
)
from triaxcal.delivery.unit import Delivery
from triaxcal.fitting.core.fieldupdate import Update
from triaxcal.model.metrological import exact_gain_and_offset, worst_force_error_g
from triaxcal.report.files import all_files
from triaxcal.report.passport.content import passport
from triaxcal.report.summary import summary
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.uncertainty.orientation import DIRECTIONS, weights

UNITS = Path(__file__).parent.parent / "units"
SHIPPED = ("AT-CHERNIAK", "AT-SIM")


@cache
def fitted(name: str) -> Fitted:
    return triaxcal.fit(triaxcal.read_unit(UNITS / name)).fitted


def chosen(name: str, **changes: object) -> Functions:
    f = fitted(name)
    return choose_functions(replace(f.unit, **changes), f.measurements, f.calibration)


def standard(f: Fitted, functions: Functions | None) -> np.ndarray:
    """Standard uncertainty (temperatures, 4) in the worst orientation, by the sums of the budgets.

    The C is an error within +-error_g of each axis, independent of the others.
    """
    found = uncertainty(f.unit, f.measurements, f.calibration, None)
    W = weights(DIRECTIONS, 4)
    variance = np.zeros((len(found.temps_degc), len(DIRECTIONS), 4))
    for source in found.sources:
        if source.force is not None:
            D = source.force
            assert D.shape[-1] == 12
            variance += np.einsum("dqi,tij,dqj->tdq", W, D, W)
    if functions is not None:
        # The last column of D is an error that does not depend on a.
        C = np.zeros((12, 12))
        C[[3, 7, 11], [3, 7, 11]] = functions.error_g**2 / 3.0
        variance += np.einsum("dqi,ij,dqj->dq", W, C, W)
    return np.sqrt(variance.max(axis=1))


@pytest.mark.parametrize("name", SHIPPED)
def test_the_c_adds_no_more_than_the_share_says(name: str) -> None:
    f, functions = fitted(name), chosen(name)
    assert functions.share_max == ERROR_SHARE
    growth = standard(f, functions) / standard(f, None)
    assert growth.max() <= math.hypot(1.0, functions.share) * (1 + 1e-12)
    assert math.hypot(1.0, functions.share) <= 1.0 + ERROR_SHARE**2 / 2
    # |a| along an axis takes the whole error of that axis: the share is reached, not only bounded.
    assert growth.max() > 1.0 + 0.9 * functions.growth


@pytest.mark.parametrize(("name", "order"), [("AT-CHERNIAK", 2), ("AT-SIM", 3)])
def test_one_order_lower_misses_the_share(name: str, order: int) -> None:
    f, functions = fitted(name), chosen(name)
    allowed_g = allowed_error_g(f.unit, functions.least_u_g)
    assert functions.plan.shape.order == order
    assert functions.error_g <= allowed_g
    lower = compensation_of(f.unit, f.calibration, "matrix", 1.0)
    for limit_g in np.geomspace(1.0, 1e-9, 200):
        found = compensation_of(f.unit, f.calibration, "matrix", float(limit_g))
        if found.curves.order == order:
            break
        lower = found
    assert lower.curves.order == order - 1
    temps = functions.plan.temp_codes * f.unit.temperature_sensor.degc_per_code
    error_g = worst_force_error_g(
        lower.gain_and_offset(temps),
        exact_gain_and_offset(f.calibration.thermal.constants_at(temps)),
        f.unit.adc.largest_v,
    ).max()
    assert error_g + functions.arithmetic_g > allowed_g


def test_a_stated_limit_and_other_methods_choose_no_share() -> None:
    stated = chosen("AT-SIM", model_error_max_micro_g=1.0)
    assert (stated.plan.shape.order, stated.share_max) == (4, None)
    assert stated.model_error_g <= 1e-6
    inverse = chosen("AT-SIM", method="inverse")
    assert (inverse.share_max, inverse.coefficients_saved) == (None, 0)
    with pytest.raises(RefusedError, match=r"model_error_max_micro_g: .* micro-g off the fitted"):
        chosen("AT-SIM", model_error_max_micro_g=1e-13)


def test_what_is_saved_is_counted_against_a_micro_g() -> None:
    functions = chosen("AT-SIM")
    assert functions.order_before == chosen("AT-SIM", model_error_max_micro_g=1.0).plan.shape.order
    assert functions.coefficients_saved == 12 * (functions.order_before - 3)
    # As many words fewer are in the tables of the C.
    by_order = [
        sum(s.coefficients.size for s in chosen("AT-SIM", **c).plan.segments)
        for c in ({}, {"model_error_max_micro_g": 1.0})
    ]
    assert by_order[1] - by_order[0] == functions.coefficients_saved


def test_narrow_limits_ask_for_more() -> None:
    """A tenth of the smallest limit: the C does not decide what passes."""
    f = fitted("AT-SIM")
    limits = replace(f.unit.limits, at_t0_g=1e-5)
    functions = chosen("AT-SIM", limits=limits)
    assert functions.error_g <= 1e-6
    assert functions.plan.shape.order == 4


def test_a_coarse_output_cannot_keep_the_share() -> None:
    functions = chosen("AT-SIM", output_q=12)
    assert functions.arithmetic_g > allowed_error_g(fitted("AT-SIM").unit, functions.least_u_g)
    assert functions.share > ERROR_SHARE
    # The method then adds little to what the arithmetic misses anyway.
    assert functions.model_error_g <= 0.1 * functions.arithmetic_g


def test_an_update_in_the_field_keeps_the_order_of_the_device() -> None:
    f = fitted("AT-CHERNIAK")
    update = Update(("a",), "field.csv", "b", 6, 1.0, 1e-3, 1e-3, 1e-3, 6.0, order=4)
    calibration = replace(f.calibration, update=update)
    found = choose_functions(f.unit, f.measurements, calibration)
    assert found.plan.shape.order == 4


def test_files_and_summary_say_share_and_order(delivered: dict[str, Delivery]) -> None:
    delivery = delivered["AT-SIM"]
    functions = delivery.firmware.functions
    files = all_files(delivery)
    for name in ("calibration.json", "passport.json"):
        said = json.loads(files[name])["compensation"]
        assert (said["method"], said["order"], said["share_max"]) == ("matrix", 3, ERROR_SHARE)
        assert said["share_of_uncertainty"] == functions.share
    page = files["passport.html"].decode()
    assert f"{functions.share:.2g} of the least standard uncertainty" in page
    text = " ".join(summary(passport(delivery, {}), [], "build").split())
    assert "order 3: method and arithmetic are 0.235 of the least standard uncertainty" in text
    assert "saved are 12 coefficients, 48 bytes of flash and 48 instructions" in text
