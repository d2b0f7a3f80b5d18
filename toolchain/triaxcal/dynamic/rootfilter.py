"""The square-root filter: attitude error that moves, constants that do not.

State x = (beta, p): the attitude error beta (3), driven by the gyro noise, and the n constants p.
What is known is kept as a triangular system

    [ R_bb  R_bp ] [ beta ]   [ z_b ]
    [  0    R_pp ] [  p   ] = [ z_p ] + unit white noise,

the square root of the information matrix (Bierman, Factorization Methods for Discrete Sequential
Estimation, chapter V; Kailath, Sayed, Hassibi, Linear Estimation, chapter 12). Only orthogonal
transformations touch it, so it stays positive definite at any length, and a state of which nothing
is known costs no large number.

Blocks are first joined in groups (`joined`). A step eliminates the old beta from its own rows, the
three rows of the transition and the rows of the measurements; the rows without beta that are left
belong to the constants alone and wait in a buffer, which a larger QR folds in from time to time.
The part of the right-hand side that no
state can explain is what the innovations of a Kalman filter are, normalised: its sum of squares is
chi-square with as many degrees of freedom as there were measurements.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import lapack, solve_triangular

from triaxcal.dynamic.joined import joined_blocks
from triaxcal.model.types import FloatArray, IntArray

BUFFER_ROWS = 512
GROUP = 8
GROUPS_MIN = 4
CHUNK = 512
"""Blocks that are joined before a step, and groups of them that make it worth while."""


@dataclass
class RootFilter:
    """Square-root information filter for beta (3) and n constants.

    Attributes
    ----------
    R_bb, R_bp, z_b : arrays, shapes (3, 3), (3, n), (3,)
    R_pp, z_p : arrays, shapes (n, n), (n,)
    chi_square, freedom : float, int
        Sum of squared normalised innovations folded in so far, and their number.
    log_root : float
        Sum of log |R_ii| of all unknowns eliminated so far, less log 1/sd of the noise of states
        that move and of new alignments. With log |R_ii| of those that are left, and of the prior,
        it is half of what a wider noise costs in the likelihood.
    """

    R_bb: FloatArray
    R_bp: FloatArray
    z_b: FloatArray
    R_pp: FloatArray
    z_p: FloatArray
    chi_square: float = 0.0
    freedom: int = 0
    log_root: float = 0.0
    _waiting: list[FloatArray] = field(default_factory=list)
    _count: int = 0

    @classmethod
    def of_prior(cls, prior_sd: FloatArray, mean: FloatArray) -> RootFilter:
        """Filter that knows the constants' prior and nothing of the attitude."""
        n = len(prior_sd)
        return cls(
            np.zeros((3, 3)), np.zeros((3, n)), np.zeros(3), np.diag(1 / prior_sd), mean / prior_sd
        )

    def restart_attitude(self, sd_rad: FloatArray) -> None:
        """Forget beta: a new alignment, error zero with standard deviations `sd_rad` (3,)."""
        if self.R_bb.any():
            self.log_root += float(np.log(np.abs(np.diag(self.R_bb))).sum())
        self.log_root += float(np.log(sd_rad).sum())
        self.R_bb = np.diag(1 / sd_rad)
        self.R_bp = np.zeros_like(self.R_bp)
        self.z_b = np.zeros(3)

    def run(self, rows: FloatArray, freedom: IntArray) -> None:
        """Steps over consecutive blocks of samples.

        Parameters
        ----------
        rows : array, shape (blocks, 3 + m, 7 + n)
            Whitened equations of each block in (beta before, beta after, p, right-hand side): the
            transition's three, then those of the measurements, zero where there was none.
        freedom : array, shape (blocks,)
            Number of measurement rows that are not zero.
        """
        for start in range(0, len(rows), CHUNK):
            self._chunk(rows[start : start + CHUNK])
        self.freedom += int(freedom.sum())

    def _chunk(self, rows: FloatArray) -> None:
        whole = len(rows) // GROUP * GROUP
        if whole >= GROUPS_MIN * GROUP:
            joined, log_root = joined_blocks(rows[:whole], GROUP)
            self.log_root += log_root
            self._steps(joined)
            rows = rows[whole:]
        self._steps(rows)
        if self._count >= BUFFER_ROWS:
            self.fold()

    def _steps(self, rows: FloatArray) -> None:
        """One step a block: eliminate the beta before it."""
        blocks, height, width = rows.shape
        if blocks == 0:
            return
        n = width - 7
        stack = np.zeros((3 + height, width), order="F")
        stack[:3, :3], stack[:3, 6:-1], stack[:3, -1] = self.R_bb, self.R_bp, self.z_b
        kept = np.empty((blocks, height - 3, n + 1))
        diagonal = np.empty((blocks, 3))
        lwork = 64 * width
        for b in range(blocks):
            stack[3:] = rows[b]
            factor, tau, _, _ = lapack.dgeqrf(stack[:, :6], lwork=lwork)
            turned, _, info = lapack.dormqr("L", "T", factor, tau, stack[:, 6:], lwork)
            if info:
                raise ValueError(f"dormqr: {info}")
            kept[b] = turned[6:]
            diagonal[b] = factor[0, 0], factor[1, 1], factor[2, 2]
            stack[:3, :3] = _upper(factor[3:6, 3:6])
            stack[:3, 3:6] = 0.0
            stack[:3, 6:] = turned[3:6]
        self.R_bb = stack[:3, :3].copy()
        self.R_bp, self.z_b = stack[:3, 6:-1].copy(), stack[:3, -1].copy()
        self.log_root += float(np.log(np.abs(diagonal)).sum())
        self._waiting.append(kept.reshape(-1, n + 1))
        self._count += kept.shape[0] * kept.shape[1]

    def fold(self) -> None:
        """Fold the waiting rows into R_pp."""
        if not self._waiting:
            return
        n = len(self.z_p)
        rows = np.zeros((n + self._count, n + 1), order="F")
        rows[:n, :n], rows[:n, n] = self.R_pp, self.z_p
        np.concatenate(self._waiting, out=rows[n:])
        factor, _, _, _ = lapack.dgeqrf(rows, lwork=64 * (n + 1), overwrite_a=1)
        self.R_pp, self.z_p = np.triu(factor[:n, :n]), factor[:n, n].copy()
        self.chi_square += float(factor[n, n] ** 2) if len(factor) > n else 0.0
        self._waiting, self._count = [], 0

    def estimate(self) -> tuple[FloatArray, FloatArray]:
        """Estimates of beta (3,) and p (n,)."""
        self.fold()
        p = solve_triangular(self.R_pp, self.z_p)
        beta = solve_triangular(self.R_bb, self.z_b - self.R_bp @ p)
        return beta, p

    def root_covariance(self) -> FloatArray:
        """S with S S^T the covariance of (beta, p), shape (3 + n, 3 + n)."""
        self.fold()
        root: FloatArray = solve_triangular(self._whole()[:, :-1], np.eye(3 + len(self.z_p)))
        return root

    def shift(self, beta: FloatArray, p: FloatArray) -> None:
        """Take off what was fed back: from now on x is counted from (beta, p)."""
        self.fold()
        self.z_b = self.z_b - self.R_bb @ beta - self.R_bp @ p
        self.z_p = self.z_p - self.R_pp @ p

    def diffuse(self, columns: IntArray, sd: FloatArray, factor: FloatArray | None = None) -> None:
        """Let states of `columns` move: x becomes factor x plus independent noise of `sd`.

        Without `factor` they keep their values; an `sd` of inf forgets them.
        """
        self.fold()
        whole = self._whole()
        m, n = len(columns), len(self.z_p)
        if factor is not None:
            whole[:, 3 + columns] /= factor
        noise = np.column_stack([np.diag(1 / sd), np.zeros((m, 4 + n))])
        old = np.column_stack([-whole[:, 3 + columns], whole])
        self.log_root += float(np.log(sd[np.isfinite(sd)]).sum())
        self._split(np.concatenate([noise, old]), m)

    def add_prior(self, columns: IntArray, sd: FloatArray, mean: FloatArray) -> None:
        """Add what is known beforehand of the constants of `columns`."""
        self.fold()
        rows = np.zeros((len(columns), 4 + len(self.z_p)))
        rows[np.arange(len(columns)), 3 + columns] = 1 / sd
        rows[:, -1] = mean / sd
        self._split(np.concatenate([self._whole(), rows]), 0)

    def _whole(self) -> FloatArray:
        n = len(self.z_p)
        upper = np.column_stack([self.R_bb, self.R_bp, self.z_b])
        lower = np.column_stack([np.zeros((n, 3)), self.R_pp, self.z_p])
        return np.concatenate([upper, lower])

    def _split(self, rows: FloatArray, drop: int) -> None:
        """Triangularise, drop the first unknowns, keep the rest."""
        n = len(self.z_p)
        root: FloatArray = np.asarray(np.linalg.qr(rows, mode="r"))
        self.log_root += float(np.log(np.abs(np.diag(root)[:drop])).sum())
        root = root[drop : drop + 3 + n, drop:]
        self.R_bb, self.R_bp, self.z_b = root[:3, :3], root[:3, 3:-1], root[:3, -1]
        self.R_pp, self.z_p = root[3:, 3:-1], root[3:, -1]


def _upper(square: FloatArray) -> FloatArray:
    """Upper triangle of a (3, 3) factor, without numpy's overhead."""
    square[1, 0] = square[2, 0] = square[2, 1] = 0.0
    return square
