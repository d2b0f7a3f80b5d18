"""Bad recordings: refused in one line that says what was found and what to do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dynamic_cases import changed, held, mems_short, part, short_motion
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.recording import ImuRecording, ImuSamples
from triaxcal.dynamic.survey import survey
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_motion import three_axes


def _samples() -> ImuSamples:
    return mems_short()[1].all()


def _with(**columns: np.ndarray) -> ImuRecording:
    return changed(mems_short()[1], **columns)


def _no_still() -> ImuRecording:
    time = _samples().time_s
    return part(mems_short()[1], time > 9.0)


def _turning() -> ImuRecording:
    """From the middle of an even turn on: no gyro tells it from a bias."""
    recording = held(simulate_imu(mems_short()[0], three_axes(1.5, still_s=12.0), 50.0, 1))
    samples = recording.all()
    return part(recording, samples.time_s > 14.0)


def _lost(count: int) -> ImuRecording:
    """So many samples are missing in an even turn."""
    recording = held(simulate_imu(mems_short()[0], three_axes(1.5, still_s=12.0), 50.0, 1))
    number = np.arange(len(recording.all().time_s))
    return part(recording, (number < 800) | (number >= 800 + count))


def _cut_at_rest() -> ImuRecording:
    time = _samples().time_s
    return part(mems_short()[1], (time < 3.0) | (time > 4.0))


def _gap() -> ImuRecording:
    time = _samples().time_s
    return part(mems_short()[1], (time < 20.0) | (time > 20.5))


def _saturated() -> ImuRecording:
    limit = np.radians(50.0)
    return _with(rate=np.clip(_samples().rate, -limit, limit))


def _two_axes() -> ImuRecording:
    truth = mems_short()[0]
    return held(simulate_imu(truth, short_motion(2), 50.0, 1))


CASES: dict[str, tuple[Callable[[], ImuRecording], tuple[str, ...]]] = {
    "no stand-still": (
        _no_still,
        ("is at rest for", "then turns at", "at least 5 s at rest at the start"),
    ),
    "starts in an even turn": (
        _turning,
        ("14.0 s: is not at rest: turns at 30.", "at least 5 s at rest at the start"),
    ),
    "one sample lost in a turn": (
        lambda: _lost(1),
        ("16.1 s: after a gap the unit is not at rest: turns at 30.", "lose no samples"),
    ),
    "a gap after three seconds": (
        _cut_at_rest,
        ("0.0 s: is at rest for 3.0 s, then the recording ends or has a gap; expected",),
    ),
    "deg/h for deg/s": (
        lambda: _with(rate=_samples().rate / 36000),
        ("gravity turns in the unit by 1", "but the gyros turn by 0.", "rate_unit"),
    ),
    "other columns for the gyros": (
        lambda: _with(rate=np.zeros_like(_samples().rate)),
        ("but the gyros turn by 0 deg in all", "rate_columns"),
    ),
    "milliseconds for seconds": (
        lambda: changed(replace(mems_short()[1], rate_hz=0.05), time_s=_samples().time_s * 1000),
        ("0.00", "(milliseconds taken for seconds?)", "time_unit"),
    ),
    "degrees for radians": (
        lambda: _with(rate=np.degrees(_samples().rate)),
        ("0.017", "as fast as the gyros measure (degrees taken for radians?)", "rate_unit"),
    ),
    "radians for degrees": (
        lambda: _with(rate=np.radians(_samples().rate)),
        ("57", "(radians taken for degrees?)", "rate_unit"),
    ),
    "g for m/s^2": (
        lambda: _with(force=_samples().force / 9.80665),
        ("the force at the start is 0.99", "g taken for m/s^2?", "force_unit"),
    ),
    "exchanged axes": (
        lambda: _with(rate=_samples().rate[:, [1, 2, 0]]),
        ("exchanged axes", "z, x, y", "rate_columns"),
    ),
    "left-handed": (
        lambda: _with(force=_samples().force * [1.0, 1.0, -1.0]),
        ("a left-handed triad of accelerometers", "rate_columns and force_columns"),
    ),
    "left-handed gyros": (
        lambda: _with(rate=_samples().rate * [1.0, -1.0, 1.0]),
        ("x, -y, z", "a left-handed triad of gyros"),
    ),
    "a gap while turning": (_gap, ("20.5 s", "is at rest for", "after each gap")),
    "saturated": (_saturated, ("gyro x reads exactly", "50 deg/s", "saturated", "more slowly")),
    "an axis never rotated": (
        _two_axes,
        ("turns about axis z by 0.2", "each axis x, y, z"),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_refused(case: str) -> None:
    make, words = CASES[case]
    with pytest.raises(RefusedError) as refusal:
        survey(make())
    text = str(refusal.value)
    assert "\n" not in text
    for word in words:
        assert word in text, text


def test_a_gap_at_rest_is_a_new_alignment() -> None:
    """The unit taken away, and put down again: what stands on both sides is used."""
    time = _samples().time_s
    truth, recording = mems_short()
    found = survey(part(recording, (time < 48.0) | (time > 69.5)))
    assert len(found.sections) == 2
    assert {stage.axis for stage in found.stages} == {0, 1, 2}
    assert truth.rate_convention == recording.rate_convention


def test_the_sound_recording_is_accepted() -> None:
    found = survey(mems_short()[1])
    assert [stage.axis for stage in found.stages] == [0, 1, 2]
    assert len(found.sections) == 1
    turned = np.degrees([stage.turned_rad for stage in found.stages])
    # 360 + 450 + 270 degrees each; scale factors of 3000 ppm, ripple and placement.
    np.testing.assert_allclose(turned, 1080.0, rtol=0.02)
    assert replace(found, rate_max=0.0).use.mean() > 0.7
