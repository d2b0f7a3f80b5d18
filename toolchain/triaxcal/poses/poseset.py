"""The poses of a recording, each with its mean and what is known of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import FloatArray

SD_FLOOR_G = 1e-4
"""Standard deviation of a pose that no length of it removes."""


@dataclass(frozen=True)
class Stillness:
    """Where a recording is still.

    Attributes
    ----------
    time_s, motion : arrays, shape (m,)
        For pictures: evenly spaced moments; motion in the unit of the readings.
    runs : tuple of (start, stop)
        Still stretches, as indices of samples, stop excluded.
    quietest : float
        Least motion that lasts for half of the shortest pose, in the unit of the readings.
    """

    time_s: FloatArray
    motion: FloatArray
    runs: tuple[tuple[int, int], ...]
    quietest: float


@dataclass(frozen=True)
class Pose:
    """Mean readings of one pose.

    Attributes
    ----------
    number : int
        Among all stretches at rest that were examined, from 1.
    line : int
        Line of its first sample.
    start_s, duration_s : float
    reading : array, shape (3,)
        In the unit of the layout.
    sd_mean : array, shape (3,), or None
        Standard deviation of `reading`: noise, sway and drift, and the steps of the readings; None
        where rows are poses.
    count : int
        Samples.
    temp_degc : float or None
    label : str
        Of its section; "" without.
    angles_rad : array, shape (2 or 3,), or None
    covariance : array, shape (3, 3), or None
        Of `reading`; `sd_mean` is the root of its diagonal.
    scatter : array, shape (3,), or None
        Standard deviation of the samples.
    drift : array, shape (3,), or None
        Mean of the second half less that of the first.
    file : str
        Of several files, the one in which `line` is; "" of one.
    """

    number: int
    line: int
    start_s: float
    duration_s: float
    reading: FloatArray
    sd_mean: FloatArray | None
    count: int
    temp_degc: float | None
    label: str
    angles_rad: FloatArray | None
    covariance: FloatArray | None = None
    scatter: FloatArray | None = None
    drift: FloatArray | None = None
    file: str = ""


@dataclass(frozen=True)
class RefusedPose:
    """A still stretch that is no pose, and why.

    `clipped` has the end at which an output stays: "y above 7.5" in the unit of the readings; ""
    where none does.
    """

    number: int
    line: int
    start_s: float
    duration_s: float
    reason: str
    clipped: str = ""


@dataclass(frozen=True)
class PoseSet:
    """Poses of one recording.

    Attributes
    ----------
    source : str
    poses : tuple of Pose
    refused : tuple of RefusedPose
    stillness : Stillness or None
        None where rows are poses, or sections say where they are.
    findings : tuple of str
    reading_of_1_g : float
        About; in the unit of the layout.
    """

    source: str
    poses: tuple[Pose, ...]
    refused: tuple[RefusedPose, ...]
    stillness: Stillness | None
    findings: tuple[str, ...]
    reading_of_1_g: float = 1.0

    @property
    def readings(self) -> FloatArray:
        """Shape (poses, 3)."""
        return np.array([p.reading for p in self.poses]).reshape(-1, 3)

    @property
    def temps_degc(self) -> FloatArray | None:
        """Shape (poses,); None when the recording has no temperature."""
        temps = [p.temp_degc for p in self.poses if p.temp_degc is not None]
        return np.array(temps) if len(temps) == len(self.poses) and temps else None

    @property
    def clipped(self) -> dict[str, list[int]]:
        """Ends at which outputs stay, each with the refused stretches at rest that show it."""
        found: dict[str, list[int]] = {}
        for refused in self.refused:
            if refused.clipped:
                found.setdefault(refused.clipped, []).append(refused.number)
        return found

    @property
    def length_sd(self) -> FloatArray | None:
        """Standard deviation along the reading of each pose, (poses,); None where rows are poses.

        Along the reading less the middle of all: their zero may lie anywhere.
        """
        found = [p.covariance for p in self.poses if p.covariance is not None]
        if len(found) != len(self.poses):
            return None
        readings = self.readings
        spread = readings - (readings.max(axis=0) + readings.min(axis=0)) / 2.0
        lengths = np.linalg.norm(spread, axis=1)
        along = spread if lengths.min() > 0.1 * self.reading_of_1_g else readings
        along = along / np.linalg.norm(along, axis=1, keepdims=True)
        result: FloatArray = np.sqrt(np.einsum("pi,pij,pj->p", along, np.array(found), along))
        return result

    @property
    def weights(self) -> FloatArray | None:
        """Weight of each pose by its own uncertainty, 1 for the best; None where rows are poses."""
        sd = self.length_sd
        if sd is None:
            return None
        floor = SD_FLOOR_G * self.reading_of_1_g
        variance = sd**2 + floor**2
        result: FloatArray = variance.min() / variance
        return result
