"""What temperatures a recording was made at, whether its thermometer worked, and what follows.

Nothing is known of the constants outside of the temperatures that were recorded, so the working
range stays within them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.description import DynamicDescription
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.model.thermal.shape import EDGE_DEGC, PLAUSIBLE_DEGC, ends_of
from triaxcal.model.types import FloatArray

PIECE_S = 5.0
"""Medians over so long are the temperatures of a recording: one wrong reading is none."""
STUCK_S = 60.0
RESOLVED = 3.0
"""Steps of a thermometer whose noise is so many times its resolution never stay away for long."""


@dataclass(frozen=True)
class Recorded:
    """Temperatures of a recording.

    Attributes
    ----------
    start_s, degc : arrays, shape (k,)
        Medians over `PIECE_S`, and when each begins.
    gyro : array, shape (k,), or None
        The same by the gyros' own thermometer, where they have one.
    """

    start_s: FloatArray
    degc: FloatArray
    gyro: FloatArray | None = None

    @property
    def ends_degc(self) -> tuple[float, float]:
        """Lowest and highest."""
        return ends_of(self.degc)

    @property
    def gyro_degc(self) -> FloatArray:
        """Temperatures of the gyros."""
        return self.degc if self.gyro is None else self.gyro

    @property
    def gyro_ends_degc(self) -> tuple[float, float]:
        """Lowest and highest of them."""
        return ends_of(self.gyro_degc)


@dataclass(frozen=True)
class _Thermometer:
    """Name of its samples in `ImuSamples`, what messages call its readings, and its key."""

    samples: str
    words: str
    key: str


_COMMON = _Thermometer("temp_degc", "temperature", "temp_column")
_OF_GYROS = _Thermometer("gyro_temp_degc", "temperature of the gyros", "gyro_temp_column")


def recorded_temperatures(recording: ImuRecording) -> Recorded | None:
    """Temperatures of a recording, or None where it has none.

    Raises
    ------
    RefusedError
        When the thermometer is stuck, or reads what no thermometer of an IMU reads.
    """
    start_s, degc = _medians(recording, _COMMON)
    if degc is None:
        return None
    return Recorded(start_s, degc, _medians(recording, _OF_GYROS)[1])


def _medians(
    recording: ImuRecording, thermometer: _Thermometer
) -> tuple[FloatArray, FloatArray | None]:
    """Medians of a thermometer over `PIECE_S`, and when each begins; None where there is none."""
    length = max(1, round(PIECE_S * recording.rate_hz))
    start, medians = [], []
    steps, ahead = _Steps(thermometer), list(recording.starts_s)
    known: list[_Steps] = []
    for piece in recording.pieces():
        degc: FloatArray | None = getattr(piece, thermometer.samples)
        if degc is None:
            return np.empty(0), None
        if ahead and piece.time_s[0] >= ahead[0]:
            known.append(steps)
            steps, ahead = _Steps(thermometer), ahead[1:]
        for k in range(0, len(piece), length):
            start.append(float(piece.time_s[k]))
            medians.append(float(np.median(degc[k : k + length])))
        steps.add(piece.time_s, degc)
    known.append(steps)
    usual_degc = max(each.usual_degc for each in known)
    names = recording.names or (recording.name,) * len(known)
    for name, each in zip(names, known, strict=True):
        each.refuse_stuck(name, usual_degc)
    found = np.array(medians)
    low, high = ends_of(found)
    if not (PLAUSIBLE_DEGC[0] <= low and high <= PLAUSIBLE_DEGC[1]):
        raise RefusedError(
            recording.name,
            f"temperatures of {low:.5g} to {high:.5g} degC",
            expected=f"{PLAUSIBLE_DEGC[0]:g} to {PLAUSIBLE_DEGC[1]:g} degC",
            remedy=f"check {thermometer.key} and temperature_unit in [dynamic]",
        )
    return np.array(start), found


class _Steps:
    """Runs of equal readings, and how large the steps between others are."""

    def __init__(self, thermometer: _Thermometer) -> None:
        self.words = thermometer.words
        self.since_s = self.longest_s = self.longest_start_s = self.value = math.nan
        self.sizes: list[FloatArray] = []

    def add(self, time_s: FloatArray, degc: FloatArray) -> None:
        """The next readings of the recording."""
        if math.isnan(self.value):
            self.since_s, self.longest_s, self.longest_start_s = time_s[0], 0.0, time_s[0]
            self.value = degc[0]
        step = np.diff(degc, prepend=self.value)
        changed = np.flatnonzero(step)
        begins = np.concatenate([[self.since_s], time_s[changed]])
        ends = np.concatenate([time_s[changed], time_s[-1:]])
        k = int(np.argmax(ends - begins))
        if ends[k] - begins[k] > self.longest_s:
            self.longest_s, self.longest_start_s = float(ends[k] - begins[k]), float(begins[k])
        self.since_s, self.value = float(begins[-1]), float(degc[-1])
        self.sizes.append(np.abs(step[changed]))

    @property
    def usual_degc(self) -> float:
        """Usual step from reading to reading; 0 where it is one of few sizes, by rounding alone."""
        sizes = np.concatenate(self.sizes)
        if len(sizes) == 0 or np.median(sizes) < RESOLVED * sizes.min():
            return 0.0
        return float(np.median(sizes))

    def refuse_stuck(self, name: str, usual_degc: float) -> None:
        """Refuse a run of equal readings that the thermometer's own noise makes impossible.

        The noise is seen elsewhere in this recording; or in others, if it has none at all.
        """
        own = np.concatenate(self.sizes)
        usual_degc = self.usual_degc if len(own) else usual_degc
        if usual_degc and self.longest_s >= STUCK_S:
            raise RefusedError(
                f"{name}, {self.longest_start_s:.1f} s",
                f"the {self.words} reads the same for {self.longest_s:.0f} s, and elsewhere "
                f"changes by {usual_degc:.2g} degC from reading to reading: the thermometer is "
                "stuck",
                expected="a thermometer that follows the unit",
                remedy="record again, or cut the recording there",
            )


def refuse_beyond(unit: DynamicDescription, recorded: Recorded | None) -> tuple[str, ...]:
    """Refuse a working range beyond what was recorded; returns what to say where nothing was.

    Raises
    ------
    RefusedError
    """
    if unit.device is None:
        return ()
    if recorded is None:
        low, high = unit.device.range_degc
        text = f"that the constants hold over the {low:g} to {high:g} degC of [device]"
        return (f"no temperature was recorded: it is not shown {text}",)
    _refuse_range(f"{unit.path}, [device] range_degc", unit.device.range_degc, recorded.ends_degc)
    key = "gyro_range_degc" if unit.device.two_thermometers else "range_degc"
    _refuse_range(f"{unit.path}, [device] {key}", unit.device.gyro_range, recorded.gyro_ends_degc)
    return ()


def _refuse_range(
    where: str, range_degc: tuple[float, float], ends_degc: tuple[float, float]
) -> None:
    (low, high), (first, last) = range_degc, ends_degc
    if first - EDGE_DEGC <= low and high <= last + EDGE_DEGC:
        return
    inner = math.ceil(10 * (first - EDGE_DEGC)) / 10, math.floor(10 * (last + EDGE_DEGC)) / 10
    raise RefusedError(
        where,
        f"{low:g} to {high:g} degC, and the temperatures recorded are {first:.1f} to {last:.1f} "
        "degC",
        expected=f"at most {EDGE_DEGC:g} degC beyond what was recorded: nothing is extrapolated",
        remedy=f"record over the whole range, or state [{inner[0]:g}, {inner[1]:g}]",
    )
