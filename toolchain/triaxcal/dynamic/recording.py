"""The recording of an IMU on a turntable: what was read, when, and what a sample means.

A recording is read in chunks and more than once (the filter makes several passes), so that its
length is limited by the disk and not by the memory. Axis order is x, y, z everywhere.

Conventions
-----------
"instant"    sample k is the value at time_s[k];
"increment"  sample k is the integral over the interval that ends at time_s[k] (rad, m/s): a
             rate-integrating gyro's angle, an integrating accelerometer's velocity, both along the
             turning instrument axes. The first sample's interval has the nominal length.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from triaxcal.model.types import FloatArray

INSTANT, INCREMENT = "instant", "increment"
CONVENTIONS = (INSTANT, INCREMENT)
HAND, TABLE = "hand", "table"
MOTIONS = (HAND, TABLE)


@dataclass(frozen=True)
class ImuSamples:
    """Consecutive samples of a recording.

    Attributes
    ----------
    time_s : array, shape (n,)
        Rising.
    rate : array, shape (n, 3)
        Gyro triad: rad/s ("instant") or rad ("increment").
    force : array, shape (n, 3)
        Accelerometer triad: m/s^2 or m/s.
    temp_degc : array, shape (n,), or None
    gyro_temp_degc : array, shape (n,), or None
        Of the gyros, where they have a thermometer of their own.
    force2 : array, shape (n, 3), or None
        Second accelerometer triad, as `force`.
    table_angle_rad : array, shape (n,), or None
        Reading of the turntable about its axis, continuous over whole turns.
    turn_variance, force_variance : arrays, shape (n,), or None
        Of samples that were lost and interpolated, beyond the noise of a sample: of the angle over
        its interval, rad^2, and of the force, (m/s^2)^2; summed over a block they are the
        variances of its sums. Zero elsewhere.
    """

    time_s: FloatArray
    rate: FloatArray
    force: FloatArray
    temp_degc: FloatArray | None = None
    force2: FloatArray | None = None
    table_angle_rad: FloatArray | None = None
    turn_variance: FloatArray | None = None
    force_variance: FloatArray | None = None
    gyro_temp_degc: FloatArray | None = None

    def __post_init__(self) -> None:
        n = len(self.time_s)
        for name, shape in _SHAPES.items():
            value = getattr(self, name)
            if value is not None and value.shape != (n, *shape):
                raise ValueError(f"{name} has shape {value.shape}, not {(n, *shape)}")

    def __len__(self) -> int:
        return len(self.time_s)

    def __getitem__(self, part: slice) -> ImuSamples:
        found = {name: getattr(self, name) for name in _SHAPES}
        columns: dict[str, Any] = {k: None if c is None else c[part] for k, c in found.items()}
        return ImuSamples(**columns)


_SHAPES: dict[str, tuple[int, ...]] = {
    "time_s": (),
    "rate": (3,),
    "force": (3,),
    "temp_degc": (),
    "gyro_temp_degc": (),
    "force2": (3,),
    "table_angle_rad": (),
    "turn_variance": (),
    "force_variance": (),
}
_DOUBTS = ("turn_variance", "force_variance")
"""Columns that are zero where nothing was lost."""


def joined(parts: Iterable[ImuSamples]) -> ImuSamples:
    """One piece of several that follow each other and have the same columns."""
    listed = list(parts)
    found = {name: [getattr(part, name) for part in listed] for name in _SHAPES}
    for name in _DOUBTS:
        if any(value is not None for value in found[name]):
            pairs = zip(listed, found[name], strict=True)
            found[name] = [np.zeros(len(part)) if v is None else v for part, v in pairs]
    columns: dict[str, Any] = {
        k: None if c[0] is None else np.concatenate(c) for k, c in found.items()
    }
    return ImuSamples(**columns)


@dataclass(frozen=True)
class Turntable:
    """What the table's own certificate states, for its angle readings (P2 (17)).

    Table axes: the first is the axis of rotation, the third is as near to up as that allows. At
    angle zero the plate's axes are the table's; it turns right-handed about the first. Geographic
    axes are east, north, up.

    Attributes
    ----------
    azimuth_rad : float
        Of the axis of rotation, from north to the east.
    elevation_rad : float
        Of the axis of rotation above the horizon.
    mountings : tuple of (float, array of shape (3, 3))
        Since which time (s), and the matrix from plate axes to instrument axes as mounted, without
        the small mounting angles theta. One for each axis put on the table; where the time is nan
        they belong to the stages that are found in the recording, in their order.
    """

    azimuth_rad: float
    elevation_rad: float
    mountings: tuple[tuple[float, FloatArray], ...]


@dataclass(frozen=True)
class ImuRecording:
    """A recording, where it was taken, and what its samples mean.

    Attributes
    ----------
    name : str
        File or origin, for messages.
    pieces : callable
        Gives a new iterator over the whole recording, in pieces of any length, at each call.
    rate_hz : float
        Nominal sampling rate.
    latitude_deg : float
        Positive to the north.
    gravity_m_per_s2 : float
        Local gravity.
    rate_convention, force_convention : str
        One of `CONVENTIONS`.
    table : Turntable, or None
        Needed only where the table's angle readings are used.
    findings : tuple of str
        What was left out or repaired when it was read.
    motion : str
        One of `MOTIONS` where it is stated how the unit was turned; "": the recording decides.
    starts_s : tuple of float
        When the second and every further one begins, where it is several recordings.
    names : tuple of str
        Of each of several recordings.
    force_hz : float or None
        At which the accelerometers were sampled, where that is slower than the samples.
    seen_density : mapping
        Random walk of "rate", rad/sqrt(s), and "force", m/s^2 sqrt(s), as the samples show it, of
        triads that the log has at a lower rate than its rows.
    """

    name: str
    pieces: Callable[[], Iterable[ImuSamples]]
    rate_hz: float
    latitude_deg: float
    gravity_m_per_s2: float
    rate_convention: str = INSTANT
    force_convention: str = INSTANT
    table: Turntable | None = None
    findings: tuple[str, ...] = ()
    motion: str = ""
    starts_s: tuple[float, ...] = ()
    names: tuple[str, ...] = ()
    force_hz: float | None = None
    seen_density: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for convention in (self.rate_convention, self.force_convention):
            if convention not in CONVENTIONS:
                raise ValueError(f"convention {convention!r} is none of {CONVENTIONS}")

    def chunks(self, length: int) -> Iterator[ImuSamples]:
        """Chunks of `length` samples, the last one shorter."""
        waiting: list[ImuSamples] = []
        count = 0
        for piece in self.pieces():
            waiting.append(piece)
            count += len(piece)
            if count >= length:
                whole = joined(waiting)
                for start in range(0, count - length + 1, length):
                    yield whole[start : start + length]
                waiting = [whole[count - count % length :]]
                count %= length
        if count:
            yield joined(waiting)

    def between(self, first: int, last: int, length: int) -> Iterator[ImuSamples]:
        """Samples of the numbers `first` to `last`, in chunks of at most `length`."""
        count = 0
        for chunk in self.chunks(length):
            low, high = max(first - count, 0), min(last + 1 - count, len(chunk))
            if low < high:
                yield chunk[low:high]
            count += len(chunk)
            if count > last:
                return

    def all(self) -> ImuSamples:
        """Everything in one piece, for short recordings."""
        return joined(self.pieces())
