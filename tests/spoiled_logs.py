"""Logs of a simulated IMU as loggers write them: rows are lost, late, doubled, exchanged, repeated.

Each function takes the rows of a whole log, columns time, rates, forces, shape (n, 7), at
`RATE_HZ`, and gives the rows of the file.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from triaxcal.dynamic.parts import Log
from triaxcal.dynamic.repair import Repaired, repaired

RATE_HZ = 100.0
Rows = np.ndarray
RNG = np.random.default_rng


def log_of(rows: Rows, rate_hz: float | None = None, *, increments: bool = False) -> Log:
    return Log(
        "log.csv",
        "row",
        np.arange(1.0, len(rows) + 1),
        rows[:, 0].copy(),
        {"rate": rows[:, 1:4].copy(), "force": rows[:, 4:7].copy()},
        rate_hz,
        increments,
    )


def mended(rows: Rows) -> Repaired:
    return repaired([log_of(rows)])


def fastest(rows: Rows) -> int:
    """Row in the fastest turn."""
    return int(np.argmax(np.linalg.norm(rows[:, 1:4], axis=1)))


def one_lost(rows: Rows) -> Rows:
    """In the turn whose rate changes most."""
    change = np.linalg.norm(np.diff(rows[:, 1:4], axis=0), axis=1)
    return np.delete(rows, int(np.argmax(change)), 0)


def some_lost(rows: Rows) -> Rows:
    return rows[RNG(5).random(len(rows)) > 0.01]


def holes_of_50_ms(rows: Rows) -> Rows:
    speed = np.linalg.norm(rows[:, 1:4], axis=1)
    turning = np.flatnonzero(speed > 0.7 * speed.max())
    starts = turning[:: len(turning) // 6]
    return np.delete(rows, np.concatenate([np.arange(k, k + 5) for k in starts]), 0)


def jitter(rows: Rows) -> Rows:
    late = 1e-3 * RNG(6).standard_normal(len(rows))
    return np.column_stack([rows[:, 0] + late, rows[:, 1:]])


def jitter_of_3_ms(rows: Rows) -> Rows:
    """A third of a step: one row of a hundred has an earlier stamp than the row before."""
    late = 3e-3 * RNG(12).standard_normal(len(rows))
    return np.column_stack([rows[:, 0] + late, rows[:, 1:]])


def late_stamps(rows: Rows) -> Rows:
    """A busy computer: late by a millisecond, now and then by three rows."""
    late = 1e-3 * RNG(7).exponential(size=len(rows))
    late[50::97] += 0.03
    return np.column_stack([rows[:, 0] + late, rows[:, 1:]])


def jitter_and_lost(rows: Rows) -> Rows:
    return some_lost(jitter(rows))


def jitter_of_3_ms_and_lost(rows: Rows) -> Rows:
    """Stamps alone leave it open behind which of a few rows one is lost."""
    return some_lost(jitter_of_3_ms(rows))


def zeros(rows: Rows) -> Rows:
    """A driver that had no sample: zeros now and then."""
    spoiled = rows.copy()
    spoiled[RNG(13).random(len(rows)) < 0.004, 1:] = 0.0
    return spoiled


def one_far_off(rows: Rows) -> Rows:
    """An error of transmission in the fastest turn: 2000 deg/s in one sample."""
    spoiled = rows.copy()
    spoiled[fastest(rows), 1] = np.radians(2000.0)
    return spoiled


def increments_among_instants(rows: Rows) -> Rows:
    """Each tenth row has the angle since the row before in place of the rate."""
    spoiled = rows.copy()
    spoiled[::10, 1:4] /= RATE_HZ
    return spoiled


def knocked(rows: Rows) -> Rows:
    """Put down hard twenty times: one sample of 30 m/s^2, and the gyros ring."""
    spoiled = rows.copy()
    for k in range(100, len(rows) - 10, len(rows) // 20):
        spoiled[k, 4:] += 30.0
        spoiled[k : k + 4, 1:4] += 0.1 * np.array([[1.0], [-0.7], [0.4], [-0.2]])
    return spoiled


def early_stamps(rows: Rows) -> Rows:
    """Rows in order, each fiftieth stamp a row and a half early."""
    early = np.zeros(len(rows))
    early[49::50] = 0.015
    return np.column_stack([rows[:, 0] - early, rows[:, 1:]])


def coarse_stamps(rows: Rows) -> Rows:
    return np.column_stack([np.floor(rows[:, 0] * 370 + 0.3) / 370, rows[:, 1:]])


def packets_of_ten(rows: Rows) -> Rows:
    """A radio link: ten rows arrive at once, each some 20 us after the other, 3 ms sd late."""
    newest = np.minimum(np.arange(len(rows)) // 10 * 10 + 9, len(rows) - 1)
    late = np.repeat(np.abs(3e-3 * RNG(11).standard_normal(len(rows) // 10 + 1)), 10)[: len(rows)]
    after = 2e-5 * (np.arange(len(rows)) % 10)
    return np.column_stack([rows[newest, 0] + late + after, rows[:, 1:]])


def stamps_of_seconds(rows: Rows) -> Rows:
    return np.column_stack([np.floor(rows[:, 0] + 1e-9), rows[:, 1:]])


def doubled(rows: Rows) -> Rows:
    return np.repeat(rows, 1 + (RNG(8).random(len(rows)) < 0.02), axis=0)


def exchanged(rows: Rows) -> Rows:
    order = np.arange(len(rows))
    for k in range(50, len(rows) - 5, 331):
        order[[k, k + 2]] = order[[k + 2, k]]
    return rows[order]


def held_twice(rows: Rows) -> Rows:
    """The logger is twice as fast as the sensor."""
    time = np.arange(2 * len(rows)) / (2 * RATE_HZ) + rows[0, 0]
    return np.column_stack([time, np.repeat(rows[:, 1:], 2, axis=0)])


def stuck(rows: Rows) -> Rows:
    """Now and then a reading that did not arrive is the last one again."""
    spoiled = rows.copy()
    for k in (np.flatnonzero(RNG(9).random(len(rows) - 1) < 0.02) + 1).tolist():
        spoiled[k, 1:] = spoiled[k - 1, 1:]
    return spoiled


def restarted(rows: Rows) -> Rows:
    """The logger starts the sensor anew twice: its samples are then 4 ms later than before."""
    spoiled = rows.copy()
    for part in (2, 3):
        spoiled[len(rows) * part // 4 :, 0] += 0.004
    return spoiled


def held_at_250_hz(rows: Rows) -> Rows:
    """The logger asks at times of its own and gets the newest sample."""
    time = np.arange(0.0113, rows[-1, 0], 0.004)
    newest = np.searchsorted(rows[:, 0], time + 1e-9, side="right") - 1
    return np.column_stack([time, rows[newest, 1:]])


def forces_held(rows: Rows) -> Rows:
    """The accelerometers are four times slower, and the log repeats them."""
    forces = np.repeat(rows[::4, 4:], 4, axis=0)[: len(rows)]
    return np.column_stack([rows[:, :4], forces])


def forces_empty(rows: Rows) -> Rows:
    """The accelerometers are four times slower, and their cells are empty between."""
    spoiled = rows.copy()
    spoiled[np.arange(len(rows)) % 4 != 1, 4:] = np.nan
    return spoiled


def forces_between(rows: Rows) -> Rows:
    """Each sensor writes rows of its own."""
    gyros, forces = rows.copy(), rows[::3].copy()
    gyros[:, 4:], forces[:, 1:4] = np.nan, np.nan
    both = np.vstack([gyros, forces])
    return both[np.argsort(both[:, 0], kind="stable")]


Spoil = Callable[[Rows], Rows]
NOTHING_LOST: tuple[Spoil, ...] = (
    jitter,
    jitter_of_3_ms,
    late_stamps,
    early_stamps,
    coarse_stamps,
    doubled,
    exchanged,
    held_twice,
    held_at_250_hz,
)
"""Kinds after which every sample is there, at its time."""
LOST: tuple[Spoil, ...] = (one_lost, some_lost, holes_of_50_ms, jitter_and_lost)
SLOW_FORCES: tuple[Spoil, ...] = (forces_held, forces_empty, forces_between)
