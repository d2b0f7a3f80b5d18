"""passport.html: one page with everything in it, for paper and for a phone."""

from __future__ import annotations

from typing import Any

from triaxcal import __version__
from triaxcal.codegen.templates import environment
from triaxcal.codegen.tryout import MethodResult
from triaxcal.delivery.firmware import fitted_to
from triaxcal.delivery.verdict import NOT_CHECKED, NOT_SHOWN, PASSED
from triaxcal.fitting.converter import input_words
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.report.passport.content import Acceptance, Passport
from triaxcal.report.pictures.curves import (
    HEIGHT,
    LEFT,
    RIGHT,
    WIDTH,
    curve_panels,
    uncertainty_panel,
)
from triaxcal.report.pictures.residual_panels import residual_panels
from triaxcal.report.stated.statements import statements
from triaxcal.report.stated.words import LABELS, added_words, caution_words, value_words
from triaxcal.report.words.device import device_not_counted, device_words
from triaxcal.report.words.firmware import (
    checked_words,
    file_rows,
    proven_words,
    theorem_rows,
    tool_rows,
)
from triaxcal.report.words.measured import measured_words
from triaxcal.report.words.numbers import (
    g_in_words,
    handy,
    in_unit,
    percent,
    raised,
    signed,
    significant,
    superscript,
    with_uncertainty,
)
from triaxcal.report.words.shares import ShareRow, share_rows
from triaxcal.uncertainty.budget import Budget, Line
from triaxcal.unit.choices import ESTIMATOR_WORDS
from triaxcal.unit.equipment import EQUIPMENT

_NEGLIGIBLE = 1e-9
"""Of the variance: no sensitivity is shown beside it."""


def passport_html(p: Passport) -> bytes:
    """HTML of a passport: no network, no clock, no script."""
    context = {
        "identity": _identity(p),
        "stated": _stated(p),
        "badge": _badge(p),
        "rule": p.delivery.unit.limits.rule_words,
        "verdict": p.verdict,
        "acceptance": [_acceptance(a, p) for a in p.acceptance],
        "unchecked": p.unchecked,
        "warnings": (*p.uncertainty.warnings, *_findings(p)),
        "constants": _constants(p),
        "terms": [signed(line.strip()) for line in p.delivery.calibration.terms.lines()],
        "t0": signed(f"{p.delivery.calibration.thermal.t0_degc:g}"),
        "curved": p.delivery.calibration.shape.parameters > 1,
        "panels": curve_panels(p.delivery.calibration, p.uncertainty),
        "panel": {"width": WIDTH, "height": HEIGHT, "left": LEFT, "right": WIDTH - RIGHT},
        "residuals": residual_panels(p.delivery),
        "before": _largest(p.delivery.methods[0]),
        "after": _largest(p.delivery.chosen),
        "over_temperature": uncertainty_panel(p.delivery.calibration, p.uncertainty),
        "budgets": [
            _budget(p.component_budget, "A component", p.component_orientation),
            _budget(p.length_budget, "The length |a|", p.length_orientation),
        ],
        "shares": [_share(s) for s in share_rows(p.delivery.calibration)],
        "candidates": _candidates(p),
        "fit_head": "bias by" if p.delivery.calibration.recording is None else "fit",
        "selection_reason": p.delivery.calibration.selection_reason,
        "verification": _verification(p),
        "tools": tool_rows(p.tools),
        "files": [*file_rows(p.delivery.files), *theorem_rows(p.tools)],
    }
    return environment().get_template("pages/passport.html.j2").render(context).encode()


def _badge(p: Passport) -> dict[str, Any]:
    """The verdict in large letters, and what it leaves open."""
    verdict, added = p.verdict, added_words(p.delivery.unit.limits)
    why = "; ".join(verdict.not_tested) or "see below"
    counted = f"{added} included" if added else "uncertainty not counted"
    beyond = f"the {added} reaches beyond a limit"
    unfit = "the scale contradicts the readings' unit"
    result, small = {
        PASSED: (PASSED, f"within the limits, {counted}"),
        NOT_SHOWN: ("not shown to pass", unfit if verdict.contradicts else beyond),
        NOT_CHECKED: (NOT_CHECKED, "as many constants as poses"),
    }.get(verdict.result, (verdict.result, why))
    return {"good": verdict.shown, "result": result.upper(), "small": small}


def _identity(p: Passport) -> dict[str, Any]:
    d = p.delivery
    low, high = d.calibration.range_degc
    return {
        "unit": d.unit.name,
        "serial": d.unit.serial,
        "rows": [
            ("Serial number", d.unit.serial),
            ("Working range", signed(f"{low:g} to {high:g} °C")),
            ("Measured", signed(measured_words(d).replace("degC", "°C"))),
            *[("Input of the C", words) for words in input_words(d.calibration.inputs, "raw_code")],
            *_left_out(d.calibration),
            ("Local gravity", f"{d.unit.gravity_g * 9.80665:.6g} m/s²"),
            ("Thermal model", f"{signed(d.calibration.shape.label.replace('degC', '°C'))}"),
            ("Fitted to", fitted_to(d.calibration)),
            (
                "Compensation",
                f"{d.chosen.method.label}, LSB 2{superscript(-d.plan.shape.output_q)} g",
            ),
            ("Made by", f"triaxcal {__version__}, {d.compiler}"),
            ("Inputs", f"sha256 {d.inputs_sha256[:16]}…"),
        ],
    }


def _stated(p: Passport) -> dict[str, Any]:
    """What the laboratory states, what it does not state, and the equipment, a row for each."""
    found = statements(p.delivery.unit)
    single = [s for s in found if not s.number]
    return {
        "rows": [
            (LABELS[s.name], value_words(s.value, s.unit)) for s in single if s.value is not None
        ],
        "missing": [LABELS[s.name] for s in single if s.value is None],
        "heads": [LABELS[f"{EQUIPMENT.name}.{key.name}"] for key in EQUIPMENT.keys],
        "equipment": [
            [value_words(s.value, s.unit) for s in found if s.number == number]
            for number in range(1, len(p.delivery.unit.equipment) + 1)
        ],
        "cautions": [caution_words(c) for c in p.cautions],
    }


def _left_out(calibration: Calibration) -> list[tuple[str, str]]:
    """The held-out error of a recording."""
    if calibration.recording is None:
        return []
    rms = calibration.recording.left_out_length_g
    words = "none: not tested" if rms is None else f"|a| − g {g_in_words(rms)} rms"
    return [("Held-out poses", words)]


def _findings(p: Passport) -> tuple[str, ...]:
    """What was found in the readings, for the top of the page."""
    found = [*p.delivery.calibration.findings, *filter(None, [p.cause])]
    return tuple(raised(signed(f[0].upper() + f[1:].replace("degC", "°C"))) for f in found)


def _acceptance(a: Acceptance, p: Passport) -> dict[str, Any]:
    checked = p.verdict.checked
    added = added_words(p.delivery.unit.limits)
    unknown = [line.source.name for line in p.length_budget.unknown if added]
    factor = significant(a.factor, 2)
    if not checked:
        text = "not checked: there are as many constants as poses, so the residuals are 0"
    elif a.shown and unknown:
        text = f"within the limit, with what is known; not in it: {', '.join(unknown)}"
    elif a.shown and not added:
        text = "the limit holds; the uncertainty is not counted"
    elif a.shown:
        text = f"the limit holds, the whole {added} included"
    else:
        text = (
            f"the residuals are within the limit, but residual and {added} together reach "
            f"{factor} times the limit; the main cause is {a.cause}; {a.advice}"
        )
    scale = max(a.limit_g, a.largest_g + a.uncertainty_g)
    return {
        "where": a.where[0].upper() + a.where[1:],
        "limit": g_in_words(a.limit_g),
        "largest": g_in_words(a.largest_g),
        "uncertainty": g_in_words(a.uncertainty_g) if checked else "unknown",
        "acceptance": g_in_words(a.acceptance_g) if a.acceptance_g > 0.0 else "none",
        "shown": a.shown and checked and not unknown,
        "text": text,
        "largest_width": round(100 * a.largest_g / scale, 2),
        "uncertainty_width": round(100 * a.uncertainty_g / scale, 2),
        "limit_at": round(100 * a.limit_g / scale, 2),
    }


def _constants(p: Passport) -> list[dict[str, Any]]:
    calibration = p.delivery.calibration
    at_t0 = calibration.thermal.constants_at(calibration.thermal.t0_degc)
    rows = []
    for c, budget in enumerate(p.constant_budgets):
        name = p.uncertainty.units[c]
        scale, unit = (1e3, f"m{name}") if name.startswith("V") else (1.0, raised(name))
        value, expanded = with_uncertainty(float(at_t0[c]), budget.expanded, scale)
        if not p.verdict.checked:
            expanded = "unknown"
        worst = budget.worst
        rows.append(
            {
                "symbol": CONSTANT_NAMES[c][0] if c < 9 else "U",
                "index": CONSTANT_NAMES[c][1:] if c < 9 else f"0{CONSTANT_NAMES[c][-1]}",
                "value": value,
                "expanded": expanded,
                "unit": unit,
                "factor": f"{budget.factor:.2f}",
                "cause": worst.source.name.removeprefix("the ") if worst else "",
                "share": percent(worst.share) if worst else "",
                "group_end": c in (2, 5, 8),
            }
        )
    return rows


def _share(row: ShareRow) -> dict[str, str]:
    return {
        "name": row.name,
        "value": raised(signed(row.value)),
        "sd": raised(row.sd),
        "prior_sd": raised(row.prior_sd),
        "data": row.data,
        "prior": row.prior,
    }


def _largest(result: MethodResult) -> str:
    return g_in_words(max(abs(r.error_g) for r in result.residuals))


def _budget(b: Budget, title: str, orientation: str) -> dict[str, Any]:
    return {
        "title": title,
        "quantity": signed(b.quantity),
        "orientation": orientation,
        "combined": in_unit(b.combined, b.unit),
        "expanded": in_unit(b.expanded, b.unit),
        "factor": f"{b.factor:.2f}",
        "dof": _dof(b.dof),
        "verdict": signed(b.verdict),
        "lines": [_line(line, b.unit) for line in b.lines],
    }


def _line(line: Line, unit: str) -> dict[str, Any]:
    source, known = line.source, line.contribution is not None
    sensitivity = "" if line.share < _NEGLIGIBLE else _sensitivity(line, unit)
    return {
        "name": source.name.removeprefix("the "),
        "origin": source.origin,
        "sd": in_unit(source.sd, source.unit) if source.sd is not None else "unknown",
        "distribution": source.distribution,
        "dof": _dof(source.dof),
        "sensitivity": sensitivity,
        "contribution": in_unit(line.contribution or 0.0, unit) if known else "unknown",
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


def _candidates(p: Passport) -> list[dict[str, Any]]:
    return [
        {
            "label": signed(c.short_label.replace("degC", "°C")),
            "estimator": ESTIMATOR_WORDS.get(c.estimator, c.estimator),
            "parameters": c.parameters,
            "fitted": g_in_words(c.fit_residual_g),
            "held_out": g_in_words(c.held_out_g) if c.held_out_g is not None else "none",
            "chosen": c.chosen,
        }
        for c in p.delivery.calibration.candidates
    ]


def _verification(p: Passport) -> list[tuple[str, str]]:
    d = p.delivery
    lsb_g = 2.0**-d.plan.shape.output_q
    method = f"≤ {g_in_words(d.model_error_g)} at every temperature code and any raw code"
    return [
        (
            "Proven arithmetic error",
            proven_words(d.bound, d.check, g_in_words(d.bound.lsb * lsb_g)),
        ),
        ("Method against the fitted model", method),
        ("Both together", f"≤ {g_in_words(d.firmware.error_g)}, the sum"),
        ("Cross-check", checked_words(d.check)),
        *_device(p),
    ]


def _device(p: Passport) -> list[tuple[str, str]]:
    if p.device is None:
        return []
    words = device_words(p.device) if p.verified_device else device_not_counted(p.device)
    return [("On the device", signed(words))]
