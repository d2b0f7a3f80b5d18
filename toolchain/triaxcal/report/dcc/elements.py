"""Elements of a Digital Calibration Certificate: texts, quantities with their units, persons."""

from __future__ import annotations

import re
from collections.abc import Iterable
from xml.etree import ElementTree as ET

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import shown

DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
XSI = "http://www.w3.org/2001/XMLSchema-instance"
SCHEMA = "3.2.1"
_NO_CHARACTER = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML 1.0 cannot hold (production 2, Char)."""


def element(parent: ET.Element, name: str, text: str | None = None, **attrs: str) -> ET.Element:
    """New last child of `parent` in the namespace of the DCC.

    Raises
    ------
    RefusedError
        When the text has a character that XML cannot hold.
    """
    made = ET.SubElement(parent, f"{{{DCC}}}{name}", attrs)
    made.text = text
    if text and (wrong := _NO_CHARACTER.search(text)):
        raise RefusedError(
            f"certificate, {name}",
            f"found {shown(text)} with the character U+{ord(wrong[0]):04X}",
            expected="characters that XML can hold",
            remedy="state it without this character",
        )
    return made


def text(parent: ET.Element, name: str, words: str) -> ET.Element:
    """Element of DCC's textType or richContentType in English."""
    made = element(parent, name)
    element(made, "content", words, lang="en")
    return made


def contact(parent: ET.Element, name: str, words: str) -> ET.Element:
    """Element of a contact with its name."""
    made = element(parent, name)
    text(made, "name", words)
    return made


def identification(parent: ET.Element, issuer: str, value: str, name: str) -> None:
    """One identification in a list of them."""
    made = element(parent, "identification")
    element(made, "issuer", issuer)
    element(made, "value", value)
    text(made, "name", name)


def quantity(parent: ET.Element, value: str, unit: str, name: str = "") -> ET.Element:
    """Quantity of one number in the unit of D-SI."""
    made = element(parent, "quantity")
    if name:
        text(made, "name", name)
    real = ET.SubElement(made, f"{{{SI}}}real")
    si(real, "value", [value])
    si(real, "unit", [unit])
    return made


def si(parent: ET.Element, name: str, words: Iterable[str]) -> ET.Element:
    """Element of D-SI with words, one space between them."""
    made = ET.SubElement(parent, f"{{{SI}}}{name}")
    made.text = " ".join(words)
    return made
