"""Tables of angles for a program: forms of a fit, a series inverse, errors over an angle."""

from __future__ import annotations

from typing import Any

import numpy as np

from triaxcal.api.study import Study
from triaxcal.base.errors import RefusedError
from triaxcal.fitting.table.anglecurves import AngleErrors, Hysteresis, angle_errors, hysteresis
from triaxcal.fitting.table.oriented import (
    OrientedFit,
    SerialGrid,
    inverse_linear,
    inverse_quadratic,
    inverse_two_stage,
)
from triaxcal.fitting.table.stand import StandAxes, stand_axes, stand_direction
from triaxcal.model.orientation import AIRCRAFT, INCLINOMETER, angles_from_force
from triaxcal.model.types import FloatArray
from triaxcal.report.angles import angle_errors_picture, angle_errors_text
from triaxcal.unit.recording import ANGLE_NAMES
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

FORMS = ("direct", "two-stage", "two-stage-as-printed")
_FIRST_DEG = {AIRCRAFT: (-90.0, 90.0), INCLINOMETER: (0.0, 180.0)}
"""All of pitch, all of zenith."""
_RAD_PER_ARCSEC = np.pi / 180.0 / 3600.0


class TableGrid:
    """Positions of a table, for one unit or for a series.

    A series shares one inverse::

        grid = triaxcal.TableGrid("aircraft", angles_deg)
        series = grid.serial(quadratic=True)          # inverts once
        for readings in series_of_units:
            constants = series.fit(readings)          # one product of matrices
            force = constants.force_g(more_readings)

    Parameters
    ----------
    kind : str
        "aircraft": pitch, roll. "inclinometer": zenith, tool face.
    angles_deg : array, shape (n, 2)
    gravity_m_per_s2 : float
    orthogonality_arcsec : float
        By how much the angle between the table's axes is off 90 deg, where it is known.

    Raises
    ------
    RefusedError
        When the kind is unknown, or the angles are not n rows of two numbers.
    """

    def __init__(
        self,
        kind: str,
        angles_deg: Any,
        gravity_m_per_s2: float = STANDARD_GRAVITY_M_PER_S2,
        orthogonality_arcsec: float = 0.0,
    ) -> None:
        self._kind = _known_kind(kind)
        self._angles = np.radians(_rows("angles_deg", angles_deg, 2))
        self._gravity_g = gravity_m_per_s2 / STANDARD_GRAVITY_M_PER_S2
        off = orthogonality_arcsec * _RAD_PER_ARCSEC
        self._force: FloatArray = self._gravity_g * stand_direction(kind, self._angles, off)

    @property
    def force_g(self) -> FloatArray:
        """Specific force in each position, (n, 3), in g."""
        return self._force

    def serial(self, *, quadratic: bool = False, centred: bool = False) -> SerialGrid:
        """The forward form, its design inverted once; `centred` in the form of one order less."""
        return SerialGrid.of(self._force, quadratic=quadratic, centred=centred)

    def fit(self, readings: Any, *, quadratic: bool = False, form: str = FORMS[0]) -> OrientedFit:
        """The inverse form, force as a function of the readings (n, 3).

        Parameters
        ----------
        form : str
            Of the quadratic function: "direct" solves for all unknowns at once. "two-stage" fits
            the linear part first and then the products, freed of what the linear part has of them:
            the same result. "two-stage-as-printed" does not free them.

        Raises
        ------
        RefusedError
            When the readings are not as many rows of three numbers, or the form is unknown.
        """
        values = self._readings(readings)
        if form not in FORMS:
            raise RefusedError("form", f'"{form}"', expected=" or ".join(FORMS))
        if not quadratic:
            return inverse_linear(values, self._force)
        if form == FORMS[0]:
            return inverse_quadratic(values, self._force)
        return inverse_two_stage(values, self._force, as_printed=form == FORMS[2])

    def angles_deg(self, force_g: Any) -> FloatArray:
        """The two angles that a force shows, (n, 2), in degrees."""
        return np.degrees(angles_from_force(self._kind, _rows("force_g", force_g, 3)))

    def orthogonality(self, readings: Any) -> StandAxes:
        """By how much the angle between the table's axes is off 90 deg, with the linear constants.

        It looks like two products of the accelerations: with quadratic terms it cannot be told
        apart well.
        """
        return stand_axes(self._kind, self._angles, self._readings(readings), self._gravity_g)

    def hysteresis(self, rising: Any, falling: Any, swept: str) -> Hysteresis:
        """Hysteresis from readings at the same positions, reached from below and from above.

        `swept` names the angle that was turned. A turn in one direction alone does not show it.
        """
        names = ANGLE_NAMES[self._kind][:2]
        if swept not in names:
            raise RefusedError("swept", f'"{swept}"', expected=" or ".join(names))
        return hysteresis(
            self._kind,
            self._angles,
            names.index(swept),
            self._readings(rising),
            self._readings(falling),
        )

    def _readings(self, readings: Any) -> FloatArray:
        values = _rows("readings", readings, 3)
        if len(values) != len(self._angles):
            raise RefusedError(
                "readings", f"{len(values)} rows", expected=f"{len(self._angles)}, one a position"
            )
        return values


def study_angle_errors(
    kind: str,
    swept: str,
    fixed_deg: float,
    *,
    offset_g: Any = (0.0, 0.0, 0.0),
    scale: Any = (0.0, 0.0, 0.0),
    misalignment_rad: Any = ((0.0,) * 3,) * 3,
) -> Study[AngleErrors]:
    """Errors of the force and of the two angles while one angle turns, and their sensitivities.

    Parameters
    ----------
    kind : str
        "aircraft" or "inclinometer".
    swept : str
        "pitch" (-90 to 90 deg) or "roll" (-180 to 180); "zenith" (0 to 180) or "tool_face".
    fixed_deg : float
        The other angle.
    offset_g, scale : arrays, shape (3,)
        Errors of the bias, and relative errors of the scale, of the three outputs.
    misalignment_rad : array, shape (3, 3)
        e_ij: what output i gains by the acceleration along j; the diagonal is not used.

    Raises
    ------
    RefusedError
        When a name is unknown or an array has another shape.
    """
    names = ANGLE_NAMES[_known_kind(kind)][:2]
    if swept not in names:
        raise RefusedError("swept", f'"{swept}"', expected=" or ".join(names))
    at = names.index(swept)
    low, high = (
        ((-90.0, 90.0) if kind == AIRCRAFT else (0.0, 180.0)) if at == 0 else (-180.0, 180.0)
    )
    angles = np.full((361, 2), fixed_deg)
    angles[:, at] = np.linspace(low, high, 361)
    e = _rows("misalignment_rad", misalignment_rad, 3)
    parts = [np.asarray(value, dtype=np.float64) for value in (offset_g, scale)]
    if any(part.shape != (3,) for part in parts) or e.shape != (3, 3):
        raise RefusedError(
            "offset_g, scale, misalignment_rad", "other shapes", expected="3, 3, 3 x 3"
        )
    off = e - np.diag(np.diag(e))
    found = angle_errors(kind, np.radians(angles), parts[0], parts[1], off)
    return Study(
        found,
        angle_errors_text(found, names),
        lambda: angle_errors_picture(found, names, at),
    )


def _known_kind(kind: str) -> str:
    if kind not in {AIRCRAFT, INCLINOMETER}:
        raise RefusedError("kind", f'"{kind}"', expected=f'"{AIRCRAFT}" or "{INCLINOMETER}"')
    return kind


def _rows(name: str, values: Any, width: int) -> FloatArray:
    try:
        found = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise RefusedError(name, str(error), expected=f"rows of {width} numbers") from error
    if found.ndim != 2 or found.shape[1] != width or not np.isfinite(found).all():
        raise RefusedError(
            name, f"an array of shape {found.shape}", expected=f"rows of {width} finite numbers"
        )
    return found
