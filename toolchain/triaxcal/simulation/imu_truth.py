"""What a simulated IMU truly is: every effect of P2 (1)-(2), (13)-(24) in the units of data sheets.

Signs and conventions, each of them physics and none of them a filter's:

- readings = truth + bias + matrix * truth; instrument axis 1 is accelerometer 1's sensitive axis,
  axis 3 is normal to those of accelerometers 1 and 2: the accelerometer matrix has no 12, 13, 23;
- origin M of the instrument axes is accelerometer 1's proof mass, where the gyros feel g as well;
- a positive delay: a triad's sample stamped t is the force at t - delay;
- an angle turns the axes right-handed: mounting elasticity turns the unit against its mounting by
  D f/g; gyro i, seen along its own axes (i, next, next but one), turns about its own second and
  third axis by kappa_12 f1 + kappa_22 f2 + kappa_32 f3 and kappa_13 f1 + kappa_23 f2 + kappa_33 f3,
  with f1..f3 along the gyro's own axes in g. This is (20) of P2, whose rows are then one another's
  cyclic images;
- g in these is the local one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.dynamic.recording import INCREMENT
from triaxcal.model.types import FloatArray

DEG_PER_H = math.radians(1.0) / 3600.0
ARCSEC = math.radians(1.0) / 3600.0
PPM = 1e-6
MICRO_G = 9.80665e-6  # of the standard g, as data sheets mean it

_OFF_DIAGONAL = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
_LOWER = ((1, 0), (2, 0), (2, 1))

Three = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
_NONE3: Three = (0.0, 0.0, 0.0)
_NONE6: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_NONE33 = (_NONE3, _NONE3, _NONE3)


@dataclass(frozen=True)
class ImuNoise:
    """What is random in the readings.

    Attributes
    ----------
    gyro_arw_deg_per_sqrt_h, accel_vrw_ug_per_sqrt_hz : float
        White noise, by the Allan rule: a mean over t seconds has the standard deviation N/sqrt(t).
        (A one-sided spectral density is sqrt(2) times this N.)
    gyro_walk_deg_per_h_per_sqrt_h, accel_walk_ug_per_sqrt_h : float
        Random walk of the biases.
    gyro_lsb, accel_lsb : float
        One count: arcsec and mm/s of the accumulated sum for increments, deg/h and micro-g for
        instants. Zero: no quantisation.
    temp_sd_degc, table_sd_arcsec : float
        One reading of the thermometer and of the table's angle.
    """

    gyro_arw_deg_per_sqrt_h: float = 0.0
    accel_vrw_ug_per_sqrt_hz: float = 0.0
    gyro_walk_deg_per_h_per_sqrt_h: float = 0.0
    accel_walk_ug_per_sqrt_h: float = 0.0
    gyro_lsb: float = 0.0
    accel_lsb: float = 0.0
    temp_sd_degc: float = 0.0
    table_sd_arcsec: float = 0.0


@dataclass(frozen=True)
class SecondTriad:
    """Second accelerometer triad, P2 (21): a full matrix, since the first defines the axes.

    Attributes
    ----------
    bias_mm_per_s2, scale_ppm : three floats
    misalignment_arcsec : six floats
        12, 13, 21, 23, 31, 32.
    position_mm : three triples
        Of each proof mass from M, on the instrument axes.
    delay_ms : float
        How much it lags behind the gyros: its electronics are its own.
    """

    bias_mm_per_s2: Three = _NONE3
    scale_ppm: Three = _NONE3
    misalignment_arcsec: Six = _NONE6
    position_mm: tuple[Three, Three, Three] = _NONE33
    delay_ms: float = 0.0

    def matrix(self) -> FloatArray:
        """Gamma of (21), shape (3, 3), rows the accelerometers 4 to 6."""
        return _matrix(self.scale_ppm, self.misalignment_arcsec, _OFF_DIAGONAL)


Nine = tuple[float, float, float, float, float, float, float, float, float]
SPAN_K = 60.0


@dataclass(frozen=True)
class Curved:
    """How the constants follow the temperature besides (23), (24).

    A constant gains c_1 x + c_2 x^2 + c_3 x^3, x the temperature above the reference over `SPAN_K`.

    Attributes
    ----------
    accel_bias_mm_per_s2, gyro_bias_deg_per_h : three triples
        c_1, c_2, c_3 of each axis.
    accel_matrix_ppm, gyro_matrix_ppm : three tuples of nine
        c_1, c_2, c_3 of the elements 11, 12, 13, 21, ... of Gamma and Theta.
    """

    accel_bias_mm_per_s2: tuple[Three, Three, Three]
    gyro_bias_deg_per_h: tuple[Three, Three, Three]
    accel_matrix_ppm: tuple[Nine, Nine, Nine]
    gyro_matrix_ppm: tuple[Nine, Nine, Nine]

    def accel(self, warmer_k: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Change of bias (3, n), m/s^2, and of Gamma (3, 3, n), at n temperatures."""
        return _powers(self.accel_bias_mm_per_s2, self.accel_matrix_ppm, 1e-3, warmer_k)

    def gyro(self, warmer_k: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Change of bias (3, n), rad/s, and of Theta (3, 3, n), at n temperatures."""
        return _powers(self.gyro_bias_deg_per_h, self.gyro_matrix_ppm, DEG_PER_H, warmer_k)


def _powers(
    bias: tuple[Three, Three, Three],
    matrix: tuple[Nine, Nine, Nine],
    unit: float,
    warmer_k: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    x = (warmer_k / SPAN_K) ** np.arange(1, 4)[:, None]
    change = PPM * np.array(matrix).T @ x
    return unit * np.array(bias).T @ x, change.reshape(3, 3, -1)


@dataclass(frozen=True)
class ImuTruth:
    """Exact properties of a simulated IMU; what is not stated is absent.

    Attributes
    ----------
    gyro_bias_deg_per_h, accel_bias_mm_per_s2 : three floats
        nu0 and df0 of P2 (1)-(2), at the reference temperature.
    gyro_scale_ppm, accel_scale_ppm : three floats
        Diagonals of Theta and Gamma, at the reference temperature.
    gyro_misalignment_arcsec : six floats
        Theta 12, 13, 21, 23, 31, 32.
    accel_misalignment_arcsec : three floats
        Gamma 21, 31, 32.
    gyro_g_deg_per_h_per_g : three triples
        Rows of (13).
    accel_delay_ms : float
        (14): how much the first triad lags behind the gyros.
    accel_position_mm : three triples
        Of each proof mass from M, on the instrument axes; the first is zero by definition of M.
    mount_elasticity_arcsec_per_g : six floats
        (19): d 12, 13, 21, 23, 31, 32.
    gyro_elasticity_arcsec_per_g : six floats
        (20): kappa 12, 13, 22, 23, 32, 33.
    second : SecondTriad, or None
    accel_bias_mm_per_s2_per_k, accel_scale_ppm_per_k : three floats
        (23).
    gyro_bias_deg_per_h_per_k, gyro_scale_ppm_per_k : three floats
        (24).
    reference_degc : float
        Where the constants above hold.
    noise : ImuNoise
    rate_convention, force_convention : str
        As in `triaxcal.dynamic.recording`.
    curved : Curved, or None
        Further change with temperature.
    gyro_asymmetry_ppm, gyro_even_ppm_per_deg_s, gyro_odd_ppm_per_deg_s : three floats
        What a gyro reads too much along its own rate w: e |w|, q w^2, o |w| w.
    gyro_cubic_ppm_per_deg2_s2 : three floats
        c w^3.
    accel_asymmetry_ppm : three floats
        What an accelerometer reads too much along its own force f: e |f|.
    accel_square_mm_per_s2_per_g2, accel_cubic_mm_per_s2_per_g3 : three floats
        Of the force in g.
    """

    gyro_bias_deg_per_h: Three = _NONE3
    gyro_scale_ppm: Three = _NONE3
    gyro_misalignment_arcsec: Six = _NONE6
    accel_bias_mm_per_s2: Three = _NONE3
    accel_scale_ppm: Three = _NONE3
    accel_misalignment_arcsec: Three = _NONE3
    gyro_g_deg_per_h_per_g: tuple[Three, Three, Three] = _NONE33
    accel_delay_ms: float = 0.0
    accel_position_mm: tuple[Three, Three, Three] = _NONE33
    mount_elasticity_arcsec_per_g: Six = _NONE6
    gyro_elasticity_arcsec_per_g: Six = _NONE6
    second: SecondTriad | None = None
    accel_bias_mm_per_s2_per_k: Three = _NONE3
    accel_scale_ppm_per_k: Three = _NONE3
    gyro_bias_deg_per_h_per_k: Three = _NONE3
    gyro_scale_ppm_per_k: Three = _NONE3
    reference_degc: float = 20.0
    noise: ImuNoise = ImuNoise()
    rate_convention: str = INCREMENT
    force_convention: str = INCREMENT
    curved: Curved | None = None
    gyro_asymmetry_ppm: Three = _NONE3
    gyro_even_ppm_per_deg_s: Three = _NONE3
    gyro_odd_ppm_per_deg_s: Three = _NONE3
    gyro_cubic_ppm_per_deg2_s2: Three = _NONE3
    accel_asymmetry_ppm: Three = _NONE3
    accel_square_mm_per_s2_per_g2: Three = _NONE3
    accel_cubic_mm_per_s2_per_g3: Three = _NONE3

    def gyro_matrix(self) -> FloatArray:
        """Theta of (2), shape (3, 3)."""
        return _matrix(self.gyro_scale_ppm, self.gyro_misalignment_arcsec, _OFF_DIAGONAL)

    def accel_matrix(self) -> FloatArray:
        """Gamma of (1), shape (3, 3), lower triangular."""
        return _matrix(self.accel_scale_ppm, self.accel_misalignment_arcsec, _LOWER)

    def mount_elasticity_rad(self) -> FloatArray:
        """D of (19), shape (3, 3), zero diagonal, rad/g."""
        return _matrix(_NONE3, self.mount_elasticity_arcsec_per_g, _OFF_DIAGONAL)

    def gyro_elasticity_rad(self) -> FloatArray:
        """kappa_ij of (20), shape (3, 2): row the gyro's own force axis, column its axis 2 or 3."""
        return ARCSEC * np.array(self.gyro_elasticity_arcsec_per_g).reshape(3, 2)


def _matrix(
    scale_ppm: Three, arcsec: tuple[float, ...], places: tuple[tuple[int, int], ...]
) -> FloatArray:
    matrix = PPM * np.diag(scale_ppm)
    for place, angle in zip(places, arcsec, strict=True):
        matrix[place] = ARCSEC * angle
    return matrix
