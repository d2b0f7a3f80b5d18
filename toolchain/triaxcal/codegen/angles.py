"""triax_angles.h and .c: two angles of the unit from its compensated acceleration."""

from __future__ import annotations

import ctypes
import math
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from triaxcal.codegen.names import Names
from triaxcal.codegen.routines import Int32Array, UInt32Array
from triaxcal.codegen.templates import render
from triaxcal.fixedpoint.angles import (
    ARCSEC_PER_UNIT,
    DIGITS,
    FRACTION,
    PER_LENGTH,
    QUOTIENT_UNITS,
    ROTATION_UNITS,
    ROTATIONS,
    START_UNITS,
    TURN,
    AnglesPlan,
)
from triaxcal.fixedpoint.angles_proof import prove_angles
from triaxcal.fixedpoint.plan import Plan
from triaxcal.unit.angles import AnglesChoice
from triaxcal.unit.arithmetic import LIMBS, THUMB1
from triaxcal.unit.prefix import DEFAULT_PREFIX

ANGLES_FILES = ("triax_angles.h", "triax_angles.c")
_DIGITS_A_ROUND = 3
"""Of the quotient, in a round of the loop."""
_WORDS_A_LINE = 7


def angles_plan(choice: AnglesChoice, plan: Plan) -> AnglesPlan:
    """The angles of a triad's routine."""
    return AnglesPlan(choice, plan.shape.output_q, plan.arithmetic in {LIMBS, THUMB1})


def angles_id(plan: AnglesPlan) -> str:
    """Eight hex digits: equal exactly when the routine gives equal results."""
    words = (plan.zenith, plan.output_q, plan.rest_low, plan.rest_high, plan.across_low)
    return f"{zlib.crc32(repr(words).encode()):08x}"


def angles_linked(plan: AnglesPlan, prefix: str = DEFAULT_PREFIX) -> str:
    """Link name of the routine."""
    return f"{prefix}_{angles_id(plan)}_angles"


def render_angles(plan: AnglesPlan, names: Names) -> dict[str, str]:
    """Texts of `ANGLES_FILES` by name, with the names of the triad whose angles they are."""
    context = _context(plan, names)
    source = f"{plan.choice.pair} of 2^-{plan.output_q} g"
    return dict(render(name, source, names, **context) for name in ANGLES_FILES)


def _context(plan: AnglesPlan, names: Names) -> dict[str, Any]:
    bound = prove_angles().units
    first, second = plan.choice.names
    growth = math.prod(math.sqrt(1.0 + 4.0**-i) for i in range(ROTATIONS))
    return {
        "zenith": plan.zenith,
        "halves": plan.halves,
        "first": first,
        "second": second,
        "axis_words": "axis z" if plan.zenith else "axis x",
        "output_q": plan.output_q,
        "second_from": f"{plan.choice.second_from_deg:g}",
        "rest_within": f"{plan.choice.rest_within_g:g}",
        "angle_type": "uint32_t" if plan.zenith else "int32_t",
        "angles_word": f"0x{angles_id(plan).upper()}u",
        "angles_linked": angles_linked(plan, names.triad).removesuffix("_angles"),
        "first_bound": math.ceil(bound[0]),
        "second_bound": math.ceil(bound[1]),
        "first_arcsec": _arcsec(float(bound[0])),
        "second_arcsec": _arcsec(float(bound[1])),
        "rotations": ROTATIONS,
        "rotation_rows": _rows([f"{word}u," for word in ROTATION_UNITS]),
        "growth": f"{growth:.5f}",
        "start": START_UNITS % TURN,
        "start_signed": START_UNITS,
        "digit_rounds": DIGITS // _DIGITS_A_ROUND,
        "quotient_shift": ROTATIONS - 3,
        "quotient_units": QUOTIENT_UNITS,
        "fraction": FRACTION,
        "per_length": PER_LENGTH,
        "across_low": plan.across_low,
        "rest_low": plan.rest_low,
        "rest_high": plan.rest_high,
    }


def _rows(words: Sequence[str]) -> list[str]:
    starts = range(0, len(words), _WORDS_A_LINE)
    return [" ".join(words[i : i + _WORDS_A_LINE]) for i in starts]


def _arcsec(units: float) -> str:
    """Rounded upwards to three decimals."""
    return f"{math.ceil(units * ARCSEC_PER_UNIT * 1e3) / 1e3:.3f}"


class GeneratedAngles:
    """The compiled triax_angles over arrays."""

    def __init__(self, library: ctypes.CDLL, plan: AnglesPlan) -> None:
        self._function = library.triax_angles_batch
        self._zenith = plan.zenith

    def run(self, accel: Int32Array) -> tuple[npt.NDArray[np.int64], UInt32Array]:
        """Angles (n, 2) and status (n,) of accelerations (n, 3)."""
        given = np.ascontiguousarray(accel, np.int32)
        angle = np.empty((len(given), 2), np.uint32 if self._zenith else np.int32)
        status = np.empty(len(given), np.uint32)
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (given, angle, status)]
        self._function(*pointers[:1], ctypes.c_uint32(len(given)), *pointers[1:])
        return angle.astype(np.int64), status
