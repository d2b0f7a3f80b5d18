"""[report] and [nonlinearity] of unit.toml: what a test report needs beside the calibration."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import TableKeys, Values, setting
from triaxcal.base.kinds import line, number, three

_VALUE = number(-1e9, 1e9)
_SD = number(0.0, 1e9)
_THREE = three(_VALUE, "a list of 3 numbers, of x, y, z")
_THREE_SD = three(_SD, "a list of 3 numbers from 0, of x, y, z")


@dataclass(frozen=True)
class Reporting:
    """[report]: what the test report is made for.

    Attributes
    ----------
    input_range_g
        Input range: accelerations along each axis up to this, of either sign.
    """

    input_range_g: float = setting(number(0.01, 1e5), 1.0, "g")


@dataclass(frozen=True, kw_only=True)
class Nonlinearity:
    """[nonlinearity]: terms of the output that another test has shown, as a centrifuge.

    The output is K1 (K0 + a + K2 a^2 + Koq a |a| + K3 a^3 + ...), a along the own axis.

    Attributes
    ----------
    how
        How they were measured, for the report.
    own_square
        K2 of x, y, z.
    own_square_sd
        Their standard uncertainties.
    odd_square
        Koq of x, y, z.
    odd_square_sd
        Their standard uncertainties.
    cube
        K3 of x, y, z.
    cube_sd
        Their standard uncertainties.
    """

    how: str = setting(line(200), example='"centrifuge, 2026-03-30"')
    own_square: tuple[float, float, float] | None = setting(
        _THREE, None, "micro-g/g^2", example="[12, -5, 8]"
    )
    own_square_sd: tuple[float, float, float] | None = setting(
        _THREE_SD, None, "micro-g/g^2", example="[2, 2, 2]"
    )
    odd_square: tuple[float, float, float] | None = setting(
        _THREE, None, "micro-g/g^2", example="[3, 1, -2]"
    )
    odd_square_sd: tuple[float, float, float] | None = setting(
        _THREE_SD, None, "micro-g/g^2", example="[2, 2, 2]"
    )
    cube: tuple[float, float, float] | None = setting(
        _THREE, None, "micro-g/g^3", example="[3, 2, 4]"
    )
    cube_sd: tuple[float, float, float] | None = setting(
        _THREE_SD, None, "micro-g/g^3", example="[0.5, 0.5, 0.5]"
    )


REPORT = TableKeys.of(Reporting)
NONLINEARITY = TableKeys.of(Nonlinearity, optional=True)
TERMS = ("own_square", "odd_square", "cube")


def nonlinearity(values: Values) -> Nonlinearity | None:
    """Terms of a table [nonlinearity]; None when there is none.

    Raises
    ------
    RefusedError
        When a value is wrong, or stands without its standard uncertainty.
    """
    if not values:
        return None
    found = values.record(Nonlinearity)
    for name in TERMS:
        if (getattr(found, name) is None) != (getattr(found, f"{name}_sd") is None):
            lacking = f"{name}_sd" if name in values else name
            raise values.missing(lacking, "the values and their standard uncertainties together")
    if all(getattr(found, name) is None for name in TERMS):
        raise RefusedError(
            values.where("own_square"), "no term", expected="own_square, odd_square or cube"
        )
    return found
