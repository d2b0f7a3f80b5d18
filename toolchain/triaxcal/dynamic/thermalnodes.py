"""Temperatures at which a unit was seen, points or steps of a ramp, and the samples of each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.rests import runs_of
from triaxcal.dynamic.survey import Section, Survey
from triaxcal.dynamic.temperatures import Recorded
from triaxcal.dynamic.windows import WINDOW_S
from triaxcal.model.thermal.shape import GROUP_GAP_DEGC
from triaxcal.model.types import FloatArray, IntArray

POINT_DEGC = 4.0
"""Temperatures that lie nearer together than this, without a gap, are one point."""
STEPS = 5
"""Of all that ramps pass through: what a cubic and a held-out step need."""
RISES = 0.1
"""Of what the accelerometers' temperature rises by: gyros rise by more."""
REST_S = 1.0
"""A section of its own may begin with a rest of this length."""


@dataclass(frozen=True)
class Nodes:
    """Temperatures at which a unit was seen.

    Attributes
    ----------
    degc : array, shape (G,)
        Rising.
    t0_degc : float
        The reference temperature: one of them.
    """

    degc: FloatArray
    t0_degc: float

    def nearest(self, degc: FloatArray | float) -> IntArray:
        """Number of the nearest node, same shape as the temperatures."""
        away = np.abs(np.asarray(degc)[..., None] - self.degc)
        return np.asarray(np.argmin(away, axis=-1))


def nodes_of(recorded: Recorded, reference_degc: float) -> Nodes:
    """Nodes of the recorded temperatures; T0 is the one that is nearest to the reference."""
    degc = np.sort(recorded.degc)
    clusters = np.split(degc, np.flatnonzero(np.diff(degc) > GROUP_GAP_DEGC) + 1)
    moved = sum(float(c[-1] - c[0]) for c in clusters if c[-1] - c[0] > POINT_DEGC)
    found: list[float] = []
    for cluster in clusters:
        low, high = float(cluster[0]), float(cluster[-1])
        if high - low <= POINT_DEGC:
            found.append(float(cluster.mean()))
            continue
        steps = max(2, math.ceil(STEPS * (high - low) / moved))
        width = (high - low) / steps
        middles = low + width * (np.arange(steps) + 0.5)
        if low <= reference_degc <= high:
            middles[int(np.argmin(np.abs(middles - reference_degc)))] = reference_degc
        found += [float(m) for m in middles]
    nodes = np.array(found)
    k = int(np.argmin(np.abs(nodes - reference_degc)))
    if abs(nodes[k] - reference_degc) <= GROUP_GAP_DEGC:
        nodes[k] = reference_degc
    return Nodes(nodes, float(nodes[k]))


def gyro_nodes_of(recorded: Recorded, nodes: Nodes, reference_degc: float) -> Nodes:
    """Temperatures that the gyros' thermometer had at the nodes; T0 is nearest to the reference.

    Raises
    ------
    RefusedError
        When the two thermometers do not rise together.
    """
    if recorded.gyro is None:
        return nodes
    by_degc = np.argsort(recorded.degc, kind="stable")
    degc = np.interp(nodes.degc, recorded.degc[by_degc], recorded.gyro[by_degc])
    part = np.diff(degc) / np.diff(nodes.degc)
    if np.any(part < RISES):
        k = int(np.argmin(part))
        raise RefusedError(
            "gyro_temp_column in [dynamic]",
            f"{degc[k]:.1f} degC where temp_column is {nodes.degc[k]:.1f} degC, and "
            f"{degc[k + 1]:.1f} degC where it is {nodes.degc[k + 1]:.1f} degC",
            expected="two thermometers that rise together",
            remedy="check the columns, or leave gyro_temp_column out",
        )
    return Nodes(degc, float(degc[np.argmin(np.abs(degc - reference_degc))]))


def cut_at_nodes(found: Survey, recorded: Recorded, nodes: Nodes) -> tuple[Survey, IntArray]:
    """The same survey with sections that end where the temperature comes to another node.

    A section can begin at a rest only. Returns the node of each section as well.
    """
    sections, numbers = [], []
    for number, section in enumerate(found.sections):
        for part in _parts(found, number, section, recorded, nodes):
            begin, end = (found.windows.first.searchsorted(k) for k in (part.first, part.last))
            start_s = found.windows.start_s[begin : max(end, begin + 1)]
            degc = np.interp(start_s, recorded.start_s, recorded.degc)
            sections.append(part)
            numbers.append(int(nodes.nearest(float(np.median(degc)))))
    return replace(found, sections=tuple(sections)), np.array(numbers)


def _parts(
    found: Survey, number: int, section: Section, recorded: Recorded, nodes: Nodes
) -> Iterator[Section]:
    windows = found.windows
    own = (windows.section == number) & (windows.first >= section.first)
    start = section
    at = int(nodes.nearest(float(np.interp(section.start_s, recorded.start_s, recorded.degc))))
    for a, b in runs_of(own & found.still & found.use, windows.section):
        if b - a < round(REST_S / WINDOW_S):
            continue
        begin_s = float(windows.start_s[a])
        node = int(nodes.nearest(float(np.interp(begin_s, recorded.start_s, recorded.degc))))
        if node == at or windows.first[a] <= start.first:
            continue
        first = int(windows.first[a])
        yield replace(start, last=first - 1)
        rate, force = windows.rate[a:b].mean(axis=0), windows.force[a:b].mean(axis=0)
        still_s = float(windows.duration_s[a:b].sum())
        start = Section(first, section.last, begin_s, still_s, rate, force)
        at = node
    yield start
