"""triax_comp.h and .c: what they show is computed here, templates only loop and format."""

from __future__ import annotations

from typing import Any

from triaxcal.codegen.annotations import (
    loader_not_covered,
    not_covered,
    with_contracts,
    without_annotations,
)
from triaxcal.codegen.forms import (
    assembly,
    form_of,
    helpers,
    limb_split,
    row_words,
    shifts_64,
)
from triaxcal.codegen.identity import FIELDS, IDENTITY_SIZE, MAGIC, VERSION
from triaxcal.codegen.image import header_names, header_words, image_size
from triaxcal.codegen.names import names_of
from triaxcal.codegen.templates import environment, macro_literal, render
from triaxcal.fixedpoint.formats import FUNCTION_NAMES
from triaxcal.fixedpoint.gyro import SENSITIVITY_LIMIT
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.quadratic import QUADRATIC_LIMIT
from triaxcal.fixedpoint.rate import RATE_Q
from triaxcal.model.terms import PRODUCT_NAMES
from triaxcal.unit.arithmetic import LIMBS, PORTABLE, THUMB1, THUMB2

ROUTINE_FILES = ("triax_comp.h", "triax_comp.c")
TERM_TABLES = (
    {"name": "quadratic", "columns": 6, "limit": QUADRATIC_LIMIT},
    {"name": "sensitivity", "columns": 3, "limit": SENSITIVITY_LIMIT},
)
"""The table of terms of an accelerometer and of a gyro."""


FORM_NOTES = {
    PORTABLE: "",
    LIMBS: ",\n * for cores without a 32x32->64 multiplication: products of halves of words",
    THUMB2: ",\n * for Cortex-M3, M4, M7, M33: both calls in assembly for GNU-compatible compilers",
    THUMB1: ",\n * for Cortex-M0, M0+, M1: both calls in assembly for GNU-compatible compilers",
}
"""What the heading of a file says of its arithmetic."""


def render_routine(plan: Plan) -> dict[str, str]:
    """Texts of `ROUTINE_FILES`, or a gyro's, by name; they depend on the plan's shape only.

    Where the plan asks for another arithmetic and its shape has it, the file of that is the last.
    """
    names = names_of(plan)
    words = {"row_words": row_words(plan.shape, arithmetic_of(plan))}
    context = {**_routine_context(plan), **words}
    texts = dict([render(ROUTINE_FILES[0], f"shape {names.shape}", names, **context)])
    for form in dict.fromkeys((PORTABLE, arithmetic_of(plan))):
        text = _annotated(plan, form, context)
        proven = form == PORTABLE and not not_covered(plan.shape)
        kept = with_contracts if proven else without_annotations
        texts[routine_file(plan, form)] = kept(text)
    return texts


def annotated_routine(plan: Plan) -> str:
    """The portable C with its contracts and every step of the proof."""
    return _annotated(plan, PORTABLE, _portable_context(plan))


def specification(plan: Plan, *, opaque: bool) -> str:
    """What the contracts mean, as a header of ACSL.

    Parameters
    ----------
    opaque : bool
        Without the definitions of products, floors and polynomials; the lemmas about them stay.
    """
    spare = plan.shape.output_shift - 32
    floors = {32, plan.shape.output_shift, *([spare] if spare > 0 else []), *shifts_64(plan.shape)}
    context = {
        **names_of(plan).context,
        **_portable_context(plan),
        "file": routine_file(plan, PORTABLE),
        "opaque": opaque,
        "floors": sorted(floors),
        "last_shift": max(floors),
    }
    return environment().get_template("verify/specification.h.j2").render(context)


def _portable_context(plan: Plan) -> dict[str, Any]:
    return {**_routine_context(plan), "row_words": row_words(plan.shape, PORTABLE)}


def _annotated(plan: Plan, form: str, context: dict[str, Any]) -> str:
    """The C file of a form with all annotations."""
    names = names_of(plan)
    own = {
        "form": form,
        "form_note": FORM_NOTES[form],
        "uses": helpers(plan.shape, form),
        "unproven": without_annotations,
    }
    file = routine_file(plan, form)
    _, text = render(ROUTINE_FILES[1], f"shape {names.shape}", names, file=file, **context, **own)
    return text


def arithmetic_of(plan: Plan) -> str:
    """The arithmetic that a plan asks for, or the next best that its shape has."""
    return form_of(plan.shape, plan.arithmetic)


def routine_file(plan: Plan, form: str) -> str:
    """Name of the C file of a form: triax_comp.c, triax_comp_thumb2.c; a firmware compiles one."""
    suffix = "" if form == PORTABLE else f"_{form}"
    return names_of(plan).file(f"triax_comp{suffix}.c")


def _routine_context(plan: Plan) -> dict[str, Any]:
    shape = plan.shape
    span = shape.raw_max - shape.raw_min
    names = FUNCTION_NAMES[shape.form]
    inverse = shape.inverse
    return {
        "shape": shape,
        "inverse": inverse,
        "gain_half": 0 if inverse is None else 1 << (inverse.gain_shift - 1),
        "reciprocal_numerator": 0 if inverse is None else 1 << inverse.reciprocal_log2,
        "offset_half": 1 << 29,
        "spare": shape.output_shift - 32,
        "checked": span != 2**32 - 1,
        "raw_span": span,
        "raw_span_is_mask": span & (span + 1) == 0,
        "raw_bits": span.bit_length(),
        "raw_min": macro_literal(shape.raw_min),
        "raw_max": macro_literal(shape.raw_max),
        "limb_split": limb_split(shape),
        "limb_mask": (1 << limb_split(shape)) - 1,
        "assembly": assembly(shape),
        "shifts_64": shifts_64(shape),
        "orders_down": list(range(shape.order - 1, -1, -1)),
        "lsb_micro_g": f"{1e6 / 2**shape.output_q:.4g}",
        "lsb_deg_per_h": f"{3600 / 2**shape.output_q:.4g}",
        "function_order": ", ".join(names[:4]) + ", ... " + names[11],
        "image_size": image_size(plan),
        "identity_size": IDENTITY_SIZE,
        "identity": FIELDS,
        "identity_magic": MAGIC,
        "identity_version": VERSION,
        "header": header_words(plan),
        "header_lines": _header_lines(plan),
        "row_limit": shape.row_limit,
        "products": PRODUCT_NAMES,
        "terms": TERM_TABLES[shape.gyro],
        "force_q": plan.force_q,
        "rate_q": RATE_Q,
        "loader_proven": not loader_not_covered(shape),
        "final_rounding": 1 << max(0, shape.output_shift - 33),
    }


def _header_lines(plan: Plan, together: int = 4) -> list[dict[str, str]]:
    """The words of the header, some a line, and what they are."""
    words, names = header_words(plan), header_names(plan)
    return [
        {
            "words": " ".join(f"0x{word:08X}u," for word in words[at : at + together]),
            "names": "; ".join(names[at : at + together]),
        }
        for at in range(0, len(words), together)
    ]
