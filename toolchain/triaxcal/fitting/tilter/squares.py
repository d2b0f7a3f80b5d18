"""The square of an axis' own acceleration in its output, K2, from the six positions.

    U = K l + U0,    l + Q p(l) = a,    Q_ii the axis' own square, l_i = a_i - Q_ii a_i^2 + ...

The half-sum of two opposite positions, brought to force by N, is the bias; along its own axis it
has -Q_ii g^2 besides. Of the three half-sums of one output

    d_i = own - mean of the other two        shows the square, half the variance of a tilt and noise
    e_i = difference of the other two        shows squareness and noise alone

so six positions carry three squares, and three values that tell how far squareness and noise reach.
A tilt enters an axis' own half-sum as 1 - cos only. Both are means over the temperatures: one set
of squares serves all, and the prior of [priors] own_square_g_per_g2 joins them.

The squares go into the C where all of this holds, or where [firmware] terms says so:

1. the largest of them, at 1 g, is more than the standard uncertainty of a component without them:
   alignment, rounding to a code, and scatter of the positions;
2. squareness and noise explain them with a chance below `CHANCE` (F test of d against e);
3. what is held out agrees: squares of the other temperatures predict those of each better than
   none, and the check dwells are nearer to g with them.

Where they do, readings are straightened: K (l - a) is taken off in each position, and all that
follows is linear as ever.

A square passes through any three values of an axis, at -g, 0 and +g. One reading that is wrong by
2 Q g^2 at one end, by saturation or else, looks the same there. If it is that, the force with the
square is wrong by Q (a^2 +- g a), up to 2 Q g^2 (`END_FORMS`). Check dwells tell it where this is
more than they leave of |a| - g.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.grouping import TemperatureGroup
from triaxcal.fitting.core.judged import OwnSquares
from triaxcal.fitting.core.outliers import fisher_tail
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.positions import AXES, TEST_POSITIONS
from triaxcal.model.terms import Terms, products
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.readings.measurements import Dwell
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.priors import AUTO, LINEAR

_FORCES = np.array(list(TEST_POSITIONS.values()), dtype=np.float64)
_PAIRS = ((4, 5), (1, 3), (0, 2))
"""TP5 and TP6 along x, TP2 and TP4 along y, TP1 and TP3 along z."""
_LEVEL_ARCSEC = 20.0
"""Where [uncertainty] level_arcsec is not given, as in the budget."""
_RADIANS_PER_ARCSEC = math.pi / 180.0 / 3600.0
_ROUNDING_G = 1e-12
END_FORMS = np.array([1.0, -1.0])
"""Sign s of the error Q (a^2 + s g a) of a square that is one wrong reading at s g."""
_SEEN = 3.0
"""Times the rms of |a| - g at the check dwells: what one of them shows."""


def own_squares(unit: UnitDescription, groups: Sequence[TemperatureGroup]) -> OwnSquares:
    """Squares from the six positions, and whether they matter; the checks are judged later."""
    half_sums = np.stack([_half_sums(group, unit.gravity_g) for group in groups])
    own, other = _contrasts(half_sums)
    g2, count = unit.gravity_g**2, len(groups)
    found, placement = own.mean(axis=0), float(np.sum(other.mean(axis=0) ** 2)) / 6.0
    noise = placement
    if count > 1:
        noise = min(noise, float(np.mean(np.var(own, axis=0, ddof=1))) / count)
    variance = noise + placement / 2.0 + _ROUNDING_G**2
    ratio = float(np.mean(found**2)) / variance
    prior = unit.priors.own_square_g_per_g2
    share = prior**2 / (prior**2 + variance / g2**2)
    values = -share * found / g2
    scale = min(_scales(group) for group in groups)
    level = unit.stated.level_arcsec
    matters = math.sqrt(
        (_RADIANS_PER_ARCSEC * (_LEVEL_ARCSEC if level is None else level) * unit.gravity_g) ** 2
        + (unit.adc.volts_per_code / scale) ** 2 / 12.0
        + placement
    )
    held_out = _predicted(own) if count > 1 else None
    return OwnSquares(
        per_g=values,
        sd_per_g=math.sqrt(share * variance) / g2,
        prior_per_g=prior,
        data_share=share,
        effect_g=float(np.abs(values).max()) * g2,
        matters_g=matters,
        chance=fisher_tail(3, 3, ratio) if ratio > 1.0 else 1.0,
        held_out_g=held_out,
        checks_g=None,
        asked=unit.firmware_terms,
        untested=np.ones((3, 2), dtype=np.bool_),
    )


def _contrasts(half_sums: FloatArray) -> tuple[FloatArray, FloatArray]:
    """d and e of half-sums (G, pair, output) in g, each of shape (G, output)."""
    own = half_sums[:, range(3), range(3)]
    first = half_sums[:, (1, 2, 0), range(3)]
    second = half_sums[:, (2, 0, 1), range(3)]
    return own - (first + second) / 2.0, first - second


def _half_sums(group: TemperatureGroup, gravity_g: float) -> FloatArray:
    """Half-sums over opposite positions in force, (pair, output), g."""
    voltage = np.array([d.voltage_v for d in group.dwells])
    K = voltage.T @ _FORCES / (2.0 * gravity_g)
    force = np.linalg.solve(K, voltage.T).T
    result: FloatArray = np.stack([(force[a] + force[b]) / 2.0 for a, b in _PAIRS])
    return result


def _scales(group: TemperatureGroup) -> float:
    """The smallest scale factor at a temperature, V/g."""
    voltage = np.array([d.voltage_v for d in group.dwells])
    return float(np.abs(np.sum(voltage * _FORCES, axis=0) / 2.0).min())


def _predicted(own: FloatArray) -> tuple[float, float]:
    """Rms of d at each temperature without squares, and by those of the other temperatures, g."""
    count = len(own)
    others = (own.sum(axis=0) - own) / (count - 1)
    return float(np.sqrt(np.mean(own**2))), float(np.sqrt(np.mean((own - others) ** 2)))


def judged_by_checks(
    squares: OwnSquares, linear: Calibration, straightened: Calibration
) -> OwnSquares:
    """The squares with the rms of |a| - g at the check dwells, without and with them."""
    errors = [
        np.array([c.error_g for c in calibration.check_dwells])
        for calibration in (linear, straightened)
    ]
    if not len(errors[0]):
        return squares
    without, having = (float(np.sqrt(np.mean(e**2))) for e in errors)
    untested = _untested(squares, straightened, having)
    return replace(squares, checks_g=(without, having), untested=untested)


def _untested(squares: OwnSquares, straightened: Calibration, rms_g: float) -> BoolArray:
    """Ends of which no check dwell shows that the reading there was right, shape (3, 2).

    A dwell in the saturated part itself, the last 2 Q g^2, is wrong with the reading at the end.
    """
    force = np.array([_force_g(straightened, c.dwell) for c in straightened.check_dwells])
    length = np.linalg.norm(force, axis=1)[:, None, None]
    at, Q = force[:, :, None], squares.per_g[:, None]
    error = Q * (at**2 + END_FORMS * length * at)
    inside = END_FORMS * at < length - 2.0 * np.abs(Q) * length**2
    shown = inside & (np.abs(error * at) > _SEEN * rms_g * length)
    result: BoolArray = ~shown.any(axis=0)
    return result


def _force_g(calibration: Calibration, dwell: Dwell) -> FloatArray:
    constants = calibration.thermal.constants_at(dwell.temp_degc)
    linear = force_from_voltage(constants, dwell.voltage_v)
    return calibration.terms.force_g(linear)


def with_squares(terms: Terms, squares: OwnSquares) -> Terms:
    """Terms with the squares beside what they have."""
    Q = np.zeros((3, 6)) if terms.quadratic_per_g is None else terms.quadratic_per_g.copy()
    Q[range(3), range(3)] += squares.per_g
    return replace(terms, quadratic_per_g=Q)


def straight(
    groups: Sequence[TemperatureGroup], terms: Terms, gravity_g: float
) -> tuple[TemperatureGroup, ...]:
    """Groups whose readings are those of a linear unit: K (l - a) is taken off."""
    Q = terms.quadratic_per_g
    if Q is None or not Q[range(3), range(3)].any():
        return tuple(groups)
    force = _FORCES * gravity_g
    linear = force.copy()
    for _ in range(20):  # gains |Q| a round
        linear = force - products(linear) @ Q.T
    result = []
    for group in groups:
        voltage = np.array([d.voltage_v for d in group.dwells])
        K = np.linalg.lstsq(np.column_stack([linear, np.ones(6)]), voltage, rcond=None)[0][:3].T
        off = dict(zip(sorted(TEST_POSITIONS), (linear - force) @ K.T, strict=True))
        runs = tuple(
            tuple(replace(d, voltage_v=d.voltage_v - off[d.position]) for d in run)
            for run in group.runs
        )
        dwells = tuple(replace(d, voltage_v=d.voltage_v - off[d.position]) for d in group.dwells)
        result.append(replace(group, dwells=dwells, runs=runs))
    return tuple(result)


def square_notes(squares: OwnSquares) -> tuple[str, ...]:
    """The squares in words, where they are in the C or are more than chance."""
    if not squares.included and (squares.asked == LINEAR or not squares.significant):
        return ()
    values = ", ".join(
        f"Q{axis}.{axis}{axis} {value * 1e3:+.3g}"
        for axis, value in zip(AXES, squares.per_g, strict=True)
    )
    text = (
        f"the sensor's own-axis squares (a = l + Q l^2) {values} mg/g^2 +- "
        f"{squares.sd_per_g * 1e3:.2g} ({100.0 * squares.data_share:.0f} % from the readings, the "
        f"rest from the prior of {squares.prior_per_g * 1e3:g})"
    )
    if squares.included and squares.asked != AUTO:
        return (f"{text}, in the C by [firmware] terms", *_untested_notes(squares))
    sizes = (
        f"{squares.effect_g * 1e3:.3g} mg at 1 g against {squares.matters_g * 1e3:.2g} mg, the "
        "standard uncertainty of a component without them"
    )
    if squares.included:
        return (f"{text}, in the C: {sizes}{_held_out_words(squares)}", *_untested_notes(squares))
    return (f"{text}, not in the C: {sizes}{_held_out_words(squares)}",)


def _untested_notes(squares: OwnSquares) -> tuple[str, ...]:
    """The largest of the squares that no check dwell tells from one wrong reading."""
    sizes = np.abs(squares.per_g) * squares.untested.any(axis=1)
    if not squares.significant or sizes.max() <= squares.sd_per_g:
        return ()
    axis = AXES[int(sizes.argmax())]
    text = (
        f"the square of {axis} may as well be saturation at one end or one wrong dwell: the six "
        "positions cannot tell them apart. If it is one of these, the C is wrong by up to "
        f"{2e3 * sizes.max():.3g} mg between the positions; it is in the uncertainty. Measure "
        f"check dwells with {axis} at about +0.8 and -0.8 g"
    )
    return (text,)


def _held_out_words(squares: OwnSquares) -> str:
    words = ""
    if squares.held_out_g is not None:
        without, having = (v * 1e3 for v in squares.held_out_g)
        words += f"; at temperatures held out they leave {having:.2g} of {without:.3g} mg"
    if squares.checks_g is not None:
        without, having = (v * 1e3 for v in squares.checks_g)
        words += f"; in the check dwells {having:.2g} of {without:.3g} mg"
    return words
