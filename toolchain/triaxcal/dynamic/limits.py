"""[limits] of the unit.toml of an IMU: what a user demands of its constants and of their test."""

from __future__ import annotations

from dataclasses import dataclass, fields

from triaxcal.base.keys import TableKeys, setting
from triaxcal.base.kinds import number
from triaxcal.dynamic.layout import Layout

_NONE = "no demand"


@dataclass(frozen=True, kw_only=True)
class ImuLimits:
    """[limits]: what is demanded of an IMU. What contradicts itself is refused in any case.

    Attributes
    ----------
    gyro_drift_sd_deg_per_h
        Largest standard deviation of a gyro drift.
    gyro_scale_sd_ppm
        Of a scale factor of a gyro.
    gyro_misalignment_sd_arcsec
        Of a misalignment of a gyro.
    g_drift_sd_deg_per_h_per_g
        Of a gyro drift in proportion to the specific force, where "g-drift" is on.
    accel_bias_sd_mm_per_s2
        Of an accelerometer bias.
    accel_scale_sd_ppm
        Of a scale factor of an accelerometer.
    accel_misalignment_sd_arcsec
        Of a misalignment of an accelerometer.
    held_out_g
        Largest | |a| - g | at the held-out rests.
    closure_deg
        Largest angle by which a held-out turn misses: where the gyros say that up is after it,
        against the accelerometers.
    """

    gyro_drift_sd_deg_per_h: float | None = setting(
        number(1e-6, 1e6), None, "deg/h", words=_NONE, example="5"
    )
    gyro_scale_sd_ppm: float | None = setting(
        number(1e-4, 1e6), None, "ppm", words=_NONE, example="100"
    )
    gyro_misalignment_sd_arcsec: float | None = setting(
        number(1e-4, 1e6), None, "arcsec", words=_NONE, example="30"
    )
    g_drift_sd_deg_per_h_per_g: float | None = setting(
        number(1e-6, 1e6), None, "deg/h/g", words=_NONE, example="5"
    )
    accel_bias_sd_mm_per_s2: float | None = setting(
        number(1e-6, 1e6), None, "mm/s^2", words=_NONE, example="1"
    )
    accel_scale_sd_ppm: float | None = setting(
        number(1e-4, 1e6), None, "ppm", words=_NONE, example="100"
    )
    accel_misalignment_sd_arcsec: float | None = setting(
        number(1e-4, 1e6), None, "arcsec", words=_NONE, example="30"
    )
    held_out_g: float | None = setting(number(1e-9, 1.0), None, "g", words=_NONE, example="0.001")
    closure_deg: float | None = setting(number(1e-9, 90.0), None, "deg", words=_NONE, example="0.1")


IMU_LIMITS = TableKeys.of(ImuLimits, optional=True)


@dataclass(frozen=True)
class SdDemand:
    """A key of [limits] for standard deviations: of the states of a block that have a unit."""

    key: str
    words: str
    block: str
    unit: str


SD_DEMANDS = (
    SdDemand("gyro_drift_sd_deg_per_h", "gyro drift", "gyro-bias", "deg/h"),
    SdDemand("gyro_scale_sd_ppm", "gyro scale factor", "gyro-matrix", "ppm"),
    SdDemand("gyro_misalignment_sd_arcsec", "gyro misalignment", "gyro-matrix", "arcsec"),
    SdDemand("g_drift_sd_deg_per_h_per_g", "g-drift", "g-drift", "deg/h/g"),
    SdDemand("accel_bias_sd_mm_per_s2", "accelerometer bias", "accelerometer-bias", "mm/s^2"),
    SdDemand("accel_scale_sd_ppm", "accelerometer scale factor", "accelerometer-matrix", "ppm"),
    SdDemand(
        "accel_misalignment_sd_arcsec", "accelerometer misalignment", "accelerometer-matrix",
        "arcsec",
    ),
)  # fmt: skip


def places_of(demand: SdDemand, layout: Layout) -> list[int]:
    """Places of the states that a demand is about; none where their block is off."""
    if demand.block not in layout:
        return []
    place, states = layout.place(demand.block), layout.states
    return [i for i in range(place.start, place.stop) if states[i].unit == demand.unit]


def demanded(limits: ImuLimits, layout: Layout) -> tuple[tuple[SdDemand, float, list[int]], ...]:
    """Demands of standard deviations that are stated: limit, and the places of their states.

    A block that is off has no states.
    """
    found = []
    for demand in SD_DEMANDS:
        limit = getattr(limits, demand.key)
        index = places_of(demand, layout)
        if limit is not None and index:
            found.append((demand, float(limit), index))
    return tuple(found)


def stated(limits: ImuLimits) -> bool:
    """Whether anything is demanded."""
    return any(getattr(limits, f.name) is not None for f in fields(limits))
