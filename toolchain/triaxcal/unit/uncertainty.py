"""[uncertainty] of unit.toml: standard uncertainties that the user knows."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, setting
from triaxcal.base.kinds import number

_TILT = number(0.0, 36000.0)


@dataclass(frozen=True)
class StatedUncertainty:
    """[uncertainty]: standard uncertainties that you know.

    None where none is stated.

    Attributes
    ----------
    squareness_arcsec
        Of each test position's tilt about each axis, the same at all temperatures.
    repeatability_arcsec
        Of the tilt of each single dwell about each axis.
    level_arcsec
        Of the tilter as a whole against the unit's axes, about each axis.
    gravity_m_per_s2
        Of local gravity.
    thermometer_degc
        Of the unit's thermometer, the same at calibration and in use.
    thermometer_drift_degc
        Of the thermometer's change between calibration and use.
    """

    squareness_arcsec: float | None = setting(
        _TILT, None, "arcsec", words="from the residuals", example="10"
    )
    repeatability_arcsec: float | None = setting(
        _TILT, None, "arcsec", words="from the residuals", example="5"
    )
    level_arcsec: float | None = setting(_TILT, None, "arcsec", words="20, assumed", example="20")
    gravity_m_per_s2: float | None = setting(
        number(0.0, 0.1), None, "m/s^2", words="5e-5, assumed", example="5e-5"
    )
    thermometer_degc: float | None = setting(
        number(0.0, 10.0), None, "degC", words="0.1, assumed", example="0.1"
    )
    thermometer_drift_degc: float | None = setting(
        number(0.0, 10.0), None, "degC", words="0.02, assumed", example="0.02"
    )


UNCERTAINTY = TableKeys.of(StatedUncertainty)
