"""triax_comp.h and .c: what they show is computed here, templates only loop and format."""

from __future__ import annotations

from typing import Any

from triaxcal.codegen.forms import assembly, forms_using, limb_split
from triaxcal.codegen.identity import FIELDS, IDENTITY_SIZE, MAGIC, VERSION
from triaxcal.codegen.image import header_names, header_words, image_size
from triaxcal.codegen.names import names_of
from triaxcal.codegen.templates import macro_literal, render
from triaxcal.fixedpoint.formats import FUNCTION_NAMES
from triaxcal.fixedpoint.gyro import SENSITIVITY_LIMIT
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.quadratic import QUADRATIC_LIMIT
from triaxcal.fixedpoint.rate import RATE_Q
from triaxcal.model.terms import PRODUCT_NAMES

ROUTINE_FILES = ("triax_comp.h", "triax_comp.c")
TERM_TABLES = (
    {"name": "quadratic", "columns": 6, "limit": QUADRATIC_LIMIT},
    {"name": "sensitivity", "columns": 3, "limit": SENSITIVITY_LIMIT},
)
"""The table of terms of an accelerometer and of a gyro."""


def render_routine(plan: Plan) -> dict[str, str]:
    """Texts of `ROUTINE_FILES`, or a gyro's, by name; they depend on the plan's shape only."""
    context = _routine_context(plan)
    names = names_of(plan)
    return dict(render(n, f"shape {names.shape}", names, **context) for n in ROUTINE_FILES)


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
        "raw_scale": 1 << shape.raw_shift,
        "limb_split": limb_split(shape),
        "limb_mask": (1 << limb_split(shape)) - 1,
        "assembly": assembly(shape),
        "forms_using": forms_using(shape),
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
        "header_names": header_names(plan),
        "row_limit": shape.row_limit,
        "products": PRODUCT_NAMES,
        "terms": TERM_TABLES[shape.gyro],
        "force_q": plan.force_q,
        "rate_q": RATE_Q,
        "final_rounding": 1 << max(0, shape.output_shift - 33),
    }
