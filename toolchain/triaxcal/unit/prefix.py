"""What the names in the generated C begin with: [firmware] prefix, [device] prefix."""

from triaxcal.base.errors import RefusedError
from triaxcal.base.kinds import Kind, pattern
from triaxcal.base.tomltable import shown

DEFAULT_PREFIX = "triax"

PREFIX: Kind[str] = pattern(
    r"(?!triax_|(?:str|mem|wcs|is|to)[a-z]|sig(?![0-9]))(?!.*__)[a-z](?:[a-z0-9_]{0,18}[a-z0-9])?",
    "1 to 20 small letters, digits and single underscores, a letter first, not beginning with "
    "triax_ nor, as C reserves them, with sig, nor with str, mem, wcs, is or to and a letter",
    '"left_accel"',
)
"""Names of the library that C99 7.26 reserves are refused: strength_apply, SIGNAL_CALIB."""


def checked_prefix(prefix: str) -> str:
    """The prefix, where it is one.

    Raises
    ------
    RefusedError
        When it is no name of C, or one that C reserves: as the key in unit.toml.
    """
    try:
        return PREFIX.parse(prefix)
    except ValueError:
        raise RefusedError("prefix", f"found {shown(prefix)}", expected=PREFIX.expected) from None
