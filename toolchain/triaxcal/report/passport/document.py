"""passport.json: the passport for machines. docs/reference/file-formats.md has the layout."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from triaxcal import __version__
from triaxcal.base.jsontext import json_bytes, sha256_of_files
from triaxcal.base.plaindata import plain
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.report.passport.content import Passport
from triaxcal.report.passport.head import unshown
from triaxcal.report.stated.statements import stated_json
from triaxcal.report.stated.words import caution_words
from triaxcal.report.texts.speaker import speaker
from triaxcal.report.words.angles import uncertainty_document
from triaxcal.uncertainty.budget import Budget
from triaxcal.uncertainty.coverage import LEVEL
from triaxcal.unit.passport import ENGLISH

FORMAT = 1


def passport_json(p: Passport) -> bytes:
    """JSON of a passport; without a clock, so equal inputs give equal bytes."""
    d = p.delivery
    document = {
        "format": FORMAT,
        "triaxcal": __version__,
        "unit": d.unit.name,
        "serial": d.unit.serial,
        "inputs_sha256": d.inputs_sha256,
        "coverage_probability": LEVEL,
        **({"inputs": list(d.calibration.inputs)} if d.calibration.inputs else {}),
        "stated": {
            **stated_json(d.unit),
            "cautions": [caution_words(c) for c in p.cautions],
        },
        **_judged(p),
        **_known(p),
        **uncertainty_document(p.angles),
        "warnings": [*p.uncertainty.warnings, *filter(None, [p.cause])],
        "compensation": d.firmware.functions.document(),
        "files_sha256": sha256_of_files(d.files),
        "tools": dict(p.tools),
        "device": _device(p),
    }
    return json_bytes(document)


def _device(p: Passport) -> dict[str, Any] | None:
    if p.device is None:
        return None
    return {"of_this_delivery": p.verified_device is not None, **plain(p.device)}


def _judged(p: Passport) -> dict[str, Any]:
    """The verdict, the limits that it rests on, and what was not tested, as on the page."""
    t = speaker(ENGLISH)
    return {
        "result": p.verdict.result,
        "verdict": p.verdict.words,
        "decision_rule": {
            "name": p.delivery.unit.limits.decision_rule,
            "words": p.delivery.unit.limits.rule_words,
        },
        "not_tested": [*p.verdict.not_tested, *(t.plain(k, **v) for k, v in unshown(p))],
        "tested": [
            {
                "where": t.where,
                "what": t.what,
                "limit_g": t.limit_g,
                "largest_g": t.largest_g if t.dwells else None,
                "rms": t.rms,
                "dwells": t.dwells,
                "all_known": t.whole,
            }
            for t in p.verdict.tested
        ],
        "acceptance": [
            {
                "where": a.where,
                "limit_g": a.limit_g,
                "largest_residual_g": a.largest_g,
                "expanded_uncertainty_g": a.uncertainty_g,
                "guard_band_g": a.guard_g,
                "acceptance_limit_g": a.acceptance_g,
                "shown_with_uncertainty": a.shown,
                "interval_over_limit": a.factor,
                "worst_source": a.cause,
            }
            for a in p.acceptance
        ],
        "limits_without_dwells": list(p.unchecked),
    }


def _known(p: Passport) -> dict[str, Any]:
    """Constants and compensated acceleration with their uncertainty, at T0 and over temperature."""
    u, thermal = p.uncertainty, p.delivery.calibration.thermal
    at_t0 = thermal.constants_at(thermal.t0_degc)
    return {
        "constants_at_t0": [
            {"name": name, "value": float(at_t0[c]), **_budget(p.constant_budgets[c])}
            for c, name in enumerate(CONSTANT_NAMES)
        ],
        "acceleration": {
            "worst_component": {
                "orientation": p.component_orientation,
                **_budget(p.component_budget),
            },
            "worst_length": {"orientation": p.length_orientation, **_budget(p.length_budget)},
        },
        "over_temperature": {
            "temp_degc": u.temps_degc.tolist(),
            "constants": thermal.constants_at(u.temps_degc).tolist(),
            "constants_expanded_uncertainty": u.constants_u.tolist(),
            "acceleration_expanded_uncertainty_g": u.worst_over_temperature.tolist(),
        },
    }


def _budget(b: Budget) -> dict[str, Any]:
    return {
        "quantity": b.quantity,
        "unit": b.unit,
        "standard_uncertainty": b.combined,
        "effective_degrees_of_freedom": _finite(b.dof),
        "coverage_factor": b.factor,
        "expanded_uncertainty": b.expanded,
        "verdict": b.verdict,
        "budget": [
            {
                "key": line.source.key,
                "source": line.source.name,
                "standard_uncertainty": line.source.sd,
                "unit": line.source.unit,
                "distribution": line.source.distribution,
                "degrees_of_freedom": _finite(line.source.dof),
                "sensitivity": line.sensitivity,
                "contribution": line.contribution,
                "share_of_variance": line.share,
                "origin": line.source.origin,
            }
            for line in b.lines
        ],
    }


def _finite(value: float) -> float | None:
    """A number, or null for infinity."""
    return float(value) if math.isfinite(value) and np.isfinite(value) else None
