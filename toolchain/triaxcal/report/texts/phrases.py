"""Sentences that other rooms say in English, recognized by their pattern and said anew.

A pattern is a text with places, "{share} % of {quantity}". What stands at a place is translated in
its turn where it is known, as the name of a source in a sentence is.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

_PLACE = re.compile(r"\{(\w+)\}")
_COUNT = "count"
"""A place of this name is a whole number."""
_WORDS = re.compile(r"(?<![\w./\\-])(?!arcsec)[a-z]{3,}(?![\w./\\-])")
"""Words of English, and no names of keys and files, nor units."""
_LETTERS = re.compile(r"[a-z]{2}")
_MOST_KEPT = 4096
"""Translations of one language that are kept: the pages of a series say much the same."""
_JOINTS = ("; ", ". ", ", ")
"""Between parts that may be known each for itself, the widest first."""


def plain(text: str) -> str:
    """Text with units as a page shows them."""
    return text.replace("degC", "°C").replace("micro-g", "µg")


@dataclass(frozen=True)
class Pattern:
    """A text with places, cut at them: the text between, and the places' names."""

    between: tuple[str, ...]
    places: tuple[str, ...]

    @staticmethod
    def of(text: str) -> Pattern:
        """The pattern of a text."""
        pieces = _PLACE.split(text)
        return Pattern(tuple(pieces[::2]), tuple(pieces[1::2]))

    @property
    def letters(self) -> int:
        """How much of it is fixed."""
        return sum(map(len, self.between))

    def match(self, text: str) -> dict[str, str] | None:
        """What stands at the places of `text`; None where it is another sentence."""
        first, *others = self.between
        if not text.startswith(first) or not text.endswith(self.between[-1]):
            return None
        found, at = {}, len(first)
        for k, (place, after) in enumerate(zip(self.places, others, strict=True)):
            last = k == len(others) - 1
            end = len(text) - len(after) if last else text.find(after, at + 1)
            if end <= at or (place == _COUNT and not text[at:end].isdigit()):
                return None
            found[place], at = text[at:end], end + len(after)
        return found

    def filled(self, values: Mapping[str, str]) -> str:
        """The text with values at its places."""
        pieces = [self.between[0]]
        for place, after in zip(self.places, self.between[1:], strict=True):
            pieces += [values[place], after]
        return "".join(pieces)


class Phrases:
    """What is said in one language, by what is said in another.

    Parameters
    ----------
    own, other : mapping of str to str
        Texts of both languages by the same keys.
    """

    def __init__(self, own: Mapping[str, str], other: Mapping[str, str]) -> None:
        self._exact: dict[str, str] = {}
        patterns = []
        for key, said in own.items():
            text = plain(said)
            pattern = Pattern.of(text)
            if pattern.places:
                patterns.append((pattern, Pattern.of(other[key])))
            else:
                self._exact[text] = other[key]
        self._patterns = sorted(patterns, key=lambda pair: -pair[0].letters)
        self._kept: dict[str, str | None] = {}

    def said(self, text: str) -> str | None:
        """`text` in the other language; None where it is not known, or only in part."""
        if text not in self._kept:
            if len(self._kept) >= _MOST_KEPT:
                self._kept.clear()
            self._kept[text] = self._found(text)
        return self._kept[text]

    def _found(self, text: str) -> str | None:
        for variant in (text, _lowered(text), text.removesuffix("."), _lowered(text[:-1])):
            found = self._whole(variant)
            if found is not None:
                capital = variant[:1] != text[:1]
                found = found[:1].upper() + found[1:] if capital else found
                return found if len(variant) == len(text) else f"{found}."
        for joint in _JOINTS:
            parts = text.split(joint)
            each = [self.said(part) for part in parts] if len(parts) > 1 else [None]
            if None not in each:
                return joint.join(part for part in each if part)
        return None

    def _whole(self, text: str) -> str | None:
        if text in self._exact:
            return self._exact[text]
        for own, other in self._patterns:
            values = own.match(text)
            if values is None:
                continue
            each = {name: _at_place(self, value) for name, value in values.items()}
            if all(value is not None for value in each.values()):
                return other.filled({k: v for k, v in each.items() if v is not None})
        return None


def _at_place(phrases: Phrases, value: str) -> str | None:
    """What stands at a place: a number or a name as it is, words in the other language."""
    if not _LETTERS.search(value):
        return value
    known = phrases.said(value)
    return value if known is None and not _WORDS.search(value) else known


def _lowered(text: str) -> str:
    return text[:1].lower() + text[1:]
