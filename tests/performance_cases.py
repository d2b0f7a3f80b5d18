"""A unit that was switched on ten times, calibrated ten times, heated and cooled: exactly known.

Nothing of the package computes the readings. U = K(T) (a + d) + U0(T), d the disturbance in g:
run to run, transient, hysteresis, noise. Flicker noise is the sum of a fractional integration
(N. J. Kasdin, discrete simulation of colored noise, 10.1109/5.381848): white noise of variance B^2
through h_0 = 1, h_k = h_(k-1) (k - 1/2) / k has the density B^2 dt / (2 sin(pi f dt)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.model.types import FloatArray

UP = {
    "TP1": (0, 0, 1), "TP2": (0, -1, 0), "TP3": (0, 0, -1),
    "TP4": (0, 1, 0), "TP5": (-1, 0, 0), "TP6": (1, 0, 0),
}  # fmt: skip
K = np.array([[-0.55, -0.0005, 0.016], [-0.013, -0.548, -0.0007], [-0.0147, -0.0004, -0.549]])
U0 = np.array([0.0045, -0.0044, -0.0035])
K_PER_K = np.diag([1.1e-5, 1.3e-5, 1.4e-5]) * -1.0
U0_PER_K = np.array([-7e-5, -6e-5, -2.5e-5])
T0 = 20.0


@dataclass(frozen=True)
class Campaign:
    """The truth; all in micro-g and s unless said otherwise."""

    runs: int = 10
    temps_degc: tuple[float, ...] = (-40.0, 0.0, 20.0, 70.0)
    run_bias: float = 25.0
    run_scale_ppm: float = 15.0
    run_cross_micro_rad: float = 12.0
    dwell_noise: float = 0.3
    switched: int = 10
    switch_sd: float = 30.0
    tau_s: float = 240.0
    amplitude: float = 900.0
    on_s: float = 2400.0
    on_rate_hz: float = 1.0
    N: float = 25.0
    B: float = 6.0
    K: float = 0.12
    rest_s: float = 3600.0
    rest_rate_hz: float = 10.0
    hysteresis: float = 180.0
    cycle_k_per_min: float = 1.5
    cycle_rate_hz: float = 0.5

    @property
    def bias_micro_g(self) -> FloatArray:
        return U0 / np.diag(K) * 1e6

    @property
    def bias_per_k(self) -> FloatArray:
        """Mean sensitivity of U0_i / K_ii over the range, micro-g/K."""
        low, high = self.temps_degc[0], self.temps_degc[-1]
        ends = [(U0 + U0_PER_K * (t - T0)) / np.diag(K + K_PER_K * (t - T0)) for t in (low, high)]
        return np.asarray((ends[1] - ends[0]) / (high - low) * 1e6)


def flicker(count: int, size: float, random: np.random.Generator) -> FloatArray:
    """Flicker noise of bias instability `size`; it has run as long again before."""
    m = 2 * count
    h = np.concatenate([[1.0], np.cumprod((np.arange(1, m) - 0.5) / np.arange(1, m))])
    white = size * random.standard_normal(m)
    full = np.fft.irfft(np.fft.rfft(h, 2 * m) * np.fft.rfft(white, 2 * m), 2 * m)[:m]
    return np.asarray(full[count:])


def noise(
    count: int, dt: float, coefficients: tuple[float, float, float], random: np.random.Generator
) -> FloatArray:
    """Noise of velocity random walk N, bias instability B, random walk K."""
    N, B, walk = coefficients
    result = N / math.sqrt(dt) * random.standard_normal(count)
    result = result + flicker(count, B, random)
    return np.asarray(result + np.cumsum(walk * math.sqrt(dt) * random.standard_normal(count)))


def voltage(force_g: FloatArray, temp_degc: FloatArray) -> FloatArray:
    """Outputs (n, 3) of forces (n, 3) at temperatures (n,)."""
    d = (np.asarray(temp_degc, dtype=np.float64) - T0)[:, None]
    gain = K + d[:, :, None] * K_PER_K
    return np.einsum("nij,nj->ni", gain, force_g) + U0 + d * U0_PER_K


UNIT = """format = 1
serial = "C-{seed}"

[adc]
bits = 32
full_scale_v = 2.5

[temperature_sensor]
degc_per_code = 0.001

[site]
local_gravity_m_per_s2 = 9.80665

[thermal]
t0_degc = 20
model = "polynomial"
order = 1

[uncertainty]
squareness_arcsec = 0.01
repeatability_arcsec = 0.01
level_arcsec = 0.01
gravity_m_per_s2 = 1e-9
thermometer_degc = 1e-4
thermometer_drift_degc = 1e-4
"""

TEST = """
[test.{name}]
kind = "{kind}"
file = "{file}"
acceleration = ["ux", "uy", "uz"]
time = "t"
temperature = "temp"
{more}
"""


def write_campaign(folder: Path, seed: int, truth: Campaign) -> None:
    """unit.toml, measurements.csv and the recordings of all tests."""
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(seed)
    text = UNIT.format(seed=seed)
    text += TEST.format(
        name="on", kind="power-on", file="on*.csv",
        more="first_sample_s = 0\nsettled_within_micro_g = 60",
    )  # fmt: skip
    text += TEST.format(name="rest", kind="rest", file="rest.csv", more="")
    text += TEST.format(name="cycle", kind="hysteresis", file="cycle.csv", more="")
    (folder / "unit.toml").write_text(text)
    write_measurements(folder, truth, random)
    for k in range(truth.switched):
        _power_on(folder / f"on{k}.csv", truth, random)
    rest = round(truth.rest_s * truth.rest_rate_hz)
    d = _noise(truth, rest, 1.0 / truth.rest_rate_hz, random)
    _write(folder / "rest.csv", np.arange(rest) / truth.rest_rate_hz, d, np.full(rest, T0))
    _cycle(folder / "cycle.csv", truth, random)


def _noise(truth: Campaign, count: int, dt: float, random: np.random.Generator) -> FloatArray:
    of = (truth.N, truth.B, truth.K)
    return np.stack([noise(count, dt, of, random) for _ in range(3)], axis=1)


def _write(path: Path, time: FloatArray, disturbed: FloatArray, temp: FloatArray) -> None:
    force = np.array([0.0, 0.0, 1.0]) + disturbed * 1e-6
    rows = np.column_stack([time, voltage(force, temp), temp])
    np.savetxt(path, rows, delimiter=",", header="t,ux,uy,uz,temp", comments="", fmt="%.10g")


def write_measurements(folder: Path, truth: Campaign, random: np.random.Generator) -> None:
    """measurements.csv of all runs."""
    lines = ["position,temp_degc,ux_v,uy_v,uz_v"]
    for _ in range(truth.runs):
        bias = truth.run_bias * 1e-6 * random.standard_normal(3)
        own = np.diag(truth.run_scale_ppm * 1e-6 * random.standard_normal(3))
        cross = truth.run_cross_micro_rad * 1e-6 * random.standard_normal((3, 3))
        np.fill_diagonal(cross, 0.0)
        for temp in truth.temps_degc:
            for name, up in UP.items():
                force = np.array(up, dtype=np.float64)
                extra = bias + (own + cross) @ force
                extra = extra + truth.dwell_noise * 1e-6 * random.standard_normal(3)
                volts = voltage(force[None], np.array([temp]))[0]
                volts = volts + np.diag(K + (temp - T0) * K_PER_K) * extra
                lines.append(f"{name},{temp}," + ",".join(f"{v:.12f}" for v in volts))
    (folder / "measurements.csv").write_text("\n".join(lines) + "\n")


def _power_on(path: Path, truth: Campaign, random: np.random.Generator) -> None:
    count = round(truth.on_s * truth.on_rate_hz)
    t = np.arange(count) / truth.on_rate_hz
    d = _noise(truth, count, 1.0 / truth.on_rate_hz, random)
    d = d + truth.switch_sd * random.standard_normal(3)
    d = d + truth.amplitude * np.exp(-t / truth.tau_s)[:, None]
    _write(path, t, d, np.full(count, T0))


def _cycle(path: Path, truth: Campaign, random: np.random.Generator) -> None:
    """Cold to hot and back; heating is ahead by h (1 - x^2), x from -1 to 1 over the range."""
    low, high = truth.temps_degc[0], truth.temps_degc[-1]
    half = round((high - low) / truth.cycle_k_per_min * 60.0 * truth.cycle_rate_hz)
    up = np.linspace(low, high, half)
    temp = np.concatenate([up, up[::-1]])
    x = (temp - 0.5 * (low + high)) / (0.5 * (high - low))
    sign = np.concatenate([np.full(half, 0.5), np.full(half, -0.5)])
    d = _noise(truth, 2 * half, 1.0 / truth.cycle_rate_hz, random)
    d = d + (sign * truth.hysteresis * (1.0 - x**2))[:, None]
    _write(path, np.arange(2 * half) / truth.cycle_rate_hz, d, temp)


def truths(truth: Campaign) -> dict[tuple[str, str], float]:
    """True values of the report's figures by key and axis, in their units."""
    settled = truth.tau_s * math.log(truth.amplitude / 60.0)
    found: dict[tuple[str, str], float] = {
        ("runs_bias", ""): math.hypot(truth.run_bias, truth.dwell_noise / 2.0),
        ("runs_scale", ""): math.hypot(truth.run_scale_ppm, truth.dwell_noise / math.sqrt(2.0)),
        ("runs_cross", ""): math.hypot(
            truth.run_cross_micro_rad, truth.dwell_noise / math.sqrt(2.0)
        ),
    }
    switching = math.hypot(truth.switch_sd, _steady_sd(truth))
    for i, axis in enumerate("xyz"):
        found[("bias", axis)] = float(truth.bias_micro_g[i])
        found[("scale_factor", axis)] = float(K[i, i])
        found[("bias_temperature", axis)] = float(truth.bias_per_k[i])
        found[("scale_temperature", axis)] = float(K_PER_K[i, i] / K[i, i] * 1e6)
        found[("own_square", axis)] = 0.0
        found[("switching", axis)] = switching
        found[("warm_up_time_constant", axis)] = truth.tau_s
        found[("warm_up_amplitude", axis)] = truth.amplitude
        found[("warm_up_settling", axis)] = settled
        found[("hysteresis", axis)] = truth.hysteresis
        for symbol, value in zip("QNBKR", (0.0, truth.N, truth.B, truth.K, 0.0), strict=True):
            found[(f"noise_{symbol}", axis)] = value
        for j in range(3):
            if j != i:
                found[("cross_axis", axis + "xyz"[j])] = float(K[i, j] / K[i, i] * 1e6)
    return found


def _steady_sd(truth: Campaign) -> float:
    """Standard deviation that noise gives the mean over the last quarter, by 2000 recordings."""
    random = np.random.default_rng(0)
    count = round(truth.on_s * truth.on_rate_hz)
    of = (truth.N, truth.B, truth.K)
    means = [
        noise(count, 1.0 / truth.on_rate_hz, of, random)[3 * count // 4 :].mean()
        for _ in range(2000)
    ]
    return float(np.std(means))
