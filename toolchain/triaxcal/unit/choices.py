"""[fit], [sensor] and [compensation] of unit.toml: how constants are fitted and evaluated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from triaxcal.base.keys import TableKeys, setting
from triaxcal.base.kinds import TEXT, Kind, checked, number, three, whole, word
from triaxcal.model.methods.registry import METHODS

ESTIMATORS = ("equation-10", "least-squares", "half-sum")
ESTIMATOR_WORDS = {
    "equation-10": "mean of 4 positions",
    "least-squares": "least squares",
    "half-sum": "mean of 2 positions",
}
"""How a bias comes from six positions, as users read it."""
TERMS = ("auto", "linear", "quadratic")
LOSSES = ("linear", "huber", "cauchy")
OUTPUT_Q_RANGE = (8, 30)


@dataclass(frozen=True)
class Fit:
    """[fit]: how the constants are fitted.

    Attributes
    ----------
    estimator
        How the bias comes from six positions: least squares over all; the mean of the four in which
        the axis is level, P1 (10) ("equation-10"); or that of its own two ("half-sum").
    terms
        Of a recording: which candidates are tried.
    loss
        Of a recording: how far a pose that stands out may pull.
    """

    estimator: str = setting(word(("auto", *ESTIMATORS)), "auto")
    terms: str = setting(word(TERMS), "auto")
    loss: str = setting(word(LOSSES), "linear")


def _one_or_three() -> Kind[tuple[float, float, float]]:
    """A sensitivity for all outputs, or one for each; none is zero."""
    item = number(-1e3, 1e3)
    each = three(item, "a number that is not zero, or a list of three", lambda v: v != 0.0)

    def parse(value: Any) -> tuple[float, float, float]:
        return each.parse(value if isinstance(value, list) else [value] * 3)

    schema = {"anyOf": [dict(item.schema), dict(each.schema)]}
    return Kind(each.expected, parse, schema, example="0.27")


@dataclass(frozen=True)
class Sensor:
    """[sensor]: the sensor itself.

    Attributes
    ----------
    polarity
        Signs of Kxx, Kyy, Kzz, where they differ.
    nominal_v_per_g
        Sensitivity of the data sheet, signed: one number for all three outputs, or three. Readings
        that differ are refused: wrong full scale, wrong gain, exchanged signs.
    nominal_tolerance
        How far a sensitivity may be from nominal_v_per_g, relative.
    """

    polarity: tuple[int, int, int] | None = setting(
        three(
            checked(lambda v: type(v) is int and abs(v) == 1, "a sign", {"enum": [1, -1]}, "1"),
            "a list of three signs, each 1 or -1",
        ),
        None,
        words="all alike",
    )
    nominal_v_per_g: tuple[float, float, float] | None = setting(
        _one_or_three(), None, "V/g", words="not checked", example="0.27"
    )
    nominal_tolerance: float = setting(number(0.0, 1.0), 0.2)


@dataclass(frozen=True)
class Compensation:
    """[compensation]: what the firmware computes.

    Attributes
    ----------
    method
        What the firmware evaluates.
    output_q
        The LSB of the result is 2^-output_q g.
    model_error_max_micro_g
        How far the firmware's functions may be from the fitted model. By default the lowest order
        is taken with which method and arithmetic together stay below 0.3 of the unit's uncertainty.
    """

    method: str = setting(TEXT)
    output_q: int = setting(whole(*OUTPUT_Q_RANGE), 24)
    model_error_max_micro_g: float | None = setting(
        number(1e-3, 1e6), None, "micro-g", words="0.3 of the uncertainty", example="1"
    )


FIT, SENSOR = TableKeys.of(Fit), TableKeys.of(Sensor)


def compensation_table() -> TableKeys:
    """Keys of [compensation], with the methods that there are."""
    names = METHODS.names
    method = {"kind": word(names), "doc": METHODS.explained, "default": names[0]}
    return TableKeys.of(Compensation).but(method=method)
