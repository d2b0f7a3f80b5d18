"""Outputs of inverted sign."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    sets = [*combinations(range(3), 1), *combinations(range(3), 2), (0, 1, 2)]
    sets = sets if known.readings.polarity else sets[:-1]
    for outputs in sets:
        names = " and ".join(AXES[i] for i in outputs)
        plural = "s" if len(outputs) > 1 else ""
        signs = np.sign(known.readings.volts_per_g) * _signs(outputs)
        key = f"polarity = [{', '.join(f'{s:.0f}' for s in signs)}]"
        if known.sensitivity_v_per_g is not None:
            nominal = np.abs(known.sensitivity_v_per_g) * signs
            key = f"nominal_v_per_g = [{', '.join(f'{v:g}' for v in nominal)}]"
        yield Hypothesis(
            f"output{plural} {names} ({key} under [sensor])",
            _inverted(outputs),
            change=f"with output{plural} {names} inverted",
            places=float(len(sets)),
            # A stated polarity is believed, and two inverted outputs are rarer than one.
            log_prior=-(3.0 if known.readings.polarity else 0.0) - (len(outputs) - 1.0),
        )


def _signs(outputs: tuple[int, ...]) -> FloatArray:
    return np.where(np.isin(np.arange(3), outputs), -1.0, 1.0)


def _inverted(outputs: tuple[int, ...]) -> Undo:
    signs = _signs(outputs)

    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        return readings.but(outputs=readings.outputs * signs)

    return undo


ENTRY = Cause(
    name="polarity",
    label="polarity of an output",
    doc="An output falls where the force along its axis rises, and the description says otherwise.",
    hypotheses=_hypotheses,
    apart="the sign of each output with a known face upward",
    discrete=True,
    rank=32,
    spoils=True,
)
