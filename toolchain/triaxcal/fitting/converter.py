"""Signs of columns, as in `acceleration = ["-ACC2", "ACC1", "ACC3"]`, go into the constants.

The fits work on readings that have the signs of unit.toml. A device has the converter's own codes.
With U = s V, s = 1 or -1 for each output, K a + U0 = s V gives V = (s K) a + s U0: a row of K and
its bias change sign together, and so do the readings. Every result of a fit below is one of V, so
that codes as the converter gives them give the right answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.recorded import RecordingFit
from triaxcal.model.curves import ThermalModel
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.model.types import FloatArray
from triaxcal.poses.poseset import PoseSet
from triaxcal.readings.measurements import Dwell, MeasurementSet
from triaxcal.unit.recording import RecordingLayout
from triaxcal.unit.recordingfile import SignedColumn


def signs_of(columns: Sequence[SignedColumn]) -> FloatArray:
    """Signs of the columns x, y, z, shape (3,)."""
    return np.array([column.sign for column in columns], dtype=np.float64)


def with_converter_signs(layout: RecordingLayout) -> RecordingLayout:
    """The layout without signs: what is read by it is what the converter gives."""
    bare = tuple(SignedColumn(column.column, 1) for column in layout.acceleration)
    return replace(layout, acceleration=bare)


def layout_of(layout: RecordingLayout, calibration: Calibration) -> RecordingLayout:
    """The layout by which readings are those that the constants of a calibration belong to.

    One of triaxcal 0.1.0 has no `inputs`: its readings have the signs of unit.toml.
    """
    return with_converter_signs(layout) if calibration.inputs else layout


def as_converted(
    layout: RecordingLayout, measurements: MeasurementSet, calibration: Calibration
) -> tuple[MeasurementSet, Calibration]:
    """Readings and constants with the signs of the converter, and the columns' names."""
    named = replace(calibration, inputs=tuple(map(_named, layout.acceleration)))
    signs = signs_of(layout.acceleration)
    if (signs > 0.0).all():
        return measurements, named
    twelve = np.concatenate([np.repeat(signs, 3), signs])
    curves = calibration.thermal.curves
    turned = replace(curves, coefficients=curves.coefficients * twelve[:, None])
    points = tuple(
        replace(
            point,
            constants=point.constants * twelve,
            covariance=point.covariance * np.outer(twelve, twelve),
        )
        for point in calibration.points
    )
    checks = tuple(
        replace(check, dwell=_dwell(check.dwell, signs)) for check in calibration.check_dwells
    )
    dwells = tuple(_dwell(dwell, signs) for dwell in measurements.dwells)
    recording = calibration.recording
    # `parameter_covariance` has only blocks of one output each, in which the signs cancel.
    return replace(measurements, dwells=dwells), replace(
        named,
        thermal=ThermalModel(calibration.thermal.t0_degc, turned),
        points=points,
        check_dwells=checks,
        recording=None if recording is None else _recording(recording, signs, twelve),
    )


def _dwell(dwell: Dwell, signs: FloatArray) -> Dwell:
    return replace(dwell, voltage_v=dwell.voltage_v * signs)


def _recording(found: RecordingFit, signs: FloatArray, twelve: FloatArray) -> RecordingFit:
    turned: RecordingFit = _turned(replace(found, poses=_poses(found.poses, signs)), twelve)
    return turned


def _turned(value: Any, twelve: FloatArray) -> Any:
    """Signs of the constants in whatever a fit holds of them, at any depth.

    `covariance` (12, P, 12, P), `cross` (12, P, ...) and single constants by their `name`.
    """
    if isinstance(value, tuple):
        return tuple(_turned(item, twelve) for item in value)
    if not is_dataclass(value) or isinstance(value, PoseSet | type):
        return value
    changed = {}
    for name in (field.name for field in fields(value)):
        old = getattr(value, name)
        if name == "covariance" and isinstance(old, np.ndarray) and old.ndim == 4:
            changed[name] = old * twelve[:, None, None, None] * twelve[:, None]
        elif name == "cross" and old is not None:
            changed[name] = old * twelve[:, None, None]
        elif name == "value" and (of := getattr(value, "name", "")) in CONSTANT_NAMES:
            changed[name] = old * float(twelve[CONSTANT_NAMES.index(of)])
        else:
            changed[name] = _turned(old, twelve)
    return replace(value, **changed)


def _poses(found: PoseSet, signs: FloatArray) -> PoseSet:
    poses = tuple(replace(pose, reading=pose.reading * signs) for pose in found.poses)
    return replace(found, poses=poses)


def input_words(inputs: Sequence[str], of_code: str) -> list[str]:
    """Which column each input of the routine takes; nothing where there are no columns.

    `of_code` is the name of the array, as "raw_code".
    """
    words = []
    for index, (axis, name) in enumerate(zip("xyz", inputs, strict=False)):
        turned = "; the constants turn its sign" if name.startswith("-") else ""
        column = f"column {plain_name(name.removeprefix('-'))} as the converter gives it"
        words.append(f"{of_code}[{index}], {axis}: {column}{turned}")
    return words


def plain_name(name: str) -> str:
    """Name of a column for a comment of C: no sign that could end it."""
    kept = " _.-[]()%+:"
    return "".join(c if c.isascii() and (c.isalnum() or c in kept) else "_" for c in name)


def _named(column: SignedColumn) -> str:
    return f"{'-' * (column.sign < 0)}{column.column}"
