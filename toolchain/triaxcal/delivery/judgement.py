"""Whether a calibration keeps its unit's limits.

Three things are held against each limit: the residual at the fitted dwells, the error at what was
held out, and the largest error with the guard band of the decision rule, by default the uncertainty
of |a|. The first two refuse. The third decides whether the unit has passed: where it reaches beyond
a limit, the limit is not shown to hold, or by a binary rule it is refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import Fitted, refuse_beyond_limits
from triaxcal.delivery.unshown import contradictions
from triaxcal.delivery.verdict import (
    AT_DWELLS,
    AT_POSES,
    COMPONENTS,
    DECISIVE,
    GUARDED,
    HELD_OUT,
    NOT_CHECKED,
    NOT_SHOWN,
    PASSED,
    REFUSED,
    RESIDUAL,
    UNCERTAINTY,
    LimitCheck,
    Verdict,
)
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.recorded.acceptance import held_out_errors
from triaxcal.fitting.tilter.acceptance import dwell_errors_g, dwells_in_range, held_out_refusal
from triaxcal.model.positions import CHECK_POSITIONS
from triaxcal.model.types import FloatArray
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.limits import AT_T0, OVER_RANGE
from triaxcal.unit.thermal import near_t0

if TYPE_CHECKING:
    from triaxcal.uncertainty.evaluate import Uncertainty


def judge(fitted: Fitted) -> Verdict:
    """Verdict on a fitted model; that of its firmware has the errors of the device besides."""
    # Only a verdict before there is a firmware needs it here.
    from triaxcal.uncertainty.evaluate import uncertainty  # noqa: PLC0415

    unit, calibration = fitted.unit, fitted.calibration
    dwells = dwells_in_range(unit, calibration.range_degc, fitted.measurements)
    errors_g = dwell_errors_g(unit, calibration, dwells)
    try:
        refuse_beyond_limits(fitted)
    except RefusedError as refusal:
        tested = tuple(_tested(fitted, errors_g))
        return Verdict(REFUSED, refusal, tested, (), _held_out_g(calibration))
    found = uncertainty(unit, fitted.measurements, calibration, None)
    return verdict_on(fitted, errors_g, found)


def verdict_on(fitted: Fitted, errors_g: FloatArray, found: Uncertainty) -> Verdict:
    """Verdict on what is not refused.

    Parameters
    ----------
    errors_g : array, shape (n,)
        | |a| - g | at the dwells in the working range, in their order.
    found : Uncertainty
    """
    unit, calibration = fitted.unit, fitted.calibration
    recording = calibration.recording
    tested = tuple(_tested(fitted, errors_g))
    if recording is not None and not recording.checked:
        return Verdict(NOT_CHECKED, None, tested, (), _held_out_g(calibration))
    tested += tuple(_with_guard_band(fitted, errors_g, found))
    untested = (*not_tested(unit, calibration), *_without_dwells(unit, tested))
    unknown = [s for s in found.sources if s.unknown]
    if not untested and unknown:
        untested = tuple(f"{s.name} is unknown" for s in unknown)
    untested = (*_clipped(calibration), *untested)
    result = PASSED
    if untested:
        result = AT_DWELLS if recording is None else AT_POSES
    contradicts = contradictions(unit, calibration)
    refusal = _in_guard_band(unit, tested)
    if refusal is not None:
        result = REFUSED
    elif contradicts or any(t.beyond for t in tested if t.what in DECISIVE):
        result = NOT_SHOWN
    note, held_out_g = _estimated(calibration), _held_out_g(calibration)
    rule = "" if unit.limits.rule_is_default else unit.limits.rule_words
    return Verdict(result, refusal, tested, untested, held_out_g, note, contradicts, rule)


def _in_guard_band(unit: UnitDescription, tested: Sequence[LimitCheck]) -> RefusedError | None:
    """Refusal by a binary rule of an error that the guard band does not leave below its limit."""
    beyond = [t for t in tested if t.what in DECISIVE and t.beyond]
    if not unit.limits.rule.binary or not beyond:
        return None
    return RefusedError(
        f"{unit.source}, [limits] decision_rule",
        "; ".join(map(str, beyond)),
        expected=f"error and {DECISIVE[beyond[0].what]} within the limit, by the "
        f"{unit.limits.rule_words}",
        remedy='make the uncertainty smaller, or choose "guard-band", which delivers it as not '
        "shown to pass",
    )


def _held_out_g(calibration: Calibration) -> float | None:
    chosen = next((c for c in calibration.candidates if c.chosen), None)
    return None if chosen is None else chosen.held_out_g


def _places(unit: UnitDescription, range_degc: tuple[float, float]) -> dict[str, float]:
    """Limits that hold at a temperature of the working range, in g, by where they do."""
    limits = {AT_T0: unit.limits.at_t0_g, OVER_RANGE: unit.limits.over_range_g}
    return {where: limits[where] for where in limits_that_apply(unit, range_degc)}


def limits_that_apply(unit: UnitDescription, range_degc: tuple[float, float]) -> tuple[str, ...]:
    """Of both limits, those that hold at any temperature of the working range."""
    low, high = range_degc
    nearest = min(max(unit.t0_degc, low), high)
    at_t0 = near_t0(nearest, unit.t0_degc)
    others = not (near_t0(low, unit.t0_degc) and near_t0(high, unit.t0_degc))
    return (*([AT_T0] if at_t0 else []), *([OVER_RANGE] if others else []))


def not_tested(unit: UnitDescription, calibration: Calibration) -> tuple[str, ...]:
    """What no reading outside the fit has tested, in words."""
    recording, test = calibration.recording, calibration.held_out
    if recording is not None:
        if not recording.tested:
            return ("nothing was held out",)
        curved = calibration.shape.parameters > 1
        return ("between the temperatures not tested",) * (curved and not recording.tested_between)
    if test is None or test.between:
        estimated = held_out_refusal(unit, calibration, "", 1.0) is not None
        return ("between the temperatures estimated, not tested",) * estimated
    if len(calibration.points) == 1:
        return ("nothing was held out",)
    return ("between the temperatures not tested", *_exchanged(unit, calibration))


def _exchanged(unit: UnitDescription, calibration: Calibration) -> tuple[str, ...]:
    """That temperatures may be exchanged, in words."""
    # Only a verdict needs it here.
    from triaxcal.uncertainty.exchanged import exchanged_error_g  # noqa: PLC0415

    largest_g = exchanged_error_g(unit, calibration)
    if largest_g is None:
        return ()
    wrong = f"with two exchanged, a component is up to {largest_g * 1e3:.2g} mg wrong"
    return (f"which temperature is which not tested: {wrong}",)


def _clipped(calibration: Calibration) -> tuple[str, ...]:
    """Ends at which an output stayed in poses: what lies beyond has not been measured."""
    recording, unit = calibration.recording, calibration.reading_unit
    ends = () if recording is None else recording.poses.clipped
    return tuple(f"{end} {unit} not tested: clipped there" for end in ends)


def _without_dwells(unit: UnitDescription, tested: Sequence[LimitCheck]) -> Iterator[str]:
    """Limits that no dwell or pose of the range has tested."""
    for check in tested:
        if check.what == RESIDUAL and not check.dwells:
            at = f" ({unit.t0_degc:g} degC)" if check.where == AT_T0 else ""
            others = any(t.dwells for t in tested if t.where == check.where)
            yield from () if others else (f"nothing measured {check.where}{at}",)


def _estimated(calibration: Calibration) -> str:
    """How the held-out error of curves that need every temperature was estimated."""
    test = calibration.held_out
    if test is None or test.worst is None or test.share == 1.0:
        return ""
    return (
        f"held out: without one temperature only a {test.function} is determined, and misses it "
        f"by up to {abs(test.worst.error_g) * 1e3:.3g} mg; the delivered "
        f"{calibration.shape.label} is estimated to miss by {test.share:.2g} of that, as the "
        "error falls from order to order"
    )


def _tested(fitted: Fitted, errors_g: FloatArray) -> Iterator[LimitCheck]:
    """Residuals and held-out errors against the limits of their temperatures."""
    unit, calibration = fitted.unit, fitted.calibration
    for what, checks in ((RESIDUAL, False), (HELD_OUT, True)):
        if checks and calibration.recording is not None:
            yield from _of_recording(unit, calibration)
            continue
        found = _by_place(fitted, errors_g, checks=checks)
        test = calibration.held_out
        if checks and test is not None:
            # They show the curves between the temperatures: over the range, even at T0.
            found[OVER_RANGE] += [test.share * abs(d.error_g) for d in test.dwells]
        for where, limit_g in _places(unit, calibration.range_degc).items():
            own = found[where]
            yield LimitCheck(where, limit_g, max(own, default=np.nan), len(own), what)
    yield from _components(unit, calibration)


def _by_place(
    fitted: Fitted, errors_g: FloatArray, *, checks: bool | None
) -> dict[str, list[float]]:
    """Errors of test dwells, of check dwells, or (None) of all, by the limit that holds there."""
    unit, calibration = fitted.unit, fitted.calibration
    found: dict[str, list[float]] = {AT_T0: [], OVER_RANGE: []}
    dwells = dwells_in_range(unit, calibration.range_degc, fitted.measurements)
    for dwell, error in zip(dwells, errors_g.tolist(), strict=True):
        if checks is None or checks == (dwell.position in CHECK_POSITIONS):
            near = near_t0(dwell.temp_degc, unit.t0_degc)
            found[AT_T0 if near else OVER_RANGE].append(error)
    return found


def _of_recording(unit: UnitDescription, calibration: Calibration) -> Iterator[LimitCheck]:
    """Rms of |a| - g at held-out poses: the worst of what was held out in turn."""
    assert calibration.recording is not None
    errors = held_out_errors(unit, calibration.recording)
    for where, limit_g in _places(unit, calibration.range_degc).items():
        own = [e for e in errors if e.where == where and not e.components]
        largest = max((e.rms_g for e in own), default=np.nan)
        yield LimitCheck(where, limit_g, largest, sum(e.poses for e in own), HELD_OUT, rms=True)


def _components(unit: UnitDescription, calibration: Calibration) -> Iterator[LimitCheck]:
    """Rms error of a component of the force at what was held out, where its direction is known."""
    found: list[tuple[str, float, int]] = []
    test = calibration.held_out
    if test is not None and test.rms_g is not None:
        found.append((OVER_RANGE, test.share * test.rms_g, len(test.dwells)))
    if calibration.recording is not None:
        errors = held_out_errors(unit, calibration.recording)
        found += [(e.where, e.rms_g, e.poses) for e in errors if e.components]
    for where, limit_g in _places(unit, calibration.range_degc).items():
        own = [(rms, count) for place, rms, count in found if place == where]
        if own:
            largest, count = max(own)[0], sum(count for _, count in own)
            yield LimitCheck(where, limit_g, largest, count, COMPONENTS, rms=True)


def _with_guard_band(
    fitted: Fitted, errors_g: FloatArray, found: Uncertainty
) -> Iterator[LimitCheck]:
    """The largest error at any dwell or pose, and the guard band of the decision rule beside it."""
    limits = fitted.unit.limits
    if not limits.rule.guarded:
        return
    what = UNCERTAINTY if limits.guard_band_g is None else GUARDED
    whole = not any(s.unknown for s in found.sources)
    uncertain = dict(zip((AT_T0, OVER_RANGE), found.length_g, strict=True))
    by_place = _by_place(fitted, errors_g, checks=None)
    for where, limit_g in _places(fitted.unit, fitted.calibration.range_degc).items():
        own = by_place[where]
        largest = max(own, default=0.0) + limits.guard_g(uncertain[where])
        yield LimitCheck(where, limit_g, largest, len(own), what, whole)
