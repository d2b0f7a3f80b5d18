"""[dynamic]: the rows of its file as the recording of an IMU, in SI units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.description import DynamicDescription
from triaxcal.dynamic.parts import Log
from triaxcal.dynamic.quantities import FORCES, offset_words, offsets_of
from triaxcal.dynamic.recording import INCREMENT, ImuRecording, ImuSamples
from triaxcal.dynamic.repair import UNEVEN, repaired
from triaxcal.model.types import FloatArray
from triaxcal.readings.beats import step_of
from triaxcal.readings.format import PIECE
from triaxcal.readings.held import stuck
from triaxcal.readings.opened import RecordingFile
from triaxcal.readings.strays import strays
from triaxcal.readings.table import TIME, Quantity, ReadTable, read_table
from triaxcal.unit.recordingfile import ClockLayout, FileLayout

SLOWEST_S = SHORTEST_S = 1.0
FULL_SCALE = 0.999
"""Of the stated range: scale factors have errors too."""


def read_recording(unit: DynamicDescription) -> ImuRecording:
    """Recording of a unit; the file is read once, every pass of the filter reads the spool.

    Raises
    ------
    RefusedError
        As `read_table`; with fewer than three samples; where increments are missing.
    """
    path = unit.recording
    if not path.exists():
        raise RefusedError(
            str(path),
            "no such file",
            expected="the recording that unit.toml names",
            remedy=_how_to_get_it(unit),
        )
    tables = _tables(unit)
    for table, _ in tables:
        if len(table.spool) < 3:
            raise RefusedError(table.source, "holds fewer than three samples")
    offsets = {k: v for table, own in tables for k, v in offsets_of(table, own).items()}
    findings = [word for table, _ in tables for word in table.findings]
    findings += offset_words(offsets, unit.quantities)
    _refuse_time_unit(unit, tables[0][0])
    about = ImuRecording(
        name=str(path),
        pieces=tuple,
        rate_hz=unit.clock.rate_hz or 1.0,
        latitude_deg=unit.latitude_deg,
        gravity_m_per_s2=unit.gravity_m_per_s2,
        rate_convention=unit.rate_convention,
        force_convention=unit.force_convention,
        table=unit.table,
        findings=tuple(findings),
        motion=unit.motion,
    )
    step_s = even_step(tables[0][0]) if len(tables) == 1 else None
    if step_s is not None:
        only = tables[0][0]
        rate_hz = unit.clock.rate_hz or 1 / step_s
        return replace(
            about, pieces=lambda: _pieces(unit, only, offsets, 1 / rate_hz), rate_hz=rate_hz
        )
    found = repaired([_log_of(unit, table, own, offsets) for table, own in tables])
    _refuse_full_scale(unit, found.samples.time_s, found.samples.rate, 1 / found.rate_hz)
    return replace(
        about,
        pieces=lambda: (found.samples[k : k + PIECE] for k in range(0, len(found.samples), PIECE)),
        rate_hz=found.rate_hz,
        findings=(*findings, *found.findings),
        force_hz=found.force_hz,
        seen_density=found.seen_density,
    )


def _refuse_time_unit(unit: DynamicDescription, table: ReadTable) -> None:
    """Refuse times of a wrong unit where they show alone."""
    step_s = step_of(table.spool.rows(0, PIECE)[:, 0])
    length_s = float(table.high[0] - table.low[0])
    found = expected = ""
    if step_s > SLOWEST_S:
        found, expected = f"a sample every {step_s:.4g} s", "one sample a second at least"
    elif length_s < SHORTEST_S:
        found, expected = f"{len(table)} samples in {length_s:.3g} s", "rests and turns"
    if found:
        units = " and ".join(unit.clock.units)
        remedy = f"correct time_unit in [dynamic], which is {units}" if table.clocked else ""
        raise RefusedError(table.source, found, expected=expected, remedy=remedy)


def _tables(unit: DynamicDescription) -> list[tuple[ReadTable, tuple[Quantity, ...]]]:
    """Rows and quantities of the recording: of one table, or of those that have own clocks."""
    own = unit.quantities
    if unit.forces is None:
        return _by_tables(unit.recording, unit.file, unit.clock, own)
    forces = unit.forces
    path = unit.recording if forces.file is None else unit.path.parent / forces.file
    others = tuple(q for q in own if q.name not in FORCES)
    mine = tuple(q for q in own if q.name in FORCES)
    return [
        *_by_tables(unit.recording, unit.file, unit.clock, others),
        *_by_tables(path, forces.layout, forces.clock, mine),
    ]


def _by_tables(
    path: Path, layout: FileLayout, clock: ClockLayout, own: tuple[Quantity, ...]
) -> list[tuple[ReadTable, tuple[Quantity, ...]]]:
    """A reading for each table of the file that the quantities come from, with its own clock."""
    file = RecordingFile(path, layout)
    if not file.source.tables:
        return [(read_table(path, layout, clock, own, ordered=False), own)]
    groups: dict[str, list[Quantity]] = {}
    for quantity in own:
        index = file.index(quantity.columns[0], quantity.key)
        groups.setdefault(file.source.tables[index], []).append(quantity)
    if len(groups) > 1:
        stamps = {file.source.tables[file.index(c, "time_column")] for c in clock.columns}
        # A column of times belongs to its own table; the other tables have the format's clock.
        clocks = {k: clock if k in stamps else replace(clock, columns=()) for k in groups}
        return [
            (read_table(path, layout, clocks[k], group, ordered=False), tuple(group))
            for k, group in groups.items()
        ]
    return [(read_table(path, layout, clock, own, ordered=False), own)]


def even_step(table: ReadTable) -> float | None:
    """Step of a log in which nothing is to be repaired, s; None of any other.

    Such a log is never held in memory.
    """
    time_s = table.spool.rows(0, PIECE)[:, 0]
    step_s = float(np.median(np.diff(time_s)))
    last_s = float(time_s[0]) - step_s
    triads = [part for part in table.columns.values() if part.stop - part.start == len("xyz")]
    for _, piece in table.spool.pieces():
        step = np.diff(piece[:, 0], prepend=last_s)
        last_s = float(piece[-1, 0])
        if np.abs(step - step_s).max() > UNEVEN * step_s or not np.isfinite(piece).all():
            return None
        if any((stuck(piece[:, k]) | strays(piece[:, k])).any() for k in triads):
            return None
    return step_s


def _log_of(
    unit: DynamicDescription,
    table: ReadTable,
    own: tuple[Quantity, ...],
    offsets: Mapping[str, FloatArray],
) -> Log:
    rows = np.concatenate([piece for _, piece in table.spool.pieces()])
    return Log(
        source=table.source,
        row_word=table.row_word,
        rows=rows[:, 1],
        time_s=rows[:, 0],
        columns={q.name: rows[:, table.columns[q.name]] - offsets.get(q.name, 0.0) for q in own},
        rate_hz=unit.clock.rate_hz,
        increments=INCREMENT in {unit.rate_convention, unit.force_convention},
    )


def _how_to_get_it(unit: DynamicDescription) -> str:
    folder = unit.path.parent
    if (folder / "imu_truth.toml").is_file():
        return f"make simulate UNIT={folder.name}, or triaxcal simulate {folder}, writes it"
    return "put it there, or correct [dynamic] recording"


def _pieces(
    unit: DynamicDescription,
    table: ReadTable,
    offsets: Mapping[str, FloatArray],
    interval_s: float,
) -> Iterator[ImuSamples]:
    """Samples in SI units; rates beyond the stated range are refused."""
    for _, rows in table.spool.pieces():
        found = {
            name: np.ascontiguousarray(rows[:, table.columns[name]] - offsets.get(name, 0.0))
            for name in (TIME, *(quantity.name for quantity in unit.quantities))
        }
        flat = {name: found[name][:, 0] for name in found if found[name].shape[1] == 1}
        samples = ImuSamples(**(found | flat))
        _refuse_full_scale(unit, samples.time_s, samples.rate, interval_s)
        yield samples


def _refuse_full_scale(
    unit: DynamicDescription, time_s: FloatArray, rate: FloatArray, interval_s: float
) -> None:
    """Refuse rates beyond the range that unit.toml states, where it states one."""
    if unit.rate_max is None:
        return
    if unit.rate_convention == INCREMENT:
        rate = rate / np.diff(time_s, prepend=time_s[0] - interval_s)[:, None]
    beyond = np.argwhere(np.abs(rate) >= FULL_SCALE * unit.rate_max)
    if len(beyond):
        row, axis = beyond[0]
        raise RefusedError(
            f"{unit.recording}, {time_s[row]:.2f} s",
            f"gyro {'xyz'[axis]} reads {np.degrees(rate[row, axis]):.4g} deg/s: it is saturated",
            expected=f"rates within its range, {np.degrees(unit.rate_max):.4g} deg/s",
            remedy="turn more slowly, or correct rate_max in [dynamic]",
        )
