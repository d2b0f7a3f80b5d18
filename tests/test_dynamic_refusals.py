"""Bad recordings: refused in one line that says what was found and what to do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from dynamic_cases import changed, held, mems_short, part, short_motion
from hand_cases import Hand, hand_short, record, stated
from hand_motion import HandNoise, hand_recording
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.poses import static_poses
from triaxcal.dynamic.recording import ImuRecording, ImuSamples
from triaxcal.dynamic.survey import survey
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import MEMS, draw_truth
from triaxcal.simulation.imu_motion import PRECISE_TABLE, ImuMotion, Mounting, Move, three_axes


def _samples() -> ImuSamples:
    return mems_short()[1].all()


def _with(**columns: np.ndarray) -> ImuRecording:
    return changed(mems_short()[1], **columns)


def _without_rests() -> ImuRecording:
    """One turn after the other about a level axis; between two of them it only turns round."""
    moves = tuple(Move(sign * 360.0, 60.0, 0.0) for sign in (1, -1) * 4)
    motion = ImuMotion(tuple(Mounting(moves, 0.0) for _ in range(3)))
    recording = held(simulate_imu(mems_short()[0], motion, 50.0, 1))
    lifted = recording.all().time_s
    turning = np.zeros(len(lifted), dtype=bool)
    for start in motion.start_s:
        turning |= (lifted > start + 0.5) & (lifted < start + 55.0)
    return part(recording, turning)


def _cut(first: float, last: float, axes_minutes: float = 1.5) -> ImuRecording:
    """Nothing was recorded between the two times."""
    recording = held(simulate_imu(mems_short()[0], three_axes(axes_minutes, still_s=12.0), 50.0, 1))
    time = recording.all().time_s
    return part(recording, (time < first) | (time > last))


def _driven(size: float, rests: slice) -> ImuRecording:
    """An even acceleration along the unit's own axes in some of the rests of a hand."""
    recording, samples = hand_short()[1], hand_short()[1].all()
    force = samples.force.copy()
    for rest in survey(recording).rests[rests]:
        inside = (samples.time_s >= rest.start_s) & (
            samples.time_s < rest.start_s + rest.duration_s
        )
        force[inside] *= 1 + size / 9.81
    return changed(recording, force=force)


def _driven_throughout() -> ImuRecording:
    """A vehicle that swings by 0.7 m/s^2, in 8 s."""
    recording, samples = hand_short()[1], hand_short()[1].all()
    swing = 0.7 * np.sin(2 * np.pi * 0.13 * samples.time_s)[:, None] * [1.0, 0.3, 0.5]
    return changed(recording, force=samples.force + swing)


def _clipped(limit_deg_per_s: float) -> ImuRecording:
    recording, samples = hand_short()[1], hand_short()[1].all()
    limit = np.radians(limit_deg_per_s)
    held_back = np.clip(samples.rate, -limit, limit)
    fastest = np.abs(samples.rate).argmax(axis=0), np.arange(3)
    held_back[fastest] = samples.rate[fastest]  # a mended log may hold larger values
    return changed(recording, rate=held_back)


def _changed_half_way(spoil: Callable[[ImuSamples], np.ndarray]) -> ImuRecording:
    """Other rates from half of the time on."""
    recording, samples = hand_short()[1], hand_short()[1].all()
    later = samples.time_s > samples.time_s[-1] / 2
    return changed(recording, rate=np.where(later[:, None], spoil(samples), samples.rate))


def _never_turned() -> ImuRecording:
    """Eleven seconds at rest; coarse rates, whose changes of sign are no turns."""
    still = part(mems_short()[1], _samples().time_s < 11.0)
    noise = np.radians(0.3) * np.random.default_rng(3).standard_normal((len(still.all()), 3))
    return changed(still, rate=still.all().rate + noise)


def _until(rests: int) -> np.ndarray:
    """Samples of a hand up to the end of so many rests."""
    recording = hand_short()[1]
    last = survey(recording).rests[rests - 1]
    return np.asarray(recording.all().time_s < last.start_s + last.duration_s)


def _parts() -> ImuRecording:
    """The rests of a hand alone, without the turns between them, as if nothing were left out."""
    recording, samples = hand_short()[1], hand_short()[1].all()
    inside = np.zeros(len(samples), dtype=bool)
    for rest in survey(recording).rests:
        inside |= (samples.time_s >= rest.start_s) & (
            samples.time_s < rest.start_s + rest.duration_s
        )
    kept = part(recording, inside)
    return changed(kept, time_s=samples.time_s[: inside.sum()])


def _late(seconds: Callable[[np.ndarray], np.ndarray]) -> ImuRecording:
    """Accelerometers with a clock that is late."""
    recording, samples = hand_short()[1], hand_short()[1].all()
    taken = samples.time_s - seconds(samples.time_s)
    force = np.column_stack([np.interp(taken, samples.time_s, c) for c in samples.force.T])
    return changed(recording, force=force)


def _few_rests() -> ImuRecording:
    recording = hand_short()[1]
    fourth = survey(recording).rests[4]
    return part(recording, recording.all().time_s < fourth.start_s)


def _shaken() -> ImuRecording:
    """An engine of 23 Hz."""
    recording, samples = hand_short()[1], hand_short()[1].all()
    shake = 1.5 * np.sin(2 * np.pi * 23.0 * samples.time_s)[:, None] * [0.5, -0.3, 0.8]
    return changed(recording, force=samples.force + shake)


def _saturated() -> ImuRecording:
    limit = np.radians(50.0)
    return _with(rate=np.clip(_samples().rate, -limit, limit))


def _two_axes() -> ImuRecording:
    truth = mems_short()[0]
    return held(simulate_imu(truth, short_motion(2), 50.0, 1))


CASES: dict[str, tuple[Callable[[], ImuRecording], tuple[str, ...]]] = {
    "no rest at all": (
        _without_rests,
        ("the unit never rests", "rests of a second and more", "put the unit down"),
    ),
    "clips in every turn": (
        lambda: _clipped(75.0),
        ("a gyro clips in ", "of the turns between 2", "it is saturated", "turn more slowly"),
    ),
    "four rests by hand": (
        _few_rests,
        ("the unit rests 4 times only", "at least 6 rests in different attitudes"),
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
        ("the force at rest is 0.99", "g taken for m/s^2?", "force_unit"),
    ),
    "never turned": (
        _never_turned,
        ("the unit rests 1 time only",),
    ),
    "one turn of a hand": (
        lambda: part(hand_short()[1], _until(2)),
        ("the unit rests 2 times only",),
    ),
    "parts of a recording, one after the other": (
        _parts,
        ("gravity turns in the unit by", "of how it turns", "use the whole recording"),
    ),
    "exchanged axes": (
        lambda: _with(rate=_samples().rate[:, [1, 2, 0]]),
        ("exchanged axes", "z, x, y", "rate_columns"),
    ),
    "forces half a second late": (
        lambda: _late(lambda time_s: np.full(len(time_s), 0.5)),
        ("the forces are 0.5 s late against the rates", "times of one clock for both triads"),
    ),
    "two clocks of different rates": (
        lambda: _late(lambda time_s: 0.01 * time_s),
        ("the forces are late against the rates by 0.", "two clocks of different rates"),
    ),
    "exchanged from half-way on": (
        lambda: _changed_half_way(lambda s: s.rate[:, [1, 0, 2]]),
        ("up to here", "gyros' x, y, z, and from here on as the gyros' y, x, z", "cut"),
    ),
    "increments from half-way on": (
        lambda: _changed_half_way(lambda s: s.rate / hand_short()[1].rate_hz),
        ("from here on as about 100 times the gyros' x, y, z", "kind of samples"),
    ),
    "left-handed": (
        lambda: _with(force=_samples().force * [1.0, 1.0, -1.0]),
        ("a left-handed triad of accelerometers", "rate_columns and force_columns"),
    ),
    "left-handed gyros": (
        lambda: _with(rate=_samples().rate * [1.0, -1.0, 1.0]),
        ("x, -y, z", "a left-handed triad of gyros"),
    ),
    "saturated": (_saturated, ("gyro x reads exactly", "50 deg/s", "saturated", "more slowly")),
    "an axis never rotated": (
        _two_axes,
        ("turns about axis z by 0.2", "each axis x, y, z"),
    ),
}


@cache
def _with_angles() -> ImuRecording:
    """On a table whose angle is read."""
    motion = replace(short_motion(), table=PRECISE_TABLE)
    return held(simulate_imu(draw_truth(MEMS, 3), motion, 50.0, 1))


def _angles(spoil: Callable[[np.ndarray], np.ndarray]) -> ImuRecording:
    angle = _with_angles().all().table_angle_rad
    assert angle is not None
    return changed(_with_angles(), table_angle_rad=spoil(angle))


def _mountings_in_another_order() -> ImuRecording:
    table = _with_angles().table
    assert table is not None
    return replace(_with_angles(), table=replace(table, mountings=table.mountings[::-1]))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: _angles(lambda angle: -angle),
            ("the table's angle rises while the gyros read", 'put "-" in front of'),
        ),
        (lambda: _angles(np.degrees), ("of each degree of the table's angle", "about x")),
        (
            _mountings_in_another_order,
            ("of each degree of the table's angle", "mounting with number 1"),
        ),
    ],
    ids=["of the wrong sign", "in another unit", "mountings in another order"],
)
def test_a_table_whose_angles_the_gyros_contradict_is_refused(
    make: Callable[[], ImuRecording], words: tuple[str, ...]
) -> None:
    with pytest.raises(RefusedError) as refusal:
        survey(make())
    for word in words:
        assert word in str(refusal.value), str(refusal.value)


def test_a_hand_that_throws_the_unit_about_is_not_refused() -> None:
    """Up to 15 m/s^2 between the rests: the forces turn by far more than gravity does."""
    wild = Hand(poses=24, start_s=10.0, turn_s=(0.6, 1.0), push_m_per_s2=15.0)
    for seed in (1, 2, 3, 4):
        found = survey(record(draw_truth(MEMS, seed), wild, seed))
        assert len(found.rests) > 20


def test_one_axis_after_the_other_is_no_change_of_axes() -> None:
    """While x turns alone, y and z may be called anything."""
    for seed in (1, 2, 3, 4, 5, 6):
        truth = draw_truth(MEMS, seed)
        assert len(survey(held(simulate_imu(truth, short_motion(), 50.0, seed))).stages) == 3


def test_a_table_whose_angles_agree_is_not_refused() -> None:
    for spoil in (lambda angle: angle, lambda angle: angle % (2 * np.pi)):
        assert len(survey(_angles(spoil)).stages) == 3


@pytest.mark.parametrize("case", CASES)
def test_refused(case: str) -> None:
    make, words = CASES[case]
    with pytest.raises(RefusedError) as refusal:
        survey(make())
    text = str(refusal.value)
    assert "\n" not in text
    for word in words:
        assert word in text, text


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: _driven(0.3, slice(0, 1)),
            (
                "0.0 s: the force of this rest is +0.",
                "off gravity by the others",
                "accelerated",
            ),
        ),
        (
            lambda: _driven(-0.25, slice(3, 9)),
            ("off gravity by the others", "rests on something that does not move"),
        ),
        (
            _shaken,
            ("forces of the rests scatter by 0.", "times the noise of [noise]", "shaken"),
        ),
        (
            _driven_throughout,
            ("rests differ from gravity by 0.", "m/s^2 rms", "was accelerated"),
        ),
    ],
    ids=["driven at the start", "driven in some rests", "an engine", "driven throughout"],
)
def test_a_rest_in_a_moving_vehicle_is_refused(
    make: Callable[[], ImuRecording], words: tuple[str, ...]
) -> None:
    recording = make()
    with pytest.raises(RefusedError) as refusal:
        static_poses(recording, survey(recording), stated(hand_short()[0]))
    text = str(refusal.value)
    assert "\n" not in text
    for word in words:
        assert word in text, text


def test_one_rest_that_contradicts_the_others_is_left_out_and_reported() -> None:
    recording = _driven(0.3, slice(7, 8))
    found = survey(recording)
    static = static_poses(recording, found, stated(hand_short()[0]))
    assert static.left_out == (found.rests[7].start_s,)
    without = found.without(static.left_out)
    assert len(without.rests) == len(found.rests) - 1
    assert any(
        f"{found.rests[7].start_s:.1f} s: contradicts the others" in f for f in without.findings
    )
    assert not without.use[found.rests[7].first : found.rests[7].end].any()


@pytest.mark.parametrize("seed", [0, 4, 7, 8, 9])
def test_coarse_accelerometers_contradict_nothing(seed: int) -> None:
    """Means of a rest scatter by 5 mg, and 22 rests have 9 constants: more than 5 mg is no outlier.

    The least sum of absolute residuals goes through nine rests. While the median residual alone was
    the measure, half of such recordings lost rests or were refused, these five among them.
    """
    _, recording = hand_recording(seed, HandNoise(accel_n=8000.0, accel_lsb=0.0), minutes=1.9)
    static = static_poses(recording, survey(recording), DataSheet(0.118794, 8000.0))
    assert static.left_out == ()


@pytest.mark.parametrize(
    ("first", "last", "starts"),
    [(0.0, 14.0, 1), (16.02, 16.06, 2), (3.0, 4.0, 2), (20.0, 20.5, 2)],
    ids=["starts in an even turn", "lost while turning", "lost at rest", "a gap while turning"],
)
def test_a_section_begins_with_its_first_rest(first: float, last: float, starts: int) -> None:
    """Nothing but the force tells an even turn from a bias: all rests read the same rate."""
    recording = _cut(first, last)
    found = survey(recording)
    assert len(found.sections) == starts
    truth = mems_short()[0]
    bias = np.radians(truth.gyro_bias_deg_per_h) / 3600
    samples = recording.all()
    for section in found.sections:
        assert section.still_s > 0.5
        assert 0 <= section.start_s - samples.time_s[section.first] < 1.5 / recording.rate_hz
        # Earth 15 deg/h; noise 0.3 deg/sqrt(h) over half a second 25 deg/h.
        assert np.degrees(np.abs(section.rate - bias).max()) * 3600 < 15 + 5 * 25
    lost_in_a_turn = last > 14.0
    assert any("are not used, the first at" in f for f in found.findings) == (
        lost_in_a_turn or starts == 1
    )


def test_a_gyro_that_clips_for_a_moment_starts_a_new_section() -> None:
    """Between two counts of its full scale the turn is unknown; elsewhere the recording stands."""
    recording, samples = hand_short()[1], hand_short()[1].all()
    fastest = np.abs(samples.rate).max()
    clip = 0.97 * fastest
    rate = np.clip(samples.rate, -clip, clip)
    at = samples.time_s[np.flatnonzero(np.abs(samples.rate).max(axis=1) > clip)]
    found = survey(changed(recording, rate=rate))
    assert len(found.sections) > len(survey(recording).sections)
    assert any(f"a gyro clips at {at[0]:.1f}"[:-1] in text for text in found.findings)


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
