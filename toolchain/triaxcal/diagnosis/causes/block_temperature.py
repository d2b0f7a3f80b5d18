"""The temperatures of a block, or of some, lost their sign, or are in another unit."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from math import comb

import numpy as np

from triaxcal.diagnosis.core.blocks import sets_of
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Undo
from triaxcal.diagnosis.core.readings import FORCES, Readings, rows_in_words
from triaxcal.fitting.tilter.temperatures import BELIEVED_DEGC
from triaxcal.model.temperatures import MISTAKES, ToDegc
from triaxcal.model.thermal.shape import GROUP_GAP_DEGC
from triaxcal.model.types import BoolArray, FloatArray

_SIGN = "the sign lost"
_FORMS: dict[str, ToDegc] = {_SIGN: lambda t: -t, **MISTAKES}
_LEAST_DEGC = 3.0
_LISTED = 8
"""Temperatures that are named one by one; of more, the first and the last."""
_ONE_MORE = -1.0
"""Log probability of each further block that a mistake strikes."""
_MOST, _MOST_SETS, _PROPOSED = 6, 500, 3
"""Blocks struck at once, sets of as many that are compared, and sets that compete."""
_INVERSE = np.linalg.pinv(np.column_stack([np.ones(6), FORCES]))
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
    count = len(blocks)
    for form, mend in _FORMS.items():
        for some in (*blocks, *together, *_several(readings, mend)):
            own = np.isin(readings.block, some)
            old, new = readings.temps_degc[own], np.asarray(mend(readings.temps_degc[own]))
            if not _inside(new).all() or abs(new.mean() - old.mean()) < _LEAST_DEGC:
                continue
            rows = readings.rows[own]
            name = "a minus sign too many" if form == _SIGN and old.mean() < 0.0 else form
            where = rows_in_words(rows)
            ways, shared = (len(together), 2.5) if any(some is t for t in together) else (0, 1.0)
            yield Hypothesis(
                f"{name}, {where}",
                _mended(form, some),
                rows=rows,
                change=f"with {_read(readings, some, mend)} degC in {where}",
                places=2.0 * len(_FORMS) * (ways or sets_of(count)),
                log_prior=_at_t0(readings, own, new, tests) * shared
                + _ONE_MORE * (len(some) - 1.0) * (not ways),
            )


def _read(readings: Readings, some: np.ndarray, mend: ToDegc) -> str:
    """Temperatures of blocks, the right ones and those of the file: "-40, -20 for 40, 20"."""
    old = np.array([readings.block_degc(b) for b in some])
    words = [[f"{t:+.4g}" for t in temps] for temps in (mend(old), old)]
    if len(old) > _LISTED:
        words = [[*w[: _LISTED - 2], "...", w[-1]] for w in words]
    return " for ".join(", ".join(w) for w in words)


def _several(readings: Readings, mend: ToDegc) -> list[np.ndarray]:
    """Sets of two blocks and more whose mended temperatures leave curves that bend least.

    Of the constants of each block, curves over temperature leave a residual. The sets of test
    blocks with the smallest are proposed, alone and with the check blocks that agree.
    """
    outputs = readings.test_blocks
    blocks = np.array(list(outputs))
    temps = np.array([readings.block_degc(b) for b in blocks])
    eligible = [
        k for k, t in enumerate(temps) if abs(mend(t) - t) >= _LEAST_DEGC and _inside(mend(t))
    ]
    if len(blocks) < 3:
        return []
    sizes = [
        n
        for n in range(1, min(len(eligible), len(blocks) - 1, _MOST) + 1)
        if comb(len(eligible), n) <= _MOST_SETS
    ]
    sets = [some for n in sizes for some in combinations(eligible, n)]
    if not sets:
        return []
    constants = np.stack([(_INVERSE @ u).ravel() for u in outputs.values()])
    mended = np.tile(temps, (len(sets), 1))
    for row, some in zip(mended, sets, strict=True):
        row[list(some)] = mend(temps[list(some)])
    found = []
    for k in _left_by_curves(mended, constants).argsort()[:_PROPOSED]:
        tests = blocks[list(sets[k])]
        checks = _checks_that_agree(readings, mend, mended[k], constants)
        found += [tests] if len(tests) > 1 else []
        found += [np.concatenate([tests, checks])] if checks else []
    return found


def _left_by_curves(temps: FloatArray, constants: FloatArray) -> FloatArray:
    """Squares that curves over each of some lists of temperatures leave, shape (n,)."""
    Q = np.linalg.qr(_powers(temps, temps, constants))[0]
    inside = np.swapaxes(Q, -1, -2) @ constants
    return np.asarray((constants**2).sum() - (inside**2).sum(axis=(-1, -2)))


def _powers(at: FloatArray, temps: FloatArray, constants: FloatArray) -> FloatArray:
    """Of a cubic over `temps`, or less with few of them, at some, shape (..., n, P)."""
    middle, span = temps.mean(axis=-1, keepdims=True), np.ptp(temps, axis=-1, keepdims=True)
    orders = np.arange(min(3, len(constants) - 2) + 1)
    return np.asarray(((at - middle) / span)[..., None] ** orders)


def _checks_that_agree(
    readings: Readings, mend: ToDegc, temps: FloatArray, constants: FloatArray
) -> list[int]:
    """Check blocks whose |a| is nearer 1 g at their mended temperature, by curves of the tests."""
    curves = np.linalg.lstsq(_powers(temps, temps, constants), constants, rcond=None)[0]
    found = []
    for block in readings.blocks:
        own = readings.of_block(block)
        degc = readings.block_degc(block)
        new = float(mend(np.array(degc)))
        if readings.test[own].any() or abs(new - degc) < _LEAST_DEGC or not _inside(new):
            continue
        errors = []
        for at in (degc, new):
            U0, *K = (_powers(np.array(at), temps, constants) @ curves).reshape(4, 3)
            force = np.linalg.lstsq(np.transpose(K), (readings.outputs[own] - U0).T, rcond=None)[0]
            errors.append(np.abs(np.linalg.norm(force, axis=0) - 1.0).mean())
        if errors[1] < errors[0]:
            found.append(block)
    return found


def _at_t0(readings: Readings, own: np.ndarray, new: FloatArray, tests: set[int]) -> float:
    """A unit is measured at its reference temperature, and at one temperature once."""
    temps = readings.temps_degc.copy()
    temps[own] = new
    means = np.array([temps[readings.block == b].mean() for b in sorted(tests)])
    before = np.array([readings.block_degc(b) for b in sorted(tests)])
    return _strange(means, readings.t0_degc) - _strange(before, readings.t0_degc)


def _inside(temps: FloatArray | float) -> BoolArray:
    return np.asarray((BELIEVED_DEGC[0] < temps) & (temps < BELIEVED_DEGC[1]))


def _strange(means: FloatArray, t0_degc: float) -> float:
    away = float(np.abs(means - t0_degc).min())
    outside = not _inside(means).all()
    return (_NOT_AT_T0 if away > GROUP_GAP_DEGC else 0.0) + _OUTSIDE * outside


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
