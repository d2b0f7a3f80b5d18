"""[quadratic] of unit.toml: readings of an orthogonal pair on a dividing head."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, Values, setting
from triaxcal.base.kinds import Kind
from triaxcal.model.positions import AXES
from triaxcal.unit.recordingfile import FILE


def _axis_pair(value: object) -> tuple[int, int]:
    names = value if isinstance(value, list) else []
    a, b = (AXES.index(name) for name in names)
    if a == b:
        raise ValueError
    return a, b


@dataclass(frozen=True)
class PairSource:
    """[quadratic]: cross-coupling that a dividing head has shown.

    Attributes
    ----------
    cross_coupling
        A pair's readings on a dividing head, in the unit's folder; its cross-coupling is removed.
    axes
        A first, then B.
    """

    cross_coupling: str = setting(FILE, example='"pair.csv"')
    axes: tuple[int, int] = setting(
        Kind(
            'the axes that A and B are, as ["x", "y"]',
            _axis_pair,
            {"type": "array", "items": {"enum": list(AXES)}, "minItems": 2, "maxItems": 2},
            example='["x", "y"]',
        )
    )


QUADRATIC = TableKeys.of(PairSource, optional=True)


def pair_source(values: Values) -> PairSource | None:
    """Pair of a table [quadratic]; None when there is none."""
    return values.record(PairSource) if values else None
