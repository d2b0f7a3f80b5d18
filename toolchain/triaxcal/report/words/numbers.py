"""Numbers in words: as many digits as the uncertainty allows, and no more."""

from __future__ import annotations

import math
import re

_NOTHING_G = 1e-12
"""Residuals below this are the rounding of floating point."""
_NOTHING = 0.001
"""Contributions below this, in the unit shown, are not worth digits."""
MINUS = "\u2212"
_HANDY = {
    "g": ("µg", 1e6),
    "V": ("µV", 1e6),
    "V/g": ("µV/g", 1e6),
    "m/s²": ("mm/s²", 1e3),
    "g/g^2": ("µg/g²", 1e6),
}


def with_uncertainty(value: float, expanded: float, scale: float = 1.0) -> tuple[str, str]:
    """Value and its expanded uncertainty, times `scale`, the latter with two digits.

    GUM 7.2.6: the value is rounded to the uncertainty's last digit.
    """
    value, expanded = value * scale, expanded * scale
    places = 9 if expanded <= 0.0 else max(0, 1 - math.floor(math.log10(expanded)))
    places = min(places, 12)
    return signed(f"{value:+.{places}f}"), f"{expanded:.{places}f}"


def signed(text: str) -> str:
    """Text whose numbers have a true minus sign; hyphens stay."""
    return re.sub(r"(?<![\w.])-(?=\d)", MINUS, text)


def significant(value: float, digits: int = 2) -> str:
    """Positive number with so many significant digits, without an exponent where it is short."""
    if value == 0.0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    places = digits - 1 - int(exponent)
    if places > 6:
        return f"{mantissa}·10{superscript(int(exponent))}"
    return signed(f"{round(value, places):.{max(places, 0)}f}")


def scaled(value: float, scale: float, digits: int = 3) -> str:
    """Number of either sign to `digits` digits of a `scale`: no exponent where it is short."""
    if not scale > 0.0:
        scale = abs(value)
    if not scale > 0.0:
        return "0"
    power = math.floor(math.log10(scale))
    places = digits - 1 - power
    if not -9 <= power <= 9:
        exponent = math.floor(math.log10(abs(value))) if value else 0
        mantissa = f"{value / 10.0**exponent:.{digits - 1}f}"
        return signed(f"{mantissa}·10{superscript(exponent)}")
    # The sign of a negative value that is rounded to 0 goes.
    return signed(f"{round(value, places) + 0.0:.{max(places, 0)}f}")


def g_in_words(value_g: float) -> str:
    """Acceleration in mg, µg or ng, whichever gives a short number."""
    for scale, unit in ((1e3, "mg"), (1e6, "µg"), (1e9, "ng")):
        if abs(value_g) * scale >= 0.995:
            return f"{significant(value_g * scale, 3)} {unit}"
    return f"{significant(value_g * 1e9)} ng" if abs(value_g) >= _NOTHING_G else "0 ng"


def raised(text: str) -> str:
    """Text whose units have raised exponents."""
    return re.sub(r"\b(s|g)\^2", r"\1²", text)


def handy(unit: str) -> tuple[str, float]:
    """Unit in which a budget shows quantities of `unit`, and how many of it are one."""
    return _HANDY.get(unit, (raised(unit), 1.0))


def in_unit(value: float, unit: str) -> str:
    """Quantity of a budget in a unit of handy size."""
    name, scale = handy(unit)
    if 0.0 < abs(value * scale) < _NOTHING:
        return f"<\u202f{_NOTHING:g} {name}"
    return f"{significant(value * scale)} {name}"


def thousands(number: int, between: str = "\u202f") -> str:
    """Whole number in groups of three."""
    return f"{number:,}".replace(",", between)


def superscript(number: int) -> str:
    """Exponent as raised digits."""
    return str(number).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def percent(share: float) -> str:
    """Share of a whole, in whole percent; a share below a half is shown as such, not as 0."""
    return "<\u202f1" if 0.0 < share < 0.005 else f"{100 * share:.0f}"
