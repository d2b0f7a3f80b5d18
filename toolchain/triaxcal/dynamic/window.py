"""Some samples with what is needed to integrate them: times, constants, corrected rate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from triaxcal.dynamic.blocks.attitude import rotation_of
from triaxcal.dynamic.blocks.base import BASE, LOWER
from triaxcal.dynamic.blocks.block import Signals
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.recording import INCREMENT, ImuSamples
from triaxcal.model.types import FloatArray

EDGE_S = 0.0225
EDGE_SAMPLES = (2.0, 5.0)
"""How far from the end of a block its rate is fitted: enough for a cubic, at most what is there."""


@dataclass(frozen=True)
class Frame:
    """What does not change during a pass.

    Attributes
    ----------
    layout : Layout
    rate_convention, force_convention : str
    gravity : float
        m/s^2.
    block : int
        Samples of a block, a multiple of 2 `preintegrate.NODES`.
    interval_s : float
        Nominal interval of the samples.
    reference_degc : float
        From which temperatures are counted.
    force_part : float
        Accelerometer samples a sample: below 1 where the accelerometers are slower.
    """

    layout: Layout
    rate_convention: str
    force_convention: str
    gravity: float
    block: int
    interval_s: float
    reference_degc: float
    force_part: float = 1.0

    @property
    def rate_is_increment(self) -> bool:
        """Whether gyro samples are angles over an interval."""
        return self.rate_convention == INCREMENT

    @property
    def force_is_increment(self) -> bool:
        """Whether accelerometer samples are velocities over an interval."""
        return self.force_convention == INCREMENT


@dataclass(frozen=True)
class About:
    """About what the equations are linear.

    Attributes
    ----------
    C : array, shape (3, 3)
        L'^T, instrument axes to the level frame, at the sample before the first block.
    p : array, shape (n,)
        Constants, SI.
    earth : array, shape (3,)
        Rate of the Earth in the level frame, rad/s.
    """

    C: FloatArray
    p: FloatArray
    earth: FloatArray


def gamma_matrix(values: FloatArray) -> FloatArray:
    """Gamma (3, 3) of its six elements."""
    gamma = np.zeros((3, 3))
    for value, (i, j) in zip(values[: len(LOWER)], LOWER, strict=True):
        gamma[i, j] = value
    return gamma


def inverse_of_one_plus(matrix: FloatArray) -> FloatArray:
    """(1 + matrix)^-1."""
    return np.linalg.inv(np.eye(3) + matrix).astype(np.float64)


@dataclass(frozen=True)
class Window:
    """`blocks` blocks of samples after sample `lead`; others around them help at the ends."""

    samples: ImuSamples
    lead: int
    blocks: int
    about: About
    frame: Frame

    @property
    def inside(self) -> slice:
        """Samples of the blocks."""
        return slice(self.lead + 1, self.lead + 1 + self.blocks * self.frame.block)

    @cached_property
    def time(self) -> FloatArray:
        """Time since sample `lead`, s."""
        since: FloatArray = self.samples.time_s - self.samples.time_s[self.lead]
        return since

    @cached_property
    def step_s(self) -> FloatArray:
        """Length of each sample's interval."""
        before = self.samples.time_s[0] - self.frame.interval_s
        return np.diff(self.samples.time_s, prepend=before)

    @cached_property
    def delta_degc(self) -> FloatArray:
        """Temperature against the reference; zero if there is none."""
        if self.samples.temp_degc is None:
            return np.zeros(len(self.samples))
        delta: FloatArray = self.samples.temp_degc - self.frame.reference_degc
        return delta

    @cached_property
    def gyro_delta_degc(self) -> FloatArray:
        """The same by the gyros' thermometer, where they have one of their own."""
        if self.samples.gyro_temp_degc is None:
            return self.delta_degc
        delta: FloatArray = self.samples.gyro_temp_degc - self.frame.reference_degc
        return delta

    def summed(self, variance: FloatArray | None) -> FloatArray:
        """Sums (blocks,) of the variances of samples; zeros where none were lost."""
        if variance is None:
            return np.zeros(self.blocks)
        sums: FloatArray = variance[self.inside].reshape(self.blocks, -1).sum(axis=1)
        return sums

    def part(self, name: str) -> FloatArray:
        """Reference values of a block's constants; zeros where it is not switched on."""
        return self.frame.layout.part(self.about.p, name)

    def outward(self, time: FloatArray) -> FloatArray:
        """exp(-[u] t) C: from the axes at sample `lead` to the level frame, shape (..., 3, 3)."""
        outward: FloatArray = rotation_of(-self.about.earth * time[:, None]) @ self.about.C
        return outward

    def measured(self, values: FloatArray, is_increment: bool) -> FloatArray:
        """Samples as values, or means, per second."""
        return values / self.step_s[:, None] if is_increment else values

    @cached_property
    def inverse_a(self) -> FloatArray:
        """(1 + Gamma)^-1."""
        return inverse_of_one_plus(gamma_matrix(self.part("accelerometer-matrix")))

    @cached_property
    def inverse_b(self) -> FloatArray:
        """(1 + Theta)^-1."""
        return inverse_of_one_plus(self.part("gyro-matrix").reshape(3, 3))

    @cached_property
    def rate(self) -> FloatArray:
        """Angular rate (n, 3), rad/s, with the reference constants taken off."""
        raw = self.measured(self.samples.rate, self.frame.rate_is_increment)
        raw = raw - self.part("gyro-bias")[:3]
        rate: FloatArray = raw @ self.inverse_b.T
        extra = [
            (block.rate, place)
            for block, place in self.frame.layout.columns("rate")
            if block not in BASE and np.any(self.about.p[place])
        ]
        if extra:
            force = self._force()
            for _ in range(2):  # each round leaves what the effects do to themselves: squares
                signals = Signals(rate, rate, force, self.gyro_delta_degc, self.frame.gravity)
                errors = [rows(signals) @ self.about.p[place] for rows, place in extra if rows]
                rate = (raw - sum(errors)) @ self.inverse_b.T
        return rate

    def edge_rate(self, later: float) -> FloatArray:
        """Rate (blocks + 1, 3) at the ends of the blocks, or the part `later` of an interval later.

        A lever arm turns it into a force. By a cubic through the samples around, means of which
        are taken as means: free of most of the noise of counting.
        """
        low, high = EDGE_SAMPLES
        reach = min(max(low, EDGE_S / self.frame.interval_s), high)
        near = np.arange(-high, high + 2)
        middle = near - later - (0.5 if self.frame.rate_is_increment else 0.0)
        near, middle = near[np.abs(middle) <= reach], middle[np.abs(middle) <= reach]
        power = np.arange(4)
        powers = middle[:, None] ** power
        if self.frame.rate_is_increment:
            after, before = (middle[:, None] + half for half in (0.5, -0.5))
            powers = (after ** (power + 1) - before ** (power + 1)) / (power + 1)
        weights = np.linalg.pinv(powers)[0]
        at = self.lead + self.frame.block * np.arange(self.blocks + 1)
        samples = np.clip(at[:, None] + near.astype(np.int64), 0, len(self.rate) - 1)
        fitted: FloatArray = np.einsum("k,nki->ni", weights, self.rate[samples])
        return fitted

    def _force(self) -> FloatArray:
        """Specific force good enough for what the gyros feel of it."""
        force = self.measured(self.samples.force, self.frame.force_is_increment)
        corrected: FloatArray = (force - self.part("accelerometer-bias")[:3]) @ self.inverse_a.T
        return corrected

    @cached_property
    def angles(self) -> FloatArray:
        """Integral of the rate over each sample's interval (n, 3), rad.

        From instants it is the trapezium less the change of slope at its ends, exact for cubics.
        """
        if self.frame.rate_is_increment:
            return self.rate * self.step_s[:, None]
        slope = np.gradient(self.rate, self.time, axis=0)
        angles = np.zeros_like(self.rate)
        h = self.step_s[1:, None]
        trapezium = h * (self.rate[:-1] + self.rate[1:]) / 2
        angles[1:] = trapezium - h**2 * np.diff(slope, axis=0) / 12
        return angles

    @cached_property
    def turn_change(self) -> FloatArray:
        """Next angle less the last one (n, 3), rad: twice what the rate gains in an interval."""
        angles = self.angles
        last = np.concatenate([angles[:1], angles[:-1]])
        change: FloatArray = np.concatenate([angles[1:], angles[-1:]]) - last
        return change

    @cached_property
    def turns(self) -> FloatArray:
        """Rotation vector of each interval (n, 3), rad.

        A rate that turns adds angle x (next angle - last angle)/24, exact to third order.
        """
        turns: FloatArray = self.angles + np.cross(self.angles, self.turn_change) / 24
        return turns
