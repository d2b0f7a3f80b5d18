"""A log of CAN frames through a rig description: joined, checked, every loss counted.

Times. A frame arrives when the bus is free, so the times of arrival scatter. Where a counter or the
clock of the unit numbers the samples, their times (`sample_time`) are those of the straight line
through the times of arrival t over the numbers k, in least squares over the whole log: even, by the
clock of the computer, with every loss left open. Without numbers they are the times of arrival.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.readings.arrays import Pieces
from triaxcal.readings.format import PIECE, Block, Source
from triaxcal.rig.bus.frames import ERR_FLAG, concatenate
from triaxcal.rig.check.census import Census
from triaxcal.rig.description.recorded import ACCELERATIONS, RATES, Recorded, unit_of
from triaxcal.rig.description.resolve import AXES, GYROS
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.logs.linelog import frames_of_log
from triaxcal.rig.logs.logfile import Left
from triaxcal.rig.samples.samples import (
    BAD_CRC,
    CONFLICT,
    DUPLICATE,
    INVALID,
    LOST_FRAME,
    ORPHAN,
    SampleDecoder,
    Samples,
)
from triaxcal.rig.samples.undetected import undetected

_TEMPERATURE, _TIME, SAMPLE_TIME, _CODE = "temperature", "time", "sample_time", "_code"
_NAMED = {"m/s^2", "g", "mg", "deg/s", "rad/s", "deg/h"}
"""Units that unit.toml names."""
_FIRST_PIECES = 2
"""Of a log, from which the rate is taken."""
_ANY_RATE_HZ = 10_000
"""For the times of samples alone: they do not depend on it."""
_TROUBLES = {
    BAD_CRC: "frames with a wrong CRC, length or kind",
    ORPHAN: "frames without their partner",
    DUPLICATE: "samples sent twice",
    INVALID: "values that are none",
    LOST_FRAME: "frames lost by counters of other messages",
    CONFLICT: "samples with an old counter and other values, as of two nodes",
}
"""What is left out, in words."""


class RiggedLog(Source):
    """A row is a sample: physical values, codes as the rig sends them, the time of arrival.

    Parameters
    ----------
    name : str
        Of the rig description, beside the log.

    Raises
    ------
    RefusedError
        As `read_description`.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path = path
        self._rig = rig = read_description(path.parent / name)
        recorded: dict[str, Recorded] = dict(zip((*AXES, *GYROS), rig.sampled, strict=False))
        if rig.temperature is not None:
            recorded[_TEMPERATURE] = rig.temperature
        self._recorded = recorded
        codes = [f"{key}{_CODE}" for key, what in recorded.items() if not what.as_value]
        self.names = (_TIME, *recorded, *codes, SAMPLE_TIME)
        self.tables = ("sample",) * len(self.names)
        self.clocks = {"sample": (0, "ns")}
        units = {key: unit_of(what.unit) for key, what in recorded.items()}
        self._factors: dict[str, float] = {}
        for keys, table, unit in ((AXES, ACCELERATIONS, "g"), (GYROS, RATES, "deg/s")):
            factors = _to_one_unit([recorded[key] for key in keys if key in recorded], table)
            self._factors |= dict(zip(keys, factors, strict=False))
            if any(factor != 1.0 for factor in factors):
                units |= dict.fromkeys(keys, unit)
        units |= dict.fromkeys(codes, "code")
        self.units = {k: units[n] for k, n in enumerate(self.names) if units.get(n)}
        self._said: list[str] = []

    @property
    def findings(self) -> tuple[str, ...]:  # type: ignore[override]  # known when it is read
        """What was left out, and what cannot be detected."""
        return (*self._rig.warnings, *self._said, *undetected(self._rig))

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """As `Source.blocks`.

        Raises
        ------
        RefusedError
            When the log cannot be read, or has no sample of the rig.
        """
        pieces = Pieces(str(self._path), self.names, numbers, texts)
        wanted = {self.names[k]: k for k in pieces.wanted}
        warm = any(name.startswith(_TEMPERATURE) for name in wanted)
        rate_hz = self._rate_hz()
        line = self._line(rate_hz) if SAMPLE_TIME in wanted else None
        decoder = SampleDecoder(self._rig, rate_hz)
        left, tally, census = Left(), _Tally(), Census(self._rig)
        temp: FloatArray = np.array([np.nan])
        for parsed in frames_of_log(self._path, self._rig.lines):
            left.add(parsed)
            left.refuse_differences(self._path)
            census.add(parsed.frames)
            samples = decoder.feed(parsed.frames)
            temps = _temperatures(samples, temp)
            temp = temps[-1:] if len(temps) else temp
            if len(samples.temp_code):
                temp = samples.temp_code[-1:].astype(np.float64)
            kept = samples.status == 0
            if warm:
                tally.cold += int((kept & np.isnan(temps)).sum())
                kept &= ~np.isnan(temps)
            tally.add(samples, kept)
            columns = self._columns(samples, temps)
            columns[SAMPLE_TIME] = samples.t_ns if line is None else line.at(samples.number)
            rows = np.flatnonzero(kept)
            for start in range(0, len(rows), PIECE):
                part = rows[start : start + PIECE]
                yield pieces.block({k: columns[name][part] for name, k in wanted.items()})
        self._said = [*left.notes(self._path.name), *tally.said()]
        if not tally.kept:
            why = "; ".join([*census.faults(), *tally.said()][:3])
            raise RefusedError(
                str(self._path),
                f"no sample of {self._rig.name}" + (f": {why}" if why else ""),
                expected="the log of the rig that the description is about",
            )

    def _rate_hz(self) -> int:
        """Samples a second: by it the turns of a counter are told apart."""
        first = [
            p.frames for p in islice(frames_of_log(self._path, self._rig.lines), _FIRST_PIECES)
        ]
        t_ns = SampleDecoder(self._rig, _ANY_RATE_HZ).feed(concatenate(first)).t_ns
        span_ns = int(t_ns[-1] - t_ns[0]) if len(t_ns) > 1 else 0
        return max(1, round((len(t_ns) - 1) * 1e9 / span_ns)) if span_ns > 0 else _ANY_RATE_HZ

    def _line(self, rate_hz: int) -> _Line | None:
        """Times of samples by their numbers; None where nothing numbers them."""
        rig = self._rig
        if rig.sample_time is None and rig.messages[rig.sample_at].counter is None:
            return None
        decoder, line = SampleDecoder(rig, rate_hz), _Line()
        for parsed in frames_of_log(self._path, rig.lines):
            line.add(decoder.feed(parsed.frames))
        return line

    def _columns(self, samples: Samples, temps: FloatArray) -> dict[str, Any]:
        """All columns of a batch of samples but their times by number."""
        found: dict[str, Any] = {_TIME: samples.t_ns}
        sent = dict(zip(AXES, samples.codes.T, strict=True)) | {_TEMPERATURE: temps}
        sent |= dict(zip(GYROS, samples.gyros.T, strict=False))
        for key, what in self._recorded.items():
            values, factor = sent[key] * what.step + what.zero, self._factors.get(key, 1.0)
            found[key] = values if factor == 1.0 else values * factor
            found[f"{key}{_CODE}"] = sent[key]
        return found


class _Line:
    """Straight line through the times of arrival over the numbers of the samples."""

    def __init__(self) -> None:
        self._first_ns: int | None = None
        self._sums = np.zeros(5)

    def add(self, samples: Samples) -> None:
        """Take the samples of one more batch, but those that fit nothing."""
        good = ~samples.jump
        k, t_ns = samples.number[good], samples.t_ns[good]
        if not len(k):
            return
        if self._first_ns is None:
            self._first_ns = int(t_ns[0])
        x, t = k.astype(np.float64), (t_ns - self._first_ns) * 1e-9
        self._sums += [len(x), x.sum(), t.sum(), x @ x, x @ t]

    def at(self, number: IntArray) -> IntArray:
        """Times, ns since 1970."""
        n, x, t, xx, xt = self._sums.tolist()
        spread = xx - x * x / n
        slope = (xt - x * t / n) / spread if spread > 0.0 else 0.0
        seconds = t / n + slope * (number - x / n)
        times: IntArray = np.rint(seconds * 1e9).astype(np.int64) + (self._first_ns or 0)
        return times


class _Tally:
    """What of the samples was left out."""

    def __init__(self) -> None:
        self.kept = self.bad_status = self.cold = self.lost = self.jumps = 0
        self._last = -1
        self._troubles: Counter[int] = Counter()
        self._errors = 0

    def add(self, samples: Samples, kept: np.ndarray) -> None:
        """Count those of one more batch."""
        self.kept += int(kept.sum())
        self.bad_status += int((samples.status != 0).sum())
        self.jumps += int(samples.jump.sum())
        if len(samples.number):
            self.lost += int(samples.number[-1]) - self._last - len(samples.number)
            self._last = int(samples.number[-1])
        error = (samples.trouble & ERR_FLAG) != 0
        self._errors += int(error.sum())
        self._troubles.update(samples.trouble[~error].tolist())

    def said(self) -> list[str]:
        """One line each."""
        counts = {what: self._troubles[kind] for kind, what in _TROUBLES.items()}
        counts |= {
            "samples lost": self.lost,
            "samples that do not fit the counter and the clock of the one before": self.jumps,
            "samples with a status that is not good, left out": self.bad_status,
            "samples before the first temperature, left out": self.cold,
            "error frames": self._errors,
        }
        return [f"{count} {what}" for what, count in counts.items() if count]


def _temperatures(samples: Samples, before: FloatArray) -> FloatArray:
    """What the thermometer said last at each sample (n,); NaN before its first word."""
    known = np.concatenate([before, samples.temp_code.astype(np.float64)])
    # A code counts from the sample after its number on: it came behind that sample.
    return known[np.searchsorted(samples.temp_number, samples.number, side="left")]


def _to_one_unit(axes: Sequence[Recorded], table: Mapping[str, float]) -> tuple[float, ...]:
    """Factors that bring axes to the unit of a table.

    Ones where all have one unit that unit.toml can name, or one is not known.
    """
    units = [table.get(axis.unit) for axis in axes]
    named = {unit_of(axis.unit) for axis in axes}
    if None in units or (len({axis.unit for axis in axes}) == 1 and named <= _NAMED):
        return (1.0,) * len(axes)
    return tuple(float(unit or 1.0) for unit in units)
