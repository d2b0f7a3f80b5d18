"""Step of the square-root filter beside the same filter of filterpy and of plain numpy."""

from __future__ import annotations

import time
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np
from measuring import Bench, Figure, pick

from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.rootfilter import RootFilter
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import GRADES, draw_truth
from triaxcal.simulation.imu_motion import three_axes


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


def moving_numpy(rows: np.ndarray, n: int) -> tuple[float, np.ndarray]:
    """A covariance filter in numpy alone that moves only what moves, the attitude error."""
    size, one = 3 + n, np.eye(3)
    x, P = np.zeros(size), np.eye(size)
    spent = 0.0
    for row in rows:
        phi, gain = row[:3, :3], row[:3, 6:-1]
        H = np.column_stack([row[3:, 3:6], row[3:, 6:-1]])
        start = time.process_time()
        x[:3] = phi @ x[:3] + gain @ x[3:]
        moved = phi @ P[:3] + gain @ P[3:]
        P[:3, :3] = moved[:, :3] @ phi.T + moved[:, 3:] @ gain.T + one
        P[:3, 3:], P[3:, :3] = moved[:, 3:], moved[:, 3:].T
        PH = P @ H.T
        K = np.linalg.solve(H @ PH + one, PH.T).T
        x += K @ (row[3:, -1] - H @ x)
        P -= K @ PH.T
        spent += time.process_time() - start
    return spent / len(rows), x


def measure(size: str) -> list[Figure]:
    steps, rounds = pick(size, (5, 1), (1600, 3), (1600, 9))
    rng = np.random.default_rng(1)
    found = []
    for states in (24, 85):
        n = states - 3
        rows = np.zeros((steps, 6, 7 + n))
        rows[:, :3, :3], rows[:, :3, 3:6] = np.eye(3), -np.eye(3)
        rows[:, :3, 6:-1] = 0.1 * rng.standard_normal((steps, 3, n))
        rows[:, 3:, 3:] = rng.standard_normal((steps, 3, 4 + n))
        peers = {
            "plain numpy that moves the attitude alone": moving_numpy,
            "plain numpy, covariance": plain_numpy,
            **_of_filterpy(),
        }
        own: list[float] = []
        theirs: dict[str, list[float]] = {name: [] for name in peers}
        for _ in range(rounds):
            seconds, estimate = ours(rows, n)
            own.append(seconds)
            for name, peer in peers.items():
                part = rows if peer is moving_numpy else rows[: max(1, steps // 4)]
                seconds, other = peer(part, n)
                theirs[name].append(seconds)
                same = estimate if part is rows else ours(part, n)[1]
                assert np.allclose(other, same, atol=1e-6), np.abs(other - same).max()
        value = 1e6 * float(np.median(own))
        found += [
            Figure(_STEP.format(states), value, "µs", name, 1e6 * float(np.median(times)))
            for name, times in theirs.items()
        ]
    return [*found, _calibration(size)]


def _calibration(size: str) -> Figure:
    """Processor time from samples in memory to constants: survey and all passes."""
    minutes = pick(size, 2.0, 2.0, 40.0)
    motion = three_axes(minutes, still_s=15.0)
    recording = simulate_imu(draw_truth(GRADES["aviation"], 1), motion, 200.0, 1)
    samples = recording.all()
    recording = replace(recording, pieces=lambda: (samples,))
    start = time.process_time()
    calibrate_dynamic(recording, _SHEET)
    spent = time.process_time() - start
    return Figure(_WHOLE, spent * MILLION / len(samples), "s")


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
_WHOLE = "a calibration with 24 states, by 1.44 million samples"
MILLION = 1.44e6
_SHEET = DataSheet(
    0.002,
    10.0,
    accel_lsb=0.01,
    gyro_bias_instability_deg_per_h=0.0,
    accel_bias_instability_ug=0.0,
)
ENTRY = Bench(
    name="dynamic_filter",
    label="The filter of a whole IMU",
    doc="One block of samples: transition with its noise, and the measurement of three components, "
    "of a random recording. The peers hold all states in one vector and are given the same "
    "matrices. All estimates are compared. The calibration has samples in memory, and all passes.",
    measure=measure,
    figures=(*(_STEP.format(states) for states in (24, 85)), _WHOLE),
    sizes="3 x 2 min at 200 Hz, 3 x 40 min with --full",
    rank=60,
)
