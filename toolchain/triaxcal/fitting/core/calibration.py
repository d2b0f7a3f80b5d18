"""The calibration of one unit: what every fit gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.fitting.core.fieldupdate import Update
from triaxcal.fitting.core.judged import HeldOutTest, OwnSquares, RunRepeatability
from triaxcal.fitting.core.recorded import PairTerms, RecordingFit
from triaxcal.model.curves import ThermalModel
from triaxcal.model.metrological import pack_blocks, per
from triaxcal.model.terms import NO_TERMS, Terms
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell


@dataclass(frozen=True)
class Candidate:
    """One row of the table of candidates.

    Attributes
    ----------
    estimator : str
    shape : ThermalShape or None
        The thermal function; None in a loaded calibration where it is unknown here.
    parameters : int
        Of each constant's curve.
    held_out_g : float or None
        Rms error on held-out values; None when nothing can be held out.
    fit_residual_g : float
        Rms error of the force, per component, at the fitted dwells.
    chosen : bool
    label, short_label : str
        The candidate in words, and for a narrow column.
    condition : float or None
        Condition number, where a recording's poses were anyone's choice.
    """

    estimator: str
    shape: ThermalShape | None
    parameters: int
    held_out_g: float | None
    fit_residual_g: float
    chosen: bool
    label: str
    short_label: str
    condition: float | None = None


@dataclass(frozen=True)
class Selection:
    """What was chosen, out of what, and why."""

    estimator: str
    shape: ThermalShape
    candidates: tuple[Candidate, ...]
    reason: str


@dataclass(frozen=True)
class CalibrationPoint:
    """The constants at one calibration temperature.

    Attributes
    ----------
    temp_degc : float
    constants : array, shape (12,)
        V/g and V, in the order of `CONSTANT_NAMES`.
    covariance : array, shape (12, 12)
    position_residual_g : float
        Rms error of the force, per component, with these constants: noise and placement.
    curve_residual_g : float
        The same with the constants of the thermal curves.
    """

    temp_degc: float
    constants: FloatArray
    covariance: FloatArray
    position_residual_g: float
    curve_residual_g: float


@dataclass(frozen=True)
class CheckResult:
    """A check dwell and |a| - g there, P1 (13), in g.

    The curves are continued to a dwell beyond the calibrated temperatures; it is not scored.
    """

    dwell: Dwell
    error_g: float


@dataclass(frozen=True)
class Calibration:
    """The twelve constants of one unit over temperature, with their covariance.

    Attributes
    ----------
    serial : str
    estimator : str
        One of `unit.choices.ESTIMATORS`.
    thermal : ThermalModel
        The curves.
    shape : ThermalShape
        Their basis, to which `parameter_covariance` belongs.
    range_degc : tuple of two floats
        Working temperature range.
    points : tuple of CalibrationPoint
        By rising temperature.
    parameter_covariance : array, shape (3, 4, P, 4, P)
        Output; its constants K_ix, K_iy, K_iz, U0_i and their P parameters, twice.
    covariance_source : str
        Where the variances come from, in words.
    candidates : tuple of Candidate
        Every thermal function with the chosen estimator, and the chosen one with the others.
    selection_reason : str
        Why this candidate, in words.
    check_dwells : tuple of CheckResult
        In the order of the file.
    terms : Terms
        Quadratic and dT/dt terms, where the data carried them.
    recording : RecordingFit or None
        The poses, where the readings are a recording and no tilter's; `points` then has the
        constants at T0 alone, and `parameter_covariance` only the blocks of each output.
    reading_unit : str
        Unit of U0; K has it per g. That of the recording, if there is one.
    pair : PairTerms or None
        Part of `terms` that a pair on a dividing head has shown.
    notes : tuple of str
        What the user should know about the readings, where they are no `recording`'s.
    inputs : tuple of str
        Columns of x, y, z as unit.toml names them, as "-ACC2", where the readings are a recording.
        The constants are those of the columns as the converter gives them: a minus is in K and U0.
        Empty in a file of triaxcal 0.1.0: its readings have the signs.
    held_out : HeldOutTest or None
        None for a recording, whose `recording` has it.
    runs : RunRepeatability or None
        Where a tilter's file has several complete runs.
    update : Update or None
        Where it comes from, if it is an update of another by poses from the field.
    squares : OwnSquares or None
        Of a tilter's six positions; in `terms` where they are included.
    """

    serial: str
    estimator: str
    thermal: ThermalModel
    shape: ThermalShape
    range_degc: tuple[float, float]
    points: tuple[CalibrationPoint, ...]
    parameter_covariance: FloatArray
    covariance_source: str
    candidates: tuple[Candidate, ...]
    selection_reason: str
    check_dwells: tuple[CheckResult, ...]
    terms: Terms = NO_TERMS
    recording: RecordingFit | None = None
    reading_unit: str = "V"
    pair: PairTerms | None = None
    notes: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    held_out: HeldOutTest | None = None
    runs: RunRepeatability | None = None
    update: Update | None = None
    squares: OwnSquares | None = None

    @property
    def findings(self) -> tuple[str, ...]:
        """What the user should know about the readings, the worst first."""
        return self.notes if self.recording is None else self.recording.findings

    @property
    def gain_unit(self) -> str:
        """Unit of K."""
        return per(self.reading_unit, "g")

    def constants_covariance(self, temp_degc: FloatArray | float) -> FloatArray:
        """Covariance of the curves' constants, (..., 12, 12), at temperatures of shape (...)."""
        if self.recording is not None:
            basis = self.shape.basis(temp_degc)
            full = self.recording.covariance
            result: FloatArray = np.einsum("...p,apbq,...q->...ab", basis, full, basis)
            return result
        return curve_covariance(self.shape, self.parameter_covariance, temp_degc)


def curve_covariance(
    shape: ThermalShape, covariance: FloatArray, temp_degc: FloatArray | float
) -> FloatArray:
    """Covariance of the constants, shape (..., 12, 12), at temperatures of shape (...).

    `covariance` is that of one estimator's parameters, shape (3, 4, P, 4, P).
    """
    basis = shape.basis(temp_degc)
    return pack_blocks(np.einsum("...p,akplq,...q->...akl", basis, covariance, basis))
