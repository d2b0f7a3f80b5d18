"""Normal gravity of latitude and height, against the local gravity that unit.toml states.

WGS 84 (NIMA TR8350.2, third edition, 2000): on the ellipsoid Somigliana's formula (4-1), above it
the series (4-3). The earth differs from it by its anomalies: some 0.3 mm/s^2 rms, 1 mm/s^2 seldom,
7 mm/s^2 on the highest volcanoes. Sea level differs from the ellipsoid by 100 m at most, which is
0.3 mm/s^2.
"""

from __future__ import annotations

import math

from triaxcal.base.errors import RefusedError
from triaxcal.unit.site import PlacedSite

ANOMALY_M_PER_S2 = 1e-3
"""A larger difference is reported."""
LARGEST_ANOMALY_M_PER_S2 = 7e-3
"""A larger difference is refused: it is found nowhere."""
_HEIGHTS_M = (-500.0, 9000.0)
_EQUATOR, _SOMIGLIANA, _ECCENTRICITY2 = 9.7803253359, 1.93185265241e-3, 6.69437999013e-3
_RADIUS_M, _FLATTENING, _M = 6378137.0, 1.0 / 298.257223563, 3.449786506841e-3


def normal_gravity_m_per_s2(latitude_deg: float, height_m: float) -> float:
    """Gravity of the ellipsoid WGS 84 at a latitude and a height above it."""
    s2 = math.sin(math.radians(latitude_deg)) ** 2
    surface = _EQUATOR * (1.0 + _SOMIGLIANA * s2) / math.sqrt(1.0 - _ECCENTRICITY2 * s2)
    first = 2.0 / _RADIUS_M * (1.0 + _FLATTENING + _M - 2.0 * _FLATTENING * s2)
    return surface * (1.0 - first * height_m + 3.0 / _RADIUS_M**2 * height_m**2)


def gravity_difference_m_per_s2(site: PlacedSite) -> float | None:
    """Stated less normal gravity; without a height the nearest of any. None without a latitude."""
    if site.latitude_deg is None:
        return None
    heights = _HEIGHTS_M if site.height_m is None else (site.height_m, site.height_m)
    high, low = (normal_gravity_m_per_s2(site.latitude_deg, h) for h in heights)
    stated = site.local_gravity_m_per_s2
    return stated - min(max(stated, low), high)


def refuse_wrong_gravity(site: PlacedSite, where: str) -> None:
    """Refuse a local gravity that the place cannot have; `where` is the file.

    Raises
    ------
    RefusedError
        With the normal gravity of the place.
    """
    difference = gravity_difference_m_per_s2(site)
    if difference is None or abs(difference) <= LARGEST_ANOMALY_M_PER_S2:
        return
    at = f"latitude {site.latitude_deg:g} deg"
    at += " at any height" if site.height_m is None else f", height {site.height_m:g} m"
    normal = site.local_gravity_m_per_s2 - difference
    raise RefusedError(
        f"{where}, [site] local_gravity_m_per_s2",
        f"{site.local_gravity_m_per_s2:g} m/s^2, {abs(difference):.4f} m/s^2 from what {at} has",
        expected=f"{normal:.4f} m/s^2 within {LARGEST_ANOMALY_M_PER_S2:g} (WGS 84 and the largest "
        "anomalies)",
        remedy="correct local gravity, or the place",
    )


def gravity_notes(difference: float | None) -> tuple[str, ...]:
    """A difference that is possible, and seldom."""
    if difference is None or abs(difference) <= ANOMALY_M_PER_S2:
        return ()
    words = (
        f"local gravity is {difference:+.4f} m/s^2 from the normal gravity of its place, "
        f"{abs(difference) / 9.80665e-3:.2g} mg at 1 g; anomalies of this size are seldom: check it"
    )
    return (words,)
