"""Forces of reversed sign: what gravity cannot show, and what the first rest does.

A sensor at rest reads the specific force, +g along the axis that points up. Some logs hold gravity
itself, with the other sign. Reversed forces turn in the unit exactly as the right ones do,
f' = -w x f, so that no turn shows the difference. A mirrored triad is another matter: one or two
of its signs are turned, and its forces do not turn as the gyros say.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.description import DynamicDescription
from triaxcal.dynamic.quantities import FORCES
from triaxcal.dynamic.recording import ImuRecording, ImuSamples
from triaxcal.dynamic.windows import WINDOW_S, Windows, read_windows
from triaxcal.model.types import FloatArray
from triaxcal.readings.table import Quantity

REST_S = 0.5
QUIET_M_PER_S2 = 0.1
QUIET_RAD_PER_S = np.radians(1.0)
"""Changes from a window to the next at rest: a hand makes larger ones."""
ALONG = 0.7
"""Cosine: an axis that is stated to point up leans by less than 45 deg."""


def upright(
    unit: DynamicDescription, recording: ImuRecording
) -> tuple[DynamicDescription, ImuRecording]:
    """Unit and recording with the signs of the forces that `up_at_start` asks for.

    Raises
    ------
    RefusedError
        Where another axis points up or down at the first rest.
    """
    up = unit.up_at_start
    force = force_at_first_rest(recording)
    if up is None:
        axis = int(np.argmax(np.abs(force)))
        said = (
            f"{'xyz'[axis]} reads {force[axis]:+.4g} m/s^2 at the first rest and is taken to point "
            f"{'up' if force[axis] > 0 else 'down'}: forces of reversed sign would look the same, "
            "and up_at_start is not given"
        )
        return unit, replace(recording, findings=(*recording.findings, said))
    axis, sign = "xyz".index(up[1]), 1.0 if up[0] == "+" else -1.0
    share = sign * float(force[axis]) / float(np.linalg.norm(force))
    if abs(share) < ALONG:
        other = int(np.argmax(np.abs(force)))
        raise RefusedError(
            f"{unit.path}, [dynamic] up_at_start",
            f"{up}, but at the first rest {'xyz'[other]} reads {force[other]:.4g} m/s^2 and "
            f"{'xyz'[axis]} {force[axis]:.4g}",
            expected="the axis along which gravity acts there",
            remedy="correct up_at_start, or force_columns",
        )
    if share > 0:
        return unit, recording
    said = (
        f"forces reversed: {'xyz'[axis]} reads {force[axis]:+.4g} m/s^2 at the first rest and "
        f"up_at_start is {up}; all their signs are turned"
    )
    quantities = tuple(_turned(q) if q.name in FORCES else q for q in unit.quantities)
    return replace(unit, quantities=quantities), replace(
        recording,
        pieces=lambda: _reversed(recording),
        findings=(*recording.findings, said),
    )


def force_at_first_rest(recording: ImuRecording) -> FloatArray:
    """Mean force (3,), m/s^2, over the first quiet stretch of `REST_S`; of the start without one.

    The recording is read up to that stretch only.
    """
    head: list[ImuSamples] = []
    begun = replace(recording, pieces=lambda: head)
    pieces = iter(recording.pieces())
    while True:
        more = list(islice(pieces, max(1, len(head))))
        head.extend(more)
        windows = read_windows(begun)[0]
        # Where more follows, the last window may lack samples.
        whole = windows.part(windows.first < windows.first[-1]) if more else windows
        found = _quiet_force(whole)
        if found is not None:
            return found
        if not more:
            return np.asarray(windows.force[: round(REST_S / WINDOW_S)].mean(axis=0))


def _quiet_force(windows: Windows) -> FloatArray | None:
    """Mean force (3,), m/s^2, over the first stretch of `REST_S` that is quiet."""
    length = round(REST_S / WINDOW_S)
    jump = np.abs(np.diff(windows.force, axis=0)).max(axis=1) > QUIET_M_PER_S2
    jump |= np.abs(np.diff(windows.rate, axis=0)).max(axis=1) > QUIET_RAD_PER_S
    for start in range(len(windows.first) - length + 1):
        if not jump[start : start + length - 1].any():
            return np.asarray(windows.force[start : start + length].mean(axis=0))
    return None


def _turned(quantity: Quantity) -> Quantity:
    return replace(quantity, convert=lambda values: -quantity.convert(values))


def _reversed(recording: ImuRecording) -> Iterator[ImuSamples]:
    for piece in recording.pieces():
        force2 = None if piece.force2 is None else -piece.force2
        yield replace(piece, force=-piece.force, force2=force2)
