"""Step of the square-root filter against the same filter written with filterpy, in one run.

A step is one block of samples: transition of beta with its noise, and the measurement of three
components, at 24 and 85 states, with the rows of a random recording. filterpy's square-root and
plain filters hold all states in one vector. Both are given the same matrices, built beforehand.

    pip install filterpy && python bench/dynamic_filter.py
"""

from __future__ import annotations

import time

import numpy as np
from filterpy.kalman import KalmanFilter, SquareRootKalmanFilter

from triaxcal.dynamic.rootfilter import RootFilter

STEPS = 400
ROUNDS = 5


def ours(rows: np.ndarray, n: int) -> tuple[float, np.ndarray]:
    """Seconds a step, and the estimate."""
    made = RootFilter.of_prior(np.ones(n), np.zeros(n))
    made.restart_attitude(np.ones(3))
    start = time.process_time()
    made.run(rows, np.full(len(rows), 3))
    made.fold()
    spent = (time.process_time() - start) / len(rows)
    return spent, np.concatenate(made.estimate())


def theirs(
    rows: np.ndarray, n: int, kind: type[KalmanFilter] | type[SquareRootKalmanFilter]
) -> tuple[float, np.ndarray]:
    """The same of filterpy; rows have unit noise."""
    size = 3 + n
    made = kind(dim_x=size, dim_z=3)
    made.x, made.P, made.R = np.zeros((size, 1)), np.eye(size), np.eye(3)
    q = np.zeros((size, size))
    q[:3, :3] = np.eye(3)
    # The square-root form needs a root of Q, and Cholesky a positive one.
    made.Q = q + 1e-18 * np.eye(size)
    spent = 0.0
    for row in rows:
        made.F = np.eye(size)
        made.F[:3, :3], made.F[:3, 3:] = row[:3, :3], row[:3, 6:-1]
        made.H = np.column_stack([row[3:, 3:6], row[3:, 6:-1]])
        start = time.process_time()
        made.predict()
        made.update(row[3:, -1:])
        spent += time.process_time() - start
    return spent / len(rows), made.x[:, 0]


def main() -> None:
    rng = np.random.default_rng(1)
    for states in (24, 85):
        n = states - 3
        rows = np.zeros((STEPS, 6, 7 + n))
        rows[:, :3, :3], rows[:, :3, 3:6] = np.eye(3), -np.eye(3)
        rows[:, :3, 6:-1] = 0.1 * rng.standard_normal((STEPS, 3, n))
        rows[:, 3:, 3:] = rng.standard_normal((STEPS, 3, 4 + n))
        own, square, plain = [], [], []
        for _ in range(ROUNDS):
            seconds, estimate = ours(rows, n)
            own.append(seconds)
            for kind, times in ((SquareRootKalmanFilter, square), (KalmanFilter, plain)):
                seconds, other = theirs(rows, n, kind)
                times.append(seconds)
                assert np.allclose(other, estimate, atol=1e-6), np.abs(other - estimate).max()
        base = float(np.median(own))
        print(
            f"{states} states: {base * 1e6:.0f} us a step; filterpy square root "
            f"{np.median(square) / base:.1f} times, plain {np.median(plain) / base:.1f} times"
        )


if __name__ == "__main__":
    main()
