"""[site] of unit.toml: where the unit is measured."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, setting
from triaxcal.base.kinds import number

STANDARD_GRAVITY_M_PER_S2 = 9.80665
EARTH_RATE_DEG_PER_H = 15.04


@dataclass(frozen=True)
class Site:
    """[site]: where the unit is measured.

    Attributes
    ----------
    local_gravity_m_per_s2
        Gravity at the place of the measurements; g is this / 9.80665.
    """

    local_gravity_m_per_s2: float = setting(number(9.7, 9.9), unit="m/s^2", example="9.8111")


@dataclass(frozen=True)
class PlacedSite(Site):
    """[site]: where the unit is measured.

    Attributes
    ----------
    latitude_deg
        Of the place, north positive: checks local_gravity_m_per_s2.
    height_m
        Of the place above sea level, with latitude_deg.
    """

    latitude_deg: float | None = setting(
        number(-90.0, 90.0), None, "deg", words="not checked", example="50.45"
    )
    height_m: float | None = setting(
        number(-500.0, 9000.0), None, "m", words="any height", example="180"
    )


@dataclass(frozen=True)
class _OnEarth:
    """Where the earth's rotation counts.

    Attributes
    ----------
    latitude_deg
        Of the place, north positive.
    """

    latitude_deg: float = setting(number(-90.0, 90.0), unit="deg", example="50.45")


@dataclass(frozen=True)
class TurningSite(Site, _OnEarth):
    """[site]: where the unit is turned."""


SITE, TURNING_SITE = TableKeys.of(PlacedSite), TableKeys.of(TurningSite)
