"""passport.html: one page with everything in it, for paper and for a phone."""

from __future__ import annotations

from triaxcal.codegen.tryout import MethodResult
from triaxcal.report.passport.angles import angles_section
from triaxcal.report.passport.content import Passport
from triaxcal.report.passport.downloads import downloads
from triaxcal.report.passport.head import badge, identity, signature, tested, verification, warnings
from triaxcal.report.passport.qrcode import qr_code
from triaxcal.report.passport.tables import (
    acceptance,
    budgets,
    candidates,
    constants,
    shares,
    unchecked,
    verdict,
)
from triaxcal.report.pictures.curves import (
    HEIGHT,
    LEFT,
    RIGHT,
    WIDTH,
    curve_panels,
    uncertainty_panel,
)
from triaxcal.report.pictures.residual_panels import residual_panels
from triaxcal.report.stated.words import stated
from triaxcal.report.texts.html import css_text, page
from triaxcal.report.texts.speaker import Speaker, speaker, typeset
from triaxcal.report.words.firmware import file_rows, theorem_rows, tool_rows
from triaxcal.report.words.numbers import g_in_words, signed

_PLACE = "\0"


def passport_html(p: Passport, language: str | None = None) -> bytes:
    """HTML of a passport: no network, no clock; the script is in it, and nothing needs it.

    Parameters
    ----------
    language : str or None
        Code of a language; None is that of the unit.
    """
    calibration, unit = p.delivery.calibration, p.delivery.unit
    t = speaker(language or p.languages[0])
    return page(
        "passport.html.j2",
        t=t,
        title=t("page.title", unit=unit.name, serial=unit.serial),
        foot=css_text(t.plain("page.foot", unit=unit.name, serial=unit.serial)),
        numbered=_numbered(t),
        identity=identity(p, t),
        badge=badge(p, t),
        qr=qr_code(p, t),
        stated=stated(unit, p.cautions, t),
        warnings=warnings(p, t),
        rule=t.say(unit.limits.rule_words),
        verdict=verdict(p.verdict, t),
        acceptance=[acceptance(a, p, t) for a in p.acceptance],
        unchecked=unchecked(p, t),
        tested=tested(p, t),
        constants=constants(p, t),
        terms=[typeset(line.strip()) for line in calibration.terms.lines()],
        t0=signed(f"{calibration.thermal.t0_degc:g}"),
        curved=calibration.shape.parameters > 1,
        panels=curve_panels(calibration, p.uncertainty, t),
        panel={"width": WIDTH, "height": HEIGHT, "left": LEFT, "right": WIDTH - RIGHT},
        residuals=residual_panels(p.delivery, t),
        before=_largest(p.delivery.methods[0]),
        after=_largest(p.delivery.chosen),
        over_temperature=uncertainty_panel(calibration, p.uncertainty, t),
        budgets=budgets(p, t),
        angles=angles_section(p, t),
        shares=shares(calibration, t),
        candidates=candidates(calibration, t),
        fit_head=t("choice.bias_by") if calibration.recording is None else t("choice.fit"),
        selection_reason=t.say(calibration.selection_reason),
        verification=verification(p, t),
        tools=tool_rows(p.tools),
        files=[*file_rows(p.delivery.files), *theorem_rows(p.tools)],
        downloads=downloads(p),
        signature=signature(p, t),
    )


def _numbered(t: Speaker) -> list[str]:
    """What stands before, between and after the number of a page and that of all pages."""
    text = t.plain("page.of_pages", page=_PLACE, pages=_PLACE)
    return [css_text(part) for part in text.split(_PLACE)]


def _largest(result: MethodResult) -> str:
    return g_in_words(max(abs(r.error_g) for r in result.residuals))
