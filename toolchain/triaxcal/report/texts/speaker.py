"""What a page says, in its language."""

from __future__ import annotations

import re
from functools import cache

from markupsafe import Markup, escape

from triaxcal.report.texts.languages import Language, language
from triaxcal.report.texts.phrases import Phrases, plain
from triaxcal.report.words.numbers import raised, signed
from triaxcal.unit.passport import ENGLISH

_PLACE = re.compile(r"\{(\w+)\}")
_WORD = re.compile(r"[a-z]{3}")
"""What makes a text one that is to be translated, and no name, number or unit."""


class Speaker:
    """The texts of a page by their keys, and what other rooms say, in one language."""

    def __init__(self, code: str) -> None:
        self.language: Language = language(code)
        english = code == ENGLISH
        self._phrases = None if english else Phrases(language(ENGLISH).said, self.language.said)

    @property
    def code(self) -> str:
        """The value of an attribute lang."""
        return self.language.code

    def __call__(self, key: str, /, **values: object) -> Markup:
        """Text of a key with `values` at its places, ready for HTML: values are escaped."""
        text = str(escape(self.language.texts[key]))
        return Markup(_PLACE.sub(lambda place: str(escape(values[place[1]])), text))

    def plain(self, key: str, /, **values: object) -> str:
        """The same where it is not HTML: nothing is escaped."""
        return _PLACE.sub(lambda place: str(values[place[1]]), self.language.texts[key])

    def say(self, words: str, *, capital: bool = False, article: bool = True) -> Markup:
        """What another room says in English: in the page's language, ready for HTML.

        What has no translation is English, and its element says so.

        Parameters
        ----------
        article : bool
            False drops the English "the", as in a cell of a table.
        """
        found = None if self._phrases is None else self._phrases.said(plain(words))
        text = words if found is None else found
        shown = typeset(text if article else text.removeprefix("the "), capital=capital)
        if self._phrases is None or found is not None or not _WORD.search(words):
            return _marked(shown)
        return Markup('<span lang="en">{}</span>').format(shown)


@cache
def speaker(code: str) -> Speaker:
    """The one of a language.

    Raises
    ------
    RefusedError
        When there is no such language.
    """
    return Speaker(code)


def _marked(words: str) -> Markup:
    """Words escaped, with the components of the acceleration as symbols."""
    return Markup(re.sub(r"\ba_([xyz])\b", r"a<sub>\1</sub>", str(escape(words))))


def typeset(words: str, *, capital: bool = False) -> str:
    """Words with a true minus, degree signs, raised exponents, and a capital where it is wanted."""
    text = raised(signed(plain(words).replace("+-", "±")))
    return text[:1].upper() + text[1:] if capital else text
