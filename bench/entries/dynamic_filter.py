"""Step of the square-root filter beside the same filter of filterpy and of plain numpy."""

from __future__ import annotations

import time
from importlib.util import find_spec
from typing import Any

import numpy as np
from measuring import Bench, Figure, pick

from triaxcal.dynamic.rootfilter import RootFilter


def ours(rows: np.ndarray, n: int) -> tuple[float, np.ndarray]:
    """Seconds a step, and the estimate."""
    made = RootFilter.of_prior(np.ones(n), np.zeros(n))
    made.restart_attitude(np.ones(3))
    start = time.process_time()
    made.run(rows, np.full(len(rows), 3))
    made.fold()
    spent = (time.process_time() - start) / len(rows)
    return spent, np.concatenate(made.estimate())


def theirs(rows: np.ndarray, n: int, kind: type[Any]) -> tuple[float, np.ndarray]:
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


def plain_numpy(rows: np.ndarray, n: int) -> tuple[float, np.ndarray]:
    """The textbook's covariance filter with Joseph's form, in numpy alone."""
    size = 3 + n
    x, P, one = np.zeros(size), np.eye(size), np.eye(size)
    spent = 0.0
    for row in rows:
        F, H = np.eye(size), np.column_stack([row[3:, 3:6], row[3:, 6:-1]])
        F[:3, :3], F[:3, 3:] = row[:3, :3], row[:3, 6:-1]
        start = time.process_time()
        x, P = F @ x, F @ P @ F.T
        P[:3, :3] += np.eye(3)
        PH = P @ H.T
        K = np.linalg.solve(H @ PH + np.eye(3), PH.T).T
        x += K @ (row[3:, -1] - H @ x)
        rest = one - K @ H
        P = rest @ P @ rest.T + K @ K.T
        spent += time.process_time() - start
    return spent / len(rows), x


def measure(size: str) -> list[Figure]:
    steps, rounds = pick(size, (5, 1), (100, 3), (400, 5))
    rng = np.random.default_rng(1)
    found = []
    for states in (24, 85):
        n = states - 3
        rows = np.zeros((steps, 6, 7 + n))
        rows[:, :3, :3], rows[:, :3, 3:6] = np.eye(3), -np.eye(3)
        rows[:, :3, 6:-1] = 0.1 * rng.standard_normal((steps, 3, n))
        rows[:, 3:, 3:] = rng.standard_normal((steps, 3, 4 + n))
        peers = {"plain numpy, covariance": plain_numpy, **_of_filterpy()}
        own: list[float] = []
        theirs: dict[str, list[float]] = {name: [] for name in peers}
        for _ in range(rounds):
            seconds, estimate = ours(rows, n)
            own.append(seconds)
            for name, peer in peers.items():
                seconds, other = peer(rows, n)
                theirs[name].append(seconds)
                assert np.allclose(other, estimate, atol=1e-6), np.abs(other - estimate).max()
        value = 1e6 * float(np.median(own))
        found += [
            Figure(_STEP.format(states), value, "µs", name, 1e6 * float(np.median(times)))
            for name, times in theirs.items()
        ]
    return found


def _of_filterpy() -> dict[str, Any]:
    """Its two filters; none where it is not installed."""
    if not find_spec("filterpy"):
        return {}
    from filterpy.kalman import KalmanFilter, SquareRootKalmanFilter  # noqa: PLC0415

    return {
        "filterpy, square root": lambda rows, n: theirs(rows, n, SquareRootKalmanFilter),
        "filterpy, covariance": lambda rows, n: theirs(rows, n, KalmanFilter),
    }


_STEP = "a step at {} states"
ENTRY = Bench(
    name="dynamic_filter",
    label="The filter of a whole IMU",
    doc="One block of samples: transition with its noise, and the measurement of three components, "
    "of a random recording. The peers hold all states in one vector and are given the same "
    "matrices. All estimates are compared.",
    measure=measure,
    figures=tuple(_STEP.format(states) for states in (24, 85)),
    sizes="100 steps, 400 with --full",
    rank=60,
)
