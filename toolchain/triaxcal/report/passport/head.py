"""The passport's head: whose it is, what was found, what was tested and what was not."""

from __future__ import annotations

from markupsafe import Markup

from triaxcal import __version__
from triaxcal.delivery.firmware import fitted_to
from triaxcal.delivery.verdict import (
    AT_DWELLS,
    AT_POSES,
    HELD_OUT,
    NOT_CHECKED,
    NOT_SHOWN,
    PASSED,
    RESIDUAL,
)
from triaxcal.fitting.converter import input_words
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.report.passport.content import Passport
from triaxcal.report.stated.words import by_rule
from triaxcal.report.texts.speaker import Speaker
from triaxcal.report.words.measured import measured_words
from triaxcal.report.words.numbers import g_in_words, signed, superscript, thousands

Rows = list[tuple[str, str]]
_RESULTS = {
    PASSED: "result.passed",
    AT_DWELLS: "result.dwells",
    AT_POSES: "result.poses",
    NOT_SHOWN: "result.not_shown",
    NOT_CHECKED: "result.not_checked",
}


def badge(p: Passport, t: Speaker) -> dict[str, object]:
    """The verdict in large letters, and what it leaves open."""
    verdict, rule = p.verdict, by_rule(p.delivery.unit.limits)
    why = Markup("; ").join(t.say(words) for words in verdict.not_tested)
    beyond = t(f"result.beyond{rule.removesuffix('_simple')}")
    small = {
        PASSED: t(f"result.within{rule}"),
        NOT_SHOWN: t("result.contradicts") if verdict.contradicts else beyond,
        NOT_CHECKED: t("result.no_check"),
    }.get(verdict.result, why or t("result.below"))
    return {"good": verdict.shown, "result": t(_RESULTS[verdict.result]), "small": small}


def identity(p: Passport, t: Speaker) -> dict[str, object]:
    """Name, serial number, and the rows that say what was measured and how it was fitted."""
    d = p.delivery
    low, high = (signed(f"{end:g}") for end in d.calibration.range_degc)
    lsb = f"2{superscript(-d.plan.shape.output_q)}"
    return {
        "unit": d.unit.name,
        "serial": d.unit.serial,
        "rows": [
            (t("facts.serial"), d.unit.serial),
            (t("facts.range"), t("facts.range_value", low=low, high=high)),
            (t("facts.measured"), t.say(measured_words(d))),
            *[
                (t("facts.input"), t.say(words))
                for words in input_words(d.calibration.inputs, "raw_code")
            ],
            *_held_out(d.calibration, t),
            (t("facts.gravity"), f"{d.unit.gravity_g * 9.80665:.6g} m/s²"),
            (t("facts.model"), t.say(d.calibration.shape.label)),
            (t("facts.fitted_to"), t.say(fitted_to(d.calibration))),
            (t("facts.compensation"), t("facts.lsb", method=d.chosen.method.label, lsb=lsb)),
            (t("facts.made_by"), f"triaxcal {__version__}, {d.compiler}"),
            (t("facts.inputs"), f"SHA-256 {d.inputs_sha256[:16]}…"),
        ],
    }


def _held_out(calibration: Calibration, t: Speaker) -> Rows:
    """The held-out error of a recording."""
    if calibration.recording is None:
        return []
    rms = calibration.recording.left_out_length_g
    if rms is None:
        return [(t("facts.held_out"), t("facts.held_out_none"))]
    return [(t("facts.held_out"), t("facts.held_out_rms", size=g_in_words(rms)))]


def warnings(p: Passport, t: Speaker) -> list[str]:
    """What was found in the readings, for the top of the page."""
    found = *p.uncertainty.warnings, *p.delivery.calibration.findings, *filter(None, [p.cause])
    return [t.say(words, capital=True) for words in found]


def tested(p: Passport, t: Speaker) -> list[tuple[str, list[str]]]:
    """Two lists: what was tested, and what was not."""
    done, verdict = p.delivery, p.verdict
    counts = {
        what: sum(check.dwells for check in verdict.tested if check.what == what)
        for what in (RESIDUAL, HELD_OUT)
    }
    poses = "" if done.calibration.recording is None else "_poses"
    yes: list[str] = [t(f"tested.residual{poses}", count=counts[RESIDUAL])]
    if counts[HELD_OUT]:
        yes.append(t(f"tested.held_out{poses}", count=counts[HELD_OUT]))
    yes.append(t("tested.arithmetic", count=thousands(done.check.total)))
    no: list[str] = [t.say(words) for words in verdict.not_tested]
    if p.verified_device is not None:
        yes.append(t("tested.device", serial=_serial(p), date=p.verified_device.date))
    if p.tools:
        yes.append(t("tested.tools", names=", ".join(p.tools)))
    no += [t(key, **values) for key, values in unshown(p)]
    return [(t("tested.yes"), yes), (t("tested.no"), no or [t("tested.everything")])]


def unshown(p: Passport) -> list[tuple[str, dict[str, str]]]:
    """What neither a device nor a tool has shown of the C: keys of texts with their values."""
    found: list[tuple[str, dict[str, str]]] = []
    if p.device is None:
        found.append(("tested.no_device", {}))
    elif p.verified_device is None:
        found.append(("tested.other_device", {"date": p.device.date}))
    if not p.tools:
        found.append(("tested.no_tools", {}))
    return found


def _serial(p: Passport) -> str:
    return "" if p.device is None else p.device.hardware or p.device.serial


def verification(p: Passport, t: Speaker) -> Rows:
    """What was proven and compared of the C, and what a device has shown."""
    d = p.delivery
    lsb_g = 2.0**-d.plan.shape.output_q
    sets = Markup("; ").join(
        Markup("{} {}").format(thousands(count), t.say(name))
        for name, count in d.check.vectors.items()
    )
    return [
        (
            t("verification.proven"),
            t(
                "verification.proven_value",
                lsb=f"{d.bound.lsb:.3f}",
                size=g_in_words(d.bound.lsb * lsb_g),
                codes=thousands(d.bound.codes),
                seen=f"{d.check.largest_error_lsb:.3f}",
            ),
        ),
        (
            t("verification.method"),
            t("verification.method_value", size=g_in_words(d.model_error_g)),
        ),
        (t("verification.both"), t("verification.both_value", size=g_in_words(d.firmware.error_g))),
        (
            t("verification.share"),
            t(
                "verification.share_value",
                share=f"{d.firmware.functions.share:.2g}",
                order=d.plan.shape.order,
            ),
        ),
        (
            t("verification.check"),
            t("verification.check_value", count=thousands(d.check.total), sets=sets),
        ),
        (t("verification.device"), _device(p, t)),
    ]


def _device(p: Passport, t: Speaker) -> str:
    record = p.device
    if record is None:
        return t("verification.device_none")
    if p.verified_device is None:
        return t("verification.device_other", date=record.date, image=record.image_sha256[:16])
    worst = record.worst
    return t(
        "verification.device_value",
        serial=_serial(p),
        date=record.date,
        firmware=record.firmware or t("verification.no_version"),
        samples=thousands(record.samples),
        lsb=record.largest_difference_lsb,
        size=g_in_words(abs(worst.error_g)),
        count=len(record.positions),
        limit=g_in_words(worst.limit_g),
    )


def signature(p: Passport, t: Speaker) -> list[tuple[str, str, str]]:
    """Fields to sign: what for, and who and in which role, as far as the unit states it."""
    unit = p.delivery.unit
    details = unit.certificate
    by = (t("sign.by"), unit.measured.operator or "", "")
    responsible, checked = (t("sign.responsible"), "", ""), (t("sign.checked"), "", "")
    if details is not None:
        responsible = (t("sign.responsible"), details.signer, details.signer_role or "")
        checked = (
            t("sign.checked"), details.second_signer or "", details.second_signer_role or "",
        )  # fmt: skip
    return [by, checked, responsible, (t("sign.date"), "", "")]
