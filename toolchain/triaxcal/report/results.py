"""calibration.json and verification.json: what was found and what was checked, for machines."""

from __future__ import annotations

import hashlib
import math
from typing import Any

from triaxcal import __version__
from triaxcal.base.jsontext import json_bytes
from triaxcal.codegen.compiler import FLAGS
from triaxcal.codegen.render import shape_id
from triaxcal.codegen.tryout import BEFORE
from triaxcal.delivery.unit import Delivery
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.curves import relative_coefficients
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.model.terms import PRODUCT_NAMES
from triaxcal.model.types import FloatArray

FORMAT = 1


def calibration_json(delivery: Delivery) -> bytes:
    """Constants, curves, covariance and provenance; docs/file-formats.md has the layout."""
    calibration = delivery.calibration
    curves = calibration.thermal.curves
    document = {
        **_header(delivery),
        "constants": list(CONSTANT_NAMES),
        "units": [calibration.gain_unit] * 9 + [calibration.reading_unit] * 3,
        "estimator": calibration.estimator,
        "thermal_model": {
            "kind": calibration.shape.name,
            "label": calibration.shape.label,
            "t0_degc": calibration.thermal.t0_degc,
            "breaks_degc": list(curves.breaks_degc),
            "origins_degc": list(curves.origins_degc),
            "coefficients": curves.coefficients.tolist(),
        },
        "temperature_coefficients": _numbers(relative_coefficients(calibration.thermal)),
        "range_degc": list(calibration.range_degc),
        "at_t0": calibration.thermal.constants_at(calibration.thermal.t0_degc).tolist(),
        "points": [
            {
                "temp_degc": point.temp_degc,
                "constants": point.constants.tolist(),
                "covariance": _numbers(point.covariance),
                "position_residual_g": point.position_residual_g,
                "curve_residual_g": point.curve_residual_g,
            }
            for point in calibration.points
        ],
        "parameter_covariance": _numbers(calibration.parameter_covariance),
        "covariance_source": calibration.covariance_source,
        "covariance_contains": "the noise of the calibration readings alone; rig, gravity, "
        "thermometer and thermal model are in passport.json",
        "candidates": [
            {
                "label": c.label,
                "estimator": c.estimator,
                "parameters": c.parameters,
                "held_out_g": c.held_out_g,
                "fit_residual_g": c.fit_residual_g,
                "chosen": c.chosen,
            }
            for c in calibration.candidates
        ],
        "selection_reason": calibration.selection_reason,
        **_beyond_the_tilter(calibration),
    }
    return json_bytes(document)


def _beyond_the_tilter(calibration: Calibration) -> dict[str, Any]:
    """Quadratic terms, and what a recording's poses say; nothing where there are none."""
    found: dict[str, Any] = {}
    if calibration.terms.quadratic_per_g is not None:
        found["quadratic_terms"] = {
            "products": list(PRODUCT_NAMES),
            "per_g": calibration.terms.quadratic_per_g.tolist(),
        }
    rate = calibration.terms.rate
    if rate is not None:
        found["rate_term"] = {
            "offset_g_s_per_k": rate.offset_g_s_per_k.tolist(),
            "range_k_per_s": list(rate.range_k_per_s),
        }
    recording = calibration.recording
    if calibration.notes:
        found["findings"] = list(calibration.notes)
    if recording is not None:
        found["recording"] = {
            "poses": len(recording.poses.poses),
            "refused": [{"line": r.line, "reason": r.reason} for r in recording.poses.refused],
            "route": recording.route,
            "rms_g": recording.rms_g,
            "rms_per_degree_of_freedom_g": recording.rms_free_g if recording.checked else None,
            "held_out_g": recording.held_out_g,
            "left_out_length_g": recording.left_out_length_g,
            "condition_number": recording.condition,
            "findings": list(recording.findings),
        }
    return found


def verification_json(delivery: Delivery) -> bytes:
    """What was checked, on how many vectors, and what was proven."""
    plan, bound, check = delivery.plan, delivery.bound, delivery.check
    lsb_g = 2.0**-plan.shape.output_q
    document = {
        **_header(delivery),
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
        "cross_check": {
            "implementations": ["Python integer model", "reference C", "generated C"],
            "vectors": check.vectors,
            "images": check.images,
            "mismatches": 0,
        },
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
        "files_sha256": {
            name: hashlib.sha256(content).hexdigest() for name, content in delivery.files.items()
        },
    }
    return json_bytes(document)


def _header(delivery: Delivery) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "triaxcal": __version__,
        "unit": delivery.unit.name,
        "serial": delivery.unit.serial,
        "inputs_sha256": delivery.inputs_sha256,
    }


def _numbers(array: FloatArray) -> Any:
    """Nested lists of an array; what is not a number becomes null."""
    values: Any = array.tolist()
    return _without_nan(values)


def _without_nan(value: Any) -> Any:
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if math.isnan(value) else value
