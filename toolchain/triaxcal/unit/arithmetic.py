"""How the C forms its products: [firmware] arithmetic, [device] arithmetic."""

from triaxcal.base.errors import RefusedError
from triaxcal.base.kinds import Kind, word
from triaxcal.base.tomltable import shown

PORTABLE, LIMBS, THUMB2, THUMB1 = "portable", "limbs", "thumb2", "thumb1"
HIGH_WORDS = "high-words"
ARITHMETICS = (PORTABLE, LIMBS, THUMB2, THUMB1, HIGH_WORDS)

ARITHMETIC: Kind[str] = word(ARITHMETICS)


def checked_arithmetic(arithmetic: str) -> str:
    """The arithmetic, where there is such a one.

    Raises
    ------
    RefusedError
        As for the key in unit.toml.
    """
    try:
        return ARITHMETIC.parse(arithmetic)
    except ValueError:
        place, found = "arithmetic", f"found {shown(arithmetic)}"
        raise RefusedError(place, found, expected=ARITHMETIC.expected) from None
