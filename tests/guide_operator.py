"""An operator who does not exist: turns a unit by exact physics, and records what it reads.

Each turn is about an axis of the instrument, by a smooth angle; the unit turns about the point
where its accelerometers are. So rate and force are known in closed form at any moment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from triaxcal.dynamic.recording import ImuRecording, ImuSamples, joined

EARTH = 7.292115e-5
G = 9.8107
RATE_HZ = 50.0
ARW_DEG, VRW_UG = 0.3, 100.0
RAMP_S = 0.5


@dataclass
class Operator:
    """A unit in a hand."""

    seed: int
    latitude_deg: float = 50.0
    attitude: Rotation = field(default_factory=Rotation.identity)
    """Instrument axes to east, north, up."""
    time_s: float = 0.0
    turned_deg: float = 0.0
    turns: int = 0

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        self.rng = rng
        self.bias = rng.normal(0, 0.1, 3)
        self.gamma = np.tril(rng.normal(0, 3e-3, (3, 3)))
        self.drift = np.radians(rng.normal(0, 300, 3) / 3600)
        self.theta = rng.normal(0, 3e-3, (3, 3))
        latitude = np.radians(self.latitude_deg)
        self.earth = EARTH * np.array([0, np.cos(latitude), np.sin(latitude)])
        self.pieces: list[ImuSamples] = []

    def _read(self, attitudes: Rotation, turn_rate: np.ndarray) -> ImuSamples:
        n = len(turn_rate)
        inside = attitudes.inv()
        rate = turn_rate + inside.apply(self.earth)
        force = inside.apply([0, 0, G])
        root = np.sqrt(RATE_HZ)
        gyro = rate + rate @ self.theta.T + self.drift
        gyro += self.rng.normal(0, np.radians(ARW_DEG) / 60 * root, (n, 3))
        accel = force + force @ self.gamma.T + self.bias
        accel += self.rng.normal(0, VRW_UG * 9.80665e-6 * root, (n, 3))
        times = self.time_s + np.arange(n) / RATE_HZ
        self.time_s += n / RATE_HZ
        samples = ImuSamples(times, gyro, accel)
        self.pieces.append(samples)
        return samples

    def hold(self, seconds: float) -> ImuSamples:
        """Samples at rest."""
        n = round(seconds * RATE_HZ)
        return self._read(Rotation.concatenate([self.attitude] * n), np.zeros((n, 3)))

    def turn(
        self, axis: Sequence[float], angle_deg: float, rate_deg_per_s: float = 60
    ) -> ImuSamples:
        """Samples of a turn about an instrument axis, starting and ending smoothly."""
        axis = np.asarray(axis, float) / np.linalg.norm(axis)
        seconds = abs(angle_deg) / rate_deg_per_s + RAMP_S
        n = round(seconds * RATE_HZ)
        part = (np.arange(n) + 1) / n
        # Angle and its rate: 10 u^3 - 15 u^4 + 6 u^5.
        angle = np.radians(angle_deg) * part**3 * (10 - 15 * part + 6 * part**2)
        rate = np.radians(angle_deg) * 30 * part**2 * (1 - part) ** 2 / (n / RATE_HZ)
        attitudes = self.attitude * Rotation.from_rotvec(angle[:, None] * axis)
        samples = self._read(attitudes, rate[:, None] * axis)
        self.attitude = attitudes[-1]
        self.turned_deg += abs(angle_deg)
        self.turns += 1
        return samples

    def recording(self) -> ImuRecording:
        """What was recorded so far."""
        whole = joined(self.pieces)
        return ImuRecording("by hand", lambda: (whole,), RATE_HZ, self.latitude_deg, G)
