"""Parts of a sample: which there are by a rig description, and what they make together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import BoolArray
from triaxcal.rig.description.description import MessageUse, RigDescription
from triaxcal.rig.description.layout import Condition
from triaxcal.rig.samples.join import Joined, Part


@dataclass(frozen=True)
class PartPlan:
    """What to take from the frames of one part."""

    use: MessageUse
    conditions: tuple[Condition, ...]
    axes: tuple[int, ...]


def parts_of(rig: RigDescription) -> list[PartPlan]:
    """Parts of a sample: what one frame gives of it."""
    by_frame: dict[tuple[str, tuple[Condition, ...]], list[int]] = {}
    for i, axis in enumerate(rig.sampled):
        by_frame.setdefault((axis.message, axis.conditions), []).append(i)
    return [
        PartPlan(rig.messages[name], conditions, tuple(axes))
        for (name, conditions), axes in by_frame.items()
    ]


def first_of(columns: Iterable[IntArray | None]) -> IntArray | None:
    """First column that there is."""
    return next((column for column in columns if column is not None), None)


def lacking(joined: Joined) -> BoolArray | None:
    """Which samples lack a number; None where none does."""
    goods = [part.good for part in joined.parts if part.good is not None]
    if not goods:
        return None
    good: BoolArray = np.logical_and.reduce(goods)
    return None if good.all() else ~good


def codes_of(parts: list[Part], plans: list[PartPlan]) -> np.ndarray:
    """What is recorded, shape (n, 3), or (n, 6) with gyros."""
    by_axis = {
        axis: column
        for part, plan in zip(parts, plans, strict=True)
        for axis, column in zip(plan.axes, part.axes, strict=True)
    }
    return np.stack([by_axis[axis] for axis in range(len(by_axis))], axis=1)


def status_of_parts(parts: list[Part], zero: IntArray) -> IntArray:
    """Status of all parts of a sample, or-ed."""
    said = [part.status for part in parts if part.status is not None]
    status = said[0] if said else zero
    for other in said[1:]:
        status = status | other
    return status
