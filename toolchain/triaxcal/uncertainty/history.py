"""A unit calibrated several times: differences against their uncertainty, repeatability, ageing.

Two results x1, x2 of one constant agree when

    En = |x2 - x1| / sqrt(U1^2 + U2^2)

is about 1 or less (ISO 13528), U being expanded (95 %). Twelve constants at T0 and at both ends of
the common range are compared, so the largest En of 36 counts: by chance it exceeds `EN_MAX` in one
comparison of twenty. Errors that both calibrations share, as on one rig, make En smaller.

Beside the twelve stand nine that no rotation of the frame changes (`model.framefree`), of which the
largest En of 27 counts. Where |a| = g alone is known of the poses, the frame is a convention, and
only the nine can contradict. Where it is the rig's, a turned sensor contradicts by the twelve.
"""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from statistics import NormalDist

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.recorded import PairTerms
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.framefree import NAMES, frame_free, frame_free_slopes, relative_scales
from triaxcal.model.metrological import BIASES, CONSTANT_NAMES, unpack_constants
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import MeasurementSet, read_measurements
from triaxcal.uncertainty.evaluate import uncertainty
from triaxcal.unit.description import UnitDescription

HISTORY_FOLDER = "history"
EN_MAX = NormalDist().inv_cdf(1.0 - 0.05 / 72.0) / NormalDist().inv_cdf(0.975)
EN_MAX_NINE = NormalDist().inv_cdf(1.0 - 0.05 / 54.0) / NormalDist().inv_cdf(0.975)
"""The same for 27 values."""
_OWN_AXIS = (0, 4, 8)
_DAYS_A_YEAR = 365.25


@dataclass(frozen=True)
class Calibrated:
    """One calibration of the unit.

    Attributes
    ----------
    name : str
        Of its file, without the suffix; "now" is the unit's own readings, "update" its calibration
        after poses from the field.
    day : date or None
        From a name as 2025-03-30, or [measured] date.
    unit : UnitDescription or None
        That it was made with; None is the present one.
    inputs_sha256 : str
    """

    name: str
    day: datetime.date | None
    measurements: MeasurementSet
    calibration: Calibration
    unit: UnitDescription | None = None
    inputs_sha256: str = ""

    @property
    def parents(self) -> tuple[str, ...]:
        """inputs_sha256 of the calibrations that this one is an update of."""
        return () if self.calibration.update is None else self.calibration.update.parents

    def frame_is_free(self, unit: UnitDescription) -> bool:
        """Whether only |a| = g was known of its poses: its axes are then a convention."""
        layout = (self.unit or unit).recording
        return layout is not None and layout.angles is None and not layout.faces


@dataclass(frozen=True)
class Change:
    """From one calibration to the next.

    Attributes
    ----------
    name, before : str
        The later one, and the one it is compared with.
    bias_mg, scale_ppm, cross_axis_micro_rad : float
        Largest change of its kind at T0, with its sign.
    en : float
        Largest En of the 36.
    where : str
        The constant and temperature that has it.
    by, expanded : float
        How much that constant changed, and the expanded uncertainty of the difference (95 %).
    of_unit : str
        Unit of both: mg, ppm or micro-rad.
    nine, nine_u : arrays, shape (9,)
        Changes at T0 of what no rotation of the frame changes, and their expanded uncertainty, in
        `model.framefree.UNITS`.
    nine_en : float
        Largest En of the 27.
    nine_where : str
    frame_is_free : bool
        Whether the frame of one of the two is a convention.
    is_update : bool
        Whether the later one is an update of the one before: the two are then not independent.
    """

    name: str
    before: str
    bias_mg: float
    scale_ppm: float
    cross_axis_micro_rad: float
    en: float
    where: str
    by: float
    expanded: float
    of_unit: str
    nine: FloatArray
    nine_u: FloatArray
    nine_en: float
    nine_where: str
    frame_is_free: bool
    is_update: bool = False

    @property
    def contradicts(self) -> bool:
        """Whether the two cannot both be right."""
        return self.nine_contradicts or (self.en > EN_MAX and not self.frame_is_free)

    @property
    def nine_contradicts(self) -> bool:
        """Whether the sensor itself has changed, and not only its frame."""
        return self.nine_en > EN_MAX_NINE


def older_files(folder: Path) -> list[Path]:
    """Measurements of earlier calibrations, by name; none when the unit has no history."""
    return sorted((folder / HISTORY_FOLDER).glob("*.csv"))


def calibrated(
    path: Path,
    unit: UnitDescription,
    name: str,
    day: datetime.date | None,
    pair: PairTerms | None,
) -> Calibrated:
    """One file, calibrated by the unit's description, with the cross-coupling of its pair."""
    measurements = read_measurements(path, unit)
    return Calibrated(name, day, measurements, calibrate(unit, measurements, pair))


def day_of(name: str) -> datetime.date | None:
    """Day of a file whose name begins with one."""
    try:
        return datetime.date.fromisoformat(name[:10])
    except ValueError:
        return None


def changes(unit: UnitDescription, history: list[Calibrated]) -> list[Change]:
    """From each calibration to the next."""
    return [_change(unit, a, b) for a, b in pairwise(history)]


def latest_change(folder: Path, unit: UnitDescription, newest: Calibrated) -> Change | None:
    """From the last earlier calibration to the newest; None when there is no earlier one.

    None of a recording either: `read_history` says why.
    """
    older = older_files(folder)
    if not older or unit.recording is not None:
        return None
    name = older[-1].stem
    last = calibrated(older[-1], unit, name, day_of(name), newest.calibration.pair)
    return _change(unit, last, newest)


def _change(unit: UnitDescription, before: Calibrated, after: Calibrated) -> Change:
    low = max(c.calibration.range_degc[0] for c in (before, after))
    high = min(c.calibration.range_degc[1] for c in (before, after))
    temps = np.unique(np.clip([low, unit.t0_degc, high], min(low, high), max(low, high)))
    values, expanded, nine, nine_u = [], [], [], []
    for c in (before, after):
        u = uncertainty(c.unit or unit, c.measurements, c.calibration, None, _with_t0(temps, unit))
        keep = np.isin(u.temps_degc, temps)
        constants = c.calibration.thermal.constants_at(temps)
        values.append(constants)
        expanded.append(u.constants_u[keep])
        nine.append(frame_free(constants))
        nine_u.append(u.of_constants(np.stack([frame_free_slopes(row) for row in constants]), keep))
    difference, its_u = values[1] - values[0], np.hypot(expanded[0], expanded[1])
    en = np.abs(difference) / its_u
    row, constant = map(int, np.unravel_index(int(en.argmax()), en.shape))
    at_t0 = [c.calibration.thermal.constants_at(unit.t0_degc) for c in (before, after)]
    bias, scale, cross = _kinds(at_t0[1] - at_t0[0], at_t0[0])
    scale_of = _scales(at_t0[0])
    change, change_u = nine[1] - nine[0], np.hypot(nine_u[0], nine_u[1])
    nine_en = np.abs(change) / change_u
    k, which = map(int, np.unravel_index(int(nine_en.argmax()), nine_en.shape))
    t0_row, to_unit = int(np.abs(temps - unit.t0_degc).argmin()), relative_scales(at_t0[0])
    return Change(
        name=after.name,
        before=before.name,
        bias_mg=_largest(bias),
        scale_ppm=_largest(scale),
        cross_axis_micro_rad=_largest(cross),
        en=float(en.max()),
        where=f"{CONSTANT_NAMES[constant]} at {temps[row]:.4g} °C",
        by=float(difference[row, constant] * scale_of[constant]),
        expanded=float(its_u[row, constant] * abs(scale_of[constant])),
        of_unit=_unit_of(constant),
        nine=change[t0_row] * to_unit,
        nine_u=change_u[t0_row] * to_unit,
        nine_en=float(nine_en.max()),
        nine_where=f"{NAMES[which]} at {temps[k]:.4g} °C",
        frame_is_free=before.frame_is_free(unit) or after.frame_is_free(unit),
        is_update=before.inputs_sha256 in after.parents,
    )


def _with_t0(temps_degc: FloatArray, unit: UnitDescription) -> FloatArray:
    result: FloatArray = np.unique([*temps_degc, unit.t0_degc])
    return result


def _kinds(change: FloatArray, constants: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Changes (..., 12) as bias in mg, scale factor in ppm, cross-axis sensitivity in micro-rad."""
    scaled = change * _scales(constants)
    cross = [k for k in range(9) if k not in _OWN_AXIS]
    return scaled[..., list(BIASES)], scaled[..., list(_OWN_AXIS)], scaled[..., cross]


def _scales(constants: FloatArray) -> FloatArray:
    """What brings a change of each constant to the unit of `_unit_of`, shape (12,).

    By the sensitivity of each output along its own direction, as `model.framefree` has it: K_ii of
    a sensor that is turned by 90 degrees is about zero.
    """
    K = unpack_constants(constants)[0]
    sensitivity = np.linalg.norm(K, axis=1)
    signed = np.where(np.diag(K) < 0.0, -sensitivity, sensitivity)
    return np.concatenate([1e6 / np.repeat(signed, 3), 1e3 / sensitivity])


def _unit_of(constant: int) -> str:
    if constant in BIASES:
        return "mg"
    return "ppm" if constant in _OWN_AXIS else "µrad"


def _largest(values: FloatArray) -> float:
    return float(values.flat[int(np.abs(values).argmax())])


@dataclass(frozen=True)
class Repeatability:
    """Standard deviation from calibration to calibration, and the change a year, at T0.

    Each is the root mean square over its constants; `*_a_year` are None without days.
    """

    calibrations: int
    bias_mg: float
    scale_ppm: float
    cross_axis_micro_rad: float
    years: float | None
    bias_mg_a_year: float | None
    scale_ppm_a_year: float | None


def independent(history: list[Calibrated]) -> list[Calibrated]:
    """Without those of which a later one is an update: they share their data."""
    parents = {parent for c in history for parent in c.parents}
    return [c for c in history if c.inputs_sha256 not in parents]


def repeatability(unit: UnitDescription, history: list[Calibrated]) -> Repeatability | None:
    """Scatter over all calibrations about a straight line in time, or about the mean without days.

    An updated calibration counts once. None if too few: 3 are needed with a mean, 4 with a line.
    """
    history = independent(history)
    at_t0 = np.array([c.calibration.thermal.constants_at(unit.t0_degc) for c in history])
    kinds = _kinds(at_t0 - at_t0[0], at_t0[0])
    days = [c.day.toordinal() for c in history if c.day]
    dated = len(days) == len(history) and len(set(days)) > 1
    columns = [np.ones(len(history))]
    if dated and len(history) > 3:
        columns.append((np.array(days) - days[0]) / _DAYS_A_YEAR)
    design = np.column_stack(columns)
    left = len(history) - design.shape[1]
    if left < 2:
        return None
    scatter, slopes = [], []
    for values in kinds:
        solution, *_ = np.linalg.lstsq(design, values)
        residual = values - design @ solution
        scatter.append(math.sqrt(float(np.mean(np.sum(residual**2, axis=0))) / left))
        slopes.append(_largest(solution[-1]))
    found = Repeatability(len(history), scatter[0], scatter[1], scatter[2], None, None, None)
    if len(columns) == 1:
        return found
    years = (days[-1] - days[0]) / _DAYS_A_YEAR
    return replace(found, years=years, bias_mg_a_year=slopes[0], scale_ppm_a_year=slopes[1])
