"""The numbers behind the passport's tables and pictures, as CSV within the page."""

from __future__ import annotations

from collections.abc import Sequence

from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.report.passport.content import Passport
from triaxcal.report.texts.csvlink import csv_link
from triaxcal.uncertainty.coverage import LEVEL

_FORCES = ("x", "y", "z", "length")


def downloads(p: Passport) -> dict[str, dict[str, str]]:
    """Name of the file and its content as a link, of each; names of columns have their units."""
    serial = "".join(
        c if (c.isalnum() and c.isascii()) or c in "-_" else "_" for c in p.delivery.unit.serial
    )
    tables = {
        "constants": _constants(p),
        "curves": _curves(p),
        "residuals": _residuals(p),
        "uncertainty": _uncertainty(p),
        "budgets": _budgets(p),
    }
    return {
        name: {"name": f"{serial}-{name}.csv", "uri": csv_link(rows)}
        for name, rows in tables.items()
    }


def _constants(p: Passport) -> list[Sequence[object]]:
    thermal = p.delivery.calibration.thermal
    at_t0 = thermal.constants_at(thermal.t0_degc).tolist()
    rows = zip(CONSTANT_NAMES, at_t0, p.constant_budgets, p.uncertainty.units, strict=True)
    head = ("constant", "temp_degc", "value", "expanded_uncertainty", "unit", "k", "coverage")
    return [
        head,
        *(
            (name, thermal.t0_degc, v, b.expanded, unit, b.factor, LEVEL)
            for name, v, b, unit in rows
        ),
    ]


def _curves(p: Passport) -> list[Sequence[object]]:
    calibration, u = p.delivery.calibration, p.uncertainty
    head = (
        "what", "temp_degc", *map("_".join, zip(CONSTANT_NAMES, u.units, strict=True)),
        *(f"U_{name}" for name in CONSTANT_NAMES),
    )  # fmt: skip
    curves = calibration.thermal.constants_at(u.temps_degc).tolist()
    return [
        head,
        *(
            ("curve", temp, *values, *expanded)
            for temp, values, expanded in zip(
                u.temps_degc.tolist(), curves, u.constants_u.tolist(), strict=True
            )
        ),
        *(("point", q.temp_degc, *q.constants.tolist()) for q in calibration.points),
    ]


def _residuals(p: Passport) -> list[Sequence[object]]:
    done = p.delivery
    limits, t0 = done.unit.limits, done.unit.t0_degc
    rows = zip(done.methods[0].residuals, done.chosen.residuals, strict=True)
    return [
        ("position", "temp_degc", "before_g", "compensated_g", "limit_g"),
        *(
            (
                a.dwell.position,
                a.dwell.temp_degc,
                a.error_g,
                b.error_g,
                limits.at(a.dwell.temp_degc, t0)[0],
            )
            for a, b in rows
        ),
    ]


def _uncertainty(p: Passport) -> list[Sequence[object]]:
    u = p.uncertainty
    rows = zip(u.temps_degc.tolist(), u.worst_over_temperature.tolist(), strict=True)
    return [("temp_degc", *(f"U_{name}_g" for name in _FORCES)), *((t, *each) for t, each in rows)]


def _budgets(p: Passport) -> list[Sequence[object]]:
    head = (
        "quantity", "unit", "source", "origin", "standard_uncertainty", "source_unit",
        "distribution", "degrees_of_freedom", "sensitivity", "contribution", "share_of_variance",
    )  # fmt: skip
    rows: list[Sequence[object]] = [head]
    for b in (p.component_budget, p.length_budget):
        for line in b.lines:
            s = line.source
            rows.append(
                (
                    b.quantity,
                    b.unit,
                    s.name,
                    s.origin,
                    s.sd,
                    s.unit,
                    s.distribution,
                    s.dof,
                    line.sensitivity,
                    line.contribution,
                    line.share,
                )
            )
    return rows
