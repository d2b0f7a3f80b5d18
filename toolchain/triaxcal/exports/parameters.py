"""Parameter files: numbers as the autopilot stores them, and what its model costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.screentext import table
from triaxcal.exports.autopilot import AxisModel, Loss, losses
from triaxcal.exports.target import Exported, Source
from triaxcal.model.types import FloatArray

AXES = ("X", "Y", "Z")


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


def exported(source: Source, notes: Notes, model: AxisModel, lines: Sequence[str]) -> Exported:
    """A parameter file, its explanation and the costs of its model in comments."""
    unit = source.fitted.unit
    where, rows = losses(source.fitted, model, notes.label)
    low, high = source.fitted.calibration.range_degc
    said = [
        f"{notes.label}: accelerometer {unit.serial}, {low:g} to {high:g} degC",
        *notes.words,
        *driver_words(source, model),
        f"What this model costs, mg, at {where}",
        "(component: the largest difference of a component from that of the fitted model):",
        *table(
            ("", "||a| - g|", "rms", "component"),
            [_cells(row) for row in rows],
        ),
    ]
    text = "\n".join([*(f"# {line}".rstrip() for line in said), *lines]) + "\n"
    return Exported({notes.file: text.encode()}, "\n".join(said))


def driver_words(source: Source, model: AxisModel) -> list[str]:
    """What the driver must multiply a reading by."""
    unit = source.fitted.calibration.reading_unit
    factors = ", ".join(f"{c:.6g}" for c in model.per_reading)
    return [f"The driver gives x, y, z in m/s^2: {factors} times the reading in {unit}."]


def parameters(rows: Mapping[str, float]) -> dict[str, str]:
    """Text of each parameter."""
    return {name: number_text(value) for name, value in rows.items()}


def _cells(row: Loss) -> tuple[str, ...]:
    values = row.length_largest_g, row.length_rms_g, row.component_largest_g
    return (row.what, *(f"{value * 1e3:.4g}" for value in values))
