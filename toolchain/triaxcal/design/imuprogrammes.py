"""Motions that a plan may choose from: of imu_truth.toml, on a table, by hand.

A new one is a function that makes a `Programme`, and its line in `programmes_of`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from triaxcal.dynamic.description import DynamicDescription
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_hand import REST_S, HandMotion, hand_recording
from triaxcal.simulation.imu_motion import ImuMotion, three_axes
from triaxcal.simulation.imu_truth import ImuTruth, SecondTriad
from triaxcal.simulation.imu_unit import IMU_TRUTH_FILE, planned_motion

RATE_HZ = 100.0
"""Where neither file states a rate: the covariance hardly depends on it."""
MINUTES, MINUTES_LEAST, MINUTES_MOST = 4.0, 2.0, 40.0
"""An axis. P2 records 10 to 40 minutes an axis."""
STILL_S = 60.0
POSES, POSES_LEAST, POSES_MOST = 36.0, 13.0, 360.0
"""imu_tk's recordings have 30 to 50; ten times as many are a patient hour."""


@dataclass(frozen=True)
class Programme:
    """A motion of any size.

    Attributes
    ----------
    name : str
    said : callable
        Words for a size, as "4 min about each axis".
    size, least, most : float
        Where a search begins, and its ends.
    recording : callable
        Perfect readings of a motion of a size.
    without : frozenset of str
        Columns that it does not have: blocks that need them are off.
    """

    name: str
    said: Callable[[float], str]
    size: float
    least: float
    most: float
    recording: Callable[[float], ImuRecording]
    without: frozenset[str] = frozenset()


def programmes_of(unit: DynamicDescription) -> tuple[Programme, ...]:
    """Programmes for a unit; the first is the one that its files plan.

    Raises
    ------
    RefusedError
        As `planned_motion`.
    """
    folder = unit.path.parent
    stated = (folder / IMU_TRUTH_FILE).is_file()
    table = _stated(unit) if stated else _table(unit, unit.clock.rate_hz or RATE_HZ)
    rate_hz = table.recording(table.least).rate_hz
    return table, *([] if "second-triad" in unit.blocks else [_hand(unit, rate_hz)])


def _truth(unit: DynamicDescription) -> ImuTruth:
    """A perfect unit that samples as `unit` does."""
    return ImuTruth(
        second=SecondTriad() if "second-triad" in unit.blocks else None,
        rate_convention=unit.rate_convention,
        force_convention=unit.force_convention,
    )


def _stated(unit: DynamicDescription) -> Programme:
    """[motion] of imu_truth.toml, its moves over and over."""
    motion, rate_hz = planned_motion(unit.path.parent)
    truth = _truth(unit)

    def recording(size: float) -> ImuRecording:
        return simulate_imu(truth, _repeated(motion, round(size)), rate_hz, 0)

    most = max(1.0, MINUTES_MOST * 60 * len(motion.mountings) // motion.duration_s)
    return Programme("[motion] of imu_truth.toml", _times, 1.0, 1.0, most, recording)


def _times(size: float) -> str:
    return "its moves once" if round(size) == 1 else f"its moves {size:.0f} times"


def _repeated(motion: ImuMotion, times: int) -> ImuMotion:
    mountings = tuple(replace(m, moves=m.moves * times) for m in motion.mountings)
    return replace(motion, mountings=mountings)


def _table(unit: DynamicDescription, rate_hz: float) -> Programme:
    truth = _truth(unit)

    def recording(size: float) -> ImuRecording:
        motion = three_axes(size, still_s=STILL_S)
        placed = replace(
            motion, latitude_deg=unit.latitude_deg, gravity_m_per_s2=unit.gravity_m_per_s2
        )
        return simulate_imu(truth, placed, rate_hz, 0)

    without = frozenset({"table_angle_rad", "table"})
    ends = MINUTES_LEAST, MINUTES_MOST
    return Programme("on a table", _minutes, MINUTES, *ends, recording, without)


def _minutes(size: float) -> str:
    return f"{size:.3g} min about each axis"


def _hand(unit: DynamicDescription, rate_hz: float) -> Programme:
    conventions = unit.rate_convention, unit.force_convention

    def recording(size: float) -> ImuRecording:
        motion = HandMotion(round(size), unit.latitude_deg, unit.gravity_m_per_s2)
        return hand_recording(motion, rate_hz, conventions, unit.reference_degc)

    without = frozenset({"table_angle_rad", "table", "temp_degc"})
    return Programme("by hand", _poses, POSES, POSES_LEAST, POSES_MOST, recording, without)


def _poses(size: float) -> str:
    return f"{size:.0f} poses of {REST_S:g} s"
