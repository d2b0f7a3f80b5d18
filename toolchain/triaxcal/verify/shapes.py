"""Generated C of a few shapes that together hold every branch of the templates.

For mutation testing and fuzzing, whose subject is the generator's output and not one unit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.render import CONSTANTS_FILE, Provenance, render_constants, render_routine
from triaxcal.delivery import IMAGE_FILE, compensation_of, inputs_sha256
from triaxcal.fit.calibrate import calibrate
from triaxcal.fixedpoint.plan import Plan, make_plan
from triaxcal.fixedpoint.proof import Bound, prove
from triaxcal.model.terms import EXAMPLE_TERMS
from triaxcal.records import MEASUREMENTS_FILE, read_measurements
from triaxcal.unitfile import UnitDescription, read_unit


@dataclass(frozen=True)
class Subject:
    """A plan, its proven bound and the files that a delivery makes of it."""

    name: str
    plan: Plan
    bound: Bound
    files: Mapping[str, bytes]


def _as_shipped(unit: UnitDescription) -> UnitDescription:
    return unit


def _inverse(unit: UnitDescription) -> UnitDescription:
    return replace(unit, method="inverse")


def _saturating(unit: UnitDescription) -> UnitDescription:
    """So fine an output that it saturates, and a raw range that is no power of two."""
    adc = replace(unit.adc, code_min=-8_000_000, code_max=8_200_000)
    return replace(unit, output_q=29, adc=adc)


SHAPES = {
    "direct-two-segments": ("AT-CHERNIAK", _as_shipped),
    "inverse": ("AT-SIM", _inverse),
    "saturating": ("AT-SIM", _saturating),
    "quadratic": ("AT-SIM", _as_shipped),
}
"""Unit that gives the measurements, and what is changed in its description. Together: one segment
and two, raw codes of 24 bits and 32, both range tests and none, both forms, both ends of apply, and
quadratic terms."""

WITH_TERMS = {"quadratic": EXAMPLE_TERMS}


def subject(name: str, units: Path) -> Subject:
    """One of `SHAPES`, from the measurements of a unit in the folder `units`.

    Raises
    ------
    RefusedError
        When the unit's files are refused.
    """
    unit_name, change = SHAPES[name]
    folder = units / unit_name
    unit = change(read_unit(folder))
    calibration = calibrate(unit, read_measurements(folder / MEASUREMENTS_FILE, unit))
    if name in WITH_TERMS:
        calibration = replace(calibration, terms=WITH_TERMS[name])
    plan = make_plan(compensation_of(unit, calibration, unit.method), unit)
    texts = render_routine(plan)
    provenance = Provenance(unit.serial, inputs_sha256(folder), (f"shape {name}",))
    texts[CONSTANTS_FILE] = render_constants(plan, unit.temperature_sensor, provenance)
    files = {file: text.encode() for file, text in texts.items()}
    return Subject(name, plan, prove(plan), {**files, IMAGE_FILE: image_bytes(plan)})
