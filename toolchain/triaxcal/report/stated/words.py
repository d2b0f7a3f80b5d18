"""What a laboratory states, in the words of a language."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from markupsafe import Markup

from triaxcal.report.stated.statements import (
    NO_CERTIFICATE,
    NO_DAY,
    NO_EQUIPMENT,
    NOT_TRACEABLE,
    OVERDUE,
    UPDATED,
    Caution,
    Statement,
    statements,
)
from triaxcal.report.texts.speaker import Speaker, speaker
from triaxcal.report.words.numbers import signed
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.equipment import EQUIPMENT
from triaxcal.unit.limits import Limits
from triaxcal.unit.passport import ENGLISH

_PERFORMED_AT = "certificate.performed_at"
_CAUTIONS = {
    OVERDUE: "caution.overdue",
    NO_CERTIFICATE: "caution.no_certificate",
    NOT_TRACEABLE: "caution.not_traceable",
    NO_EQUIPMENT: "caution.no_equipment",
    NO_DAY: "caution.no_day",
    UPDATED: "caution.updated",
}


def label(name: str, t: Speaker) -> Markup:
    """Name of a key, as "measured.rig", as a form has it."""
    return t(f"stated.{name}")


def stated(unit: UnitDescription, cautions: Iterable[Caution], t: Speaker) -> dict[str, Any]:
    """What is stated, what is not, and the equipment, a row for each."""
    found = statements(unit)
    single = [s for s in found if not s.number]
    missing = [label(s.name, t) for s in single if s.value is None]
    if not unit.equipment:
        missing.append(label("equipment.name", t))
    return {
        "rows": [(label(s.name, t), value_words(s, t)) for s in single if s.value is not None],
        "missing": missing,
        "heads": [label(f"{EQUIPMENT.name}.{key.name}", t) for key in EQUIPMENT.keys],
        "equipment": [
            [value_words(s, t) for s in found if s.number == number]
            for number in range(1, len(unit.equipment) + 1)
        ],
        "cautions": [
            words[:1].upper() + words[1:] for words in (caution_words(c, t) for c in cautions)
        ],
    }


def value_words(found: Statement, t: Speaker) -> str:
    """A value with its unit."""
    value = found.value
    if value is None:
        return t("stated.not_stated")
    if found.name == _PERFORMED_AT:
        return t(f"performed.{value}")
    if isinstance(value, tuple):
        low, high = (signed(f"{end:g}") for end in value)
        words = low if low == high else t.plain("stated.between", low=low, high=high)
    else:
        words = f"{value:g}" if isinstance(value, float) else str(value)
    return f"{words} {found.unit.replace('degC', '°C')}".strip()


def by_rule(limits: Limits) -> str:
    """End of the keys of texts that say what the decision rule adds to an error."""
    if not limits.rule.guarded:
        return "_simple"
    return "" if limits.guard_band_g is None else "_guarded"


def caution_words(caution: Caution, t: Speaker | None = None) -> str:
    """A caution as a sentence without its full stop; None is English."""
    first, last = (*map(str, caution.dates), "", "")[:2]
    return (t or speaker(ENGLISH)).plain(
        _CAUTIONS[caution.kind], subject=caution.subject, due=first, last=last
    )
