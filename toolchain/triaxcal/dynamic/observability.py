"""Which states a motion determines, and which it cannot separate.

The covariance of the filter needs the motion and the noise but no measured value, so that a planned
motion, simulated with any truth, shows the same as a recorded one. In units of the prior standard
deviations, a direction of the state space whose variance the recording has left is one that it did
not see: its states cannot be separated, and their estimates are the prior's guess.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.dynamic.layout import Layout
from triaxcal.model.types import FloatArray

UNSEEN = 0.5
"""Of the prior's standard deviation: a direction that kept more than this was not seen."""
SHARE = 0.1
"""Of the squared length of a direction: states with less take no part in it."""
CLOSE = 0.99
"""Correlation of two estimates that are determined only in combination."""
BADLY = 10.0
"""Within a block: one direction is known so many times worse than the next."""


@dataclass(frozen=True)
class Weak:
    """The one direction of a block's states that is known much worse than all others.

    Attributes
    ----------
    names : tuple of str
        States that take part, with the sign: "D11", "-D22".
    unit : str
    sd_each : float
        Of what they have in common, in `unit`, root mean square over the states.
    sd_next : float
        Of the next worst direction of the block.
    why : str
        What it is and what would show it, where the block knows; or "".
    """

    names: tuple[str, ...]
    unit: str
    sd_each: float
    sd_next: float
    why: str


@dataclass(frozen=True)
class Observability:
    """What is seen.

    Attributes
    ----------
    gain : array, shape (n,)
        Prior standard deviation over the one after the recording.
    unseen : tuple of tuples of str
        Names of the states of each direction that was not seen.
    together : tuple of (str, str, float)
        Pairs whose correlation is beyond `CLOSE`, and it; besides those of `weak`.
    weak : tuple of Weak
    """

    gain: FloatArray
    unseen: tuple[tuple[str, ...], ...]
    together: tuple[tuple[str, str, float], ...]
    weak: tuple[Weak, ...]


def observability(layout: Layout, covariance: FloatArray) -> Observability:
    """What the recording determines of the states of `layout`, by their covariance (n, n), SI."""
    names = [state.name for state in layout.states]
    n = len(names)
    prior = layout.prior_sd
    covariance = covariance[:n, :n]
    scaled = covariance / np.outer(prior, prior)
    variances, directions = np.linalg.eigh(scaled)
    unseen = []
    for k in np.flatnonzero(np.sqrt(np.maximum(variances, 0.0)) > UNSEEN):
        share = directions[:, k] ** 2
        order = np.argsort(-share)
        unseen.append(tuple(names[i] for i in order if share[i] > SHARE))
    sd = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sd, sd)
    weak = tuple(w for w in _weak(layout, covariance) if _plain(w) not in map(set, unseen))
    reported = [_plain(w) for w in weak]
    pairs = [
        (i, j)
        for i, j in np.argwhere(np.triu(np.abs(correlation) > CLOSE, 1))
        if not any({names[i], names[j]} <= group for group in reported)
    ]
    together = tuple((names[i], names[j], float(correlation[i, j])) for i, j in pairs)
    return Observability(prior / sd, tuple(unseen), together, weak)


def _plain(weak: Weak) -> set[str]:
    """Its states without signs."""
    return {name.lstrip("-") for name in weak.names}


def _weak(layout: Layout, covariance: FloatArray) -> tuple[Weak, ...]:
    found = []
    for block in layout.blocks:
        units = {state.unit for state in block.states}
        if len(units) > 1 or len(block.states) < 2:
            continue
        place, per_unit = layout.place(block.name), block.states[0].per_unit
        variances, directions = np.linalg.eigh(covariance[place, place] / per_unit**2)
        second, worst = np.sqrt(np.maximum(variances[-2:], 0.0))
        part = np.flatnonzero(directions[:, -1] ** 2 > SHARE)
        if worst < BADLY * second or len(part) < 2:
            continue
        signs = directions[part, -1] * np.sign(directions[part[0], -1])
        named = tuple(
            ("-" if sign < 0 else "") + block.states[k].name
            for k, sign in zip(part, signs, strict=True)
        )
        each = float(worst) / len(part) ** 0.5
        found.append(Weak(named, block.states[0].unit, each, float(second), block.weak))
    return tuple(found)
