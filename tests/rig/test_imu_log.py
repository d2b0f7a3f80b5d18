"""A log of CAN frames of an IMU is a recording that `triaxcal dynamic` takes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import imu_cases
import numpy as np
import pytest

from dynamic_cases import mems_short
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.description import read_dynamic
from triaxcal.dynamic.reading import read_recording
from triaxcal.dynamic.recording import ImuRecording, ImuSamples
from triaxcal.rig.description.rigfile import read_description

LATE_NS = 1_500_000
"""Another message of 130 us is sent first, ten times at most, at 1 Mbit/s."""


def samples() -> ImuSamples:
    return mems_short()[1].all()


def read(folder: Path) -> ImuRecording:
    return read_recording(read_dynamic(folder))


def test_readings_are_the_codes_that_were_sent_and_times_are_even(tmp_path: Path) -> None:
    sent = samples()
    found = read(imu_cases.write_unit(tmp_path / "U", sent, late_ns=LATE_NS)).all()
    force, rate = imu_cases.codes_of(sent)
    assert len(found) == len(sent)
    np.testing.assert_allclose(found.force, force * imu_cases.FORCE_LSB * imu_cases.G, rtol=1e-14)
    np.testing.assert_allclose(found.rate, np.radians(rate * imu_cases.RATE_LSB), rtol=1e-14)
    # The line's slope is known to sd(late) / sd(t) / sqrt(n), sd(t) = T / sqrt(12): 5 sd.
    n, span_s = len(sent), sent.time_s[-1] - sent.time_s[0]
    late_s = LATE_NS * 1e-9 / np.sqrt(12)
    steps = np.diff(found.time_s)
    assert np.ptp(steps) < 1.2e-6  # doubles of 1.7e9 s have 0.24 us
    slope = (found.time_s[-1] - found.time_s[0]) / span_s - 1.0
    assert abs(slope) < 5 * late_s / (span_s / np.sqrt(12)) / np.sqrt(n)


def test_the_log_gives_the_constants_of_the_same_samples(tmp_path: Path) -> None:
    _, recording = mems_short()
    unit = read_dynamic(imu_cases.write_unit(tmp_path / "U", samples(), late_ns=LATE_NS))
    by_log = calibrate_dynamic(read_recording(unit), unit.noise)
    force, rate = imu_cases.codes_of(samples())
    same = replace(
        samples(), force=force * imu_cases.FORCE_LSB * imu_cases.G,
        rate=np.radians(rate * imu_cases.RATE_LSB), temp_degc=None,
    )  # fmt: skip
    direct = calibrate_dynamic(replace(recording, pieces=lambda: (same,)), unit.noise)
    # Times differ by some 1e-7 s, and passes end at 0.05 sd.
    assert np.abs((by_log.p - direct.p) / direct.sd).max() < 0.1


def test_what_is_lost_or_bad_is_left_out_and_said(tmp_path: Path) -> None:
    sent = samples()[:900]
    folder = imu_cases.write_unit(
        tmp_path / "U", sent, lost=(100, 101), spoiled=(200,), bad=(300, 301, 302)
    )
    recording = read(folder)
    kept = recording.all()
    gone = {100, 101, 200, 300, 301, 302}
    assert len(kept) == len(sent)
    assert kept.turn_variance is not None
    # Filled by interpolation, with an uncertainty that also touches the samples beside.
    filled = set(np.flatnonzero(kept.turn_variance).tolist())
    assert gone <= filled
    assert len(filled) < 3 * len(gone)
    said = "; ".join(recording.findings)
    for text in (
        "1 frames with a wrong CRC", "3 samples with a status that is not good, left out",
        "3 samples lost", "3 frames without their partner",
    ):  # fmt: skip
        assert text in said, said


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('gyro_y = "IMU_RATE.RateY"\n', "", "gyro_y: missing; expected all three gyros or none"),
        ("IMU_RATE.RateY", "IMU_RATE.RateX", "IMU_RATE.RateX is gyro_x already"),
        ("IMU_RATE.RateY", "IMU_FORCE.ForceY", "its unit is"),
        ('join = "counter"\n', "", "the axes come in 2 frames"),
    ],
)
def test_wrong_gyros_are_refused(tmp_path: Path, old: str, new: str, text: str) -> None:
    folder = imu_cases.write_unit(tmp_path / "U", samples()[:100])
    words = (folder / "rig.toml").read_text(encoding="utf-8")
    assert old in words
    (folder / "rig.toml").write_text(words.replace(old, new), encoding="utf-8")
    with pytest.raises(RefusedError) as refusal:
        read_description(folder / "rig.toml")
    assert text in str(refusal.value)


@pytest.mark.parametrize(
    ("unit", "named", "per"),
    [
        ("mdps", "deg/s", 1e-3), ("rad/s", "rad/s", np.degrees(1.0)), ("°/h", "deg/h", 1 / 3600),
    ],
)  # fmt: skip
def test_rates_of_any_unit_come_in_one_that_unit_toml_names(
    tmp_path: Path, unit: str, named: str, per: float
) -> None:
    folder = imu_cases.write_unit(tmp_path / "U", samples()[:200])
    for name, old, new in (
        ("imu.dbc", '(0.015625,0) [-512|511.984375] "deg/s"', f'(0.015625,0) [0|0] "{unit}"'),
        ("unit.toml", 'rate_unit = "deg/s"', f'rate_unit = "{named}"'),
    ):  # fmt: skip
        text = (folder / name).read_text(encoding="utf-8")
        assert old in text
        (folder / name).write_text(text.replace(old, new), encoding="utf-8")
    _, rate = imu_cases.codes_of(samples()[:200])
    found = read(folder).all()
    np.testing.assert_allclose(found.rate, np.radians(rate * imu_cases.RATE_LSB * per), rtol=1e-13)
