"""Parameter files: numbers as the autopilot stores them, and what its model costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.screentext import table
from triaxcal.exports.autopilot import (
    TURNING_DEG_PER_S,
    AxisModel,
    Loss,
    gyro_losses,
    losses,
)
from triaxcal.exports.target import Exported, Source
from triaxcal.exports.triad import Gyro, Triad
from triaxcal.model.types import FloatArray

AXES = ("X", "Y", "Z")
_ROUNDING_G = 1e-12
"""A smaller loss is one of floats."""


def as_float32(values: FloatArray) -> FloatArray:
    """Values as an autopilot stores them."""
    return values.astype(np.float32).astype(np.float64)


def stored(model: AxisModel) -> AxisModel:
    """The model with scale and offsets as they are stored."""
    return replace(model, scale=as_float32(model.scale), offset=as_float32(model.offset))


def number_text(value: float) -> str:
    """The shortest text that gives the same float32 again."""
    return f"{np.float32(value):.9g}"


@dataclass(frozen=True)
class Notes:
    """Whose parameters they are, the name of their file, and how to use it."""

    label: str
    file: str
    words: tuple[str, ...]


@dataclass(frozen=True)
class Models:
    """What an autopilot stores: the model of the accelerometer, and the gyro's where it has one."""

    accel: AxisModel
    gyro: AxisModel | None = None


def exported(source: Source, notes: Notes, models: Models, lines: Sequence[str]) -> Exported:
    """A parameter file, its explanation and the costs of its models in comments."""
    accel, gyro = source.triads()
    low, high = accel.range_degc
    rows = losses(accel, models.accel, notes.label)
    said = [
        f"{notes.label}: {source.sensor} {source.serial}, {low:g} to {high:g} degC",
        *notes.words,
        _driver_words("m/s^2", accel, models.accel),
        f"What this model costs, mg, at {accel.samples.where}",
        "(component: the largest difference of a component from that of the fitted model):",
        *table(
            ("", "||a| - g|", "rms", "component"),
            [_cells(row) for row in rows],
        ),
        *(_gyro_words(gyro, models.gyro, notes.label) if gyro and models.gyro else ()),
    ]
    text = "\n".join([*(f"# {line}".rstrip() for line in said), *lines]) + "\n"
    return Exported({notes.file: text.encode()}, "\n".join(said))


def _gyro_words(gyro: Gyro, model: AxisModel, label: str) -> list[str]:
    rate = f"at {TURNING_DEG_PER_S:g} deg/s, deg/s"
    cells = [
        (row.what, *(f"{v:.4g}" for v in np.rad2deg(
            [row.at_rest_rad_per_s * 3600, row.turning_rad_per_s]
        )))
        for row in gyro_losses(gyro, model, label)
    ]  # fmt: skip
    return [
        _driver_words("rad/s", gyro.triad, model),
        "What the gyro's model costs, the largest error of a component in 26 directions",
        "(at rest under 1 g; turning without its g-sensitivity):",
        *table(("", "at rest, deg/h", rate), cells),
    ]


def _driver_words(unit: str, triad: Triad, model: AxisModel) -> str:
    """What the driver must multiply a reading by."""
    factors = ", ".join(f"{c:.6g}" for c in model.per_reading)
    return f"The driver gives x, y, z in {unit}: {factors} times the reading in {triad.reading}."


def parameters(rows: Mapping[str, float]) -> dict[str, str]:
    """Text of each parameter."""
    return {name: number_text(value) for name, value in rows.items()}


def _cells(row: Loss) -> tuple[str, ...]:
    values = row.length_largest_g, row.length_rms_g, row.component_largest_g
    return (row.what, *(f"{value * 1e3:.4g}" if value > _ROUNDING_G else "0" for value in values))
