"""How exact the device's functions have to be: a share of what the calibration is uncertain by.

The C misses the fitted model by at most e = arithmetic + method, for any raw code at any
temperature. As a rectangular error it has the standard uncertainty e / sqrt(3) (GUM 4.3.7). Where
that is at most s u, u being the unit's without the C, the combined one is at most

    u sqrt(1 + s^2) <= u (1 + s^2 / 2)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.tryout import model_error_g
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fixedpoint.plan import Plan, make_plan, with_high_words
from triaxcal.fixedpoint.proof import Bound, prove
from triaxcal.model.methods.compensation import Compensation, compensate
from triaxcal.model.methods.registry import METHODS
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.unit.arithmetic import HIGH_WORDS
from triaxcal.unit.description import UnitDescription

ERROR_SHARE = 0.3
"""s: the C makes the combined uncertainty at most 4.5 % larger. It is itself known to a quarter
where it rests on assumed values (8 degrees of freedom, GUM G.4.2)."""
_OF_LIMITS = 0.1
"""Of the unit's smallest limit: the C does not decide whether a unit passes."""
_OF_ARITHMETIC = 0.1
"""Of the arithmetic's error, where that alone is more than the share: what the method may add."""
ONE_MICRO_G = 1e-6
"""What the method may miss where no uncertainty is known, and what is never refused."""


@dataclass(frozen=True)
class Functions:
    """The functions that the device evaluates, in floats and in integers, and what they miss.

    Attributes
    ----------
    model_error_g : float
        Largest error of the compensation against K(T)^-1 (U - U0(T)) at any temperature code and
        any raw code, in g.
    bound : Bound
        Proven error of the arithmetic.
    least_u_g : float
        The unit's least standard uncertainty without the C, `Uncertainty.least_standard_g`.
    share_max : float or None
        The share by which the order was chosen; None where the order has another reason.
    order_before : int
        The order with which the method alone would be within a micro-g; 0 where it has no choice.
    """

    compensation: Compensation
    plan: Plan
    model_error_g: float
    bound: Bound
    least_u_g: float
    share_max: float | None = None
    order_before: int = 0

    @property
    def arithmetic_g(self) -> float:
        """The bound in g."""
        return self.bound.lsb * 2.0**-self.plan.shape.output_q

    @property
    def error_g(self) -> float:
        """Largest error against K(T)^-1 (U - U0(T)): that of arithmetic and method."""
        return self.arithmetic_g + self.model_error_g

    @property
    def share(self) -> float:
        """Standard uncertainty of that error, as a share of the unit's least without it."""
        return self.error_g / math.sqrt(3.0) / self.least_u_g

    @property
    def growth(self) -> float:
        """What the C adds to the combined uncertainty at most, relative."""
        return math.hypot(1.0, self.share) - 1.0

    @property
    def coefficients_saved(self) -> int:
        """How many fewer they are than for a micro-g; 12 functions a segment."""
        shape = self.plan.shape
        return 12 * shape.segments * max(0, self.order_before - shape.order)

    def document(self) -> dict[str, Any]:
        """For JSON files."""
        return {
            "method": self.compensation.method,
            "order": self.plan.shape.order,
            "segments": self.plan.shape.segments,
            "error_g": self.error_g,
            "least_standard_uncertainty_g": self.least_u_g,
            "share_of_uncertainty": self.share,
            "share_max": self.share_max,
        }


def allowed_error_g(unit: UnitDescription, least_u_g: float) -> float:
    """What method and arithmetic together may miss, in g."""
    limit_g = min(unit.limits.at_t0_g, unit.limits.over_range_g)
    return min(ERROR_SHARE * math.sqrt(3.0) * least_u_g, _OF_LIMITS * limit_g)


def compensation_of(
    unit: UnitDescription, calibration: Calibration, method: str, error_max_g: float | None = None
) -> Compensation:
    """The functions that the device evaluates for one method.

    Without `error_max_g` the unit's model_error_max_micro_g counts, or `ONE_MICRO_G`.
    """
    return compensate(
        calibration.thermal,
        method,
        calibration.range_degc,
        unit.adc.largest_v,
        (unit.model_error_max_g or ONE_MICRO_G) if error_max_g is None else error_max_g,
        terms=calibration.terms,
        order_min=max(1, calibration.update.order if calibration.update else 1),
    )


def choose_functions(
    unit: UnitDescription, measurements: MeasurementSet, calibration: Calibration
) -> Functions:
    """Functions of the lowest order that keeps the share, or the unit's own limit.

    With [firmware] arithmetic = "high-words" their products are summed so where that keeps the
    share too.

    Raises
    ------
    RefusedError
        When no integers of the format hold the functions, or they miss the fitted model by more
        than [compensation] model_error_max_micro_g.
    """
    found = _lowest_order(unit, measurements, calibration)
    if unit.arithmetic != HIGH_WORDS:
        return found
    plan = with_high_words(found.plan)
    if plan is None:
        return found
    made = replace(found, plan=plan, bound=prove(plan))
    return made if made.error_g <= allowed_error_g(unit, found.least_u_g) else found


def _lowest_order(
    unit: UnitDescription, measurements: MeasurementSet, calibration: Calibration
) -> Functions:
    """The same with 64-bit sums."""
    least_u_g = uncertainty(unit, measurements, calibration, None).least_standard_g

    def made(error_max_g: float | None) -> Functions:
        compensation = compensation_of(unit, calibration, unit.method, error_max_g)
        plan = replace(make_plan(compensation, unit), reading=calibration.reading_unit)
        error_g = model_error_g(unit, calibration.thermal, plan)
        return Functions(compensation, plan, error_g, prove(plan), least_u_g)

    if not METHODS[unit.method].keeps_error:
        return made(None)
    if unit.model_error_max_g is not None:
        found = made(None)
        _refuse_model_error(unit, found, unit.model_error_max_g)
        return found
    allowed_g = allowed_error_g(unit, least_u_g)
    found, order = made(allowed_g), 0
    while found.error_g > allowed_g and found.arithmetic_g < allowed_g:
        if found.plan.shape.order == order:
            break
        order = found.plan.shape.order
        found = made(allowed_g - found.arithmetic_g)
    added_g = _OF_ARITHMETIC * found.arithmetic_g
    if found.error_g > allowed_g:
        found = made(added_g)
    _refuse_model_error(unit, found, max(allowed_g, added_g, ONE_MICRO_G))
    before = compensation_of(unit, calibration, unit.method, ONE_MICRO_G).curves.order
    return replace(found, share_max=ERROR_SHARE, order_before=before)


def _refuse_model_error(unit: UnitDescription, found: Functions, limit_g: float) -> None:
    """The order of N(T) is chosen on a grid; what counts is every temperature code."""
    if found.model_error_g > limit_g:
        raise RefusedError(
            f"{unit.source}, [compensation] model_error_max_micro_g",
            f"N(T) of order {found.plan.shape.order} is {found.model_error_g * 1e6:.4g} micro-g "
            "off the fitted model",
            expected=f"at most {limit_g * 1e6:.4g} micro-g",
            remedy='choose method = "inverse", or allow more',
        )
