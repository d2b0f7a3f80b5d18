"""[dynamic]: the rows of its file as the recording of an IMU, in SI units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.description import DynamicDescription
from triaxcal.dynamic.parts import Log
from triaxcal.dynamic.recording import INCREMENT, ImuRecording, ImuSamples
from triaxcal.dynamic.repair import repaired
from triaxcal.model.types import FloatArray
from triaxcal.readings.format import PIECE
from triaxcal.readings.held import HELD_MIN
from triaxcal.readings.table import TIME, ReadTable, read_table

UNEVEN = 0.01
"""Of a step: stamps that are nearer to even ones cost nothing."""
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
    table = read_table(path, unit.file, unit.clock, unit.quantities, ordered=False)
    if len(table.spool) < 3:
        raise RefusedError(str(path), "holds fewer than three samples")
    about = ImuRecording(
        name=str(path),
        pieces=tuple,
        rate_hz=unit.clock.rate_hz or 1.0,
        latitude_deg=unit.latitude_deg,
        gravity_m_per_s2=unit.gravity_m_per_s2,
        rate_convention=unit.rate_convention,
        force_convention=unit.force_convention,
        table=unit.table,
        findings=table.findings,
    )
    step_s = even_step(table)
    if step_s is not None:
        rate_hz = unit.clock.rate_hz or 1 / step_s
        return replace(about, pieces=lambda: _pieces(unit, table, 1 / rate_hz), rate_hz=rate_hz)
    found = repaired([_log_of(unit, table)])
    _refuse_full_scale(unit, found.samples.time_s, found.samples.rate, 1 / found.rate_hz)
    return replace(
        about,
        pieces=lambda: (found.samples[k : k + PIECE] for k in range(0, len(found.samples), PIECE)),
        rate_hz=found.rate_hz,
        findings=(*table.findings, *found.findings),
        force_hz=found.force_hz,
    )


def even_step(table: ReadTable) -> float | None:
    """Step of a log in which nothing is to be repaired, s; None of any other.

    Such a log is never held in memory.
    """
    time_s = table.spool.rows(0, PIECE)[:, 0]
    step_s = float(np.median(np.diff(time_s)))
    last_s, repeats, rows = float(time_s[0]) - step_s, np.zeros(len(table.columns)), 0
    triads = [part for part in table.columns.values() if part.stop - part.start == len("xyz")]
    for _, piece in table.spool.pieces():
        step = np.diff(piece[:, 0], prepend=last_s)
        last_s = float(piece[-1, 0])
        if np.abs(step - step_s).max() > UNEVEN * step_s or not np.isfinite(piece).all():
            return None
        rows += len(piece)
        for k, part in enumerate(triads):
            repeats[k] += (piece[1:, part] == piece[:-1, part]).all(axis=1).sum()
    return None if (repeats > HELD_MIN * rows).any() else step_s


def _log_of(unit: DynamicDescription, table: ReadTable) -> Log:
    rows = np.concatenate([piece for _, piece in table.spool.pieces()])
    return Log(
        source=table.source,
        row_word=table.row_word,
        rows=rows[:, 1],
        time_s=rows[:, 0],
        columns={q.name: rows[:, table.columns[q.name]] for q in unit.quantities},
        rate_hz=unit.clock.rate_hz,
        increments=INCREMENT in {unit.rate_convention, unit.force_convention},
    )


def _how_to_get_it(unit: DynamicDescription) -> str:
    folder = unit.path.parent
    if (folder / "imu_truth.toml").is_file():
        return f"make simulate UNIT={folder.name}, or triaxcal simulate {folder}, writes it"
    return "put it there, or correct [dynamic] recording"


def _pieces(unit: DynamicDescription, table: ReadTable, interval_s: float) -> Iterator[ImuSamples]:
    """Samples in SI units; rates beyond the stated range are refused."""
    for _, rows in table.spool.pieces():
        found = {
            name: np.ascontiguousarray(rows[:, table.columns[name]])
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
