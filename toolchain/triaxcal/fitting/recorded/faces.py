"""Labelled sections of a recording, the unit on its faces: the tilter's six positions by hand."""

from __future__ import annotations

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import did_you_mean, shown
from triaxcal.model.positions import AXES, position_of
from triaxcal.model.thermal.shape import GROUP_GAP_DEGC
from triaxcal.poses.stated import refuse_wrong_unit
from triaxcal.poses.steps import Steps
from triaxcal.readings.measurements import Dwell, MeasurementSet
from triaxcal.readings.samples import READING, TEMP, Samples
from triaxcal.readings.table import ROW
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import FACES, RecordingLayout

Run = tuple[int, int]
"""Start and stop of samples, stop excluded."""
_MOVING = 0.1
"""Of 1 g: a section whose readings scatter by more was not held still."""


def face_measurements(
    unit: UnitDescription, layout: RecordingLayout, samples: Samples
) -> MeasurementSet:
    """One dwell a face and temperature, from all samples of its sections.

    A section is taken whole: who labelled it says that the unit lay still in it. Without a
    temperature column all are at T0.

    Raises
    ------
    RefusedError
        When a face has no section, readings are in another unit, or the unit moved.
    """
    labelled = ((samples.label(run[0]), run) for run in samples.runs())
    faces = [(layout.faces[label], run) for label, run in labelled if label in layout.faces]
    _refuse_missing(unit, layout, samples)
    means = np.array([samples.mean(READING, *run) for _, run in faces])
    refuse_wrong_unit(samples.source, means, layout, Steps.of(samples))
    one_g = float(np.median(np.linalg.norm(means - means.mean(axis=0), axis=1)))
    for _, run in faces:
        _refuse_moving(samples, run, one_g)
    temps = [
        float(samples.mean(TEMP, *run)) if TEMP in samples else unit.t0_degc for _, run in faces
    ]
    cells = _cells([face for face, _ in faces], temps)
    return MeasurementSet(
        samples.source, tuple(_dwell(samples, faces, temps, cell) for cell in cells)
    )


def _refuse_missing(unit: UnitDescription, layout: RecordingLayout, samples: Samples) -> None:
    """Refuse a face without a section, by the label that it should have."""
    unnamed = [face for face in FACES if face not in layout.faces.values()]
    if unnamed:
        raise RefusedError(
            f"{unit.source}, [recording] faces",
            f"no label for {', '.join(unnamed)}",
            expected="six faces, +x, -x, +y, -y, +z and -z",
            remedy="name the sections in which these axes point up, or omit faces: the fit then "
            'uses "|a| = g" alone',
        )
    present = set(samples.table.labels or ())
    for face in FACES:
        labels = [label for label, up in layout.faces.items() if up == face]
        if present.isdisjoint(labels):
            others = sorted(present - set(layout.faces))
            hint = did_you_mean(labels[0], [label for label in others if label])
            raise RefusedError(
                samples.source,
                f"no section {shown(labels[0])}, {face} up{hint}; sections found: "
                + ", ".join(sorted(present)[:10]),
                expected="one of each label in [recording] faces",
                remedy="correct the label in faces, or record that face",
            )


def _cells(faces: list[str], temps: list[float]) -> list[list[int]]:
    """Sections of one face at one temperature."""
    cells: list[list[int]] = []
    for k in sorted(range(len(faces)), key=lambda k: (faces[k], temps[k])):
        last = cells[-1][-1] if cells else None
        if last is not None and faces[last] == faces[k] and temps[k] - temps[last] < GROUP_GAP_DEGC:
            cells[-1].append(k)
        else:
            cells.append([k])
    return sorted(cells)


def _dwell(
    samples: Samples, faces: list[tuple[str, Run]], temps: list[float], cell: list[int]
) -> Dwell:
    runs = [faces[k][1] for k in cell]
    totals = [samples.total(READING, *run) for run in runs]
    return Dwell(
        row=int(samples.one(ROW, runs[0][0])),
        position=position_of(faces[cell[0]][0]),
        temp_degc=float(np.mean([temps[k] for k in cell])),
        voltage_v=np.sum(totals, axis=0) / sum(stop - start for start, stop in runs),
        count=None,
        sd_v=None,
    )


def _refuse_moving(samples: Samples, run: Run, one_g: float) -> None:
    deviation = samples.deviation(READING, *run)
    if deviation.max() <= _MOVING * one_g:
        return
    axis = int(deviation.argmax())
    raise RefusedError(
        samples.place(run[0]),
        f'section "{samples.label(run[0])}" moves: axis {AXES[axis]} scatters by '
        f"{deviation[axis] / one_g:.2g} g",
        expected=f"at most {_MOVING:g} g while the unit lies on a face",
        remedy="cut the section to the time at rest",
    )
