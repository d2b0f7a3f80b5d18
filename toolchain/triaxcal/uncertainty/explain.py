"""Why a recording contradicts a calibration: single causes, and what else it may be.

A cause is a change of the sensor with a few values. It is undone in the readings, and its values
are those that leave the least chi-square r^T cov(r)^-1 r, found by the method of Gauss and Newton.
Where an ordinary chi-square is left, the cause explains the recording.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.outliers import CHANCE
from triaxcal.fitting.field.force import force_and_slopes
from triaxcal.fitting.field.poses import FieldPoses
from triaxcal.model.metrological import unpack_constants
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.uncertainty.expected import Expectation, Expected, chance_of
from triaxcal.unit.description import UnitDescription

Parts = tuple[UnitDescription, MeasurementSet, Calibration]
"""A unit, what was measured, and its calibration."""
_ORDINARY = 0.01
"""A chance above it: what is left after a cause is nothing unusual."""
_PAIRS = ((0, 1), (0, 2), (1, 2))
_STEPS_MAX = 30
_SETTLED = 1e-3
"""Of a standard deviation: a smaller step of a value ends its search."""
_STEP_MOST = 0.3
"""g, or relative: a longer step would leave what the derivatives show."""
_DIFFERENCE = 1e-6
_FACTORS = (9.80665, 1e3, 9806.65, 1e6, 2.0, 4.0, 8.0, 16.0, 256.0, 65536.0)
"""Of readings in another unit: m/s^2, mg, mm/s^2, micro-g for g; full scales and shifts."""
_FACTOR_STEPS = 8
_GROSS = 0.3
"""Relative rms error of |a| from which readings in another unit are tried."""
_HEALED = 0.2
"""Of the rms error: what another unit or order of the columns must leave, to be looked at."""
_ORDERS_MAX = 8


@dataclass(frozen=True)
class Explanation:
    """A change that makes the recording agree.

    Attributes
    ----------
    words : str
        As "the bias of x changed by +2.01 mg (sd 0.03)".
    parameters : int
    chance : float
        Of the chi-square that is left.
    """

    words: str
    parameters: int
    chance: float


@dataclass(frozen=True)
class _Outputs:
    """K and U0 at each pose, and the outputs' sensitivities at T0, as `model.framefree` has them.

    A bias that changed is the same in the reading's unit at all temperatures, as a drift is.
    """

    K: FloatArray
    U0: FloatArray
    sensitivity: FloatArray

    @staticmethod
    def of(calibration: Calibration, poses: FieldPoses) -> _Outputs:
        thermal = calibration.thermal
        K, U0 = unpack_constants(thermal.constants_at(poses.temps_degc))
        at_t0 = unpack_constants(thermal.constants_at(thermal.t0_degc))[0]
        return _Outputs(K, U0, np.linalg.norm(at_t0, axis=1))


@dataclass(frozen=True)
class _Cause:
    """A change of the sensor: its words, what 1 is in its unit, and how it is undone.

    `undone` takes outputs, readings (n, 3) and values (k,), and gives the readings before it.
    """

    words: str
    parameters: int
    scale: float
    unit: str
    undone: Callable[[_Outputs, FloatArray, FloatArray], FloatArray]


def _bias(axes: FloatArray) -> Callable[[_Outputs, FloatArray, FloatArray], FloatArray]:
    return lambda o, readings, values: readings - o.sensitivity * (axes @ values)


def _scale(axes: FloatArray) -> Callable[[_Outputs, FloatArray, FloatArray], FloatArray]:
    return lambda o, readings, values: o.U0 + (readings - o.U0) / (1.0 + axes @ values)


def _angles(o: _Outputs, readings: FloatArray, values: FloatArray) -> FloatArray:
    S = np.eye(3)
    for (i, j), value in zip(_PAIRS, values, strict=True):
        S[i, j] = S[j, i] = value / 2.0
    turned = o.K @ np.linalg.inv(S) @ np.linalg.inv(o.K)
    result: FloatArray = o.U0 + np.einsum("nij,nj->ni", turned, readings - o.U0)
    return result


def _causes() -> Iterator[_Cause]:
    """Changes of the sensor that |a| can show."""
    each = np.eye(3)
    for k, axis in enumerate(AXES):
        yield _Cause(f"the bias of {axis} changed by", 1, 1e3, "mg", _bias(each[:, [k]]))
        yield _Cause(f"the scale of {axis} changed by", 1, 1e2, "%", _scale(each[:, [k]]))
    every = "all scales, or local gravity, changed by"
    yield _Cause(every, 1, 1e2, "%", _scale(np.ones((3, 1))))
    yield _Cause("the biases of x, y, z changed by", 3, 1e3, "mg", _bias(each))
    yield _Cause("the scales of x, y, z changed by", 3, 1e2, "%", _scale(each))
    yield _Cause("the axes' angles xy, xz, yz changed by", 3, 1e3, "mrad", _angles)


def why(
    expects: Expectation, poses: FieldPoses, gravity_g: float, found: Expected
) -> tuple[tuple[Explanation, ...], tuple[str, ...]]:
    """Why poses contradict a calibration: the changes that explain it, and other suspicions.

    The changes are those with the fewest values that leave an ordinary chi-square.
    """
    calibration, count = expects.calibration, len(poses)
    relative = _rms(calibration, poses, gravity_g)
    factor = _factor(calibration, poses, gravity_g, relative) if relative > _GROSS else ""
    if factor:
        return (), (factor,)
    if count == 1:
        return (), ("one pose cannot tell why",)
    causes = (c for c in _causes() if c.parameters < count)
    fits = [_fitted(expects, poses, gravity_g, cause) for cause in causes]
    fits.append(_disturbed(found, poses))
    good = [e for e in fits if e is not None and e.chance > _ORDINARY]
    least = min((e.parameters for e in good), default=0)
    explained = sorted((e for e in good if e.parameters == least), key=lambda e: -e.chance)
    turned = _turned(expects, poses, gravity_g, relative)
    if turned or explained:
        return tuple(explained), (turned,) if turned else ()
    words = "no single change explains it: several constants changed, or it is another unit"
    return (), (words,)


def _fitted(
    expects: Expectation, poses: FieldPoses, gravity_g: float, cause: _Cause
) -> Explanation | None:
    """The values of a cause that leave the least chi-square; None where the search does not end."""
    outputs = _Outputs.of(expects.calibration, poses)

    def undone(values: FloatArray) -> FieldPoses:
        return replace(poses, readings=cause.undone(outputs, poses.readings, values))

    def length(values: FloatArray) -> FloatArray:
        own = undone(values)
        force, _ = force_and_slopes(expects.calibration, own.readings, own.temps_degc)
        result: FloatArray = np.linalg.norm(force, axis=1)
        return result

    values = np.zeros(cause.parameters)
    for _ in range(_STEPS_MAX):
        found = expects.at(undone(values), gravity_g)
        steps = _DIFFERENCE * np.eye(cause.parameters)
        slopes = np.stack([length(values + d) - length(values - d) for d in steps], axis=1)
        slopes /= 2.0 * _DIFFERENCE
        weighted = found.solve(slopes)
        covariance = np.linalg.pinv(slopes.T @ weighted, rcond=1e-9, hermitian=True)
        step = -covariance @ (weighted.T @ found.error_g)
        sd = np.sqrt(np.diag(covariance))
        if (np.abs(step) <= _SETTLED * sd).all():
            return _explanation(cause, values, sd, found)
        values = values + step * min(1.0, _STEP_MOST / float(np.abs(step).max()))
        if (values < -1.0 + _STEP_MOST).any():
            return None
    return None


def _explanation(cause: _Cause, values: FloatArray, sd: FloatArray, left: Expected) -> Explanation:
    numbers = ", ".join(f"{v * cause.scale:+.3g}" for v in values)
    sds = ", ".join(f"{v * cause.scale:.2g}" for v in sd)
    chance = chance_of(left.chi_square, len(left.error_g) - cause.parameters, left.dof)
    words = f"{cause.words} {numbers} {cause.unit} (sd {sds})"
    return Explanation(words, cause.parameters, chance)


def _disturbed(found: Expected, poses: FieldPoses) -> Explanation | None:
    """A few disturbed poses, the others agreeing; of n poses the worst pays for n tests."""
    kept, off, rest = list(range(len(poses))), list[int](), found
    while len(kept) > 2 and len(off) < max(1, len(poses) // 4):
        worst = int(np.abs(rest.left_out).argmax())
        if len(kept) * chance_of(float(rest.left_out[worst]) ** 2, 1, rest.dof) > CHANCE:
            return None
        off.append(kept.pop(worst))
        rest = rest.without(worst)
        chance = chance_of(rest.chi_square, len(kept), rest.dof)
        if chance > _ORDINARY:
            each = [f"{poses.names[k]} (by {found.error_g[k] * 1e3:+.3g} mg)" for k in sorted(off)]
            verb = "was" if len(off) == 1 else "were"
            words = f"only {' and '.join(each)} {verb} disturbed; the other {len(kept)} poses agree"
            return Explanation(words, len(off), chance)
    return None


def _factor(calibration: Calibration, poses: FieldPoses, gravity_g: float, relative: float) -> str:
    """Readings in another unit: a factor after which |a| is near g in all poses, a known one first.

    Codes have any factor: that which brings the median of |a| to g, for U0 in a few steps.
    """

    def scaled(factor: float) -> FieldPoses:
        return replace(poses, readings=poses.readings * factor, sd=poses.sd * factor)

    any_factor = 1.0
    for _ in range(_FACTOR_STEPS):
        own = scaled(any_factor)
        force, _ = force_and_slopes(calibration, own.readings, own.temps_degc)
        any_factor *= gravity_g / float(np.median(np.linalg.norm(force, axis=1)))
    known = (*_FACTORS, *(1.0 / f for f in _FACTORS))
    best = min(known, key=lambda f: _rms(calibration, scaled(f), gravity_g))
    for factor in (best, any_factor):
        if _rms(calibration, scaled(factor), gravity_g) < min(_GROSS, _HEALED * relative):
            return (
                f"|a| is near g if the readings are multiplied by {factor:.6g}: they are in "
                "another unit, or of another full scale"
            )
    return ""


def _turned(expects: Expectation, poses: FieldPoses, gravity_g: float, relative: float) -> str:
    """Columns exchanged or with another sign: those of the 47 other ways that agree."""
    near = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            if order == (0, 1, 2) and min(signs) > 0.0:
                continue
            own = replace(poses, readings=poses.readings[:, order] * signs, sd=poses.sd[:, order])
            rms = _rms(expects.calibration, own, gravity_g)
            if rms < _HEALED * relative:
                columns = [f"{'-' * (s < 0)}{AXES[k]}" for k, s in zip(order, signs, strict=True)]
                near.append((rms, ", ".join(columns), own))
    ordinary = []
    for _, words, own in sorted(near, key=lambda row: row[:2])[:_ORDERS_MAX]:
        found = expects.at(own, gravity_g)
        if chance_of(found.chi_square, len(poses), found.dof) > _ORDINARY:
            ordinary.append(words)
    if not ordinary:
        return ""
    others = f" (or {ordinary[1]})" if len(ordinary) == 2 else ""
    others = f", or {len(ordinary) - 1} other ways" if len(ordinary) > 2 else others
    read = f"it agrees if the columns are read as {ordinary[0]}{others}"
    return f"{read}: axes or signs are exchanged"


def _rms(calibration: Calibration, poses: FieldPoses, gravity_g: float) -> float:
    """Relative rms error of |a|, by the fitted model."""
    force, _ = force_and_slopes(calibration, poses.readings, poses.temps_degc)
    return float(np.sqrt(np.mean((np.linalg.norm(force, axis=1) / gravity_g - 1.0) ** 2)))
