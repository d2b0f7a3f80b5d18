"""Several files as one recording: their rows one after another, a gap in time between files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.types import FloatArray
from triaxcal.readings.spool import Spool
from triaxcal.readings.table import GAP, LABEL, ReadTable

_ALIKE = 2.0
"""Median steps of time of two files: the one may be so much longer than the other."""


def joined(tables: Sequence[ReadTable]) -> ReadTable:
    """One table of the rows of several, whose clocks have nothing to do with each other.

    Raises
    ------
    RefusedError
        When one of several logs has another rate than the first.
    """
    first = tables[0]
    step_s = first.median_step()
    for table in tables[1:]:
        _refuse_rate(first, table, step_s)
    labels: dict[str, int] = {}
    spool, parts, end_s = Spool(first.spool.columns), [], -2.0 * GAP * step_s
    for table in tables:
        parts.append((len(spool), table.source))
        begin_s = end_s + 2.0 * GAP * step_s
        for _, rows in table.spool.pieces():
            moved = rows.copy()
            moved[:, 0] += begin_s - table.start_s
            if table.labels is not None:
                codes = [labels.setdefault(text, len(labels)) for text in table.labels]
                part = table.columns[LABEL]
                moved[:, part] = np.array(codes, dtype=np.float64)[rows[:, part].astype(np.int64)]
            spool.append(moved)
            end_s = float(moved[-1, 0])
    return replace(
        first,
        source=_together([Path(table.source) for table in tables]),
        spool=spool,
        labels=None if first.labels is None else tuple(labels),
        start_s=0.0,
        low=_extreme(tables, "low").min(axis=0),
        high=_extreme(tables, "high").max(axis=0),
        left_out=sum(table.left_out for table in tables),
        findings=(
            f"{len(tables)} files as one recording; no pose extends from one into the next",
            *(f"{Path(t.source).name}: {told}" for t in tables for told in t.findings),
        ),
        parts=tuple(parts),
    )


def _refuse_rate(first: ReadTable, table: ReadTable, step_s: float) -> None:
    other = table.median_step()
    if not first.clocked or len(table) < 2 or 1.0 / _ALIKE <= other / step_s <= _ALIKE:
        return
    raise RefusedError(
        table.source,
        f"a row every {other:.4g} s, but every {step_s:.4g} s in {Path(first.source).name}",
        expected="files of one rate",
        remedy="read them as recordings of their own, or correct time and time_unit",
    )


def _extreme(tables: Sequence[ReadTable], name: str) -> FloatArray:
    return np.stack([getattr(table, name) for table in tables])


def _together(paths: Sequence[Path]) -> str:
    names = ", ".join(path.name for path in paths[:3])
    more = f" and {len(paths) - 3} more files" if len(paths) > 3 else ""
    return str(paths[0].parent / names) + more
