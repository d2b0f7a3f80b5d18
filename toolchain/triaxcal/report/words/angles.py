"""The angles that a device makes: what was shown of their routine, and how well they are known."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from triaxcal.codegen.angles_check import AnglesCheck
from triaxcal.fixedpoint.angles import ARCSEC_PER_UNIT, AnglesPlan
from triaxcal.uncertainty.angles import AngleUncertainty


def angles_document(plan: AnglesPlan | None, check: AnglesCheck | None) -> dict[str, Any]:
    """The key `angles` of verification.json; nothing where the device makes none."""
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


@dataclass(frozen=True)
class AnglesWords:
    """Of the routine: the two angles, their proven errors in arcsec, and the vectors compared."""

    names: str
    proven: str
    vectors: int


def angles_words(plan: AnglesPlan | None, check: AnglesCheck | None) -> AnglesWords | None:
    """None where the device makes no angles."""
    if plan is None or check is None:
        return None
    arcsec = [math.ceil(u * Fraction(ARCSEC_PER_UNIT) * 10**4) for u in check.bound.units]
    return AnglesWords(
        " and ".join(plan.choice.names),
        " and ".join(f"{a / 1e4:.4f}" for a in arcsec),
        check.total,
    )


def uncertainty_document(a: AngleUncertainty | None) -> dict[str, Any]:
    """Uncertainty of the angles over the first of them, as the key `angles`; nothing for None."""
    if a is None:
        return {}
    return {
        "angles": {
            "names": list(a.names),
            "second": "times the sine of the angle between its axis and the plumb line",
            "first_deg": a.first_deg.tolist(),
            "expanded_uncertainty_at_t0_arcsec": a.at_t0.tolist(),
            "expanded_uncertainty_over_range_arcsec": a.over_range.tolist(),
            "arcsec_per_mg_of_bias": a.per_offset.tolist(),
            "arcsec_per_1e_3_of_scale": a.per_scale.tolist(),
        }
    }
