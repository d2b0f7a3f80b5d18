"""The one further dwell that separates two causes most.

Both causes predict what a dwell would read, with a variance; the dwell is best whose predictions
differ by most of their standard deviations. It is measured after all others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.diagnosis.core.cause import Undo
from triaxcal.diagnosis.core.curves import MEAN
from triaxcal.diagnosis.core.evidence import Judged
from triaxcal.diagnosis.core.readings import FORCES, POSITIONS, Readings
from triaxcal.diagnosis.core.sound import Added, System
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

_WORTH_ASKING = 4.0
"""Squared distance of the predictions, in variances, below which a dwell would tell little."""


@dataclass(frozen=True)
class Request:
    """A dwell to measure after all others.

    Attributes
    ----------
    position : str
    temp_degc : float
    output : str
        Axis of the output in which the causes differ most.
    expected_g : tuple of two floats
        What the two causes predict there, less what the readings' own model says without either.
    distance : float
        Of the predictions, in standard deviations.
    """

    position: str
    temp_degc: float
    output: str
    expected_g: tuple[float, float]
    distance: float

    def between(self, first: str, second: str) -> str:
        """What to measure and what it would show, in words."""
        apart_mg = abs(self.expected_g[0] - self.expected_g[1]) * 1e3
        return (
            f"to tell {first} from {second}, measure {self.position} at {self.temp_degc:.4g} degC "
            f"once more, after all others: they predict outputs {self.output} that differ by "
            f"{apart_mg:.3g} mg ({self.distance:.2g} standard deviations)"
        )


def next_dwell(readings: Readings, first: Judged, second: Judged) -> Request | None:
    """The dwell that separates two causes most; None where no dwell would."""
    best: Request | None = None
    for temp in _temperatures(readings):
        extended = _with_dwells(readings, temp)
        (mean_1, variance_1), (mean_2, variance_2) = (
            _predicted(extended, len(readings), j) for j in (first, second)
        )
        squares = (mean_1 - mean_2) ** 2 / (variance_1 + variance_2)
        k = int(squares.sum(axis=1).argmax())
        distance = float(np.sqrt(squares[k].sum()))
        if best is None or distance > best.distance:
            i = int(squares[k].argmax())
            expected = float(mean_1[k, i]), float(mean_2[k, i])
            best = Request(POSITIONS[k], temp, AXES[i], expected, distance)
    return best if best is not None and best.distance**2 > _WORTH_ASKING else None


def _temperatures(readings: Readings) -> list[float]:
    """Those of the test dwells, and the middles between them."""
    tests = [b for b in readings.blocks if readings.test[readings.of_block(b)].all()]
    temps = np.unique(np.round([readings.block_degc(b) for b in tests], 0))
    middles = (temps[1:] + temps[:-1]) / 2.0
    return [float(t) for t in np.sort(np.concatenate([temps, middles]))]


def _with_dwells(readings: Readings, temp_degc: float) -> Readings:
    """The readings and six dwells more, whose outputs are those of an ideal unit."""
    return readings.but(
        rows=np.concatenate([readings.rows, readings.rows.max() + 1 + np.arange(6)]),
        positions=(*readings.positions, *POSITIONS),
        test=np.concatenate([readings.test, np.ones(6, dtype=np.bool_)]),
        temps_degc=np.concatenate([readings.temps_degc, np.full(6, temp_degc)]),
        outputs=np.vstack([readings.outputs, FORCES]),
        sd=np.vstack([readings.sd, np.tile(np.median(readings.sd, axis=0), (6, 1))]),
        force=np.vstack([readings.force, FORCES]),
        block=np.concatenate([readings.block, np.full(6, readings.block.max() + 1)]),
        order=np.concatenate([readings.order, np.arange(6)]),
    )


def _predicted(extended: Readings, count: int, judged: Judged) -> tuple[FloatArray, FloatArray]:
    """Outputs of the six further dwells and their variances, shapes (6, 3)."""
    hypothesis, amplitudes = judged.hypothesis, judged.amplitudes
    mended = hypothesis.undo(extended, amplitudes)
    theta = judged.system.linear_about
    unused = None
    if hypothesis.unused is not None:
        unused = np.vstack([hypothesis.unused, np.zeros((6, 3), dtype=np.bool_)])
    system = System(mended, theta, unused)
    new = np.flatnonzero(system.rows.dwell >= count)
    noise = system.row_variance(judged.scales)[new]
    system.variance[new] = 1e6
    added = judged.added
    if added is not None:
        about = judged.fit.theta if theta is None else theta
        columns = hypothesis.columns(extended, about, amplitudes)
        added = Added(columns, added.size, amplitudes)
    fit = system.fit(judged.scales, added)
    G, _ = system.columns(judged.scales)
    values = fit.values.copy()
    if added is not None:
        G = np.hstack([G, added.columns])
        values[len(values) - fit.added :] -= amplitudes
    mean = (G[new] @ values + G[new][:, : MEAN.size] @ MEAN.ravel()).reshape(6, 3)
    spread = np.linalg.solve(fit.root, (G[new] * fit.scale).T)
    variance = ((spread**2).sum(axis=0) + noise).reshape(6, 3)
    return _as_read(extended, hypothesis.undo, amplitudes, mean, count), variance


def _as_read(
    extended: Readings, undo: Undo, amplitudes: FloatArray, mean: FloatArray, count: int
) -> FloatArray:
    """What is read where the mended outputs are `mean`: undoing is a shift or a change of sign."""
    at = []
    for value in (0.0, 1.0):
        outputs = extended.outputs.copy()
        outputs[count:] = value
        at.append(undo(extended.but(outputs=outputs), amplitudes).outputs[count:])
    return np.asarray((mean - at[0]) / (at[1] - at[0]))
