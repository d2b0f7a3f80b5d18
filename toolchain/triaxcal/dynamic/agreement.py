"""Whether several recordings are of one unit: each against what the others say at its temperature.

The normal equations L x = b of a recording are rows R x = y of unit noise, L = R' R. With x of
covariance P by the other recordings the prediction error e = y - R x has the covariance 1 + R P R'.
Its chi-square says whether the recordings contradict each other. If the unit had other constants
there, larger by d, it would be e = R_0 d with R_0 the columns of the constants: d by least squares
with their priors says which differ, and by how much.

What switches on anew differs by a part of its bias; another unit, or another temperature than was
recorded, by as much as the constants are large. So a contradiction is refused where a group of
constants differs by more than `PART` of its size, and reported otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.blocks.block import StateBlock
from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.temperatures import Recorded
from triaxcal.dynamic.thermalparts import Information, constants_of, information_of_parts
from triaxcal.model.thermal.shape import GROUP_GAP_DEGC
from triaxcal.model.types import FloatArray, IntArray

CHANCE = 1e-6
"""Of a false alarm, for each recording."""
PART = 0.5
"""Of the size of a group of constants."""
SEEN = 1.0
"""A direction that a recording shows better than the prior does counts."""


@dataclass(frozen=True)
class Difference:
    """How a recording differs from all others.

    Attributes
    ----------
    name : str
        Of the recording.
    words : str
        The constant that differs most.
    part : float
        Of the size of its group of constants, for the group that differs most.
    """

    name: str
    words: str
    part: float


def differences(
    by_recording: Mapping[str, Information],
    maps: Mapping[str, FloatArray],
    about: tuple[Layout, FloatArray],
    scale: float,
) -> tuple[Difference, ...]:
    """Recordings that contradict the others.

    Parameters
    ----------
    by_recording : mapping
        What each says, by its name.
    maps : mapping
        M (n, parameters) that hold for the constants, of each recording to be tested.
    about : tuple
        Layout, and the constants p (n,) of the solution, SI.
    scale : float
        Mean square of the innovations over that of the stated noise.
    """
    found = []
    for name, M in maps.items():
        others = [known for other, known in by_recording.items() if other != name]
        rest = sum(others[1:], start=others[0])
        difference = _difference(by_recording[name], rest, M, about, max(scale, 1.0))
        if difference is not None:
            found.append(Difference(name, *difference))
    return tuple(found)


def recordings_differ(
    recording: ImuRecording,
    result: DynamicResult,
    recorded: Recorded | None,
    functions: FloatArray | None,
) -> tuple[Difference, ...]:
    """Which of several recordings contradict the others; linear about the `result`.

    With `functions` over temperature (`Solved.functions`) a recording is tested where others were
    made at lower and at higher temperatures, or at the same.
    """
    if not recording.starts_s:
        return ()
    starts = np.array(recording.starts_s)
    sections = result.survey.sections
    of_section = np.searchsorted(starts, [s.start_s for s in sections], side="right").tolist()
    present = sorted(set(of_section))
    parts = tuple(
        tuple(s for s, k in zip(sections, of_section, strict=True) if k == own) for own in present
    )
    known = information_of_parts(recording, result, parts)
    by_recording = dict(zip((recording.names[k] for k in present), known, strict=True))
    layout = constants_of(result)
    M = np.eye(len(layout)) if functions is None else functions
    tested = [k for k in present if functions is None or _between(k, starts, recorded)]
    maps = {recording.names[k]: M for k in tested}
    last = result.passes[-1]
    about = layout, result.p[: len(layout)]
    return differences(by_recording, maps, about, last.chi_square / last.freedom)


def _between(number: int, starts: FloatArray, recorded: Recorded | None) -> bool:
    """Whether the temperatures of a recording lie between those of others."""
    if recorded is None:
        return False
    of = np.searchsorted(starts, recorded.start_s, side="right")
    own, others = recorded.degc[of == number], recorded.degc[of != number]
    gap = GROUP_GAP_DEGC
    inside = others.min() - gap <= own.min() and own.max() <= others.max() + gap
    return bool(inside)


def refuse_others(found: tuple[Difference, ...]) -> tuple[str, ...]:
    """Refuse a recording of another unit; returns what to say of smaller contradictions.

    Raises
    ------
    RefusedError
    """
    for difference in sorted(found, key=lambda d: -d.part):
        if difference.part > PART:
            raise RefusedError(
                difference.name,
                f"contradicts the other recordings: {difference.words}",
                expected="recordings of one unit, with the temperature that it had",
                remedy="check that all are of one unit, and their temperatures, or leave it out",
            )
    return tuple(
        f"{d.name} differs from the other recordings by more than the noise: {d.words}"
        for d in found
    )


def _difference(
    own: Information,
    others: Information,
    M: FloatArray,
    about: tuple[Layout, FloatArray],
    scale: float,
) -> tuple[str, float] | None:
    layout, p = about
    normal = M.T @ others.matrix @ M + M.T @ M
    x = M @ np.linalg.solve(normal, M.T @ others.vector)
    values, vectors = np.linalg.eigh(own.matrix)
    keep = values > SEEN
    R = np.sqrt(values[keep])[:, None] * vectors[:, keep].T
    e = vectors[:, keep].T @ own.vector / np.sqrt(values[keep]) - R @ x
    covariance = np.eye(len(e)) + R @ M @ np.linalg.solve(normal, M.T @ R.T)
    weighted = np.linalg.solve(covariance, np.column_stack([e, R]))
    if chi2.sf(float(e @ weighted[:, 0]) / scale, len(e)) > CHANCE:
        return None
    places = {block.name: np.arange(len(layout))[layout.place(block.name)] for block in BASE}
    index = np.concatenate(list(places.values()))
    J = R[:, index]
    spread = np.linalg.inv(J.T @ weighted[:, 1:][:, index] + np.eye(len(index)))
    d = spread @ (J.T @ weighted[:, 0])
    worst = int(np.argmax(np.abs(d) / np.sqrt(np.diag(spread))))
    prior = layout.prior_sd[index]
    changed = dict(zip(index.tolist(), (d * prior).tolist(), strict=True))
    parts = [_part(block, places[block.name], changed, p) for block in BASE]
    state = layout.states[int(index[worst])]
    sd = float(np.sqrt(spread[worst, worst]))
    value = d[worst] * prior[worst] / state.per_unit
    words = (
        f"{state.label} is {value:.3g} {state.unit} off, {abs(d[worst]) / sd:.0f} standard "
        "deviations"
    )
    return words, max(parts)


def _part(
    block: StateBlock, places: IntArray, changed: Mapping[int, float], p: FloatArray
) -> float:
    """Change of a block's constants over their size; states of other units weigh by their unit."""
    unit = np.array([s.per_unit * s.prior_sd for s in block.states])
    change = np.array([changed[int(k)] for k in places]) / unit
    return float(np.linalg.norm(change) / max(float(np.linalg.norm(p[places] / unit)), 1e-12))
