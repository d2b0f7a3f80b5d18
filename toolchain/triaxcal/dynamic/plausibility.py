"""Mistakes of units and axes, seen before anything is fitted.

At rest on the Earth gravity turns in the instrument as f' = -w x f. Over the whole recording this
gives, by least squares, the matrix M that best makes the turning of the forces out of the measured
rates. For a good recording M is near the identity; a factor in it is a wrong unit, and a signed
permutation is exchanged axes or a left-handed triad. Neither is concluded from rates that hardly
explain how the forces turn.
"""

from __future__ import annotations

import math

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.gravityturns import (
    SIGNED_AXES,
    GravityTurns,
    gravity_turns,
    signed_axes_matrices,
)
from triaxcal.dynamic.halfway import left_by_axes, refuse_change
from triaxcal.dynamic.lagging import refuse_lag
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.windows import WINDOW_S, Windows
from triaxcal.model.types import FloatArray

GRAVITY_TOLERANCE = 0.25
"""The force at rest is within a quarter of gravity: coarser units are not meant, wrong ones are."""
FACTOR_LIMITS = (0.6, 1.6)
"""M of a unit with errors below ten per cent, and of handling in between, stays well within."""
START_S = 2.0
LEAST_TURN_RAD = 0.01
"""Below it M is noise."""
EXPLAINED, MISSED = 0.2, 0.01
"""Of the squared turns of the forces. A hand's accelerations leave the rates above a half; one that
throws the unit about leaves 2 %, from which nothing is concluded. Gyros that miss the turns
explain less than the second on any axes."""
CLEARLY = 0.05
"""Exchanged axes explain more than those stated by more than this."""
TURNED_COSINE = math.cos(math.radians(30.0))
"""Gravity that moved so far in the unit was turned by somebody."""


def refuse_wrong_units(recording: ImuRecording, windows: Windows) -> None:
    """Refuse mistakes that the filter would attribute to the unit.

    Raises
    ------
    RefusedError
        For wrong units of force or rate, and for exchanged or left-handed axes.
    """
    start = _quietest(windows)
    _refuse_force(recording, np.median(windows.force[start], axis=0))
    turns = gravity_turns(windows, np.median(windows.rate[start], axis=0))
    left = left_by_axes(recording, windows, turns)
    if left is not None:
        refuse_lag(recording, windows, turns, left.other_axes)
        refuse_change(recording, left)
    _refuse_rate(recording, windows, turns)


def _quietest(windows: Windows) -> slice:
    """The `START_S` in which the direction of the force changes least; of equals the first."""
    length = min(round(START_S / WINDOW_S), len(windows.first))
    direction = windows.force / np.linalg.norm(windows.force, axis=1)[:, None]
    change = np.r_[0.0, np.cumsum((np.diff(direction, axis=0) ** 2).sum(axis=1))]
    spread = change[length - 1 :] - change[: len(change) - length + 1]
    begin = int(np.flatnonzero(spread <= 2 * spread.min())[0])
    return slice(begin, begin + length)


def _refuse_force(recording: ImuRecording, force: FloatArray) -> None:
    g = recording.gravity_m_per_s2
    size = float(np.linalg.norm(force))
    if abs(size / g - 1) > GRAVITY_TOLERANCE:
        hints = {
            9.80665: " (g taken for m/s^2?)",
            1 / 9.80665: " (m/s^2 taken for g?)",
            **_other_samples(recording.rate_hz),
        }
        hint = next((h for k, h in hints.items() if abs(size * k / g - 1) < 0.2), "")
        raise RefusedError(
            recording.name,
            f"the force at rest is {size:.4g} m/s^2{hint}",
            expected=f"local gravity, {g:.4f} m/s^2, within {100 * GRAVITY_TOLERANCE:.0f} %",
            remedy="check force_unit and force_samples in [dynamic]",
        )


def _rate_matrix(rows: FloatArray, change: FloatArray, turned: FloatArray) -> FloatArray:
    """M (3, 3), true rate = M measured rate.

    Columns of axes that hardly turned are those of the identity.
    """
    seen = turned > 0.05 * turned.max() if turned.max() > 0 else np.zeros(3, dtype=bool)
    columns = np.tile(seen, 3)
    matrix = np.eye(3)
    if seen.any():
        solved = np.linalg.lstsq(rows[:, columns], change, rcond=None)[0]
        matrix[:, seen] = solved.reshape(3, -1)
    return matrix


def _equations(turns: GravityTurns) -> tuple[FloatArray, FloatArray]:
    """Rows (n, 9) and right sides (n,) of the equations of M, row by row."""
    rows = np.einsum("nij,nk->nijk", turns.middle, turns.turn).reshape(-1, 3, 9)[turns.alone]
    return rows.reshape(-1, 9), turns.change[turns.alone].ravel()


def _shares(
    rows: FloatArray, change: FloatArray, tried: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Of the squared turns of the forces: what each M (m, 3, 3) explains, and with which factor.

    The factor that explains most is not negative.
    """
    M = tried.reshape(-1, 9)
    along = np.maximum(M @ (rows.T @ change), 0.0)
    size = np.maximum(np.einsum("mi,ij,mj->m", M, rows.T @ rows, M), 1e-300)
    return along**2 / size / max(float(change @ change), 1e-300), along / size


def _refuse_gyros_that_miss_the_turn(
    name: str, windows: Windows, turned: FloatArray, share: float
) -> None:
    """Refuse forces that turn otherwise than the gyros: the wrong unit, other columns, lost rows.

    Forces that keep their direction show nothing.
    """
    direction = windows.force / np.linalg.norm(windows.force, axis=1)[:, None]
    least = float((direction @ direction[0]).min())
    if least >= TURNED_COSINE:
        return
    gravity = math.degrees(math.acos(max(least, -1.0)))
    if turned.max() < LEAST_TURN_RAD:
        raise RefusedError(
            name,
            f"gravity turns in the unit by {gravity:.0f} deg, "
            f"but the gyros turn by {math.degrees(turned.max()):.2g} deg in all",
            expected="gyros that turn as the unit does",
            remedy="check rate_columns and rate_unit in [dynamic]",
        )
    raise RefusedError(
        name,
        f"gravity turns in the unit by {gravity:.0f} deg, and the gyros explain "
        f"{100 * share:.0f} % of how it turns",
        expected="gyros that turn as the unit does, and every row between the rests",
        remedy="check rate_columns, rate_unit and force_columns; where rows were cut out, as of a "
        "file of labelled parts, use the whole recording",
    )


def _other_samples(rate_hz: float) -> dict[float, str]:
    """Hints by the factor that is missing, where a log mixes samples and increments."""
    return {
        rate_hz: " (increments taken for instants?)",
        1 / rate_hz: " (instants taken for increments?)",
    }


def _refuse_rate(recording: ImuRecording, windows: Windows, turns: GravityTurns) -> None:
    name = recording.name
    turned = np.abs(turns.turn[turns.follows]).sum(axis=0)  # by each gyro
    rows, change = _equations(turns)
    matrix = _rate_matrix(rows, change, turned)
    share, factor = _shares(rows, change, np.concatenate([[matrix], signed_axes_matrices()]))
    if turned.max() >= LEAST_TURN_RAD and share[0] < EXPLAINED and share[1:].max() > MISSED:
        return
    if turned.max() < LEAST_TURN_RAD or share[0] < EXPLAINED:
        _refuse_gyros_that_miss_the_turn(name, windows, turned, float(share[0]))
        return
    best = int(np.argmax(share[1:]))
    if share[1 + best] <= share[1] + CLEARLY:
        best = 0
    order, signs = SIGNED_AXES[best]
    # Axes that hardly turn spoil the first, a wrong bias the second; another unit is in both.
    sizes = float(np.median([abs(matrix[i, order[i]]) for i in range(3)])), float(factor[1 + best])
    size = min(sizes, key=lambda k: abs(math.log(max(k, 1e-300))))
    if order != (0, 1, 2) or min(signs) < 0:
        words = ", ".join(f"{'-' if signs[i] < 0 else ''}{'xyz'[order[i]]}" for i in range(3))
        handed = np.linalg.det(np.diag(signs)[:, list(order)])
        kind = "a left-handed triad of gyros"
        if handed > 0:
            # Turned axes and a mirrored accelerometer triad look the same in M.
            kind = "exchanged axes, or a left-handed triad of accelerometers"
        raise RefusedError(
            name,
            f"the forces turn about x, y, z as the gyros' {words} measure: {kind}",
            expected="gyros and accelerometers on the same right-handed axes",
            remedy="check the order and signs of rate_columns and force_columns",
        )
    if not FACTOR_LIMITS[0] < size < FACTOR_LIMITS[1]:
        hints = {
            math.pi / 180: " (degrees taken for radians?)",
            180 / math.pi: " (radians taken for degrees?)",
            1e-3: " (milliseconds taken for seconds?)",
            1e-6: " (microseconds taken for seconds?)",
            1e3: " (seconds taken for milliseconds?)",
            **_other_samples(recording.rate_hz),
        }
        nearest = min(hints, key=lambda k: abs(math.log(size / k)))
        hint = hints[nearest] if abs(math.log(size / nearest)) < 0.5 else ""
        raise RefusedError(
            name,
            f"gravity turns in the unit {size:.3g} times as fast as the gyros measure{hint}",
            expected="once",
            remedy="check rate_unit, rate_samples and time_unit in [dynamic]",
        )
