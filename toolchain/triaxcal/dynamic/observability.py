"""Which states a motion lets see, and which it cannot separate.

The covariance of the filter needs the motion and the noise but no measured value, so that a planned
motion, simulated with any truth, tells the same as a recorded one. In units of the prior standard
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
"""Correlation of two estimates that are known only together."""


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
        Pairs whose correlation is beyond `CLOSE`, and it.
    """

    gain: FloatArray
    unseen: tuple[tuple[str, ...], ...]
    together: tuple[tuple[str, str, float], ...]


def observability(layout: Layout, covariance: FloatArray) -> Observability:
    """What the recording let see of the states of `layout`, by their covariance (n, n), SI."""
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
    pairs = np.argwhere(np.triu(np.abs(correlation) > CLOSE, 1))
    together = tuple((names[i], names[j], float(correlation[i, j])) for i, j in pairs)
    return Observability(prior / sd, tuple(unseen), together)
