"""Bad recordings: refused in one line that says what was found and what to do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dynamic_cases import changed, held, mems_short, part, short_motion
from triaxcal.dynamic.recording import ImuRecording, ImuSamples
from triaxcal.dynamic.survey import survey
from triaxcal.errors import RefusedError
from triaxcal.simulation.imu import simulate_imu


def _samples() -> ImuSamples:
    return mems_short()[1].all()


def _with(**columns: np.ndarray) -> ImuRecording:
    return changed(mems_short()[1], **columns)


def _no_still() -> ImuRecording:
    time = _samples().time_s
    return part(mems_short()[1], time > 9.0)


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
        ("stands still for", "then turns at", "at least 5 s at rest at the start"),
    ),
    "degrees for radians": (
        lambda: _with(rate=np.degrees(_samples().rate)),
        ("0.017", "as fast as the gyros say (degrees taken for radians?)", "rate_unit"),
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
    "a gap while turning": (_gap, ("20.5 s", "stands still for", "after each gap")),
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
