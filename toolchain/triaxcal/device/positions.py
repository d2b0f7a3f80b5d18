"""A flashed device in check positions: bits at every sample, |a| - g at each position."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from triaxcal.base.errors import RefusedError
from triaxcal.device.compare import Routine, Samples, compare, take_samples
from triaxcal.device.link import Link
from triaxcal.device.record import PositionResult

APART_DEG = 10.0
"""Two positions are at least so far from each other."""
ATTEMPTS = 5
_STANDARD_ERRORS = 6.0
"""Of the halves of the samples in a position, which differ by chance."""


@dataclass(frozen=True)
class Expected:
    """What the samples of a device are held against.

    Attributes
    ----------
    routine : callable
        The integer model.
    output_q : int
        Q of its accelerations.
    gravity_g : float
        Local gravity, in g of 9.80665 m/s^2.
    degc : callable
        Temperature of a code.
    limit_g : callable
        Largest | |a| - g | at a temperature.
    """

    routine: Routine
    output_q: int
    gravity_g: float
    degc: Callable[[float], float]
    limit_g: Callable[[float], float]


def at_positions(
    link: Link,
    expected: Expected,
    positions: Sequence[str],
    samples: int,
    place: Callable[[str, str], None],
) -> list[PositionResult]:
    """Take samples in each position and check them.

    Parameters
    ----------
    link : Link
        The device, with the calibration in use.
    expected : Expected
        What its samples must be.
    positions : sequence of str
        Names of the positions, in their order.
    samples : int
        How many in each.
    place : callable
        Has the device put in a position, and returns when it is. It is called with the name, and
        with why it must be done again; "" at first.

    Raises
    ------
    RefusedError
        When a bit differs, a status is not 0, the device does not rest in a position of its own, or
        |a| - g is beyond its limit.
    """
    done: list[PositionResult] = []
    for position in positions:
        why = ""
        for _ in range(ATTEMPTS):
            place(position, why)
            result = _result(link, expected, position, take_samples(link, samples))
            why = result if isinstance(result, str) else _not_new(result, done)
            if not why:
                break
        if isinstance(result, str) or why:
            raise RefusedError(
                f"{link.name}, {position}",
                f"{why}, {ATTEMPTS} times",
                expected="the device at rest in another position",
                remedy="fasten it; nothing was written",
            )
        done.append(result)
    _refuse_beyond(link, done)
    return done


def _result(
    link: Link, expected: Expected, position: str, samples: Samples
) -> PositionResult | str:
    """The result; where the device has moved, how far."""
    found = compare(samples, expected.routine, expected.output_q, expected.gravity_g)
    place = f"{link.name}, {position}"
    found.refuse_difference(place)
    if found.flagged:
        raise RefusedError(
            place,
            f"{found.flagged} of {found.samples} samples have a status other than 0",
            expected="0: temperature and codes within the calibrated range",
        )
    temp_degc = expected.degc(float(samples.temp.mean()))
    limit_g = expected.limit_g(temp_degc)
    moved_g = _moved_g(samples.accel.astype(np.float64) * 2.0**-expected.output_q)
    if moved_g > limit_g:
        return f"it moved by {1e3 * moved_g:.3g} mg while the samples were taken"
    return PositionResult(
        position,
        found.samples,
        temp_degc,
        found.mean_g,
        found.length_error_g,
        found.length_sd_g,
        limit_g,
    )


def _moved_g(force_g: npt.NDArray[np.float64]) -> float:
    """How far the halves of the samples differ beyond chance, in the worst axis."""
    halves = np.array_split(force_g, 2)
    means = [half.mean(axis=0) for half in halves]
    variance = sum(half.var(axis=0, ddof=1) / len(half) for half in halves)
    beyond = np.abs(means[0] - means[1]) - _STANDARD_ERRORS * np.sqrt(variance)
    return float(beyond.max())


def _not_new(result: PositionResult, done: Sequence[PositionResult]) -> str:
    """Which earlier position this one is; "" where it is a new one."""
    for earlier in done:
        a, b = np.array(result.mean_g), np.array(earlier.mean_g)
        cosine = float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b))
        angle_deg = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
        if angle_deg < APART_DEG:
            return f"it is {angle_deg:.2g} deg from its position at {earlier.position}"
    return ""


def _refuse_beyond(link: Link, done: Sequence[PositionResult]) -> None:
    wrong = [p for p in done if abs(p.error_g) > p.limit_g]
    if not wrong:
        return
    found = ", ".join(f"{p.position} {1e3 * p.error_g:+.3f} mg" for p in wrong)
    raise RefusedError(
        link.name,
        f"|a| - g beyond the limit: {found}",
        expected=f"at most {1e3 * wrong[0].limit_g:g} mg; every bit was that of the integer model",
        remedy="the sensor, its mounting or the local gravity is another; nothing was written",
    )
