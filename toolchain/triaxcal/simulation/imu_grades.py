"""Grades of simulated IMUs, and units drawn from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from triaxcal.dynamic.recording import INCREMENT, INSTANT
from triaxcal.model.types import FloatArray
from triaxcal.simulation.imu_truth import Curved, ImuNoise, ImuTruth, SecondTriad


@dataclass(frozen=True)
class Grade:
    """A class of units: how far its constants lie from nominal (one sigma), and its noise.

    Attributes
    ----------
    name : str
    noise : ImuNoise
    convention : str
        Of both triads, as in `triaxcal.dynamic.recording`.
    sd : mapping
        Standard deviations by name: attributes of `ImuTruth`, and with "second_" before them those
        of `SecondTriad`.
    """

    name: str
    noise: ImuNoise
    convention: str
    sd: Mapping[str, float]


_SD = {
    "gyro_bias_deg_per_h": (0.1, 500.0),
    "gyro_scale_ppm": (50.0, 3000.0),
    "gyro_misalignment_arcsec": (60.0, 600.0),
    "accel_bias_mm_per_s2": (5.0, 30.0),
    "accel_scale_ppm": (200.0, 3000.0),
    "accel_misalignment_arcsec": (60.0, 600.0),
    "gyro_g_deg_per_h_per_g": (0.05, 50.0),
    "accel_delay_ms": (1.0, 5.0),
    "accel_position_mm": (20.0, 10.0),
    "mount_elasticity_arcsec_per_g": (15.0, 120.0),
    "gyro_elasticity_arcsec_per_g": (1.5, 30.0),
    "accel_bias_mm_per_s2_per_k": (0.1, 1.0),
    "accel_scale_ppm_per_k": (10.0, 50.0),
    "gyro_bias_deg_per_h_per_k": (0.005, 10.0),
    "gyro_scale_ppm_per_k": (1.0, 50.0),
    "curved_accel_bias_mm_per_s2": (2.0, 20.0),
    "curved_gyro_bias_deg_per_h": (0.2, 300.0),
    "curved_accel_ppm": (300.0, 1500.0),
    "curved_gyro_ppm": (30.0, 1500.0),
    "second_bias_mm_per_s2": (10.0, 50.0),
    "second_scale_ppm": (500.0, 5000.0),
}
"""Standard deviations of both grades."""
AVIATION = Grade(
    # Ring laser gyros that count fringes, quartz accelerometers behind a charge-balance counter.
    name="aviation",
    noise=ImuNoise(
        gyro_arw_deg_per_sqrt_h=0.002,
        accel_vrw_ug_per_sqrt_hz=10.0,
        gyro_lsb=0.1,
        accel_lsb=0.01,
        temp_sd_degc=0.01,
        table_sd_arcsec=1.0,
    ),
    convention=INCREMENT,
    sd={name: pair[0] for name, pair in _SD.items()},
)
MEMS = Grade(
    # A tactical-to-industrial part with instantaneous readings over a digital bus.
    name="mems",
    noise=ImuNoise(
        gyro_arw_deg_per_sqrt_h=0.3,
        accel_vrw_ug_per_sqrt_hz=100.0,
        gyro_lsb=3.6,
        accel_lsb=10.0,
        temp_sd_degc=0.05,
        table_sd_arcsec=60.0,
    ),
    convention=INSTANT,
    sd={name: pair[1] for name, pair in _SD.items()},
)
GRADES = {grade.name: grade for grade in (AVIATION, MEMS)}

EFFECTS: dict[str, tuple[str, ...]] = {
    "g-drift": ("gyro_g_deg_per_h_per_g",),
    "delay": ("accel_delay_ms",),
    "accel-positions": ("accel_position_mm",),
    "mount-elasticity": ("mount_elasticity_arcsec_per_g",),
    "gyro-elasticity": ("gyro_elasticity_arcsec_per_g",),
    "second-triad": ("second",),
    "accel-temperature": ("accel_bias_mm_per_s2_per_k", "accel_scale_ppm_per_k"),
    "gyro-temperature": ("gyro_bias_deg_per_h_per_k", "gyro_scale_ppm_per_k"),
    "cubic-temperature": ("curved",),
}
"""Effects of the unit beyond the base model, and the attributes of `ImuTruth` that hold them."""

_BASE = (
    "gyro_bias_deg_per_h",
    "gyro_scale_ppm",
    "gyro_misalignment_arcsec",
    "accel_bias_mm_per_s2",
    "accel_scale_ppm",
    "accel_misalignment_arcsec",
)


def draw_truth(grade: Grade, seed: int, effects: tuple[str, ...] = ()) -> ImuTruth:
    """A unit of a grade: every constant drawn from its normal distribution.

    `effects` are keys of `EFFECTS`; what is left out is absent. Each attribute has a generator of
    its own, so that an effect switched on changes no other constant.
    """
    wanted = [*_BASE, *(name for effect in effects for name in EFFECTS[effect])]
    drawn = {name: _drawn(grade, name, seed) for name in wanted}
    return ImuTruth(
        **drawn,
        noise=grade.noise,
        rate_convention=grade.convention,
        force_convention=grade.convention,
    )


def _drawn(grade: Grade, name: str, seed: int) -> Any:
    names = list(ImuTruth.__dataclass_fields__)
    rng = np.random.Generator(np.random.PCG64([seed, names.index(name)]))
    sd = grade.sd
    if name == "second":
        return SecondTriad(
            bias_mm_per_s2=_tuple(sd["second_bias_mm_per_s2"] * rng.standard_normal(3)),
            scale_ppm=_tuple(sd["second_scale_ppm"] * rng.standard_normal(3)),
            misalignment_arcsec=_tuple(sd["gyro_misalignment_arcsec"] * rng.standard_normal(6)),
            delay_ms=sd["accel_delay_ms"] * float(rng.standard_normal()),
        )
    if name == "curved":
        return _curved(sd, rng)
    shape = np.shape(getattr(ImuTruth(), name))
    values = sd[name] * rng.standard_normal(shape)
    if name == "accel_position_mm":
        values[0] = 0.0
    return _tuple(values)


_POWERS = np.array([[1.0], [0.5], [0.25]])
"""Deviations of the coefficients of x, x^2 and x^3, of those in the grade."""
_TURNS = 0.2
"""Deviations of the elements beside the diagonal, of those on it."""


def _curved(sd: Mapping[str, float], rng: np.random.Generator) -> Curved:
    matrix = _POWERS * np.where(np.eye(3).ravel() > 0, 1.0, _TURNS)
    lower = np.tril(np.ones((3, 3))).ravel()
    return Curved(
        _tuple(sd["curved_accel_bias_mm_per_s2"] * _POWERS * rng.standard_normal((3, 3))),
        _tuple(sd["curved_gyro_bias_deg_per_h"] * _POWERS * rng.standard_normal((3, 3))),
        _tuple(sd["curved_accel_ppm"] * lower * matrix * rng.standard_normal((3, 9))),
        _tuple(sd["curved_gyro_ppm"] * matrix * rng.standard_normal((3, 9))),
    )


def _tuple(values: FloatArray) -> Any:  # nested tuples of floats, or one float; shape known above
    if np.ndim(values) == 0:
        return float(values)
    return tuple(_tuple(value) for value in values)
