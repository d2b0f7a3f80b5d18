"""Frames of an IMU as samples in SI units, while they come."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.recording import ImuSamples
from triaxcal.model.types import FloatArray
from triaxcal.rig.bus.frames import Frames, concatenate
from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.description.recorded import ACCELERATIONS, RATES, Recorded
from triaxcal.rig.samples.samples import SampleDecoder
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

RATE_FROM_S = 2.0
"""Of samples, from which their rate is taken."""
_ANY_RATE_HZ = 10_000
_LEAST = 20


class ImuStream:
    """Decodes frames; a sample's time is its number over the rate of the first seconds.

    That is good enough to guide by. A calibration reads the log, whose times are better.

    Attributes
    ----------
    rate_hz : int or None
        Samples a second; None while it is not known.
    count, bad, lost : int
        Samples; those with a status that is not good, left out; those lost.

    Raises
    ------
    RefusedError
        For a rig description without gyros, or whose units are not known.
    """

    def __init__(self, rig: RigDescription) -> None:
        if not rig.gyros:
            raise RefusedError(
                f"{rig.name}, [signals]",
                "no gyros",
                expected="gyro_x, gyro_y and gyro_z",
                remedy="name them; docs/how-to/any-rig.md has an example",
            )
        self._rig = rig
        to_rad = math.pi / 180
        self._force = _to_si(rig, rig.axes, ACCELERATIONS, STANDARD_GRAVITY_M_PER_S2)
        self._rate = _to_si(rig, rig.gyros, RATES, to_rad)
        self._decoder: SampleDecoder | None = None
        self._first: list[Frames] = []
        self._trial = SampleDecoder(rig, _ANY_RATE_HZ)
        self._times: list[int] = []
        self._last = -1
        self.rate_hz: int | None = None
        self.count = self.bad = self.lost = 0

    def feed(self, frames: Frames) -> ImuSamples | None:
        """Samples that these frames complete; None where there are none yet."""
        if not len(frames):
            return None
        if self._decoder is None:
            self._first.append(frames)
            self._times += self._trial.feed(frames).t_ns.tolist()
            span_s = (self._times[-1] - self._times[0]) * 1e-9 if self._times else 0.0
            if span_s < RATE_FROM_S or len(self._times) < _LEAST:
                return None
            self.rate_hz = max(1, round((len(self._times) - 1) / span_s))
            self._decoder = SampleDecoder(self._rig, self.rate_hz)
            frames, self._first, self._times = concatenate(self._first), [], []
        assert self.rate_hz is not None
        samples = self._decoder.feed(frames)
        if not len(samples.number):
            return None
        self.lost += int(samples.number[-1]) - self._last - len(samples.number)
        self._last = int(samples.number[-1])
        good = samples.status == 0
        self.count += int(good.sum())
        self.bad += int((~good).sum())
        if not good.any():
            return None
        (force, force_zero), (rate, rate_zero) = self._force, self._rate
        return ImuSamples(
            samples.number[good] / self.rate_hz,
            samples.gyros[good] * rate + rate_zero,
            samples.codes[good] * force + force_zero,
        )


def _to_si(
    rig: RigDescription, axes: Sequence[Recorded], table: Mapping[str, float], per: float
) -> tuple[FloatArray, FloatArray]:
    """SI value = what is recorded * first + second, arrays of shape (3,)."""
    scale, zero = np.zeros(3), np.zeros(3)
    for i, axis in enumerate(axes):
        unit = table.get(axis.unit)
        if unit is None:
            raise RefusedError(
                f"{rig.name}, {axis.label}",
                f"its unit is {axis.unit or 'not stated'}",
                expected="a unit of acceleration, or of rate of a gyro",
                remedy="state unit, and gyro_unit, in [signals] of rig.toml",
            )
        scale[i], zero[i] = axis.step * unit * per, axis.zero * unit * per
    return scale, zero
