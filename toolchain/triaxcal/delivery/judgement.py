"""Whether a fitted model keeps its unit's limits: the verdict before any C is made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import Fitted, refuse_beyond_limits
from triaxcal.fitting.tilter.acceptance import dwells_in_range
from triaxcal.model.metrological import force_from_voltage
from triaxcal.unit.thermal import near_t0


@dataclass(frozen=True)
class LimitCheck:
    """One limit, and the dwells it was held against.

    Attributes
    ----------
    where : str
        "at T0" or "over the range".
    limit_g, largest_g : float
        Limit, and the largest | |a| - g | of the fitted model.
    dwells : int
        How many; with none the limit was not tested, and `largest_g` is NaN.
    """

    where: str
    limit_g: float
    largest_g: float
    dwells: int

    def __str__(self) -> str:
        if not self.dwells:
            return f"{self.where}: not tested"
        largest, limit = self.largest_g * 1e3, self.limit_g * 1e3
        return f"{self.where}: {largest:.4g} mg, limit {limit:g} mg, {self.dwells} dwells"


@dataclass(frozen=True, repr=False)
class Verdict:
    """Whether a calibration may be delivered.

    Attributes
    ----------
    passed : bool
    refusal : RefusedError or None
        Why it did not pass: place, found, expected, remedy.
    tested : tuple of LimitCheck
    held_out_g : float or None
        Rms error of the chosen functions on readings that their fit did not use.
    checked : bool
        Whether the readings could contradict the constants at all.
    """

    passed: bool
    refusal: RefusedError | None
    tested: tuple[LimitCheck, ...]
    held_out_g: float | None
    checked: bool

    def __str__(self) -> str:
        if self.refusal is not None:
            return f"refused: {self.refusal}"
        lines = [str(t) for t in self.tested]
        if self.held_out_g is not None:
            lines.append(f"held-out error: {self.held_out_g * 1e3:.4g} mg rms")
        return "\n".join(["passed" if self.checked else "not checked", *lines])

    __repr__ = __str__


def judge(fitted: Fitted) -> Verdict:
    """Verdict on a fitted model."""
    refusal = None
    try:
        refuse_beyond_limits(fitted)
    except RefusedError as error:
        refusal = error
    calibration = fitted.calibration
    chosen = next((c for c in calibration.candidates if c.chosen), None)
    return Verdict(
        refusal is None,
        refusal,
        _tested(fitted),
        None if chosen is None else chosen.held_out_g,
        calibration.recording is None or calibration.recording.checked,
    )


def _tested(fitted: Fitted) -> tuple[LimitCheck, ...]:
    unit, calibration = fitted.unit, fitted.calibration
    dwells = dwells_in_range(unit, calibration.range_degc, fitted.measurements)
    temps = np.array([d.temp_degc for d in dwells])
    voltages = np.array([d.voltage_v for d in dwells]).reshape(-1, 3)
    linear = force_from_voltage(calibration.thermal.constants_at(temps), voltages)
    force = calibration.terms.force_g(linear, np.array([d.rate_k_per_s for d in dwells]))
    errors = np.abs(np.linalg.norm(force, axis=1) - unit.gravity_g)
    at_t0 = np.array([near_t0(t, unit.t0_degc) for t in temps], dtype=bool)
    return tuple(
        LimitCheck(where, limit_g, float(errors[own].max(initial=-np.inf)) if own.any() else np.nan,
               int(own.sum()))
        for where, limit_g, own in (
            ("at T0", unit.limits.at_t0_g, at_t0),
            ("over the range", unit.limits.over_range_g, ~at_t0),
        )
    )  # fmt: skip
