"""What the turntable does to a simulated IMU: mountings, moves and stops, and a rough table.

Every angle and shift is a polynomial of time between breaks, or a smooth function of one, so that
all derivatives are exact. In the order in which they turn the geographic axes (east, north, up)
into the unit's: the table's axis (azimuth, elevation), its wobble, the angle of the table, the
mounting, the small placement error, and the elasticity of the mounts.

The unit is remounted by hand between the axes: it is lifted, turned by a third of a turn about its
diagonal and put down, and its gyros and accelerometers see all of that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.recording import Turntable
from triaxcal.simulation.imu_polynomials import Pieces, PiecewiseMotion, smooth_move, smooth_step
from triaxcal.simulation.imu_temperature import CONSTANT, TemperatureDrift, TemperatureRamp
from triaxcal.simulation.imu_truth import Three

_TO_NEXT_AXIS = -2.0 * math.pi / 3.0


@dataclass(frozen=True)
class Move:
    """One rotation of the table, and the stop after it.

    Attributes
    ----------
    angle_deg : float
        Signed.
    rate_deg_per_s : float
        Positive; held between a smooth start and a smooth end.
    stop_s : float
    """

    angle_deg: float
    rate_deg_per_s: float
    stop_s: float = 0.0

    def turning_s(self, ramp_s: float) -> float:
        """How long the table turns; `ramp_s` is the time from rest to the rate."""
        return abs(self.angle_deg) / self.rate_deg_per_s + ramp_s


@dataclass(frozen=True)
class Mounting:
    """The unit with one of its axes along the table's: a stand-still, then moves.

    Attributes
    ----------
    moves : tuple of Move
    still_s : float
        Stand-still before the first move.
    placement_deg : three floats
        Rotation vector from the nominal mounting to the true one, on the instrument axes.
    centre_mm : three floats
        The centre of rotation from the unit's point M, on the instrument axes: s of P2 (16).
    """

    moves: tuple[Move, ...]
    still_s: float = 120.0
    placement_deg: Three = (0.0, 0.0, 0.0)
    centre_mm: Three = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class RoughTable:
    """A single-axis turntable.

    Attributes
    ----------
    azimuth_deg, elevation_deg : float
        Direction of its axis: from north to the east, and above the horizon.
    wobble_arcsec : float
        How far the axis leans, in two harmonics of the angle.
    ripple_deg : float
        Unevenness of the angle while turning, in three periods that are no fractions of a turn.
        The rate is uneven by 3.7 + 7.3 + 11.9 times this, per radian and at worst, over three.
    ramp_s : float
        Time from rest to the rate of a move.
    reads_angle : bool
        Whether its angle is recorded.
    """

    azimuth_deg: float = 40.0
    elevation_deg: float = 1.0
    wobble_arcsec: float = 120.0
    ripple_deg: float = 0.05
    ramp_s: float = 1.0
    reads_angle: bool = False


PRECISE_TABLE = RoughTable(wobble_arcsec=0.0, ripple_deg=0.0, reads_angle=True)
"""A table whose angle readings give the whole attitude of its plate."""


@dataclass(frozen=True)
class ImuMotion:
    """A whole recording on a table.

    Attributes
    ----------
    mountings : tuple of one to three Mounting
        Instrument axis 1, 2, 3 along the table's axis in turn.
    table : RoughTable
    temperature : TemperatureDrift or TemperatureRamp
    gyro_temperature : TemperatureDrift, TemperatureRamp or None
        Of the gyros, where they have a temperature and a thermometer of their own.
    latitude_deg, gravity_m_per_s2 : float
        Gravity is that of a plumb line: with the centrifugal part.
    remount_s, lift_m : float
        How long the unit is in the operator's hands, and how high it is lifted.
    """

    mountings: tuple[Mounting, ...]
    table: RoughTable = RoughTable()
    temperature: TemperatureDrift | TemperatureRamp = CONSTANT
    latitude_deg: float = 50.0
    gravity_m_per_s2: float = 9.8107
    remount_s: float = 20.0
    lift_m: float = 0.2
    gyro_temperature: TemperatureDrift | TemperatureRamp | None = None
    _built: _Built = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 1 <= len(self.mountings) <= 3:
            raise ValueError(f"{len(self.mountings)} mountings; there are three axes")
        object.__setattr__(self, "_built", _built(self))

    @property
    def duration_s(self) -> float:
        """From the first sample to the last."""
        return self._built.end_s

    @property
    def start_s(self) -> tuple[float, ...]:
        """When each mounting's stand-still begins."""
        return self._built.start_s

    @property
    def table_angle(self) -> PiecewiseMotion:
        """Nominal angle of the table, rad."""
        return self._built.table_angle

    @property
    def mounting_angle(self) -> PiecewiseMotion:
        """About (1, 1, 1), rad: each third of a turn back puts the next axis in place."""
        return self._built.mounting_angle

    @property
    def present(self) -> tuple[PiecewiseMotion, ...]:
        """For each mounting, how much of it there is: 1 while it lasts, smoothly 0 elsewhere."""
        return self._built.present

    @property
    def lift(self) -> PiecewiseMotion:
        """Height of the unit above its place on the table, m."""
        return self._built.lift

    def turntable(self) -> Turntable:
        """What the table's certificate states, without wobble and placement."""
        return Turntable(
            azimuth_rad=math.radians(self.table.azimuth_deg),
            elevation_rad=math.radians(self.table.elevation_deg),
            mountings=tuple(
                (start, np.roll(np.eye(3), k, axis=0)) for k, start in enumerate(self.start_s)
            ),
        )


@dataclass(frozen=True)
class _Built:
    """Functions of time made from a description."""

    end_s: float
    start_s: tuple[float, ...]
    table_angle: PiecewiseMotion
    mounting_angle: PiecewiseMotion
    present: tuple[PiecewiseMotion, ...]
    lift: PiecewiseMotion


def _built(motion: ImuMotion) -> _Built:
    """Put moves and remountings one after the other."""
    ramp_s, count = motion.table.ramp_s, len(motion.mountings)
    angle, turn, lift = (PiecewiseMotion.resting() for _ in range(3))
    present = [PiecewiseMotion.resting(1.0 if k == 0 else 0.0) for k in range(count)]
    time_s, starts = 0.0, []
    for k, mounting in enumerate(motion.mountings):
        starts.append(time_s)
        time_s += mounting.still_s
        for move in mounting.moves:
            angle = angle.then(time_s, *_turn(move, ramp_s))
            time_s += move.turning_s(ramp_s) + move.stop_s
        if k + 1 < count:
            span = motion.remount_s
            turn = turn.then(time_s, *smooth_step(_TO_NEXT_AXIS, span))
            present[k] = present[k].then(time_s, *smooth_step(-1.0, span))
            present[k + 1] = present[k + 1].then(time_s, *smooth_step(1.0, span))
            for rise in (1.0, -1.0):
                start = time_s if rise > 0 else time_s + span / 2
                lift = lift.then(start, *smooth_step(rise * motion.lift_m, span / 2))
            time_s += span
    return _Built(time_s, tuple(starts), angle, turn, tuple(present), lift)


def _turn(move: Move, ramp_s: float) -> Pieces:
    return smooth_move(math.radians(move.angle_deg), math.radians(move.rate_deg_per_s), ramp_s)


# One round of the programme: slow, fast, both senses, uneven stops, quarter turns for the table's
# readings. 5 to 60 deg/s, about eight minutes.
_ROUND = (
    Move(360.0, 30.0, 3.0),
    Move(-720.0, 60.0, 5.0),
    *(Move(90.0, 30.0, 12.0) for _ in range(4)),
    Move(360.0, 10.0, 3.0),
    Move(-1080.0, 60.0, 5.0),
    Move(-270.0, 20.0, 4.0),
    Move(720.0, 45.0, 2.0),
    *(Move(-90.0, 30.0, 12.0) for _ in range(4)),
    Move(270.0, 5.0, 4.0),
    Move(-360.0, 15.0, 3.0),
    Move(1080.0, 60.0, 5.0),
    Move(-450.0, 25.0, 4.0),
)


def programme(minutes: float, still_s: float, ramp_s: float) -> tuple[Move, ...]:
    """Moves for one axis, repeated until the next would not end within `minutes`.

    Raises
    ------
    RefusedError
        When the time is not enough for a stand-still and three moves.
    """
    moves: list[Move] = []
    left_s = 60.0 * minutes - still_s
    while True:
        for move in _ROUND:
            left_s -= move.turning_s(ramp_s) + move.stop_s
            if left_s < 0.0:
                if len(moves) < 3:
                    raise RefusedError(
                        "motion of a simulated IMU",
                        f"{minutes:g} min an axis, {still_s:g} s of it at rest",
                        expected="time for at least three moves",
                    )
                return tuple(moves)
            moves.append(move)


def three_axes(
    minutes: float = 40.0,
    *,
    still_s: float = 120.0,
    table: RoughTable | None = None,
    temperature: TemperatureDrift | TemperatureRamp | None = None,
    moves: tuple[Move, ...] | None = None,
    centre_mm: tuple[Three, Three, Three] = ((0.0, 0.0, 0.0),) * 3,
    placement_deg: tuple[Three, Three, Three] = (
        (0.0, 0.2, -0.3),
        (-0.25, 0.0, 0.15),
        (0.3, -0.2, 0.0),
    ),
) -> ImuMotion:
    """The ordinary recording: each axis along the table for `minutes`, all at 5 to 60 deg/s.

    `moves` of each axis replace the ordinary ones, and their time `minutes`.
    """
    table = table or RoughTable()
    moves = moves or programme(minutes, still_s, table.ramp_s)
    return ImuMotion(
        mountings=tuple(
            Mounting(moves, still_s, placement, centre)
            for placement, centre in zip(placement_deg, centre_mm, strict=True)
        ),
        table=table,
        temperature=temperature or CONSTANT,
    )
