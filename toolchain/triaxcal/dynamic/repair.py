"""A log that is not as it should be, as samples on one even clock: what was done is reported.

Each triad is put on its own clock: the rows that have it, without those that only repeat it. Two
triads of one clock stay together. Of two clocks the faster one counts, and the other triad is
interpolated between its own instants.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.screentext import counted
from triaxcal.dynamic.misplaced import settled
from triaxcal.dynamic.parts import NAMES, Log, Part, between, hole_words
from triaxcal.dynamic.polled import density_words, white_density
from triaxcal.dynamic.recording import ImuSamples
from triaxcal.dynamic.series import at_times, held_series, series_of
from triaxcal.dynamic.strayrows import stray_rows
from triaxcal.model.types import BoolArray, FloatArray, IntArray
from triaxcal.readings.evenclock import EvenClock, taken_at_stamps
from triaxcal.readings.held import changed, held_share, stuck
from triaxcal.readings.sequence import sequence

UNEVEN = 0.01
"""Of a step: stamps that are nearer to even ones cost nothing."""
TOGETHER = 0.75
"""Of the rows of either triad: where more have both, the triads have one clock."""
SLOWER = 1.2
"""Of the step of the other triad: a slower one may have been left out in part."""
ALIKE = 0.9
"""Of the changes of two held triads: where more are in one row, they are sampled together."""
_LEAST = 3


@dataclass(frozen=True)
class Repaired:
    """Samples on one clock.

    Attributes
    ----------
    samples : ImuSamples
    rate_hz : float
        Of the samples.
    force_hz : float
        At which the accelerometers were sampled.
    findings : tuple of str
    seen_density : mapping
        As of `ImuRecording`.
    """

    samples: ImuSamples
    rate_hz: float
    force_hz: float
    findings: tuple[str, ...]
    seen_density: Mapping[str, float]


def repaired(logs: Sequence[Log]) -> Repaired:
    """Samples of the rows of one file, or of a file for each of two triads.

    Raises
    ------
    RefusedError
        As `sequence`; where a triad has too few rows; where two triads have no time in common;
        where increments are lost or have different clocks.
    """
    parts: list[Part] = []
    findings: list[str] = []
    for log in logs:
        for names in _groups(log):
            found, words = _parts(log, names)
            parts += found
            findings += words
    base = min(parts, key=lambda part: part.rank)
    if any(log.increments for log in logs):
        _refuse_increments(logs[0], parts)
    time_s, step_s = base.series.time_s, base.series.step_s
    columns: dict[str, FloatArray] = {}
    spread: dict[str, FloatArray] = {}
    inside = np.ones(len(time_s), dtype=bool)
    seen: dict[str, float] = {}
    for part in parts:
        if part.held or part.series.step_s > SLOWER * step_s:
            own = {n: white_density(part.series, p) for n, p in part.places.items()}
            seen |= own
            findings += [f"{NAMES[n]}: {density_words(n, density)}" for n, density in own.items()]
        values, variance = part.series.values, part.series.variance
        findings += hole_words(part)
        if part is not base:
            values, variance, there = at_times(part.series, time_s)
            inside &= there
            findings.append(
                f"{part.words} at {1 / part.series.step_s:.5g} Hz, {base.words} at "
                f"{1 / step_s:.5g} Hz: the former are interpolated between their own instants"
            )
        for name, place in part.places.items():
            columns[name] = values[:, place]
            spread[name] = variance[:, place].max(axis=1) * (part.series.step_s / step_s)
    if inside.sum() < _LEAST:
        raise RefusedError(
            logs[-1].source,
            "gyros and accelerometers have no time in common",
            expected="times of one origin for both",
            remedy="correct the columns of time and their units in [dynamic]",
        )
    for log in logs:
        for name in log.columns.keys() - NAMES.keys():
            columns[name] = between(log.time_s, log.columns[name][:, 0], time_s)
    whole = {name: np.ascontiguousarray(values[inside]) for name, values in columns.items()}
    force = spread["force"]
    if "force2" in spread:
        force = np.maximum(force, spread["force2"])
    doubts = {"turn_variance": spread["rate"] * step_s**2, "force_variance": force}
    if any(values.any() for values in doubts.values()):
        whole |= {name: np.ascontiguousarray(values[inside]) for name, values in doubts.items()}
    force_hz = min(1 / part.series.step_s for part in parts if "force" in part.places)
    samples = ImuSamples(time_s=np.ascontiguousarray(time_s[inside]), **whole)
    return Repaired(samples, 1 / step_s, min(force_hz, 1 / step_s), tuple(findings), seen)


def _rows(count: int) -> str:
    return counted(count, "row")


def _groups(log: Log) -> list[tuple[str, ...]]:
    """Triads that have one clock, by the rows that have their readings."""
    names = [name for name in NAMES if name in log.columns]
    have = {name: np.isfinite(log.columns[name]).all(axis=1) for name in names}
    groups: list[tuple[str, ...]] = []
    for name in names:
        for k, group in enumerate(groups):
            both = have[name] & have[group[0]]
            if both.sum() > TOGETHER * max(have[name].sum(), have[group[0]].sum()):
                groups[k] = (*group, name)
                break
        else:
            groups.append((name,))
    return groups


def _parts(log: Log, names: tuple[str, ...]) -> tuple[list[Part], list[str]]:
    """Series of triads whose readings come in the same rows, and what was done."""
    values = np.column_stack([log.columns[name] for name in names])
    whole = np.isfinite(values).all(axis=1)
    words = []
    if not whole.all() and len(names) == len(log.columns.keys() & NAMES.keys()):
        words.append(
            f"{_rows(int((~whole).sum()))} without all readings left out, the first is "
            f"{log.row_word} {int(log.rows[np.argmin(whole)])}"
        )
    if whole.sum() < _LEAST:
        raise RefusedError(
            log.source, f"{_rows(int(whole.sum()))} with readings of {' and '.join(names)}"
        )
    rows = np.flatnonzero(whole)
    clock, stamps_s, values, more = _in_order(log, rows, values[rows])
    words += more
    if clock.smoothed:
        hz, rms = f"{1 / clock.step_s:.6g} Hz", f"{1e3 * clock.rms_s:.3g} ms rms"
        if names[0] == "rate" and taken_at_stamps(stamps_s, clock, values[:, :3]):
            clock = replace(clock, time_s=stamps_s)
            words.append(f"samples are uneven by {rms}, and are taken at their stamps")
        else:
            words.append(f"stamps scatter by {rms} about an even clock of {hz}: its times are used")
            clock = settled(clock, stamps_s, values)
    else:
        uneven = np.std(np.diff(stamps_s) / np.diff(clock.number) - clock.step_s)
        if uneven > UNEVEN * clock.step_s:
            rms = f"{1e3 * uneven:.3g} ms rms"
            words.append(f"samples are uneven by {rms} from row to row: taken at their stamps")
    places = {name: slice(3 * k, 3 * k + 3) for k, name in enumerate(names)}
    return _unheld(log, places, clock, values, words), words


def _in_order(
    log: Log, rows: IntArray, values: FloatArray
) -> tuple[EvenClock, FloatArray, FloatArray, list[str]]:
    """Clock, stamps and readings of the rows in the order of the clock's beats."""
    time_s = log.time_s[rows]
    if log.rate_hz is not None:
        number = np.rint((time_s - time_s[0]) * log.rate_hz).astype(np.int64)
        return EvenClock(number, time_s, 1 / log.rate_hz, 0.0, False), time_s, values, []
    same = np.zeros(len(rows), dtype=bool)
    same[1:] = (values[1:] == values[:-1]).all(axis=1)
    found = sequence(time_s, same, log.rows[rows], f"{log.source}, {log.row_word}")
    return found.clock, time_s[found.rows], values[found.rows], list(found.findings)


def _unheld(
    log: Log,
    places: Mapping[str, slice],
    clock: EvenClock,
    values: FloatArray,
    words: list[str],
) -> list[Part]:
    """Series of the triads, without the rows that only repeat one; `words` is added to."""
    shares = {name: held_share(values[:, place]) for name, place in places.items()}
    if log.increments or not any(shares.values()):
        known = np.ones(len(values), dtype=bool)
        if not log.increments:
            known = ~np.logical_or.reduce([stuck(values[:, place]) for place in places.values()])
        if not known.all():
            words.append(
                f"{_rows(int((~known).sum()))} with the readings of the row before while the "
                "unit moves: taken as lost"
            )
        stray = stray_rows(log, places, values, clock) & known
        if stray.any():
            known &= ~stray
            words.append(
                f"{_rows(int(stray.sum()))} whose rates do not fit between those before and after: "
                "taken as lost"
            )
        return [Part(places, series_of(clock, values, known, _turns(places)))]
    whole = {name: place for name, place in places.items() if shares[name]}
    if len(whole) > 1 and _change_together([changed(values[:, p]) for p in whole.values()]):
        groups = [whole, *({n: p} for n, p in places.items() if n not in whole)]
    else:
        groups = [{name: place} for name, place in places.items()]
    parts = []
    for group in groups:
        own = values[:, np.concatenate([np.arange(p.start, p.stop) for p in group.values()])]
        put = {name: slice(3 * k, 3 * k + 3) for k, name in enumerate(group)}
        if next(iter(group)) in whole:
            series = held_series(clock.time_s, own, clock.step_s, _turns(put))
            part = Part(put, series, held=True)
            words.append(
                f"{part.words} repeat their values: sampled at {1 / series.step_s:.5g} Hz in a log "
                f"of {1 / clock.step_s:.5g} Hz, the repeats are left out"
            )
        else:
            known = np.ones(len(own), dtype=bool)
            part = Part(put, series_of(clock, own, known, _turns(put)))
        parts.append(part)
    return parts


def _change_together(changes: list[BoolArray]) -> bool:
    both = np.logical_and.reduce(changes).sum()
    return bool(both > ALIKE * np.logical_or.reduce(changes).sum())


def _turns(places: Mapping[str, slice]) -> slice:
    return places.get("rate", slice(0, 0))


def _refuse_increments(log: Log, parts: Sequence[Part]) -> None:
    if len(parts) > 1:
        raise RefusedError(
            log.source,
            "gyros and accelerometers come in different rows",
            expected="increments of both triads over the same intervals",
            remedy="record both in each row, or read instants",
        )
    series = parts[0].series
    if series.lost:
        raise RefusedError(
            log.source,
            f"{_rows(series.lost)} lost in {counted(series.places, 'place')}, the first at "
            f"{series.first_s:.6g} s",
            expected="every increment, because the increments are summed",
            remedy="record again, or cut the recording there",
        )
