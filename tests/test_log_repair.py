"""Logs that are not as they should be, back to the samples: rows, times, what is uncertain."""

from __future__ import annotations

import numpy as np
import pytest

from spoiled_logs import (
    LOST,
    NOTHING_LOST,
    RATE_HZ,
    SLOW_FORCES,
    Spoil,
    fastest,
    forces_empty,
    holes_of_50_ms,
    increments_among_instants,
    jitter,
    jitter_of_3_ms_and_lost,
    knocked,
    log_of,
    mended,
    one_far_off,
    packets_of_ten,
    restarted,
    stamps_of_seconds,
    zeros,
)
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.repair import repaired
from triaxcal.readings.beats import step_of
from triaxcal.readings.evenclock import even_clock

SD_RATE, SD_FORCE = 3e-4, 3e-3


def rows(seconds: float = 40.0, noise: float = 1.0) -> np.ndarray:
    """Rests and smooth turns, with noise; analytic."""
    time = np.arange(1, round(seconds * RATE_HZ) + 1) / RATE_HZ
    swing = np.sin(2 * np.pi * 0.45 * time) * np.clip(np.sin(2 * np.pi * time / 20), 0, None) ** 2
    rate = swing[:, None] * np.array([2.0, -1.0, 0.5])
    angle = np.cumsum(swing) / RATE_HZ
    force = 9.81 * np.column_stack([np.sin(angle), 0.3 * np.cos(2 * angle), np.cos(angle)])
    rng = np.random.default_rng(1)
    rate = rate + noise * SD_RATE * rng.standard_normal(rate.shape)
    force = force + noise * SD_FORCE * rng.standard_normal(force.shape)
    return np.column_stack([time, rate, force])


@pytest.mark.parametrize("spoil", NOTHING_LOST)
def test_every_sample_is_found_again_at_even_times(spoil: Spoil) -> None:
    whole = rows()
    found = mended(spoil(whole))
    # The first and the last row may miss what tells their place.
    first = int(np.argmax((whole[:, 1:4] == found.samples.rate[5]).all(axis=1))) - 5
    samples = found.samples[-first if first < 0 else 0 :]
    first = max(first, 0)
    kept = whole[first : first + len(samples)]
    assert len(kept) >= len(whole) - 4
    samples = samples[: len(kept)]
    exact = slice(3, -3)
    assert np.array_equal(samples.rate[exact], kept[exact, 1:4])
    assert np.array_equal(samples.force[exact], kept[exact, 4:7])
    late = samples.time_s - kept[:, 0]
    # A line's end has 2 sd / sqrt(4000), 0.03 ms of each millisecond; three of them.
    jitter_s = 3e-3 if "3_ms" in spoil.__name__ else 1e-3
    assert np.abs(late - late.mean()).max() < 0.1 * jitter_s
    assert abs(found.rate_hz / RATE_HZ - 1) < 1e-5
    assert found.findings


@pytest.mark.parametrize("spoil", LOST)
def test_lost_samples_are_interpolated_with_the_uncertainty_that_they_have(spoil: Spoil) -> None:
    whole = rows(120.0)
    found = mended(spoil(whole))
    samples = found.samples
    assert samples.turn_variance is not None
    place = np.rint((samples.time_s - whole[0, 0]) * RATE_HZ).astype(int)
    np.testing.assert_array_equal(np.diff(place), 1)
    filled = np.flatnonzero(samples.turn_variance > 0)
    off = (samples.rate - whole[place, 1:4])[filled] / RATE_HZ
    holes = np.split(np.arange(len(filled)), np.flatnonzero(np.diff(filled) > 1) + 1)
    z = np.array(
        [off[h].sum(axis=0) / np.sqrt(samples.turn_variance[filled[h]].sum()) for h in holes]
    )
    # The variance is that of the worst axis and estimated from some fifty places: the mean square
    # is below one, and no error beyond five deviations.
    assert np.mean(z**2) < 1.0 + 3 * np.sqrt(2 / z.size)
    assert np.abs(z).max() < 5.0
    assert len(holes) < 30 or np.mean(z**2) > 0.2
    untouched = np.setdiff1d(np.arange(len(place)), filled)
    assert np.array_equal(samples.rate[untouched], whole[place[untouched], 1:4])


@pytest.mark.parametrize("spoil", SLOW_FORCES)
def test_slower_accelerometers_are_interpolated_without_a_shift(spoil: Spoil) -> None:
    whole = rows(40.0, noise=0.0)
    # Without noise no reading repeats by chance; rests would repeat themselves.
    whole[:, 4:] += 1e-6 * np.random.default_rng(2).standard_normal((len(whole), 3))
    whole[:, 1:4] += 1e-7 * np.random.default_rng(3).standard_normal((len(whole), 3))
    found = mended(spoil(whole))
    place = np.rint((found.samples.time_s - whole[0, 0]) * RATE_HZ).astype(int)
    off = found.samples.force - whole[place, 4:]
    # A cubic over steps of 40 ms: 3/128 h^4 f'''' with f of 9.81 m/s^2 at up to 2 * 2 rad/s, twice
    # for the swing that the rate itself has.
    assert np.abs(off).max() < 2 * 3 / 128 * 0.04**4 * 9.81 * 4.0**4
    assert found.force_hz == pytest.approx(25.0 if "between" not in spoil.__name__ else 100 / 3)
    assert np.array_equal(found.samples.rate, whole[place, 1:4])


def test_a_pause_is_a_gap_and_no_turn_is_made_up() -> None:
    whole = rows()
    found = mended(np.delete(whole, slice(1000, 1100), 0))
    assert len(found.samples) == len(whole) - 100
    assert "1 gap in the gyros and accelerometers, the longest 1 s at 10 s" in found.findings[-1]


def test_rows_lost_among_jittered_ones_are_lost_where_they_were() -> None:
    """The angles over 4 s are off by what holes of known place are, and not by a row's change."""
    whole = rows(240.0)
    samples = mended(jitter_of_3_ms_and_lost(whole)).samples
    assert samples.turn_variance is not None
    place = np.rint((samples.time_s - whole[0, 0]) * RATE_HZ).astype(int)
    place = place.clip(0, len(whole) - 1)
    off = np.cumsum(samples.rate - whole[place, 1:4], axis=0) / RATE_HZ
    known = np.cumsum(samples.turn_variance)
    span = slice(4 * 100, None, 4 * 100)
    error, variance = np.diff(off[span], axis=0), np.diff(known[span])
    # The variance is that of the worst axis; a row that is displaced in a turn adds some hundred
    # times as much.
    assert np.mean(error**2) < np.mean(variance) * (1 + 4 * np.sqrt(2 / error.size))


def test_one_stray_row_is_a_lost_sample() -> None:
    whole = rows()
    found = mended(one_far_off(whole))
    assert "1 row whose rates do not fit between those before and after" in found.findings[0]
    off = np.abs(found.samples.rate - whole[:, 1:4])
    assert off[fastest(whole)].max() < 10 * SD_RATE
    assert np.delete(off, fastest(whole), 0).max() == 0.0


def test_zeros_of_a_driver_are_lost_samples() -> None:
    whole = rows()
    off = np.abs(mended(zeros(whole)).samples.rate - whole[:, 1:4])
    # What is left is below a twentieth of the fastest readings.
    assert off.max() < 0.05 * np.abs(whole[:, 1:4]).max()


def test_knocks_are_left_as_they_are() -> None:
    whole = knocked(rows())
    assert np.array_equal(mended(whole).samples.rate, whole[:, 1:4])
    assert np.array_equal(mended(whole).samples.force, whole[:, 4:])


def test_increments_among_instants_are_refused() -> None:
    with pytest.raises(RefusedError) as refusal:
        mended(increments_among_instants(rows()))
    said = str(refusal.value)
    assert "of 4000 rows of the gyros do not fit between the rows before and after" in said
    assert "they read 0.01 of it: increments among instants?" in said
    assert "rate_samples in [dynamic] holds for every row" in said


def test_samples_that_are_uneven_in_truth_keep_their_stamps() -> None:
    """The readings say which: between 0.45 Hz swings of 2 rad/s a millisecond is 6e-3 rad/s."""
    even = rows(40.0, noise=0.0)
    time = even[:, 0] + 1e-3 * np.random.default_rng(4).uniform(-1, 1, len(even))
    taken = np.column_stack([time, *(np.interp(time, even[:, 0], c) for c in even[:, 1:].T)])
    taken[:, 1:4] += SD_RATE * np.random.default_rng(5).standard_normal((len(even), 3))
    found = mended(taken)
    assert "are taken at their stamps" in found.findings[0]
    assert np.array_equal(found.samples.time_s, time)


def test_a_drifting_rate_is_followed() -> None:
    beat = np.arange(60000.0)
    exact = beat * 0.01 + 2e-3 * np.sin(2 * np.pi * beat / 60000)
    stamps = exact + 1e-3 * np.random.default_rng(9).standard_normal(len(beat))
    clock = even_clock(np.sort(stamps), step_of(stamps))
    assert clock.lost == 0
    off = clock.time_s - exact
    assert np.abs(off).max() < 2e-4  # a polynomial of order 5 has some 2.4/sqrt(n/36) at its ends


def test_a_clock_that_starts_anew_is_not_smoothed_over() -> None:
    """Nor is one of samples that are held: 4 ms are 0.1 of a step of the slow accelerometers."""
    whole = rows()
    found = mended(restarted(jitter(whole)))
    at = restarted(whole)[:, 0]
    off = found.samples.time_s - at
    # Three lines through 1000 and 2000 stamps of 1 ms: 2/sqrt(n) at their ends; three of them. The
    # jitter may hide which of some rows is the first of the new clock.
    assert np.median(np.abs(off)) < 1e-4
    assert (np.abs(off) > 2e-4).sum() <= 2 * 3
    assert np.abs(off).max() < 4.5e-3


def test_a_sensor_asked_less_often_than_it_samples_is_noisier() -> None:
    found = mended(forces_empty(rows()))
    # 0.003 m/s^2 a sample, at 25 Hz; about 1000 samples at rest and in turns say it to 4 %.
    assert found.seen_density["force"] == pytest.approx(SD_FORCE / 5, rel=0.12)
    assert "rate" not in found.seen_density
    assert any("white noise of 6" in finding for finding in found.findings)


def test_increments_are_not_made_up() -> None:
    whole = rows()
    spoiled = holes_of_50_ms(whole)
    with pytest.raises(RefusedError, match=r"30 rows lost in 6 places, the first at .*summed"):
        repaired([log_of(spoiled, increments=True)])
    assert repaired([log_of(jitter(whole), increments=True)]).samples.turn_variance is None


def test_a_clock_that_is_none() -> None:
    whole = rows()
    whole[:, 0] = np.random.default_rng(3).permutation(len(whole))
    with pytest.raises(RefusedError) as refusal:
        mended(whole)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(("spoil", "off_s"), [(packets_of_ten, 3e-4), (stamps_of_seconds, 5e-3)])
def test_rows_of_packets_have_beats_of_their_own(spoil: Spoil, off_s: float) -> None:
    whole = rows(120.0)
    found = mended(spoil(whole))
    assert "stamps of packets" in found.findings[0]
    assert np.array_equal(found.samples.rate, whole[:, 1:4])
    late = found.samples.time_s - whole[:, 0]
    # The line through 1200 packets of 3 ms, at its ends; seconds hide half a sample.
    assert np.abs(late - late.mean()).max() < off_s
    without = np.delete(whole, slice(5000, 5010), 0)
    lost = mended(
        spoil(without)
        if spoil is stamps_of_seconds
        else np.delete(spoil(whole), slice(5000, 5010), 0)
    )
    place = np.rint((lost.samples.time_s - lost.samples.time_s[0]) * RATE_HZ).astype(int)
    assert place[-1] == len(whole) - 1
    assert lost.samples.turn_variance is not None
    filled = np.flatnonzero(lost.samples.turn_variance)
    assert len(filled) == 10


def test_steps_that_add_up_are_no_jitter() -> None:
    """A program that waits 9 to 11 ms for each sample: the stamps wander from any even clock."""
    whole = rows()
    step = np.random.default_rng(10).integers(9, 12, len(whole)) * 1e-3
    time = np.cumsum(step)
    taken = np.column_stack([time, *(np.interp(time, whole[:, 0], c) for c in whole[:, 1:].T)])
    taken = taken[time < whole[-1, 0]]
    found = mended(taken)
    assert np.array_equal(found.samples.time_s, taken[:, 0])
    assert "uneven by 0.8" in found.findings[0]
    assert "taken at their stamps" in found.findings[0]
