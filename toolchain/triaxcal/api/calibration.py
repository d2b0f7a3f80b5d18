"""`fit`, `Calibration`, `load`: from readings to constants and their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from triaxcal.api.arguments import refuse_other_length, temperatures
from triaxcal.api.field import InTheField
from triaxcal.api.unit import Unit
from triaxcal.base.arrays import finite
from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import renew
from triaxcal.delivery.causes import causes_of
from triaxcal.delivery.fitted import Fitted, fit_columns, fit_folder
from triaxcal.delivery.judgement import judge
from triaxcal.delivery.posecauses import causes_of_poses
from triaxcal.delivery.saved import Saved, calibration_json, read_saved
from triaxcal.delivery.verdict import Verdict
from triaxcal.fitting.core.calibration import Candidate
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.budget import Budget
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.uncertainty.orientation import QUANTITIES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from triaxcal.diagnosis import Diagnosis as Causes


@dataclass(frozen=True, repr=False)
class Diagnosis:
    """Findings about the readings, and the candidates of the fit.

    Attributes
    ----------
    findings : tuple of str
        What a user should know about the readings, the worst first.
    candidates : tuple of Candidate
        Thermal functions and estimators that were tried, each with its held-out error.
    reason : str
        Why the chosen one was chosen.
    """

    findings: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    reason: str
    _fitted: Fitted = field(compare=False)

    @cached_property
    def causes(self) -> Causes | None:
        """Physical causes that could explain the readings, ranked as `diagnose` does.

        Quadratic terms of the calibration are no fault. None where the angles of poses are known.
        """
        done = self._fitted
        if done.calibration.recording is not None:
            return causes_of_poses(done.unit, done.calibration)
        return causes_of(done.unit, done.measurements, done.calibration)

    def __str__(self) -> str:
        return "\n".join([*self.findings, self.reason])

    __repr__ = __str__


class Calibration(InTheField):
    """The twelve constants of one unit over temperature, a = K(T)^-1 (U - U0(T)).

    Made by `fit` or `load`. U are readings in volts, or in the unit of the recording
    (`reading_unit`); a is specific force in g of 9.80665 m/s^2. Axes are x, y, z everywhere.
    """

    def __init__(self, unit: Unit | None, saved: Saved) -> None:
        self._unit, self._saved = unit, saved

    def __repr__(self) -> str:
        low, high = self.range_degc
        return f"<triaxcal.Calibration {self.serial}, {low:g} to {high:g} degC>"

    @property
    def unit(self) -> Unit | None:
        """The unit; None for a file of triaxcal 0.1.0, which does not describe it."""
        return self._unit

    @property
    def serial(self) -> str:
        """Serial number."""
        return self._saved.serial

    @property
    def range_degc(self) -> tuple[float, float]:
        """Working range; no other temperature is answered."""
        return self._saved.range_degc

    @property
    def reading_unit(self) -> str:
        """Unit of U and U0; K is in it per g."""
        return self._saved.reading_unit

    @property
    def fitted(self) -> Fitted:
        """The fit behind it.

        Raises
        ------
        RefusedError
            When the calibration was loaded from a file of triaxcal 0.1.0: it has only the curves.
        """
        if self._saved.fitted is None:
            raise RefusedError(
                self._saved.source,
                self._saved.without_fit,
                expected="a calibration.json with its fit",
                remedy="calibrate the unit again",
            )
        return self._saved.fitted

    def constants(self, temp_degc: Any) -> tuple[FloatArray, FloatArray]:
        """K and U0 at temperatures.

        Parameters
        ----------
        temp_degc : array_like, shape (...)

        Returns
        -------
        K : array, shape (..., 3, 3)
            `reading_unit` per g: output of axis i for 1 g along axis j.
        U0 : array, shape (..., 3)
            `reading_unit`.

        Raises
        ------
        RefusedError
            For a temperature that is no number, or outside of `range_degc`.
        """
        return unpack_constants(self._saved.thermal.constants_at(self._inside(temp_degc)))

    def apply(self, readings: Any, temp_degc: Any, rate_k_per_s: Any = 0.0) -> FloatArray:
        """Specific force by the fitted model, in floats: P1 (1), and the terms beyond it.

        Parameters
        ----------
        readings : array_like, shape (3,) or (n, 3)
            Outputs x, y, z in `reading_unit`; a data frame of three columns is accepted.
        temp_degc : array_like, shape () or (n,)
        rate_k_per_s : array_like, shape () or (n,)
            dT/dt; used only if a term in it was fitted.

        Returns
        -------
        array, shape of `readings`
            In g.

        Raises
        ------
        RefusedError
            For another shape, a number that is not finite, or a temperature out of `range_degc`.
        """
        voltage = finite("readings", readings, 3)
        temp, rate = self._inside(temp_degc), finite("rate_k_per_s", rate_k_per_s)
        refuse_other_length(voltage, temp_degc=temp, rate_k_per_s=rate)
        linear = force_from_voltage(self._saved.thermal.constants_at(temp), voltage)
        return self._saved.terms.force_g(linear, rate)

    def uncertainty(
        self, temp_degc: float, direction: Any = (0.0, 0.0, 1.0), quantity: str = "|a|"
    ) -> Budget:
        """Uncertainty budget of the compensated acceleration by the GUM, before the firmware.

        Parameters
        ----------
        temp_degc : float
        direction : array_like, shape (3,)
            Direction of the force of 1 g in the unit's axes; it is normalised.
        quantity : str
            "a_x", "a_y", "a_z" or "|a|".

        Returns
        -------
        Budget
            Its `expanded` is the half-width of the 95 % interval in g; its `lines` are the sources.

        Raises
        ------
        RefusedError
            For an unknown quantity, a direction of length 0, or a temperature out of `range_degc`.
        """
        if quantity not in QUANTITIES:
            raise RefusedError(
                "quantity", f"found {quantity!r}", expected="one of " + ", ".join(QUANTITIES)
            )
        vector = finite("direction", direction, 3)
        with np.errstate(over="ignore"):
            length = float(np.linalg.norm(vector))
        if vector.ndim != 1 or not 0.0 < length < np.inf:
            raise RefusedError(
                "direction", f"found {direction!r}", expected="one vector of a finite length, not 0"
            )
        temp = self._inside(temp_degc)
        if temp.ndim:
            raise RefusedError(
                "temp_degc", f"found the shape {temp.shape}", expected="one temperature"
            )
        at = float(temp)
        done = self.fitted
        temps = np.unique([at, done.unit.t0_degc])
        found = uncertainty(done.unit, done.measurements, done.calibration, None, temps)
        index = int(np.searchsorted(temps, at))
        return found.force_budget(QUANTITIES.index(quantity), index, vector / length)

    @cached_property
    def verdict(self) -> Verdict:
        """Whether the fitted model keeps the unit's limits, and what was not tested."""
        return judge(self.fitted)

    @property
    def diagnosis(self) -> Diagnosis:
        """Findings about the readings, and the candidates of the fit."""
        found = self.fitted.calibration
        return Diagnosis(found.findings, found.candidates, found.selection_reason, self.fitted)

    def plot(self) -> Figure:
        """Constants over temperature, their uncertainty, and the residuals at the dwells.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        RefusedError
            Where matplotlib is missing: `pip install 'triaxcal[plot]'`.
        """
        from triaxcal.report.pictures.figure import calibration_figure  # noqa: PLC0415

        return calibration_figure(self.fitted)

    def save(self, path: str | Path) -> Path:
        """Write calibration.json, whole or not at all; `load` reads it."""
        target = Path(path)
        renew({target.name: calibration_json(self.fitted)}, target.parent)
        return target

    def _inside(self, temp_degc: Any) -> FloatArray:
        return temperatures(temp_degc, self.range_degc)


def fit(unit: Unit, readings: Any = None) -> Calibration:
    """Fit the constants of a unit over temperature.

    A calibration beyond the unit's limits is returned all the same; its `verdict` shows it, and
    `firmware` refuses it.

    Parameters
    ----------
    unit : Unit
    readings : mapping, data frame or structured array, or None
        Columns by name, with the names and units of measurements.csv: `position`, `temp_degc` (or
        `temp_code`), `ux_v`, `uy_v`, `uz_v` (or `_mv`, `_code`), and optionally `count` and
        `sd_ux_v`, ...; of a unit with [recording], the columns that its keys name. None reads the
        unit's folder.

    Returns
    -------
    Calibration

    Raises
    ------
    RefusedError
        When the readings break a rule of the file formats, or do not determine a calibration.
    """
    if not isinstance(unit, Unit):
        raise RefusedError(
            "unit",
            f"found a {type(unit).__name__}",
            expected="a Unit",
            remedy="read it with read_unit(folder), or make it with Unit(...)",
        )
    if readings is not None:
        return _of_fitted(unit, fit_columns(unit.description, readings))
    if unit.folder is None:
        raise RefusedError(
            f"unit {unit.name}",
            "made without a folder, and no readings are given",
            expected="readings",
            remedy="call fit(unit, readings), or read the unit with read_unit(folder)",
        )
    return _of_fitted(unit, fit_folder(unit.description, unit.folder))


def load(path: str | Path) -> Calibration:
    """Calibration from a calibration.json, of this version or an earlier one.

    Raises
    ------
    RefusedError
        When the file cannot be read, is no calibration, or is of a later version.
    """
    saved = read_saved(Path(path))
    done = saved.fitted
    unit = None if done is None else Unit.of(done.unit, None)
    return Calibration(unit, saved)


def _of_fitted(unit: Unit, fitted: Fitted) -> Calibration:
    return Calibration(unit, Saved.of(fitted))
