"""verification.json: what was checked, for machines."""

from __future__ import annotations

from triaxcal.base.jsontext import json_bytes, sha256_of_files
from triaxcal.codegen.compiler import FLAGS
from triaxcal.codegen.names import shape_id
from triaxcal.codegen.tryout import BEFORE
from triaxcal.delivery.saved import header
from triaxcal.delivery.unit import Delivery
from triaxcal.report.words.angles import angles_document


def verification_json(delivery: Delivery) -> bytes:
    """What was checked, on how many vectors, and what was proven."""
    plan, bound, check = delivery.plan, delivery.bound, delivery.check
    lsb_g = 2.0**-plan.shape.output_q
    document = {
        **header(delivery),
        "verdict": delivery.verdict.words,
        "compiler": delivery.compiler,
        "compiler_flags": list(FLAGS),
        "shape": shape_id(plan),
        "method": delivery.unit.method,
        "model_error_g": delivery.model_error_g,
        "arithmetic_bound": {
            "lsb": bound.lsb,
            "g": bound.lsb * lsb_g,
            "per_axis_lsb": list(bound.per_axis_lsb),
            "temp_code": bound.temp_code,
            "temp_codes_visited": bound.codes,
            "largest_seen_lsb": check.largest_error_lsb,
        },
        "error_g": delivery.firmware.error_g,
        "cross_check": {
            "implementations": ["Python integer model", "reference C", "generated C"],
            "vectors": check.vectors,
            "images": check.images,
            "mismatches": 0,
        },
        **angles_document(delivery.firmware.angles, delivery.angles_check),
        "residuals_g": {
            m.method.name: [
                {
                    "row": r.dwell.row,
                    "position": r.dwell.position,
                    "temp_degc": r.dwell.temp_degc,
                    "error_g": r.error_g,
                }
                for r in m.residuals
            ]
            for m in delivery.methods
        },
        "refused_methods": {m.method.name: m.refusal for m in delivery.methods if m.refusal},
        "before": f"'{BEFORE.name}' is {BEFORE.doc}",
        "limits_g": {
            "at_t0": delivery.unit.limits.at_t0_g,
            "over_range": delivery.unit.limits.over_range_g,
        },
        "files_sha256": sha256_of_files(delivery.files),
    }
    return json_bytes(document)
