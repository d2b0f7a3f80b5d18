"""The temperatures of a block lost their sign, or are in another unit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo
from triaxcal.diagnosis.core.readings import Readings, rows_in_words
from triaxcal.model.temperatures import MISTAKES, ToDegc
from triaxcal.model.thermal.shape import GROUP_GAP_DEGC
from triaxcal.model.types import FloatArray

_SIGN = "the sign lost"
_FORMS: dict[str, ToDegc] = {_SIGN: lambda t: -t, **MISTAKES}
_WORKING_DEGC = -80.0, 160.0
"""Where accelerometers are calibrated: what a form makes of a temperature must be inside."""
_LEAST_DEGC = 3.0
_NOT_AT_T0, _OUTSIDE = -6.0, -20.0
"""Log probability of readings without the reference temperature, and outside of these."""


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    blocks = [np.array([b]) for b in readings.blocks]
    tests = {int(b) for b in readings.block[readings.test]}
    every = np.array(readings.blocks)
    below = np.array([b for b in readings.blocks if readings.block_degc(b) > 127.0], dtype=int)
    # Another scale for all temperatures only bends the curves: it takes more to think of it.
    strange = _strange(np.array([readings.block_degc(b) for b in sorted(tests)]), readings.t0_degc)
    together = [every] if strange < 0.0 and len(every) > 1 else []
    together += [below] if 1 < len(below) < len(every) else []
    candidates = [*blocks, *together]
    for form, mend in _FORMS.items():
        for some in candidates:
            own = np.isin(readings.block, some)
            old, new = readings.temps_degc[own], np.asarray(mend(readings.temps_degc[own]))
            inside = (_WORKING_DEGC[0] < new) & (new < _WORKING_DEGC[1])
            if not inside.all() or abs(new.mean() - old.mean()) < _LEAST_DEGC:
                continue
            rows = readings.rows[own]
            one = len(some) == 1
            name = "a sign too many" if form == _SIGN and old.mean() < 0.0 else form
            temps = f"{new.mean():+.4g} for {old.mean():+.4g} degC" if one else name
            yield Hypothesis(
                f"{name}, {rows_in_words(rows)}",
                _mended(form, some),
                rows=rows,
                change=f"with {temps}" + (f" in {rows_in_words(rows)}" if one else " undone"),
                places=2.0 * len(_FORMS) * (len(blocks) if one else len(together)),
                log_prior=_at_t0(readings, own, new, tests) * (1.0 if one else 2.5),
            )


def _at_t0(readings: Readings, own: np.ndarray, new: FloatArray, tests: set[int]) -> float:
    """A unit is measured at its reference temperature, and at one temperature once."""
    temps = readings.temps_degc.copy()
    temps[own] = new
    means = np.array([temps[readings.block == b].mean() for b in sorted(tests)])
    before = np.array([readings.block_degc(b) for b in sorted(tests)])
    return _strange(means, readings.t0_degc) - _strange(before, readings.t0_degc)


def _strange(means: FloatArray, t0_degc: float) -> float:
    away = float(np.abs(means - t0_degc).min())
    outside = (means < _WORKING_DEGC[0]) | (means > _WORKING_DEGC[1])
    return (_NOT_AT_T0 if away > GROUP_GAP_DEGC else 0.0) + _OUTSIDE * float(outside.any())


def _mended(form: str, blocks: np.ndarray) -> Undo:
    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        own = np.isin(readings.block, blocks)
        temps = readings.temps_degc
        return readings.but(temps_degc=np.where(own, _FORMS[form](temps), temps))

    return undo


ENTRY = Cause(
    name="block_temperature",
    label="temperatures of a block: sign or unit",
    doc="A block's temperatures lost their sign, are an unsigned byte, or are in K or degF.",
    hypotheses=_hypotheses,
    apart="the log of the chamber",
    discrete=True,
    rank=60,
    spoils=True,
)
