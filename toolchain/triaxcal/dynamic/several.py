"""Several recordings of one unit as one: what the filter shares between them are the constants.

Between two of them lies a gap, so that each begins a section with an alignment of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.columns import RecordedFile
from triaxcal.dynamic.description import DynamicDescription
from triaxcal.dynamic.reading import read_recording
from triaxcal.dynamic.recording import ImuRecording, ImuSamples

BREAK_S = 3600.0
"""From the end of a recording to the start of the next: the filter counts time through all."""
RATE_TOLERANCE = 0.01
"""Of the sampling rate, between recordings: by it a gap is longer than an interval."""


@dataclass(frozen=True)
class Placed:
    """A recording, what is added to its times, and where it stands then, s."""

    recording: ImuRecording
    added_s: float
    start_s: float
    end_s: float


def read_recordings(unit: DynamicDescription) -> ImuRecording:
    """The recordings of a unit, one after the other; a single one as it is.

    Raises
    ------
    RefusedError
        As `read_recording`; where recordings have not the same rate and columns.
    """
    found = [_one(unit, file) for file in unit.recordings]
    return found[0] if len(found) == 1 else joined_recordings(found)


def _one(unit: DynamicDescription, file: RecordedFile) -> ImuRecording:
    """One recording; where its temperature is stated, with a column of it."""
    read = read_recording(replace(unit, recordings=(file,)))
    stated = file.temp_degc
    if stated is None:
        return read

    def pieces() -> Iterator[ImuSamples]:
        for piece in read.pieces():
            yield replace(piece, temp_degc=np.full(len(piece), stated))

    return replace(read, pieces=pieces)


def joined_recordings(found: list[ImuRecording]) -> ImuRecording:
    """Recordings one after the other, `BREAK_S` between them.

    Raises
    ------
    RefusedError
        Where their rates or columns differ.
    """
    first = found[0]
    for other in found[1:]:
        _refuse_others(first, other)
    placed: list[Placed] = []
    end_s = -BREAK_S
    for recording in found:
        start_s, last_s = _ends(recording)
        added_s = end_s + BREAK_S - start_s if placed else 0.0
        end_s = last_s + added_s
        placed.append(Placed(recording, added_s, start_s + added_s, end_s))

    def pieces() -> Iterator[ImuSamples]:
        for part in placed:
            for piece in part.recording.pieces():
                yield replace(piece, time_s=piece.time_s + part.added_s)

    words = [(r.name, finding) for r in found for finding in r.findings]
    return replace(
        first,
        name=", ".join(recording.name for recording in found),
        pieces=pieces,
        findings=tuple(f"{name}: {finding}" for name, finding in words),
        starts_s=tuple(part.start_s for part in placed[1:]),
        names=tuple(recording.name for recording in found),
    )


def _ends(recording: ImuRecording) -> tuple[float, float]:
    """First and last time, s."""
    pieces = iter(recording.pieces())
    piece = next(pieces)
    start_s = float(piece.time_s[0])
    for later in pieces:
        piece = later
    return start_s, float(piece.time_s[-1])


def _refuse_others(first: ImuRecording, other: ImuRecording) -> None:
    one, two = (next(iter(recording.pieces())) for recording in (first, other))
    if abs(other.rate_hz / first.rate_hz - 1) > RATE_TOLERANCE:
        raise RefusedError(
            other.name,
            f"{other.rate_hz:.5g} samples a second, and {first.rate_hz:.5g} in {first.name}",
            expected="recordings of one sampling rate",
            remedy="record all of them in the same way",
        )
    if (one.temp_degc is None) != (two.temp_degc is None):
        raise RefusedError(
            other.name if two.temp_degc is None else first.name,
            "no temperature, and other recordings have one",
            expected="the temperature of each recording, or of none",
            remedy="name temp_column, or state temp_degc of each [[dynamic.recording]]",
        )
