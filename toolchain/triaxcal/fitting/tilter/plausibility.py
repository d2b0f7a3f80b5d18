"""Exchanged positions, which readings give away before any fit.

Along the six positions output i must follow s_i a_i, the force along its own
axis times the sign of K_ii. Let u_i be output i, mean removed, scaled to length 1, and

    M[d', d] = sum_i s_i u_i[d'] a_i[d] / sqrt(2):

the trace of M is the sum of the three correlations, and taking the reading of row d' for that of
position d and vice versa changes it by M[d', d] + M[d, d'] - M[d, d] - M[d', d']. For outputs
that follow their own axes (trace 3) any exchange loses 1 (positions of two axes: two correlations
fall to 1/2) or 2 (of one axis: a correlation turns to -1), and undoing it gains as much. Neither
bias nor sensitivity matters, and cross sensitivities take a few hundredths off. An exchange is
reported when undoing it gains more than 1/4: halfway but for a margin that leaves a dead output
(gain 0) to the check of the condition number.

What cannot be seen this way: all positions turned over, or the axes relabelled in a cycle.

A single reading that is off by little is not looked for here: with two degrees of freedom an
output and temperature, and imperfect placement in them, no threshold is both sharp and free of
false alarms. The residuals, and the acceptance limits of P1 (13), show it.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from triaxcal.base.errors import ContradictionError
from triaxcal.fitting.core.grouping import TemperatureGroup
from triaxcal.fitting.tilter.estimators import DEAD_OUTPUT
from triaxcal.model.metrological import per
from triaxcal.model.positions import AXES, TEST_POSITIONS
from triaxcal.model.types import FloatArray

_GAIN_MIN = 0.25
_FORCES = np.array(list(TEST_POSITIONS.values()), dtype=np.float64)
_NAMES = tuple(TEST_POSITIONS)
_PAIRS = tuple(combinations(range(6), 2))
_AXIS_PAIRS = {(4, 5): 0, (1, 3): 1, (0, 2): 2}
"""Indices of the two positions along each axis: TP5/TP6 x, TP2/TP4 y, TP1/TP3 z."""

Exchange = tuple[int, int]


def refuse_exchanged_positions(
    source: str,
    groups: tuple[TemperatureGroup, ...],
    polarity: tuple[int, int, int] | None,
    nominal_v_per_g: tuple[float, float, float] | None = None,
    reading_unit: str = "V",
) -> None:
    """Refuse groups in which two positions look exchanged, and name the two.

    Parameters
    ----------
    polarity : tuple of three signs, or None
        Signs of Kxx, Kyy, Kzz; None means that all three are alike.
    nominal_v_per_g : tuple of three floats, or None
        Where the signs come from it, it is the key that is named.
    reading_unit : str

    Raises
    ------
    ContradictionError
        Naming positions, rows and temperatures; where signs of K alone give it away at every
        temperature, also the key that declares such a unit.
    """
    shapes = [_follow(group) for group in groups]
    signs = _signs(shapes, polarity)
    found = [_exchanges((shape * signs) @ _FORCES.T / np.sqrt(2.0)) for shape in shapes]
    if not any(found):
        return
    first = next(pairs for pairs in found if pairs)
    spoiled = [g for g, pairs in zip(groups, found, strict=True) if pairs == first]
    if all(pairs == first for pairs in found) and all(p in _AXIS_PAIRS for p in first):
        _refuse_signs(source, groups, polarity, nominal_v_per_g, reading_unit)
    row_of = [(spoiled[0].dwells[a].row, spoiled[0].dwells[b].row) for a, b in first]
    rows = "; ".join(f"rows {min(r)} and {max(r)}" for r in row_of)
    remedy = f"exchange {'the positions of these rows' if len(first) == 1 else 'them back'}"
    if len(first) > 1:
        remedy += ", or put the columns of Ux, Uy, Uz in order"
    raise ContradictionError(
        f"{source}, {rows}",
        f"{_exchanged(first)} look exchanged at {_temps([g.temp_degc for g in spoiled])} degC: "
        f"Kxx, Kyy, Kzz are {_diagonal(spoiled[0], ())} {per(reading_unit, 'g')} as recorded, "
        f"{_diagonal(spoiled[0], first)} {per(reading_unit, 'g')} with the exchange undone",
        expected="each output to follow the force along its own axis",
        remedy=remedy,
    )


def _refuse_signs(
    source: str,
    groups: tuple[TemperatureGroup, ...],
    polarity: tuple[int, int, int] | None,
    nominal_v_per_g: tuple[float, float, float] | None,
    reading_unit: str,
) -> None:
    """Signs that differ at every temperature: positions, a turn of the unit, or its polarity.

    A half turn inverts two outputs, an exchange of opposite positions one. Where no polarity is
    stated one output that differs from two may be either: the sensitivities may all be negative.
    """
    shown = np.sign(_own(groups[0], ()))
    relative = shown * (polarity or (1, 1, 1))
    odd = int(np.argmax(relative != np.sign(relative.sum())))
    wrong = [i for i in range(3) if relative[i] < 0] if polarity else [odd]
    pair = next(p for p, axis in _AXIS_PAIRS.items() if axis == odd)
    others = [p for p, axis in _AXIS_PAIRS.items() if axis != odd]
    turn = f"half a turn of the unit about {AXES[odd]} ({_exchanged(others)} exchanged throughout)"
    swap = f"{_exchanged([pair])} exchanged throughout"
    expected, exchanged = "signs of Kxx, Kyy, Kzz all alike", [pair]
    ways = f"{swap} or {turn}"
    if polarity is not None:
        expected = f"those of [sensor] {_key(polarity, nominal_v_per_g)}"
        exchanged = [p for p, axis in _AXIS_PAIRS.items() if axis in wrong]
        ways = {1: swap, 2: turn, 3: "all positions turned over"}[len(wrong)]
    names = " and ".join(f"K{AXES[i]}{AXES[i]}" for i in wrong)
    place = source if len(wrong) == 3 else f"{source}, {_rows(groups, exchanged)}"
    signs = shown[0], shown[1], shown[2]
    raise ContradictionError(
        place,
        f"{names} {'has' if len(wrong) == 1 else 'have'} the wrong sign at every temperature: "
        f"Kxx, Kyy, Kzz are {_diagonal(groups[0], ())} {per(reading_unit, 'g')}; the readings "
        f"cannot tell {ways} from polarity",
        expected=expected,
        remedy="see how the unit was seated and correct the positions; only if it has this "
        f"polarity, set {_key(signs, nominal_v_per_g)} under [sensor] in unit.toml",
    )


def _key(
    signs: tuple[float, float, float], nominal_v_per_g: tuple[float, float, float] | None
) -> str:
    """The key that states signs, as it is to be written."""
    if nominal_v_per_g is None:
        return f"polarity = {[int(s) for s in signs]}"
    nominal = [f"{s * abs(v):g}" for s, v in zip(signs, nominal_v_per_g, strict=True)]
    alike = len(set(nominal)) == 1
    return f"nominal_v_per_g = {nominal[0] if alike else '[' + ', '.join(nominal) + ']'}"


def _rows(groups: tuple[TemperatureGroup, ...], exchanged: list[Exchange]) -> str:
    first = groups[0]
    rows = "; ".join(
        f"rows {min(r)} and {max(r)}"
        for r in [(first.dwells[a].row, first.dwells[b].row) for a, b in exchanged]
    )
    rows += f" ({first.temp_degc:.6g} degC)"
    return f"{rows}, and those of the other temperatures" if len(groups) > 1 else rows


def _follow(group: TemperatureGroup) -> FloatArray:
    """Outputs over the positions, shape (6, 3), mean removed and scaled to length 1.

    A dead output is noise of no shape: zeros.
    """
    voltage = np.array([d.voltage_v for d in group.dwells])
    centred = voltage - voltage.mean(axis=0)
    length = np.linalg.norm(centred, axis=0)
    alive = length > DEAD_OUTPUT * length.max()
    shape: FloatArray = np.divide(centred, length, out=np.zeros((6, 3)), where=alive)
    return shape


def _signs(shapes: list[FloatArray], polarity: tuple[int, int, int] | None) -> FloatArray:
    """Signs that K_ii must have; without polarity the common one that most readings show."""
    if polarity is not None:
        return np.array(polarity, dtype=np.float64)
    correlation = sum(float(np.sum(shape * _FORCES)) for shape in shapes)
    return np.full(3, 1.0 if correlation >= 0.0 else -1.0)


def _exchanges(follow: FloatArray) -> list[Exchange]:
    """Exchanges that restore the order, the most telling first; `follow` is M, shape (6, 6)."""
    order = np.arange(6)
    pairs: list[Exchange] = []
    for _ in range(5):
        M = follow[order]
        gains = [M[a, b] + M[b, a] - M[a, a] - M[b, b] for a, b in _PAIRS]
        best = int(np.argmax(gains))
        if gains[best] <= _GAIN_MIN:
            break
        a, b = _PAIRS[best]
        order[[a, b]] = order[[b, a]]
        pairs.append((a, b))
    return pairs


def _own(group: TemperatureGroup, undo: tuple[Exchange, ...] | list[Exchange]) -> FloatArray:
    """Kxx, Kyy, Kzz of (10), shape (3,), V/g."""
    voltage = np.array([d.voltage_v for d in group.dwells])
    for a, b in undo:
        voltage[[a, b]] = voltage[[b, a]]
    return np.asarray(np.sum(voltage * _FORCES, axis=0) / 2.0)


def _diagonal(group: TemperatureGroup, undo: tuple[Exchange, ...] | list[Exchange]) -> str:
    return "(" + ", ".join(f"{k:+.4g}" for k in _own(group, undo)) + ")"


def _exchanged(pairs: list[Exchange]) -> str:
    return ", ".join(f"{_NAMES[a]} and {_NAMES[b]}" for a, b in pairs)


def _temps(temps: list[float]) -> str:
    return ", ".join(f"{t:.6g}" for t in temps)
