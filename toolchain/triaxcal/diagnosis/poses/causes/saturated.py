"""An output saturates inside the range of +-1 g."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause
from triaxcal.diagnosis.poses.core.cause import KnownPoses, PoseHypothesis
from triaxcal.model.positions import AXES

_SPREADS_G = (1e-3, 4e-3, 15e-3)
"""Within which readings are at one level: noise adds to a converter at its end."""
_MOST = 0.7
_PER_G = 2.0
"""Density of |a| of a pose at the end, which may be too short by up to half of 1 g."""


def _hypotheses(known: KnownPoses) -> Iterator[PoseHypothesis]:
    readings = known.readings
    for i in range(3):
        for sign in (1.0, -1.0):
            values = sign * readings.outputs[:, i]
            level = float(values.max())
            clips = {tuple(np.flatnonzero(values > level - spread)) for spread in _SPREADS_G}
            for clip in sorted(clips):
                if not 2 <= len(clip) <= _MOST * len(readings):
                    continue
                unused = np.zeros(len(readings), dtype=np.bool_)
                unused[list(clip)] = True
                at = sign * float(values[list(clip)].mean()) * readings.one_g
                yield PoseHypothesis(
                    f"output {AXES[i]} at {at:+.4g} {known.unit}, {readings.words(np.array(clip))}",
                    lines=readings.lines[list(clip)],
                    change="without the poses in which it is at its end",
                    places=6.0 * len(_SPREADS_G),
                    unused=unused,
                    density_per_g=_PER_G,
                )


ENTRY = Cause(
    name="saturated",
    label="saturation inside the range",
    doc="An output stays at one level where the force goes on rising: its converter is at its end.",
    hypotheses=_hypotheses,
    apart="a wider range of the sensor",
    discrete=True,
    rank=41,
    spoils=True,
)
