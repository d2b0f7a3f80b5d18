"""Outputs have another gain at some temperatures than at the others."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from triaxcal.diagnosis.core.blocks import (
    apart,
    at_temperatures,
    in_blocks,
    sets_of,
    unlike,
)
from triaxcal.diagnosis.core.cause import Cause, Hypothesis, Known, Parameter, Undo
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

Outputs = tuple[int, ...]
_FACTORS = (0.25, 0.5, 2.0, 4.0)
_OUTPUTS: tuple[Outputs, ...] = ((0, 1, 2), (0,), (1,), (2,))
_CHANGES = tuple(product(_FACTORS, _OUTPUTS))
_LONGEST = 2
"""Blocks that follow each other and have one gain, where it is no power of two.

More of them, against check dwells that have the right gain, look like cubes of the sensor.
"""
_SIZES = (1e-3, 10e-3, 100e-3)


def _hypotheses(known: Known) -> Iterator[Hypothesis]:
    readings = known.readings
    count = len(readings.test_blocks)
    if count < 2:
        return
    scales = np.array([_scale(*change) for change in _CHANGES])
    places = 2.0 * len(_OUTPUTS) * sets_of(count)
    for (factor, outputs), blocks in unlike(readings, _CHANGES, lambda u: u / scales[:, None]):
        if len(blocks) == count:
            continue
        named, there = _wrong_ones(known, factor, outputs, blocks)
        yield Hypothesis(
            f"{_named(outputs)} {at_temperatures(readings, there)}, {named:g} times the others'",
            _divided(factor, outputs, blocks),
            rows=readings.rows[in_blocks(readings, there)],
            change=f"divided by {named:g} there",
            places=places * len(_FACTORS),
            log_prior=apart(readings, blocks),
        )
    for blocks in _followers(readings):
        for outputs in _OUTPUTS:
            yield Hypothesis(
                f"{_named(outputs)} {at_temperatures(readings, blocks)}",
                _gained(outputs, blocks),
                (Parameter("gain", "%", 100.0),),
                readings.rows[in_blocks(readings, blocks)],
                "with the gain of the others there",
                places=places,
                sizes=_SIZES,
            )


def _scale(factor: float, outputs: Outputs) -> FloatArray:
    return np.where(np.isin(np.arange(3), outputs), factor, 1.0)


def _named(outputs: Outputs) -> str:
    return "all outputs" if len(outputs) == 3 else f"output {AXES[outputs[0]]}"


def _wrong_ones(
    known: Known, factor: float, outputs: Outputs, blocks: tuple[int, ...]
) -> tuple[float, tuple[int, ...]]:
    """Factor and blocks as they are named: those that the nominal sensitivity does not fit."""
    nominal = known.sensitivity_v_per_g
    others = tuple(b for b in known.readings.test_blocks if b not in blocks)
    if nominal is None:
        return factor, blocks
    off = np.log(np.abs(known.readings.volts_per_g / nominal))[list(outputs)].mean()
    if abs(off) <= abs(off + np.log(factor)):
        return factor, blocks
    return 1.0 / factor, others


def _divided(factor: float, outputs: Outputs, blocks: tuple[int, ...]) -> Undo:
    by = _scale(factor, outputs)

    def undo(readings: Readings, _amplitudes: FloatArray) -> Readings:
        own = in_blocks(readings, blocks)[:, None]
        return readings.but(
            outputs=np.where(own, readings.outputs / by, readings.outputs),
            sd=np.where(own, readings.sd / by, readings.sd),
        )

    return undo


def _followers(readings: Readings) -> Iterator[tuple[int, ...]]:
    """One block, and two that follow each other in the order of the file; fewer than others."""
    blocks = list(readings.test_blocks)
    for length in range(1, min(_LONGEST, max(len(blocks) // 2, 1)) + 1):
        for first in range(len(blocks) - length + 1):
            yield tuple(blocks[first : first + length])


def _gained(outputs: Outputs, blocks: tuple[int, ...]) -> Undo:
    some = np.isin(np.arange(3), outputs)

    def undo(readings: Readings, amplitudes: FloatArray) -> Readings:
        own = in_blocks(readings, blocks)[:, None] & some
        return readings.but(
            outputs=np.where(own, readings.outputs / (1.0 + amplitudes[0]), readings.outputs)
        )

    return undo


ENTRY = Cause(
    name="block_gain",
    label="another gain at some temperatures",
    doc="The sensitivity is another one in some blocks: a range or an amplifier was switched.",
    hypotheses=_hypotheses,
    apart="the settings of converter and amplifier at these temperatures",
    rank=55,
    spoils=True,
)
