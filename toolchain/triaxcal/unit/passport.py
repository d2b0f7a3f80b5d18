"""[passport] of unit.toml: in which languages the passport is written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.keys import TableKeys, setting
from triaxcal.base.kinds import listed, word
from triaxcal.base.shipped import shipped

ENGLISH = "en"
"""The language in which the rest of triaxcal speaks."""


def languages_folder() -> Path:
    """Where the texts of each language are: a file each, of the name of its code."""
    return shipped("templates") / "languages"


def _codes() -> tuple[str, ...]:
    others = sorted(p.stem for p in languages_folder().glob("*.toml") if p.stem != ENGLISH)
    return (ENGLISH, *others)


CODES = _codes()
"""Of ISO 639-1, of the languages that there are."""


@dataclass(frozen=True)
class PassportChoice:
    """[passport]: in which languages the passport is written.

    Attributes
    ----------
    languages
        Languages of the passport. passport.html is in the first, passport.<language>.html in each
        other one.
    """

    languages: tuple[str, ...] = setting(
        listed(
            word(CODES),
            range(1, len(CODES) + 1),
            "a list of different languages of " + ", ".join(CODES),
            different=True,
        ),
        (ENGLISH,),
        words='["en"]',
        example='["en", "de"]',
    )


PASSPORT = TableKeys.of(PassportChoice)
