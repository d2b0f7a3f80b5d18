"""The passport's tables: limits, constants, budgets, and the functions that were compared."""

from __future__ import annotations

from typing import Any

from markupsafe import Markup

from triaxcal.delivery.verdict import (
    COMPONENTS,
    GUARDED,
    HELD_OUT,
    RESIDUAL,
    UNCERTAINTY,
    LimitCheck,
    Verdict,
    cell,
)
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.report.passport.content import Acceptance, Passport
from triaxcal.report.stated.words import by_rule
from triaxcal.report.texts.speaker import Speaker
from triaxcal.report.words.numbers import (
    g_in_words,
    handy,
    in_unit,
    percent,
    raised,
    significant,
    with_uncertainty,
)
from triaxcal.report.words.shares import share_rows
from triaxcal.uncertainty.budget import Budget, Line
from triaxcal.unit.choices import ESTIMATOR_WORDS
from triaxcal.unit.limits import AT_T0, OVER_RANGE

_NEGLIGIBLE = 1e-9
"""Of the variance: no sensitivity is shown beside it."""
_WHERE = {AT_T0: "acceptance.at_t0", OVER_RANGE: "acceptance.over_range"}
_ROWS = {
    RESIDUAL: "row.residual",
    HELD_OUT: "row.held_out",
    COMPONENTS: "row.components",
    UNCERTAINTY: "row.uncertainty",
    GUARDED: "row.guarded",
}


def verdict(found: Verdict, t: Speaker) -> dict[str, Any]:
    """What was held against the limits, in mg, and last the limits."""
    places = list(dict.fromkeys(check.where for check in found.tested))
    rows = []
    for what, key in _ROWS.items():
        own = {check.where: check for check in found.tested if check.what == what}
        if own:
            head = t(key)
            if any(check.rms for check in own.values()):
                head = t("row.rms", row=head)
            rows.append((head, *(_cell(own.get(where), t) for where in places)))
    limits = {check.where: f"{check.limit_g * 1e3:g}" for check in found.tested}
    return {
        "words": [] if found.shown else [t.say(words, capital=True) for words in _said(found)],
        "heads": (t("acceptance.head"), *(t(_WHERE[where]) for where in places)),
        "rows": [*rows, (t("row.limit"), *(limits[where] for where in places))],
        "note": t.say(found.note, capital=True),
    }


def _said(found: Verdict) -> list[str]:
    """The verdict's reasons, a sentence each."""
    return [f"{words}." for words in (*found.reasons, *found.not_tested)] or [f"{found.words}."]


def _cell(check: LimitCheck | None, t: Speaker) -> str:
    words = cell(check)
    if check is None or words is None:
        return t("acceptance.nothing")
    return words if check.whole else t("acceptance.unknown", size=words)


def acceptance(a: Acceptance, p: Passport, t: Speaker) -> dict[str, Any]:
    """One limit, and how the unit stands to it."""
    checked, rule = p.verdict.checked, by_rule(p.delivery.unit.limits)
    if not checked:
        text = t("acceptance.not_checked")
    elif a.shown:
        text = t(f"acceptance.shown{rule}")
    elif a.within:
        text = t("acceptance.known", unknown=Markup(", ").join(t.say(name) for name in a.unknown))
    else:
        text = t(
            f"acceptance.not_shown{rule.removesuffix('_simple')}",
            factor=significant(a.factor, 2),
            cause=t.say(a.cause),
            advice=t.say(a.advice),
        )
    scale = max(a.limit_g, a.largest_g + a.uncertainty_g)
    size = g_in_words(a.uncertainty_g)
    limit, largest = g_in_words(a.limit_g), g_in_words(a.largest_g)
    accepted = g_in_words(a.acceptance_g) if a.acceptance_g > 0.0 else ""
    return {
        "accepted": t("acceptance.accepted", size=accepted)
        if accepted
        else t("acceptance.accepted_nothing"),
        "title": t("acceptance.of_limit", where=t(_WHERE[a.where]), size=largest, limit=limit),
        "uncertainty": t("acceptance.uncertainty", size=size)
        if checked
        else t("acceptance.uncertainty_unknown"),
        "shown": a.shown and checked,
        "text": text,
        "largest_width": round(100 * a.largest_g / scale, 2),
        "uncertainty_width": round(100 * a.uncertainty_g / scale, 2),
        "limit_at": round(100 * a.limit_g / scale, 2),
    }


def unchecked(p: Passport, t: Speaker) -> list[str]:
    """Limits that hold in the working range, without a dwell to check them."""
    return [t("acceptance.unchecked", where=t(_WHERE[where])) for where in p.unchecked]


def constants(p: Passport, t: Speaker) -> list[dict[str, Any]]:
    """The twelve constants at T0."""
    calibration = p.delivery.calibration
    at_t0 = calibration.thermal.constants_at(calibration.thermal.t0_degc)
    rows = []
    for c, budget in enumerate(p.constant_budgets):
        name = p.uncertainty.units[c]
        scale, unit = (1e3, f"m{name}") if name.startswith("V") else (1.0, raised(name))
        value, expanded = with_uncertainty(float(at_t0[c]), budget.expanded, scale)
        worst = budget.worst
        rows.append(
            {
                "symbol": CONSTANT_NAMES[c][0] if c < 9 else "U",
                "index": CONSTANT_NAMES[c][1:] if c < 9 else f"0{CONSTANT_NAMES[c][-1]}",
                "value": value,
                "expanded": expanded if p.verdict.checked else t("constants.unknown"),
                "unit": unit,
                "factor": f"{budget.factor:.2f}",
                "cause": t.say(worst.source.name, article=False) if worst else "",
                "share": percent(worst.share) if worst else "",
                "group_end": c in (2, 5, 8),
            }
        )
    return rows


def shares(calibration: Calibration, t: Speaker) -> list[dict[str, str]]:
    """How much poses and priors determine each constant."""
    return [
        {
            "name": t.say(row.name),
            "value": t.say(row.value),
            "sd": raised(row.sd),
            "prior_sd": raised(row.prior_sd),
            "data": t.say(row.data),
            "prior": t.say(row.prior),
        }
        for row in share_rows(calibration)
    ]


def budgets(p: Passport, t: Speaker) -> list[dict[str, Any]]:
    """The budgets of a component and of the length, where they are known worst."""
    return [
        _budget(p.component_budget, "of_component", p.component_orientation, t),
        _budget(p.length_budget, "of_length", p.length_orientation, t),
    ]


def _budget(b: Budget, title: str, orientation: str, t: Speaker) -> dict[str, Any]:
    quantity, size = t.say(b.quantity), in_unit(b.expanded, b.unit)
    return {
        "title": t(f"uncertainty.{title}", size=size),
        "caption": t("uncertainty.caption", quantity=quantity),
        "combined": t(
            "uncertainty.combined",
            quantity=quantity,
            orientation=t.say(orientation),
            size=in_unit(b.combined, b.unit),
            dof=_dof(b.dof),
            factor=f"{b.factor:.2f}",
        ),
        "verdict": t.say(b.verdict),
        "lines": [_line(line, b.unit, t) for line in b.lines],
    }


def _line(line: Line, unit: str, t: Speaker) -> dict[str, Any]:
    source, known = line.source, line.contribution is not None
    sensitivity = "" if line.share < _NEGLIGIBLE else _sensitivity(line, unit)
    unknown = t("uncertainty.unknown")
    return {
        "name": t.say(source.name, article=False),
        "origin": t.say(source.origin),
        "sd": in_unit(source.sd, source.unit) if source.sd is not None else unknown,
        "distribution": t.say(source.distribution),
        "dof": _dof(source.dof),
        "sensitivity": sensitivity,
        "contribution": in_unit(line.contribution or 0.0, unit) if known else unknown,
        "share": percent(line.share) if known else "?",
        "width": round(100 * line.share, 1),
        "assumed": source.assumed or source.unknown,
    }


def _sensitivity(line: Line, unit: str) -> str:
    above, below = handy(unit), handy(line.source.unit)
    value = significant((line.sensitivity or 0.0) * above[1] / below[1])
    if unit == line.source.unit:
        return value
    divisor = f"({below[0]})" if "/" in below[0] else below[0]
    return f"{value} {above[0]}/{divisor}"


def _dof(value: float) -> str:
    return "∞" if value > 1e5 else f"{value:.0f}"


def candidates(calibration: Calibration, t: Speaker) -> list[dict[str, Any]]:
    """Every thermal function that was compared."""
    return [
        {
            "label": t.say(c.short_label),
            "estimator": t.say(ESTIMATOR_WORDS.get(c.estimator, c.estimator)),
            "parameters": c.parameters,
            "fitted": g_in_words(c.fit_residual_g),
            "held_out": t("choice.none") if c.held_out_g is None else g_in_words(c.held_out_g),
            "chosen": c.chosen,
        }
        for c in calibration.candidates
    ]
