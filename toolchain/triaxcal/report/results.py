"""verification.json: what was checked, for machines."""

from __future__ import annotations

from typing import Any

from triaxcal.base.jsontext import json_bytes, sha256_of_files
from triaxcal.codegen.compiler import FLAGS
from triaxcal.codegen.names import shape_id
from triaxcal.codegen.tryout import BEFORE
from triaxcal.delivery.saved import header
from triaxcal.delivery.unit import Delivery
from triaxcal.fixedpoint.angles import ARCSEC_PER_UNIT


def _angles(delivery: Delivery) -> dict[str, Any]:
    """Of triax_angles, where the device has it: proven, and seen on how many vectors."""
    plan, check = delivery.firmware.angles, delivery.angles_check
    if plan is None or check is None:
        return {}
    terms = check.bound.first, check.bound.second
    return {
        "angles": {
            "pair": plan.choice.pair,
            "rest_within_g": plan.choice.rest_within_g,
            "second_angle_from_deg": plan.choice.second_from_deg,
            "errors": [
                {
                    "angle": plan.choice.names[k],
                    "bound_units": float(check.bound.units[k]),
                    "bound_arcsec": float(check.bound.units[k]) * ARCSEC_PER_UNIT,
                    "terms_units": {t.name: float(t.units) for t in terms[k]},
                    "largest_seen_units": check.largest_units[k],
                }
                for k in range(2)
            ],
            "vectors": check.vectors,
            "mismatches": 0,
        }
    }


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
        **_angles(delivery),
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
