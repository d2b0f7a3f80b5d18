"""What each part of the recordings says of the constants alone: a pass of the filter through each.

Parts share nothing but the constants. A pass with the prior gives estimate p and covariance C, so
that in units of the prior's standard deviations (mean zero, covariance 1) the part alone says

    L = C^-1 - 1,    b = C^-1 p:    the normal equations L x = b.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.dynamic.again import task_again
from triaxcal.dynamic.blocks import north
from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.filterpass import run_pass
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.passdata import Reference
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.survey import Section
from triaxcal.model.types import FloatArray


@dataclass(frozen=True)
class Information:
    """Normal equations of a part, in units of the prior's standard deviations.

    Attributes
    ----------
    matrix : array, shape (n, n)
    vector : array, shape (n,)
    """

    matrix: FloatArray
    vector: FloatArray

    def __add__(self, other: Information) -> Information:
        return Information(self.matrix + other.matrix, self.vector + other.vector)

    def padded(self, size: int) -> Information:
        """The same for a layout with further states behind, of which it says nothing."""
        more = size - len(self.vector)
        return Information(np.pad(self.matrix, (0, more)), np.pad(self.vector, (0, more)))


def constants_of(result: DynamicResult) -> Layout:
    """Layout of a result without what belongs to its sections."""
    blocks = tuple(b for b in result.layout.blocks if b.name != north.BLOCK.name)
    return Layout(blocks)


def information_of(result: DynamicResult) -> Information:
    """What all recordings together say."""
    return _information(constants_of(result), result.p, result.covariance)


def _information(layout: Layout, p: FloatArray, covariance: FloatArray) -> Information:
    n, sd = len(layout), layout.prior_sd
    inverse = np.linalg.inv(covariance[:n, :n] / np.outer(sd, sd))
    inverse = (inverse + inverse.T) / 2
    return Information(inverse - np.eye(n), inverse @ (p[:n] / sd))


def information_of_parts(
    recording: ImuRecording,
    result: DynamicResult,
    parts: tuple[tuple[Section, ...], ...],
    progress: Callable[[float], None] | None = None,
) -> tuple[Information, ...]:
    """What each part, some sections, says alone; linear about the `result`."""
    layout = constants_of(result)
    searching = Layout((*layout.blocks, north.BLOCK))
    p = np.concatenate([result.p[: len(layout)], np.zeros(len(searching) - len(layout))])
    whole = task_again(recording, result, searching)
    found = []
    for number, sections in enumerate(parts):
        task = replace(whole, survey=replace(result.survey, sections=sections))
        done = run_pass(task, Reference(p, result.stage_p, None), first=False)
        found.append(_information(layout, done.p, done.root @ done.root.T))
        if progress is not None:
            progress((number + 1) / len(parts))
    return tuple(found)
