"""The judge of the filter: what its states truly are in a simulated unit, and how far it is off."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.noise import DataSheet
from triaxcal.model.types import FloatArray
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_motion import ImuMotion
from triaxcal.simulation.imu_truth import ARCSEC, DEG_PER_H, PPM, ImuNoise, ImuTruth

MM = 1e-3
DEG = np.pi / 180
PAIRS = ((1, 2), (1, 3), (2, 1), (2, 3), (3, 1), (3, 2))


def true_constants(truth: ImuTruth) -> dict[str, float]:
    """Every constant of P2 by its name; zero where the unit does not have the effect."""
    true: dict[str, float] = {}
    gamma, theta = truth.accel_matrix(), truth.gyro_matrix()
    for i in range(3):
        axis = i + 1
        true[f"df0_{axis}"] = MM * truth.accel_bias_mm_per_s2[i]
        true[f"nu0_{axis}"] = DEG_PER_H * truth.gyro_bias_deg_per_h[i]
        true[f"kdf{axis}"] = MM * truth.accel_bias_mm_per_s2_per_k[i]
        true[f"KGamma{axis}{axis}"] = PPM * truth.accel_scale_ppm_per_k[i]
        true[f"knu{axis}"] = DEG_PER_H * truth.gyro_bias_deg_per_h_per_k[i]
        true[f"aw{axis}"] = PPM * truth.gyro_asymmetry_ppm[i]
        true[f"qw{axis}"] = PPM / DEG * truth.gyro_even_ppm_per_deg_s[i]
        true[f"ow{axis}"] = PPM / DEG * truth.gyro_odd_ppm_per_deg_s[i]
        true[f"cw{axis}"] = PPM / DEG**2 * truth.gyro_cubic_ppm_per_deg2_s2[i]
        true[f"af{axis}"] = PPM * truth.accel_asymmetry_ppm[i]
        true[f"qf{axis}"] = MM * truth.accel_square_mm_per_s2_per_g2[i]
        true[f"cf{axis}"] = MM * truth.accel_cubic_mm_per_s2_per_g3[i]
        true[f"KTheta{axis}{axis}"] = PPM * truth.gyro_scale_ppm_per_k[i]
        for j in range(3):
            true[f"Gamma{axis}{j + 1}"] = float(gamma[i, j])
            true[f"Theta{axis}{j + 1}"] = float(theta[i, j])
            true[f"D{axis}{j + 1}"] = DEG_PER_H * truth.gyro_g_deg_per_h_per_g[i][j]
            true[f"rho{axis}_{j + 1}"] = MM * truth.accel_position_mm[i][j]
    for (i, j), value in zip(PAIRS, truth.mount_elasticity_arcsec_per_g, strict=True):
        true[f"d{i}{j}"] = ARCSEC * value
    places = ((1, 2), (1, 3), (2, 2), (2, 3), (3, 2), (3, 3))
    for (i, j), value in zip(places, truth.gyro_elasticity_arcsec_per_g, strict=True):
        true[f"K{i}{j}"] = ARCSEC * value
    true["tau"] = 1e-3 * truth.accel_delay_ms
    second = truth.second
    if second is not None:
        true["tau2"] = 1e-3 * second.delay_ms
        for i in range(3):
            true[f"df0_{i + 4}"] = MM * second.bias_mm_per_s2[i]
            for j in range(3):
                true[f"Gamma{i + 4}{j + 1}"] = float(second.matrix()[i, j])
    return true


@dataclass(frozen=True)
class Verdict:
    """Errors of a calibration against the truth, SI, of the states that the truth knows.

    Attributes
    ----------
    names : tuple of str
    error, sd : arrays, shape (n,)
    z : array, shape (n,)
        Error over standard deviation.
    nees : float
        Error weighted with the inverse of its covariance: chi-square with n degrees of freedom.
    chi_square_z : float
        Normalised innovations of the last pass: their sum of squares less its expectation, in its
        own standard deviations.
    result : DynamicResult
    """

    names: tuple[str, ...]
    error: FloatArray
    sd: FloatArray
    z: FloatArray
    nees: float
    chi_square_z: float
    result: DynamicResult

    def of(self, start: str) -> FloatArray:
        """z of the states whose names begin so."""
        return self.z[[name.startswith(start) for name in self.names]]


def judge(
    truth: ImuTruth,
    motion: ImuMotion,
    rate_hz: float,
    seed: int,
    blocks: tuple[str, ...] = (),
    *,
    noise: ImuNoise | None = None,
) -> Verdict:
    """Simulate, calibrate, compare.

    `noise`: what the filter is told; the truth's own by default.
    """
    recording = simulate_imu(truth, motion, rate_hz, seed)
    samples = recording.all()
    recording = replace(recording, pieces=lambda: (samples,))
    wanted = tuple(block for name in blocks for block in EXTENSIONS[name].blocks)
    result = calibrate_dynamic(recording, data_sheet(noise or truth.noise), wanted)
    true = true_constants(truth)
    states = result.layout.states
    known = [i for i, state in enumerate(states) if state.name in true]
    names = tuple(states[i].name for i in known)
    error = result.p[known] - np.array([true[name] for name in names])
    sd = result.sd[known]
    covariance = result.covariance[np.ix_(known, known)] / np.outer(sd, sd)
    z = error / sd
    last = result.passes[-1]
    excess = (last.chi_square - last.freedom) / np.sqrt(2.0 * last.freedom)
    return Verdict(
        names, error, sd, z, float(z @ np.linalg.solve(covariance, z)), float(excess), result
    )


def data_sheet(noise: ImuNoise) -> DataSheet:
    """What the maker of the simulated unit would print."""
    return DataSheet(
        gyro_arw_deg_per_sqrt_h=noise.gyro_arw_deg_per_sqrt_h,
        accel_vrw_ug_per_sqrt_hz=noise.accel_vrw_ug_per_sqrt_hz,
        accel_lsb=noise.accel_lsb,
        table_sd_arcsec=noise.table_sd_arcsec,
        axis_wobble_arcsec=120.0,
        gyro_bias_instability_deg_per_h=0.0,
        accel_bias_instability_ug=0.0,
    )
