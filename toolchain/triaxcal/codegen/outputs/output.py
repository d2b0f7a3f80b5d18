"""An output: files that are made of a plan for the firmware."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from triaxcal.codegen.constants import Provenance
from triaxcal.fixedpoint.angles import AnglesPlan
from triaxcal.fixedpoint.plan import Plan
from triaxcal.unit.thermometer import TemperatureSensor


@dataclass(frozen=True)
class Job:
    """A plan, the thermometer of its codes, and what the files say of where they come from.

    `angles` is None where the device makes no angles.
    """

    plan: Plan
    sensor: TemperatureSensor
    provenance: Provenance
    angles: AnglesPlan | None = None


@dataclass(frozen=True)
class Output:
    """Entry of an output; `files` gives name and content, the same for the same job."""

    name: str
    label: str
    doc: str
    files: Callable[[Job], dict[str, bytes]]
    rank: int = 100
