"""How likely a recording is for other bias instabilities, without another pass through it.

A pass writes down what it did to the filter: the equations of each interval between two moves of
the wandering states, and what was forgotten or fed back. All of that is linear and does not depend
on how much the states wander. So the filter is run again on these few hundred intervals, with other
deviations, and the likelihood of all innovations follows from the determinants:

    -2 ln L = chi-square + ln det(information left and eliminated) - ln det(information put in).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from triaxcal.dynamic.rootfilter import RootFilter
from triaxcal.model.types import FloatArray, IntArray

Replay = Callable[[RootFilter, FloatArray], None]
"""Does one thing to a filter again; the array are factors of the deviations of all states."""


@dataclass
class Tape(RootFilter):
    """A filter that remembers what was done to it.

    Attributes
    ----------
    prior_sd, prior_mean : arrays, shape (n,)
    log : list of Replay
    """

    prior_sd: FloatArray = field(default_factory=lambda: np.empty(0))
    prior_mean: FloatArray = field(default_factory=lambda: np.empty(0))
    log: list[Replay] = field(default_factory=list)

    @classmethod
    def of_prior(cls, prior_sd: FloatArray, mean: FloatArray) -> Tape:
        """As a filter."""
        made = super().of_prior(prior_sd, mean)
        assert isinstance(made, Tape)
        made.prior_sd, made.prior_mean = prior_sd, mean
        return made

    def restart_attitude(self, sd_rad: FloatArray) -> None:
        """As a filter."""
        super().restart_attitude(sd_rad)
        self.log.append(lambda root, _: root.restart_attitude(sd_rad))

    def run(self, rows: FloatArray, freedom: IntArray) -> None:
        """As a filter; `rows` are kept as triangles."""
        super().run(rows, freedom)
        self.log.extend(partial(_run_again, np.asarray(np.linalg.qr(b, mode="r"))) for b in rows)

    def shift(self, beta: FloatArray, p: FloatArray) -> None:
        """As a filter."""
        super().shift(beta, p)
        self.log.append(lambda root, _: root.shift(beta, p))

    def diffuse(self, columns: IntArray, sd: FloatArray, factor: FloatArray | None = None) -> None:
        """As a filter."""
        super().diffuse(columns, sd, factor)
        self.log.append(lambda root, wider: root.diffuse(columns, sd * wider[columns], factor))

    def add_prior(self, columns: IntArray, sd: FloatArray, mean: FloatArray) -> None:
        """As a filter."""
        super().add_prior(columns, sd, mean)
        self.log.append(lambda root, _: root.add_prior(columns, sd, mean))

    def deviance(self, wider: FloatArray) -> float:
        """-2 ln L but for a constant, with the deviations of the states (n,) times `wider`."""
        sd = self.prior_sd * wider
        root = RootFilter.of_prior(sd, self.prior_mean * self.prior_sd / sd)
        for replay in self.log:
            replay(root, wider)
        root.fold()
        left = np.concatenate([np.diag(root.R_bb), np.diag(root.R_pp)])
        information = root.log_root + np.log(np.abs(left)).sum() + np.log(sd).sum()
        return float(root.chi_square + 2 * information)


def _run_again(block: FloatArray, root: RootFilter, _wider: FloatArray) -> None:
    root.run(block[None], np.zeros(1, dtype=np.int64))
