"""Biases that wander: bias instability and random walk as states of the filter.

Bias instability B of IEEE 952 has the two-sided density B^2/w, w the angular frequency. A sum of
independent first-order Gauss-Markov processes, each of variance s^2, whose time constants tau
have equal ratios r, has nearly this density between the corners of the shortest and the longest:

    sum_k 2 s^2 tau_k / (1 + (w tau_k)^2)  ~  (2 s^2 / ln r) int dtau / (1 + (w tau)^2)
                                           =  pi s^2 / (w ln r),   so   s^2 = B^2 ln r / pi

(the ripple is 2/cosh(pi^2 / ln r): 5.5 % at r = 10). Below the corner N^2/B^2, where the density of
the white noise N^2 is that of the flicker, flicker adds nothing to what white noise hides; the
shortest time constant is a tenth of it. The longest is `LONGEST` times the recording: what is
slower is a part of the constant. So the constant is the mean over that time, and its standard
deviation has what the recording's own mean may be off.

A random walk K has no mean. It moves the constant; what is delivered is its value at the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from triaxcal.dynamic.blocks.base import DEG_PER_H
from triaxcal.dynamic.blocks.block import AXIS, State, StateBlock, bias_rows
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import MICRO_G, DataSheet
from triaxcal.model.types import FloatArray, IntArray

FLOOR = math.sqrt(2 * math.log(2) / math.pi)
"""Allan deviation of B = 1, which is what data sheets state."""
LONGEST = 10.0
"""Of the recording's length: the longest time constant."""
RATIO_MAX = 10.0
"""Of neighbouring time constants."""
CORNER_PART = 0.1
SHORTEST_S = 1.0
"""A few blocks of samples."""
STEPS = 2.0
"""In the shortest time constant: how often states move."""
STEPS_MIN = 100
"""Of a random walk in a recording."""

FORGOTTEN = 30.0
"""Time constants after which nothing of a value is left, 1e-13; the filter divides by what is."""


@dataclass(frozen=True)
class Wander:
    """How the states of a layout move between blocks of samples.

    Attributes
    ----------
    layout : Layout
        The constants, then the Gauss-Markov states.
    constants : int
        How many states come first.
    columns : array, shape (m,)
        States that move.
    memory_s, sd : arrays, shape (m,)
        Time constant and standing deviation of the Gauss-Markov states; inf and the deviation
        after 1 s of a random walk.
    step_s : float
        How often they are moved; inf without any.
    """

    layout: Layout
    constants: int
    columns: IntArray
    memory_s: FloatArray
    sd: FloatArray
    step_s: float

    def over(self, seconds: float) -> tuple[FloatArray, FloatArray]:
        """Factor of the old values, and deviation of what is added, in a time; shapes (m,)."""
        factor = np.exp(-np.minimum(seconds / self.memory_s, FORGOTTEN))
        walks = np.isinf(self.memory_s)
        growth = np.where(walks, seconds, -np.expm1(-2 * seconds / self.memory_s))
        return factor, self.sd * np.sqrt(growth)


def wander_of(
    constants: Layout, noise: DataSheet, duration_s: float, shortest_s: float = 0.0
) -> Wander:
    """What moves beside and among the constants of a layout, in a recording of a length.

    No time constant is below `shortest_s`.
    """
    gyro = (noise.gyro_bias_instability_deg_per_h or 0.0) * DEG_PER_H / FLOOR
    accel = (noise.accel_bias_instability_ug or 0.0) * MICRO_G / FLOOR
    times_s = max(shortest_s, SHORTEST_S), LONGEST * duration_s
    made = _of_triad("rate", gyro, noise.rate_density, times_s)
    made += _of_triad("force", accel, noise.force_density(), times_s)
    if "second-bias" in constants:
        made += _of_triad("force2", accel, noise.force_density(second=True), times_s)
    layout = Layout((*constants.blocks, *(block for block, _ in made)))
    moving = [(block.name, memory_s, block.states[0].prior_sd) for block, memory_s in made]
    root_hour = 60.0  # root seconds
    walk = noise.gyro_random_walk_deg_per_h_per_sqrt_h * DEG_PER_H / root_hour
    accel_walk = noise.accel_random_walk_ug_per_sqrt_h * MICRO_G / root_hour
    for name, sd in (
        ("gyro-bias", walk),
        ("accelerometer-bias", accel_walk),
        ("second-bias", accel_walk),
    ):
        if sd and name in constants:
            moving.append((name, math.inf, sd))
    if not moving:
        none = np.empty(0)
        return Wander(layout, len(constants), none.astype(np.int64), none, none, math.inf)
    index = np.arange(len(layout))
    shortest = min(duration_s / STEPS_MIN, *(memory_s for _, memory_s, _ in moving))
    return Wander(
        layout,
        len(constants),
        np.concatenate([index[layout.place(name)] for name, _, _ in moving]),
        np.repeat([memory_s for _, memory_s, _ in moving], 3),
        np.repeat([sd for _, _, sd in moving], 3),
        shortest / STEPS,
    )


def _of_triad(
    kind: str, instability: float, density: float, times_s: tuple[float, float]
) -> list[tuple[StateBlock, float]]:
    """Gauss-Markov states of one triad, axes x, y, z for each time constant, and those."""
    least, longest = times_s
    shortest = CORNER_PART * (density / instability) ** 2 if instability else math.inf
    shortest = max(shortest, least)
    if shortest >= longest:
        return []
    steps = math.ceil(math.log(longest / shortest) / math.log(RATIO_MAX))
    ratio = (longest / shortest) ** (1 / steps)
    sd = instability * math.sqrt(math.log(ratio) / math.pi)
    made: list[tuple[StateBlock, float]] = []
    for number in range(steps + 1):
        states = tuple(
            State(f"{kind}{i}_{number}", "SI", 1.0, sd, f"{kind} {AXIS[i]}") for i in (1, 2, 3)
        )
        name = f"{kind}-wander-{number}"
        kinds: dict[str, Any] = {kind: bias_rows}
        block = StateBlock(name, name, states, **kinds)
        made.append((block, shortest * ratio**number))
    return made
