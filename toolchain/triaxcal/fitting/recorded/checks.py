"""What is wrong with a set of poses before anything is fitted, each fault with what to do."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations, product

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.poses.poses import ALIKE_DEG, PoseSet
from triaxcal.readings.samples import GYRO, READING, Samples
from triaxcal.readings.spool import SAMPLED
from triaxcal.unit.priors import Priors
from triaxcal.unit.recording import SAMPLES, RecordingLayout

CONDITION_MAX = 100.0
"""Of the scaled Jacobian: beyond it less than a hundredth of a constant's effect is its own."""
_PLANE = 0.02
"""Rms distance of the poses from a plane, of 1 g: a bias across it has 50 times their noise."""
_CROWD = 0.6
"""Share of the poses in one orientation from which on it is reported."""
_HANDED_MIN = 0.35
"""Correlation of the movement with the gyro that can decide: logs turned by hand have about 0.5."""
_MOVING_MIN = 50
"""Samples of movement that can decide."""
_HANDED_UNKNOWN = (
    "note: |a| is the same with left-handed axes and with all signs reversed, so neither is "
    "detected here: an axis that points up must read more than its bias, and x, y, z must be "
    "right-handed"
)
_SIGN_UNKNOWN = (
    "note: the axes agree with the gyro, but three reversed signs are not detected here: an axis "
    "that points up must read more than its bias"
)


def clipped_findings(poses: PoseSet, layout: RecordingLayout) -> list[str]:
    """Outputs that stay at an end: what lies beyond it is not measured."""
    return [
        f"output {end} {layout.acceleration_unit} is clipped, in pose{'s' * (len(shown) > 1)} "
        f"{', '.join(map(str, shown))}: accelerations beyond are measured by no pose, and the C "
        "does not see that such a reading is wrong; measure with a wider range"
        for end, shown in poses.clipped.items()
    ]


def turned_columns(layout: RecordingLayout, order: Sequence[int], turned: Sequence[bool]) -> str:
    """Line for unit.toml: the layout's own columns in another order, some with the other sign."""
    words = []
    for k, negative in zip(order, turned, strict=True):
        column = layout.acceleration[k]
        minus = (column.sign < 0) != bool(negative)
        if isinstance(column.column, int):
            words.append(str(-column.column if minus else column.column))
        else:
            words.append(f'"{"-" * minus}{column.column}"')
    return f"acceleration = [{', '.join(words)}]"


def refuse_left_handed(samples: Samples, layout: RecordingLayout, centre: FloatArray) -> str:
    """Refuse readings that turn the other way than the gyro says; `centre` is a rough bias, (3,).

    What the recording does not show of its axes is returned, in words.

    A force fixed in the world, seen from the turning unit, obeys da/dt = a x w. Over slow movement
    both sides correlate for one way of naming and signing the axes: it must be theirs.
    """
    if GYRO not in samples or layout.rows != SAMPLES or len(samples) < _MOVING_MIN:
        return _HANDED_UNKNOWN
    force, change, rate = _slow_movement(samples, centre)
    length, speed = np.linalg.norm(force, axis=1), np.linalg.norm(rate, axis=1)
    middle = float(np.median(length))
    # Where |a| is far from 1 g the hand pushes, and it is not gravity that is seen.
    moving = (np.abs(length - middle) < 0.1 * middle) & (speed > np.percentile(speed, 70))
    if moving.sum() < _MOVING_MIN:
        return _HANDED_UNKNOWN
    scores = {
        turned: _correlation(change[moving] @ matrix.T, force[moving] @ matrix.T, rate[moving])
        for turned, matrix in _TURNS.items()
    }
    best = max(scores, key=lambda turned: scores[turned])
    own = scores["x, y, z"]
    if own >= _HANDED_MIN and scores[best] < 2.0 * own:
        return _SIGN_UNKNOWN
    if scores[best] < _HANDED_MIN or scores[best] < 2.0 * own:
        return _HANDED_UNKNOWN
    matrix = _TURNS[best]
    order = np.abs(matrix).argmax(axis=1).tolist()
    columns = turned_columns(layout, order, (matrix.sum(axis=1) < 0.0).tolist())
    raise RefusedError(
        samples.source,
        f"the readings agree with the gyro if x, y, z are {best} (correlation "
        f"{scores[best]:.2f}; {own:.2f} as given)",
        expected="da/dt = a x w, right-handed axes for both",
        remedy=f"left-handed axes? then {columns}; if only the gyro is turned, omit it",
    )


def _slow_movement(
    samples: Samples, centre: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Force less its bias, its change a sample, and rate less its own, over 0.1 s, (n, 3) each.

    Of a long recording the four pieces in which the gyro moves most: no more is needed.
    """
    parts = [(0, len(samples))]
    if len(samples) > SAMPLED:
        moving = sorted(
            (-float(samples.cut(rows, GYRO).var(axis=0).sum()), first, first + len(rows))
            for first, rows in samples.pieces()
        )
        parts = [(first, last) for _, first, last in moving[:4] if last - first > _MOVING_MIN]
    window = max(1, round(0.1 / samples.step_s))
    rates = [samples.part(GYRO, *part) for part in parts]
    bias = np.median(np.concatenate(rates), axis=0)
    force = [_smooth(samples.part(READING, *part) - centre, window) for part in parts]
    change = [np.gradient(part, axis=0) for part in force]
    rate = [_smooth(part - bias, window) for part in rates]
    return np.concatenate(force), np.concatenate(change), np.concatenate(rate)


def _correlation(change: FloatArray, force: FloatArray, rate: FloatArray) -> float:
    predicted = np.cross(force, rate)
    size = float(np.linalg.norm(change) * np.linalg.norm(predicted))
    return float((change * predicted).sum()) / size if size else 0.0


def _turns() -> dict[str, FloatArray]:
    """The 24 ways to name and sign three axes, by their names.

    A sign of all three changes nothing here: of two such ways the one with fewer signs.
    """
    turns = {}
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            if sum(signs) < 0.0:
                continue
            matrix = np.zeros((3, 3))
            matrix[np.arange(3), list(order)] = signs
            words = [("" if s > 0 else "-") + AXES[k] for k, s in zip(order, signs, strict=True)]
            turns[", ".join(words)] = matrix
    return turns


_TURNS = _turns()


def _smooth(values: FloatArray, window: int) -> FloatArray:
    kernel = np.ones(window) / window
    return np.stack([np.convolve(values[:, k], kernel, mode="same") for k in range(3)], axis=1)


def crowd_finding(groups: list[list[int]], poses: PoseSet) -> str:
    """Sentence about poses of which most look alike; "" when they do not."""
    largest = max(groups, key=len)
    if len(groups) < 2 or len(largest) < _CROWD * len(poses.poses):
        return ""
    numbers = ", ".join(str(poses.poses[k].number) for k in largest[:6])
    more = ", ..." if len(largest) > 6 else ""
    return (
        f"{len(largest)} of {len(poses.poses)} poses look alike (within {ALIKE_DEG:g} deg: poses "
        f"{numbers}{more}); together they count as one orientation"
    )


def open_finding(poses: PoseSet, radius: float, priors: Priors) -> tuple[str, int]:
    """What poses in a plane, or of one direction, leave open, and how many dimensions they span.

    "" where they lie all round.

    `radius` is about that of 1 g. A circle determines no sphere.
    """
    centred = poses.readings - poses.readings.mean(axis=0)
    size = max(radius, float(np.median(np.linalg.norm(poses.readings, axis=1))))
    _, singular, directions = np.linalg.svd(centred / size / np.sqrt(len(centred)))
    spans = int((singular >= _PLANE).sum())
    if spans == 3:
        return "", spans
    count = len(poses.poses)
    looked = f"{count} pose{'s' * (count != 1)}"
    bounded = f"bounded by [priors] bias_g = {priors.bias_g:g} g alone"
    if spans < 2:
        way = "all point one way and determine" if count > 1 else "determines"
        text = f"{looked}: {way} one combination of bias and scale factor; the others are {bounded}"
        return f"{text}; add poses that are not alike, six faces first", spans
    normal = AXES[int(np.abs(directions[-1]).argmax())]
    angle = np.degrees(singular[-1]) if len(singular) == 3 else 0.0
    text = (
        f"the {looked} lie near one plane (within {angle:.2g} deg, rms) and do not determine "
        f"U0{normal}: it is {bounded}; add poses with {normal} up and down, and some between"
    )
    return text, spans


def refuse_no_numbers(poses: PoseSet) -> None:
    """Refuse poses whose means are no numbers."""
    for pose in poses.poses:
        if not np.isfinite(pose.reading).all():
            raise RefusedError(
                f"{poses.source}, line {pose.line}",
                f"pose {pose.number} has a reading that is no number",
                expected="finite readings",
                remedy="remove that pose",
            )
