"""Generated C of a few shapes that together hold every branch of the templates.

For mutation testing and fuzzing, whose subject is the generator's output and not one unit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from triaxcal.codegen.names import names_of
from triaxcal.codegen.outputs.image import IMAGE_FILE
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.proof import Bound, prove
from triaxcal.model.terms import EXAMPLE_RATE, EXAMPLE_TERMS, NO_TERMS
from triaxcal.targets.shapes import made_case
from triaxcal.unit.arithmetic import HIGH_WORDS
from triaxcal.unit.description import UnitDescription


@dataclass(frozen=True)
class Subject:
    """A plan, its proven bound and the files that a delivery makes of it."""

    name: str
    plan: Plan
    bound: Bound
    files: Mapping[str, bytes]


def _as_shipped(unit: UnitDescription) -> UnitDescription:
    return unit


def _order_4(unit: UnitDescription) -> UnitDescription:
    return replace(unit, model_error_max_micro_g=1.0)


def _inverse(unit: UnitDescription) -> UnitDescription:
    return replace(unit, method="inverse")


def _high_words(unit: UnitDescription) -> UnitDescription:
    return replace(unit, arithmetic=HIGH_WORDS)


def _saturating(unit: UnitDescription) -> UnitDescription:
    """So fine an output that it saturates, and a raw range that is no power of two."""
    adc = replace(unit.adc, code_min=-8_000_000, code_max=8_200_000)
    return replace(_order_4(unit), output_q=29, adc=adc)


SHAPES = {
    "direct-two-segments": ("AT-CHERNIAK", _as_shipped),
    "inverse": ("AT-SIM", _inverse),
    "saturating": ("AT-SIM", _saturating),
    "quadratic": ("AT-SIM", _order_4),
    "high words": ("AT-SIM", _high_words),
}
"""Unit that gives the measurements, and what is changed in its description. Together: one segment
and two, raw codes of 24 bits and 32, both range tests and none, both forms, both ends of apply,
sums of high words, and quadratic terms."""

WITH_TERMS = {"quadratic": EXAMPLE_TERMS, "rate": replace(EXAMPLE_TERMS, rate=EXAMPLE_RATE)}
"""Terms of shapes that have them."""

MORE_SHAPES = {"rate": ("AT-SIM", _order_4), "gyro": ("AT-SIM", _order_4)}
"""Shapes that fuzzing leaves out: its runner does not vary dT/dt and the specific force."""

ALL_SHAPES = {**SHAPES, **MORE_SHAPES}


def subject(name: str, units: Path) -> Subject:
    """One of `ALL_SHAPES`, from the measurements of a unit in the folder `units`.

    Raises
    ------
    RefusedError
        When the unit's files are refused.
    """
    unit, change = ALL_SHAPES[name]
    case = made_case(units / unit, name, "", change, WITH_TERMS.get(name, NO_TERMS))
    files = {file: text.encode() for file, text in case.files.items()}
    files[names_of(case.plan).file(IMAGE_FILE)] = case.image
    return Subject(name, case.plan, prove(case.plan), files)
