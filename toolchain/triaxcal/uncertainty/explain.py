"""Why a recording contradicts a calibration: single causes, and what else it may be.

A cause is a few columns: its effect on |a| at the poses. It is fitted by generalised least squares;
where an ordinary chi-square is left, it explains the recording.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.field.force import force_and_slopes
from triaxcal.fitting.field.poses import FieldPoses
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.uncertainty.expected import Expected, chance_of, expected
from triaxcal.unit.description import UnitDescription

Parts = tuple[UnitDescription, MeasurementSet, Calibration]
"""A unit, what was measured, and its calibration."""
_ORDINARY = 0.01
"""A chance above it: what is left after a cause is nothing unusual."""
_PAIRS = ((0, 1), (0, 2), (1, 2))
_FACTORS = (9.80665, 1e3, 9806.65, 1e6, 2.0, 4.0, 8.0, 16.0, 256.0, 65536.0)
"""Of readings in another unit: m/s^2, mg, mm/s^2, micro-g for g; full scales and shifts."""
_GROSS = 0.3
"""Relative rms error of |a| from which readings in another unit are tried."""
_HEALED = 0.2
"""Of the rms error: what another order of the columns must leave, to be looked at."""
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


def explain(found: Expected, poses: FieldPoses) -> tuple[Explanation, ...]:
    """Single causes that leave an ordinary chi-square, with the fewest parameters."""
    count = len(found.error_g)
    fits = [e for e in _causes(found) if e.parameters < count and e.chance > _ORDINARY]
    if count > 2:
        worst = int(np.abs(found.left_out).argmax())
        rest = found.without(worst)
        chance = chance_of(rest.chi_square, count - 1, rest.dof)
        if chance > _ORDINARY:
            error = found.error_g[worst] * 1e3
            words = f"{poses.names[worst]} alone is off, by {error:+.3g} mg; the others agree"
            fits.append(Explanation(words, 1, chance))
    least = min((e.parameters for e in fits), default=0)
    return tuple(sorted((e for e in fits if e.parameters == least), key=lambda e: -e.chance))


def _causes(found: Expected) -> Iterator[Explanation]:
    """Changes of the sensor that |a| can show, each with its effect on |a| at the poses."""
    force = found.force_g
    u = force / np.linalg.norm(force, axis=1, keepdims=True)
    slopes, own = found.slopes, found.slopes * found.outputs_g
    mixed = np.column_stack([2.0 * u[:, i] * force[:, j] for i, j in _PAIRS])
    for k, axis in enumerate(AXES):
        yield _fitted(found, slopes[:, [k]], f"the bias of {axis} changed by", 1e3, "mg")
        yield _fitted(found, own[:, [k]], f"the scale of {axis} changed by", 1e2, "%")
    every = own.sum(axis=1, keepdims=True)
    yield _fitted(found, every, "all scales, or local gravity, changed by", 1e2, "%")
    yield _fitted(found, slopes, "the biases of x, y, z changed by", 1e3, "mg")
    yield _fitted(found, own, "the scales of x, y, z changed by", 1e2, "%")
    yield _fitted(found, mixed, "the axes' angles xy, xz, yz changed by", 2e3, "mrad")


def _fitted(
    found: Expected, effect: FloatArray, words: str, scale: float, unit: str
) -> Explanation:
    left, values, sd = found.explained(effect)
    count = effect.shape[1]
    numbers = ", ".join(f"{v * scale:+.3g}" for v in values)
    sds = ", ".join(f"{v * scale:.2g}" for v in sd)
    chance = chance_of(left, len(found.error_g) - count, found.dof)
    return Explanation(f"{words} {numbers} {unit} (sd {sds})", count, chance)


def suspect(
    parts: Parts, poses: FieldPoses, gravity_g: float, found: Expected, *, explained: bool
) -> tuple[str, ...]:
    """What the recording may be where the constants do not fit it at all."""
    relative = float(np.sqrt(np.mean((found.error_g / gravity_g) ** 2)))
    factor = _factor(parts, poses, gravity_g) if relative > _GROSS else ""
    if factor:
        return (factor,)
    turned = _turned(parts, poses, gravity_g, relative)
    if turned:
        return (turned,)
    contradicting = np.abs(found.error_g) > 3.0 * found.sd_g
    if explained or contradicting.sum() <= len(poses) / 2:
        return ()
    several = "another unit, or a sensor of which several constants changed"
    return (f"no single change explains it: {several}; the poses cannot tell which",)


def _factor(parts: Parts, poses: FieldPoses, gravity_g: float) -> str:
    """Readings in another unit: a known factor after which |a| is near g in all poses."""
    best, ratio = _GROSS, 0.0
    for known in itertools.chain(_FACTORS, (1.0 / f for f in _FACTORS)):
        scaled = replace(poses, readings=poses.readings * known, sd=poses.sd * known)
        rms = _rms(parts, scaled, gravity_g)
        if rms < best:
            best, ratio = rms, known
    if not ratio:
        return ""
    return (
        f"|a| is near g if the readings are multiplied by {ratio:.6g}: they are in another unit, "
        "or of another full scale"
    )


def _turned(parts: Parts, poses: FieldPoses, gravity_g: float, relative: float) -> str:
    """Columns exchanged or with another sign: those of the 47 other ways that agree."""
    near = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            if order == (0, 1, 2) and min(signs) > 0.0:
                continue
            own = replace(poses, readings=poses.readings[:, order] * signs, sd=poses.sd[:, order])
            rms = _rms(parts, own, gravity_g)
            if rms < _HEALED * relative:
                columns = [f"{'-' * (s < 0)}{AXES[k]}" for k, s in zip(order, signs, strict=True)]
                near.append((rms, ", ".join(columns), own))
    ordinary = []
    for _, words, own in sorted(near, key=lambda row: row[:2])[:_ORDERS_MAX]:
        found = expected(*parts, own, gravity_g)
        if chance_of(found.chi_square, len(poses), found.dof) > _ORDINARY:
            ordinary.append(words)
    if not ordinary:
        return ""
    others = f" (or {ordinary[1]})" if len(ordinary) == 2 else ""
    others = f", or {len(ordinary) - 1} other ways" if len(ordinary) > 2 else others
    read = f"it agrees if the columns are read as {ordinary[0]}{others}"
    return f"{read}: axes or signs are exchanged"


def _rms(parts: Parts, poses: FieldPoses, gravity_g: float) -> float:
    """Relative rms error of |a|, by the fitted model."""
    force, _ = force_and_slopes(parts[2], poses.readings, poses.temps_degc)
    return float(np.sqrt(np.mean((np.linalg.norm(force, axis=1) / gravity_g - 1.0) ** 2)))
