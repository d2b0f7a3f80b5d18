"""Whether a calibration keeps its unit's limits, and in which words that is said.

Three things are held against each limit: the residual at the fitted dwells, the error at what was
held out, and the residual with the uncertainty of |a|. The first two refuse; the third decides
whether the limit is shown to hold everywhere.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import Fitted, refuse_beyond_limits
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.tilter.acceptance import dwell_errors_g, dwells_in_range, held_out_refusal
from triaxcal.model.positions import CHECK_POSITIONS
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.thermal import near_t0

AT_T0, OVER_RANGE = "at T0", "over the range"
RESIDUAL, HELD_OUT, UNCERTAINTY = "residual", "held out", "with uncertainty"


@dataclass(frozen=True)
class LimitCheck:
    """One limit, and what was held against it.

    Attributes
    ----------
    where : str
        "at T0" or "over the range".
    limit_g, largest_g : float
        Limit, and the largest | |a| - g |.
    dwells : int
        How many; with none the limit was not tested, and `largest_g` is NaN.
    what : str
        "residual" of the fitted model at the dwells of the fit; "held out", at check dwells and
        temperatures held out; "with uncertainty", the residual and the uncertainty (95 %) of |a|.
    whole : bool
        False where a source of the uncertainty is unknown: `largest_g` is without it.
    """

    where: str
    limit_g: float
    largest_g: float
    dwells: int
    what: str = RESIDUAL
    whole: bool = True

    @property
    def held(self) -> bool:
        """Whether the limit holds; what was not tested, or is not all known, does not."""
        return self.whole and self.largest_g <= self.limit_g

    def __str__(self) -> str:
        what = f"{self.what} {self.where}"
        if not self.dwells:
            return f"{what}: not tested"
        largest, limit = self.largest_g * 1e3, self.limit_g * 1e3
        more = "" if self.whole else " and what is unknown"
        words = f"{what}: {largest:.4g} mg{more}, limit {limit:g} mg"
        return words if self.what == UNCERTAINTY else f"{words}, {self.dwells} dwells"


@dataclass(frozen=True, repr=False)
class Verdict:
    """Whether a calibration may be delivered.

    Attributes
    ----------
    passed : bool
        Whether it may: no limit is missed by what was tested.
    refusal : RefusedError or None
        Why it did not pass: place, found, expected, remedy.
    tested : tuple of LimitCheck
        Residuals, then held-out errors, then residuals with their uncertainty; each at T0 and over
        the range.
    held_out_g : float or None
        Rms error of the chosen functions on readings that their fit did not use.
    checked : bool
        Whether the readings could contradict the constants at all.
    words : str
        The verdict in words.
    """

    passed: bool
    refusal: RefusedError | None
    tested: tuple[LimitCheck, ...]
    held_out_g: float | None
    checked: bool
    words: str

    def __str__(self) -> str:
        if self.refusal is not None:
            return f"refused: {self.refusal}"
        lines = [str(t) for t in self.tested]
        if self.held_out_g is not None:
            lines.append(f"held-out error: {self.held_out_g * 1e3:.4g} mg rms")
        return "\n".join([self.words, *lines])

    __repr__ = __str__


def judge(fitted: Fitted) -> Verdict:
    """Verdict on a fitted model."""
    from triaxcal.uncertainty.acceptance import length_uncertainty_g  # noqa: PLC0415

    refusal = None
    try:
        refuse_beyond_limits(fitted)
    except RefusedError as error:
        refusal = error
    calibration = fitted.calibration
    checked = calibration.recording is None or calibration.recording.checked
    tested = (*residual_checks(fitted), *held_out_checks(fitted))
    if checked and refusal is None:
        found, whole = length_uncertainty_g(fitted.unit, fitted.measurements, calibration)
        residuals = _both(fitted.unit, UNCERTAINTY, _errors(fitted, checks=True))
        tested += tuple(
            replace(r, largest_g=r.largest_g + u, whole=whole)
            for r, u in zip(residuals, found, strict=True)
        )
    chosen = next((c for c in calibration.candidates if c.chosen), None)
    needed = limits_that_apply(fitted.unit, calibration.range_degc)
    against = [t for t in tested if t.what == UNCERTAINTY and t.where in needed]
    shown = all(t.held for t in against)
    words = verdict_words(fitted.unit, calibration, checked=checked, shown=shown)
    return Verdict(
        refusal is None,
        refusal,
        tested,
        None if chosen is None else chosen.held_out_g,
        checked,
        words if refusal is None else "refused",
    )


def limits_that_apply(unit: UnitDescription, range_degc: tuple[float, float]) -> tuple[str, ...]:
    """Of both limits, those that hold at any temperature of the working range."""
    low, high = range_degc
    nearest = min(max(unit.t0_degc, low), high)
    at_t0 = near_t0(nearest, unit.t0_degc)
    others = not (near_t0(low, unit.t0_degc) and near_t0(high, unit.t0_degc))
    return (*([AT_T0] if at_t0 else []), *([OVER_RANGE] if others else []))


def verdict_words(
    unit: UnitDescription, calibration: Calibration, *, checked: bool, shown: bool
) -> str:
    """The verdict on what has not been refused: the same words on the terminal and everywhere.

    `checked` is whether the readings could contradict the constants, `shown` whether the limits
    hold with the uncertainty inside them.
    """
    if not checked:
        return "not checked"
    untested = not_tested(unit, calibration)
    if untested:
        return f"passed at the dwells; {untested}"
    return "passed" if shown else "passed at the dwells, not shown everywhere"


def not_tested(unit: UnitDescription, calibration: Calibration) -> str:
    """What no reading outside the fit has tested, in words; empty where something has."""
    recording, test = calibration.recording, calibration.held_out
    if recording is not None:
        if not recording.tested:
            return "not tested: nothing was held out"
        curved = calibration.shape.parameters > 1
        return "between them not tested" if curved and not recording.tested_between else ""
    if test is None:
        return ""
    if held_out_refusal(unit, calibration, "", 1.0) is not None:
        return "between them estimated, not shown"
    if test.between:
        return ""
    return "nothing was held out" if len(calibration.points) == 1 else "between them not tested"


def residual_checks(fitted: Fitted) -> tuple[LimitCheck, ...]:
    """Both limits against the dwells of the fit."""
    return _both(fitted.unit, RESIDUAL, _errors(fitted, checks=False))


def held_out_checks(fitted: Fitted) -> tuple[LimitCheck, ...]:
    """Both limits against check dwells and the temperatures held out; none for a recording.

    The latter show the curves between the calibrated temperatures: over the range, even at T0.
    """
    test = fitted.calibration.held_out
    if test is None:
        return ()
    others = [test.share * abs(d.error_g) for d in test.dwells]
    return _both(fitted.unit, HELD_OUT, _errors(fitted, fitted_too=False), others)


def _errors(
    fitted: Fitted, *, checks: bool = True, fitted_too: bool = True
) -> list[tuple[float, float]]:
    """Temperature and | |a| - g | of the dwells in the range, (degC, g)."""
    unit, calibration = fitted.unit, fitted.calibration
    dwells = [
        d
        for d in dwells_in_range(unit, calibration.range_degc, fitted.measurements)
        if (checks if d.position in CHECK_POSITIONS else fitted_too)
    ]
    errors = dwell_errors_g(unit, calibration, dwells).tolist()
    return list(zip([d.temp_degc for d in dwells], errors, strict=True))


def _both(
    unit: UnitDescription,
    what: str,
    found: Iterable[tuple[float, float]],
    over_range: Iterable[float] = (),
) -> tuple[LimitCheck, LimitCheck]:
    """Errors at temperatures, (degC, g), held against the limit that holds there."""
    errors: dict[bool, list[float]] = {True: [], False: [*over_range]}
    for temp, error in found:
        errors[near_t0(temp, unit.t0_degc)].append(error)
    at_t0, others = (
        LimitCheck(where, limit_g, max(own, default=np.nan), len(own), what)
        for where, limit_g, own in (
            (AT_T0, unit.limits.at_t0_g, errors[True]),
            (OVER_RANGE, unit.limits.over_range_g, errors[False]),
        )
    )
    return at_t0, others
