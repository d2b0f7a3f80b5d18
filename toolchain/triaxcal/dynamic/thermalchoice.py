"""Which function each group of constants follows: the one that predicts held-out temperatures best.

Every temperature but the lowest and the highest is held out in turn. The score is minus twice the
logarithm of the probability density that the other temperatures, by the candidate, give to what was
read there. A candidate that misses by more than its own uncertainty has a bad score, and so has one
that leaves the prediction uncertain. The residual of the fit takes no part.

With x = M q, M the linear map from the parameters of the chosen functions to all terms, the others
say H q = h, H = M' L M + M' M with the priors and h = M' b, no further pass of the filter. With
A = M' L M and c = M' b of the held-out part, the density is, but for a factor common to all
candidates,

    sqrt(det H / det(H + A)) exp([(h + c)' (H + A)^-1 (h + c) - h' H^-1 h] / 2).

The groups are chosen in turns, each with the others as they were chosen last. exp(-score/2) is the
weight of the other candidates in the uncertainty: where two functions predict equally well and
differ between the temperatures, the difference is uncertain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.thermalbasis import (
    GROUPS,
    OF_GYROS,
    Basis,
    over_temperature,
    prior_of_term,
)
from triaxcal.dynamic.thermalnodes import Nodes
from triaxcal.dynamic.thermalparts import Information
from triaxcal.model.thermal.shape import ThermalShape
from triaxcal.model.types import FloatArray, IntArray

ROUNDS_MAX = 6
Shapes = Mapping[str, ThermalShape]
"""Function of each group, by the name of its block."""


@dataclass(frozen=True)
class Fold:
    """What lies at a held-out temperature, and what lies at all others.

    Of the accelerometers; the gyros had `gyro_degc` then.
    """

    degc: float
    gyro_degc: float
    held_out: Information
    others: Information


@dataclass(frozen=True)
class Fit:
    """Curves of chosen functions.

    Attributes
    ----------
    shapes : mapping
    q : array, shape (parameters,)
        In units of the prior's standard deviations; those of each group, state by state, first.
    covariance : array, shape (parameters, parameters)
    places : mapping
        Where the parameters of a group stand, reshaped (states, P).
    """

    shapes: Shapes
    q: FloatArray
    covariance: FloatArray
    places: Mapping[str, IntArray]


class Curves:
    """Fits of any functions to normal equations of all terms.

    `seen` are the temperatures at which each group was seen, by the name of its block, and `bases`
    its functions; groups that were not seen at all temperatures are `free` to differ from their
    function by the prior of its terms.
    """

    def __init__(
        self,
        layout: Layout,
        bases: Mapping[str, Basis],
        seen: Mapping[str, FloatArray],
        free: tuple[str, ...] = (),
    ) -> None:
        self.layout, self.bases, self.seen, self.free = layout, bases, seen, free
        self._maps: dict[tuple[str, ThermalShape], tuple[FloatArray, FloatArray]] = {}

    def map_of(
        self, shapes: Shapes, free: tuple[str, ...] = ()
    ) -> tuple[FloatArray, dict[str, IntArray]]:
        """M (n, parameters), in units of the priors, and where each group's parameters stand.

        Terms of groups that are `free` are parameters as well; they stand under `over_temperature`.
        """
        layout, index = self.layout, np.arange(len(self.layout))
        columns: list[FloatArray] = []
        places: dict[str, IntArray] = {}
        used = np.zeros(len(layout), dtype=bool)
        start = 0
        for block in GROUPS:
            name, shape = block.name, shapes[block.name]
            if (name, shape) not in self._maps:
                self._maps[name, shape] = self.bases[name].of_shape(shape)
            value, change = self._maps[name, shape]
            base = index[layout.place(block.name)]
            terms = index[layout.place(over_temperature(block.name))].reshape(len(base), -1)
            P = shape.parameters
            part = np.zeros((len(layout), len(base), P))
            part[base, np.arange(len(base))] = value
            ratio = np.array([s.prior_sd / prior_of_term(s) for s in block.states])
            part[terms, np.arange(len(base))[:, None]] = ratio[:, None, None] * change
            used[base] = used[terms.ravel()] = True
            columns.append(part.reshape(len(layout), -1))
            places[block.name] = start + np.arange(len(base) * P).reshape(len(base), P)
            start += len(base) * P
        for group in free:
            name = over_temperature(group)
            own = index[layout.place(name)]
            columns.append(np.eye(len(layout))[:, own])
            places[name] = (start + np.arange(len(own))).reshape(-1, self.bases[group].terms)
            start += len(own)
        return np.column_stack([*columns, np.eye(len(layout))[:, ~used]]), places

    def fit(self, known: Information, shapes: Shapes, free: tuple[str, ...] = ()) -> Fit:
        """Curves of some functions by least squares with the priors."""
        M, places = self.map_of(shapes, free)
        normal = M.T @ known.matrix @ M + M.T @ M
        covariance: FloatArray = np.linalg.inv(normal).astype(np.float64)
        return Fit(shapes, covariance @ (M.T @ known.vector), covariance, places)

    def without(self, group: str, shape: ThermalShape, fold: Fold) -> ThermalShape:
        """What is left of a function of a group where a temperature is held out."""
        seen, degc = self.seen[group], fold.gyro_degc if group in OF_GYROS else fold.degc
        remaining = seen[seen != degc]
        return shape if len(remaining) == len(seen) else shape.without(remaining, degc)

    def score(self, folds: Sequence[Fold], shapes: Shapes) -> float:
        """Minus twice the log density of what was held out, up to a constant."""
        total = 0.0
        for fold in folds:
            M, _ = self.map_of({n: self.without(n, s, fold) for n, s in shapes.items()})
            before, known = M.T @ fold.others.matrix @ M + M.T @ M, M.T @ fold.others.vector
            after, both = before + M.T @ fold.held_out.matrix @ M, M.T @ fold.held_out.vector
            both = both + known
            total += float(known @ np.linalg.solve(before, known))
            total -= float(both @ np.linalg.solve(after, both))
            total += float(np.linalg.slogdet(after)[1] - np.linalg.slogdet(before)[1])
        return total


@dataclass(frozen=True)
class Scored:
    """A candidate of a group: its score above the best one's, and its weight."""

    shape: ThermalShape
    score: float
    weight: float


@dataclass(frozen=True)
class Choice:
    """What was chosen.

    Attributes
    ----------
    fit : Fit
    candidates : mapping
        Of each group, as scored with the other groups as chosen; empty where nothing was held out.
    held_out_degc : tuple of float
    """

    fit: Fit
    candidates: Mapping[str, tuple[Scored, ...]]
    held_out_degc: tuple[float, ...]


def folds_of(
    nodes: Nodes, gyro_nodes: Nodes, by_node: Mapping[int, Information]
) -> tuple[Fold, ...]:
    """Each inner temperature held out in turn."""
    folds = []
    for k in range(1, len(nodes.degc) - 1):
        if k not in by_node:
            continue
        first, *others = (found for j, found in by_node.items() if j != k)
        rest = sum(others, start=first)
        degc = float(nodes.degc[k]), float(gyro_nodes.degc[k])
        folds.append(Fold(*degc, by_node[k], rest))
    return tuple(folds)


def choose(
    curves: Curves,
    known: Information,
    folds: Sequence[Fold],
    shapes: Mapping[str, Sequence[ThermalShape]],
) -> Choice:
    """Function of each group, by the held-out temperatures; the richest where there are none."""
    chosen = {name: max(own, key=lambda s: s.parameters) for name, own in shapes.items()}
    if not folds or all(len(own) == 1 for own in shapes.values()):
        held_out = tuple(fold.degc for fold in folds)
        return Choice(curves.fit(known, chosen), {}, held_out)
    scores: dict[str, list[float]] = {}
    for _ in range(ROUNDS_MAX):
        before = dict(chosen)
        for block in GROUPS:
            own = shapes[block.name]
            tried = [curves.score(folds, chosen | {block.name: shape}) for shape in own]
            scores[block.name] = tried
            chosen[block.name] = own[int(np.argmin(tried))]
        if chosen == before:
            break
    found = {name: _weighted(shapes[name], np.array(s)) for name, s in scores.items()}
    return Choice(curves.fit(known, chosen), found, tuple(fold.degc for fold in folds))


def _weighted(shapes: Sequence[ThermalShape], scores: FloatArray) -> tuple[Scored, ...]:
    above = scores - scores.min()
    weight = np.exp(-above / 2)
    weight /= weight.sum()
    rows = zip(shapes, above.tolist(), weight.tolist(), strict=True)
    return tuple(Scored(*row) for row in rows)
