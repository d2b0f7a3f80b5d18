"""A second bound of the arithmetic error, by Gappa, that shares nothing with `fixedpoint.proof`.

One script for each axis and segment: the integers are those of the delivered image, the reals
those that the plan stands for; temperature and raw codes are intervals. Gappa propagates the
errors of the floors by interval arithmetic, which is coarser than visiting every code: its bound
lies above the exact one or one of the two is wrong. verification.md has the script explained.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path

from triaxcal.base.tools import TOOLS
from triaxcal.verify.image_reader import Image, read_image
from triaxcal.verify.outcome import NOT_DONE, Outcome, judged
from triaxcal.verify.tools import BrokenToolError, run
from triaxcal.verify.workspace import Workspace

GAPPA = TOOLS["gappa"]
SLICES = 16
"""Temperature intervals of a segment; more do not tighten the bound."""
TIGHT = 1.2
"""A bound within this ratio of the exact one is called tight."""

ROUNDED_UP = 2.0**-49
"""Of the exact bound: no more than eight operations in floats, each rounded up by an ulp. Of
constant functions both bounds are the same number, and Gappa's is not rounded up."""

_KEY, _TITLE = "gappa", "Gappa: error bound"
_NAMES = "ABCD"
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Axes of the products, as docs/explanation/fixed-point.md, step Q, names them."""
_NUMBER = r"(-?\d+)(?:b(-?\d+))?"
_APPROXIMATION = r"(?: \{[^}]*\})?"
_HARMLESS = re.compile(
    r"Warning: (renaming identifier '\w+' as '\w+' at .*|case split on x has not produced any .*)"
)
"""Two names for one expression, and slices that gain nothing: of functions that are constant."""
INTERVAL = re.compile(rf" in \[{_NUMBER}{_APPROXIMATION}, {_NUMBER}{_APPROXIMATION}\]")


def check(work: Workspace) -> Outcome:
    """Bound every axis on every segment and compare with the exact bound.

    Raises
    ------
    MissingToolError, BrokenToolError
    """
    GAPPA.find()
    image = read_image(work.image)
    if image.inverse_form:
        return Outcome(
            _KEY, _TITLE, NOT_DONE,
            "not done for the inverse form: intervals lose how the errors of adjugate and "
            "determinant cancel; the exact bound over every code stands alone",
        )  # fmt: skip
    jobs = [(axis, s) for axis in range(3) for s in range(len(image.segments))]
    with ThreadPoolExecutor(2) as pool:
        bounds = list(pool.map(lambda job: _bound(work, image, *job), jobs))
    per_axis = [max(b for (a, _), b in zip(jobs, bounds, strict=True) if a == i) for i in range(3)]
    if image.quadratic:
        per_axis = [b + e for b, e in zip(per_axis, _quadratic(work, image, per_axis), strict=True)]
    exact = work.bound.per_axis_lsb
    good = not_below(per_axis, exact)
    ratio = max(per_axis) / work.bound.lsb
    finding = (
        f"{max(per_axis):.3f} LSB, {abs(100 * (ratio - 1)):.1f} % above the exact "
        f"{work.bound.lsb:.3f}"
    )
    if not good:
        finding = f"{max(per_axis):.3f} LSB lies below the exact {work.bound.lsb:.3f}: one is wrong"
    elif ratio > TIGHT:
        finding += " (loose)"
    figures = {
        "version": GAPPA.version(),
        "per_axis_lsb": per_axis,
        "exact_per_axis_lsb": list(exact),
        "ratio_to_exact": ratio,
    }
    return judged(_KEY, _TITLE, good=good, finding=finding, figures=figures)


def not_below(found_lsb: Sequence[float], exact_lsb: Sequence[float]) -> bool:
    """Whether bounds of the axes leave room for the exact ones; if not, one is wrong."""
    return all(
        found >= exact * (1 - ROUNDED_UP) for found, exact in zip(found_lsb, exact_lsb, strict=True)
    )


def _bound(work: Workspace, image: Image, axis: int, s: int) -> float:
    """Gappa's bound of |a - a*| in LSB, rounded up."""
    script = work.render(
        f"verify_{axis}_{s}.g", "verify/gappa.g.j2", script_context(work, image, axis, s)
    )
    return largest_magnitude(run_gappa(work, script))


def run_gappa(work: Workspace, script: Path, *flags: str) -> str:
    """What Gappa printed of a script that it could check.

    Raises
    ------
    MissingToolError, BrokenToolError
    """
    answer = run([GAPPA.find(), *flags, script.name], work.folder)
    if answer.code or "arning" in _HARMLESS.sub("", answer.text):
        # A hint that Gappa cannot check itself comes as a warning: then nothing is proven.
        raise BrokenToolError(f"gappa: {' '.join(answer.text.split())[:200]}")
    return answer.text


def _quadratic(work: Workspace, image: Image, linear_lsb: Sequence[float]) -> list[float]:
    """Gappa's bound of what quadratic terms add to each axis, in LSB, rounded up.

    h lies within the linear bound of the exact result, less the final 1/2 and with a floor of its
    own; its reach follows from the words of the image.
    """
    real = work.plan.real_quadratic
    assert real is not None
    place = Fraction(2) ** (image.output_shift - 32)
    error = [(Fraction(lsb) - Fraction(1, 2)) * place + 1 for lsb in linear_lsb]
    reach = [_reach(image, axis) + e for axis, e in enumerate(error)]
    bounds = []
    for axis in range(3):
        terms = [
            {"a": a, "b": b, "integer": q, "real": _dyadic(Fraction(float(exact)))}
            for q, exact, (a, b) in zip(image.quadratic[axis], real[axis], PAIRS, strict=True)
        ]
        context = {
            "axis": "xyz"[axis],
            "terms": terms,
            "reach": [_dyadic(Fraction(math.ceil(r))) for r in reach],
            "error": [_dyadic(e) for e in error],
        }
        script = work.render(f"verify_q{axis}.g", "verify/gappa_quadratic.g.j2", context)
        found = largest_magnitude(run_gappa(work, script))
        bounds.append(math.nextafter(float(Fraction(found) / place), math.inf))
    return bounds


def _reach(image: Image, axis: int) -> int:
    """Bound of |h| of an axis over all codes, by the size of each function's words."""
    box = max(abs(image.raw_min), abs(image.raw_max)) << image.raw_shift
    by_rate = abs(image.rate[3 + axis]) // 2 + 1 if image.rate else 0
    reach = 0
    for segment in image.segments:
        # |p_0| <= |c_0| + |c_1| / 2 + |c_2| / 4 + ..., and less than 2 for the floors.
        n0, n1, n2, b = (
            sum(abs(c) >> k for k, c in enumerate(words)) + len(words) + 2
            for words in segment.coefficients[4 * axis : 4 * axis + 4]
        )
        reach = max(reach, (n0 + n1 + n2) * box // 2**32 + 1 + b + by_rate)
    return reach


def largest_magnitude(text: str) -> float:
    """Larger magnitude of the ends of the interval that Gappa printed, rounded up.

    Raises
    ------
    BrokenToolError
        When it printed none.
    """
    found = INTERVAL.search(text)
    if found is None:
        raise BrokenToolError(f"gappa gave no interval: {' '.join(text.split())[:200]}")
    largest = max(map(abs, ends_of(found)))
    value = float(largest)
    # Shortest step upwards that a float can hold: the stated bound never lies below the proven.
    return value if Fraction(value) >= largest else value * (1 + 2.0**-52)


def ends_of(interval: re.Match[str]) -> tuple[Fraction, Fraction]:
    """Both ends of an interval that `INTERVAL` found."""
    low, high = (
        Fraction(int(m)) * Fraction(2) ** int(e or 0)
        for m, e in (interval.group(1, 2), interval.group(3, 4))
    )
    return low, high


def script_context(work: Workspace, image: Image, axis: int, s: int) -> dict[str, object]:
    """What the template of the script shows; numbers are exact, as integers over powers of two."""
    segment = image.segments[s]
    spare = image.output_shift - 32
    preload = 1 << (spare - 1) if spare > 0 and not image.quadratic else 0
    box = max(abs(image.raw_min), abs(image.raw_max)) << image.raw_shift
    return {
        "axis": "xyz"[axis],
        "segment": s,
        "functions": [
            _function(name, segment.coefficients[4 * axis + j], work.plan.real[s, 4 * axis + j])
            for j, name in enumerate(_NAMES)
        ],
        "order": image.order,
        "preload": preload,
        "held": preload + image.high_words,
        "high_words": image.high_words,
        "rows": tuple(zip(_NAMES, "uvw", strict=False)),
        "rounding": "" if preload else " + 1b-1",
        "spare": spare,
        "x_low": _dyadic(
            Fraction((segment.first_code - segment.origin_code) * segment.gain, 2**32)
        ),
        "x_high": _dyadic(
            Fraction((segment.last_code - segment.origin_code) * segment.gain, 2**32)
        ),
        "x_is_a_point": segment.first_code == segment.last_code,
        "rate": _rate(work, image, axis),
        "sensitivity": _sensitivity(work, image, axis),
        "box": _dyadic(Fraction(box, 2**32)),
        "slices": SLICES,
    }


def _rate(work: Workspace, image: Image, axis: int) -> dict[str, object] | None:
    """The word of a term in dT/dt, what it stands for, and how far the rate reaches."""
    if not image.rate or work.plan.rate is None:
        return None
    low, high, gain = image.rate[:3]
    return {
        "integer": image.rate[3 + axis],
        "real": _dyadic(Fraction(float(work.plan.rate.real[axis]))),
        "reach": _dyadic(Fraction(max(-low, high) * gain, 2**32)),
    }


def _sensitivity(work: Workspace, image: Image, axis: int) -> list[dict[str, object]]:
    """Words of a gyro's g-sensitivity and what they stand for."""
    if not image.sensitivity or work.plan.real_sensitivity is None:
        return []
    return [
        {"integer": k, "real": _dyadic(Fraction(float(exact)))}
        for k, exact in zip(image.sensitivity[axis], work.plan.real_sensitivity[axis], strict=True)
    ]


def _function(name: str, integers: Sequence[int], reals: Iterable[float]) -> dict[str, object]:
    """Integer and real coefficient of each order, highest first.

    The real one of order k carries the k bits that Horner's halving adds.
    """
    terms = [
        {"k": k, "integer": integer, "real": _dyadic(Fraction(float(real)) * 2**k)}
        for k, (integer, real) in enumerate(zip(integers, reals, strict=True))
    ]
    return {"name": name, "highest": terms[-1], "lower": terms[-2::-1]}


def _dyadic(value: Fraction) -> str:
    """Gappa's literal of an integer over a power of two."""
    shift = value.denominator.bit_length() - 1
    if value.denominator != 1 << shift:
        raise ValueError(f"{value} is no integer over a power of two")
    return f"{value.numerator}b-{shift}" if shift else str(value.numerator)
