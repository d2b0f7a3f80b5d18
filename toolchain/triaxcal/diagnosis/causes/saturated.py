"""An output saturates inside the range of +-1 g."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, explained, unchanged
from triaxcal.model.positions import AXES

_TO_END_G = 2.0
"""Where the level can lie."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    for i in range(3):
        for sign in (1.0, -1.0):
            own = readings.test & (sign * readings.force[:, i] > 0.5)
            values = sign * readings.outputs[:, i]
            if not own.any():
                continue
            level = values[own].max()
            near = np.maximum(6.0 * np.median(readings.sd[:, i]), 60e-6)
            clipped = own & (values > level - near)
            if clipped.sum() < 2:
                continue
            rest = values[clipped] - values[clipped].mean()
            sd = np.maximum(np.sqrt(np.mean(rest**2)), 3e-6)
            freedom = len(rest) - 1
            density = -0.5 * np.sum((rest / sd) ** 2) - freedom * np.log(sd * 2.5066)
            unused = np.zeros((len(readings), 3), dtype=np.bool_)
            unused[clipped, i] = True
            yield Hypothesis(
                f"output {AXES[i]} at {sign * level:+.4g} g",
                unchanged,
                rows=readings.rows[clipped],
                change=f"without output {AXES[i]} where it is at its end",
                places=6.0,
                unused=unused,
                log_density=explained(float(density) - np.log(_TO_END_G), len(rest)),
            )


ENTRY = Cause(
    name="saturated",
    label="saturation inside the range",
    doc="An output stays at one level where the force goes on rising: its converter is at its end.",
    hypotheses=_hypotheses,
    apart="the codes of the converter near its end",
    discrete=True,
    rank=41,
    spoils=True,
)
