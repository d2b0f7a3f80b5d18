"""The section of the passport, and of an IMU's page, on the angles of the device."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from triaxcal.codegen.angles_check import AnglesCheck
from triaxcal.fixedpoint.angles import ARCSEC_PER_UNIT
from triaxcal.model.types import FloatArray
from triaxcal.report.passport.content import Passport
from triaxcal.report.pictures.curves import HEIGHT, LEFT, RIGHT, WIDTH, Frame, x_ticks, y_ticks
from triaxcal.report.texts.speaker import Speaker
from triaxcal.report.words.numbers import significant
from triaxcal.uncertainty.angles import AngleUncertainty

_STYLES = (("curve", ""), ("curve2", ""))
_AXES = (("curve", ""), ("curve2", "5 4"), ("curve", "2 3"))


def angles_section(p: Passport, t: Speaker) -> dict[str, Any] | None:
    """Context of the section; None where the device makes no angles."""
    a, check = p.angles, p.delivery.angles_check
    if a is None or check is None:
        return None
    first, second = arcsec_of_routine(check)
    return angles_context(a, t, t("angles.note", r_first=first, r_second=second))


def arcsec_of_routine(check: AnglesCheck) -> tuple[str, str]:
    """Proven errors of the routine, rounded upwards."""
    first, second = (_upwards(float(u) * ARCSEC_PER_UNIT) for u in check.bound.units)
    return first, second


def angles_context(a: AngleUncertainty, t: Speaker, note: str) -> dict[str, Any]:
    """Context of the section; `note` says where the uncertainty is from."""
    first, second = (t(f"angles.{name.replace(' ', '_')}") for name in a.names)
    names = {"first": first, "second": second}
    values = {
        "u_first": significant(float(a.over_range[:, 0].max())),
        "u_second": significant(float(a.over_range[:, 1].max())),
    }
    return {
        "lead": t("angles.lead", **names, **values),
        "note": note,
        "legend": t("angles.legend", **names),
        "panels": [
            {**_panel(values, styles, a.first_deg), "title": title, "alt": alt}
            for title, values, styles in (
                (t("angles.uncertainty"), a.over_range, _STYLES),
                (t("angles.bias", first=first), a.per_offset[:, 0], _AXES),
                (t("angles.scale", first=first), a.per_scale[:, 0], _AXES),
                (t("angles.scale", first=second), a.per_scale[:, 1], _AXES),
            )
            for alt in (t("angles.alt", what=title, first=first),)
        ],
    }


def _upwards(arcsec: float) -> str:
    return f"{math.ceil(arcsec * 1e3) / 1e3:.3f}"


def _panel(
    values: FloatArray, styles: Sequence[tuple[str, str]], first_deg: FloatArray
) -> dict[str, Any]:
    """One panel: columns of values (n, m) over the first angle."""
    xs = [float(v) for v in first_deg]
    frame = Frame((xs[0], xs[-1]), (0.0, float(np.max(values)) * 1.08 or 1.0))
    return {
        "width": WIDTH,
        "height": HEIGHT,
        "left": LEFT,
        "right": WIDTH - RIGHT,
        "x_ticks": x_ticks(frame),
        "y_ticks": y_ticks(frame, 4),
        "lines": [
            {"points": frame.points(xs, values[:, k].tolist()), "style": style, "dash": dash}
            for k, (style, dash) in enumerate(styles)
        ],
    }
