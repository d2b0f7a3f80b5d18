"""A recording in which the unit lies still while its temperature changes: it shows biases alone.

The filter separates nothing there: a tilt and an accelerometer's bias look the same, and so do the
Earth's rate and a gyro's bias. But the unit does not move, so that the force f = f_0 + E d and the
Earth's rate u on its axes are constant. Means over a few seconds are then linear,

    f' - f_0 = Gamma(T) f_0 + df(T) + (1 + Gamma) E d,      w' = nu(T) + D f/g + u,

with d (2), how far f_0 leans, and u (3) as unknowns of each such recording. Their normal equations
join those of the recordings that turn.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.dynamic.blocks.base import DEG_PER_H
from triaxcal.dynamic.blocks.block import AXIS, Signals, State, StateBlock
from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import MICRO_G, DataSheet
from triaxcal.dynamic.recording import INCREMENT, ImuRecording, ImuSamples
from triaxcal.dynamic.thermalnodes import Nodes
from triaxcal.dynamic.thermalparts import Information
from triaxcal.dynamic.window import gamma_matrix, inverse_of_one_plus
from triaxcal.model.types import FloatArray
from triaxcal.unit.site import EARTH_RATE_DEG_PER_H

MEAN_S = 5.0
LEANS_RAD = np.radians(1.0)
"""A unit whose force turns by less in all lies still; biases turn it by less than that."""
DRIFTS_RAD_PER_S = np.radians(5.0)
"""A gyro's bias changes by less over any temperature."""
FORCE_SD = 0.05
"""Of d, m/s^2: 5 mrad, what the constants leave of f_0."""


@dataclass(frozen=True)
class Soak:
    """Means over `MEAN_S` of a recording without a turn.

    Attributes
    ----------
    start_s : float
    degc, gyro_degc : arrays, shape (k,)
    rate, force : arrays, shape (k, 3)
        rad/s, m/s^2.
    samples : int
        Of a mean.
    """

    start_s: float
    degc: FloatArray
    gyro_degc: FloatArray
    rate: FloatArray
    force: FloatArray
    samples: int


def split_soaks(recording: ImuRecording) -> tuple[ImuRecording, tuple[Soak, ...]]:
    """The recordings that turn, and those that do not; as they are where none turns."""
    if not recording.starts_s:
        return recording, ()
    starts = np.array(recording.starts_s)
    means: list[list[tuple[float, FloatArray]]] = [[] for _ in range(len(starts) + 1)]
    length = max(1, round(MEAN_S * recording.rate_hz))
    for piece in recording.pieces():
        part = means[int(np.searchsorted(starts, piece.time_s[0], side="right"))]
        for k in range(0, len(piece) - length + 1, length):
            part.append((float(piece.time_s[k]), _mean(piece[k : k + length], recording)))
    found = [_soak(part, length) for part in means]
    soaks = tuple(soak for soak in found if soak is not None)
    if not soaks or len(soaks) == len(found):
        return recording, ()
    turning = [number for number, soak in enumerate(found) if soak is None]

    def pieces() -> list[ImuSamples]:
        numbers = ((int(np.searchsorted(starts, p.time_s[0], side="right")), p)
                   for p in recording.pieces())  # fmt: skip
        return [piece for number, piece in numbers if number in turning]

    kept = tuple(float(starts[number - 1]) for number in turning[1:])
    names = tuple(recording.names[number] for number in turning)
    return replace(recording, pieces=pieces, starts_s=kept, names=names), soaks


def _mean(samples: ImuSamples, recording: ImuRecording) -> FloatArray:
    """Temperatures of accelerometers and gyros, rate and force, shape (8,)."""
    per_rate = recording.rate_hz if recording.rate_convention == INCREMENT else 1.0
    per_force = recording.rate_hz if recording.force_convention == INCREMENT else 1.0
    own = samples.gyro_temp_degc is not None
    temps = samples.temp_degc, samples.gyro_temp_degc if own else samples.temp_degc
    degc = [np.nan if t is None else float(np.median(t)) for t in temps]
    rate, force = samples.rate.mean(axis=0) * per_rate, samples.force.mean(axis=0) * per_force
    return np.array([*degc, *rate, *force])


def _soak(part: list[tuple[float, FloatArray]], samples: int) -> Soak | None:
    if not part:
        return None
    rows = np.array([row for _, row in part])
    degc, gyro_degc, rate, force = rows[:, 0], rows[:, 1], rows[:, 2:5], rows[:, 5:]
    direction = force / np.linalg.norm(force, axis=1)[:, None]
    leans = np.arccos(np.clip(direction @ direction.mean(axis=0), -1, 1)).max()
    drifts = np.abs(rate - np.median(rate, axis=0)).max()
    if leans > LEANS_RAD or drifts > DRIFTS_RAD_PER_S or np.isnan(degc).any():
        return None
    return Soak(part[0][0], degc, gyro_degc, rate, force, samples)


def soak_blocks(soaks: tuple[Soak, ...]) -> tuple[StateBlock, ...]:
    """The unknowns of each: how f_0 leans (2), m/s^2, and the Earth's rate (3)."""
    made = []
    for number in range(1, len(soaks) + 1):
        lean = [State(f"lean{number}_{i}", "m/s^2", 1.0, FORCE_SD, f"lean {i}") for i in (1, 2)]
        rate = "deg/h", DEG_PER_H, EARTH_RATE_DEG_PER_H
        earth = [State(f"earth{number}_{i}", *rate, f"Earth, {AXIS[i]}") for i in (1, 2, 3)]
        made.append(StateBlock(f"soak-{number}", "rest", (*lean, *earth), shown=False))
    return tuple(made)


def soak_information(
    soak: Soak, block: StateBlock, layout: Layout, result: DynamicResult, nodes: Nodes
) -> dict[int, Information]:
    """What a recording at rest says of the states of `layout`, its own `block` among them.

    By node of temperature; linear about the `result`.
    """
    frame, noise, gravity = result.frame, result.noise, result.frame.gravity
    part = result.layout.part
    A = np.eye(3) + gamma_matrix(part(result.p, "accelerometer-matrix"))
    nearest = int(np.argmin(np.abs(soak.degc - nodes.t0_degc)))
    bias = part(result.p, "accelerometer-bias")[:3]
    force = inverse_of_one_plus(A - np.eye(3)) @ (soak.force[nearest] - bias)
    force *= gravity / np.linalg.norm(force)
    zero, one = np.zeros_like(soak.rate), np.ones((len(soak.degc), 1))
    of_force, of_rate = (
        layout.rows(kind, Signals(zero, zero, one * force, degc - frame.reference_degc, gravity))
        for kind, degc in (("force", soak.degc), ("rate", soak.gyro_degc))
    )
    own = layout.place(block.name)
    of_force[:, :, own.start : own.start + 2] = A @ np.linalg.svd(force[None])[2][1:].T
    of_rate[:, :, own.start + 2 : own.stop] = np.eye(3)
    node_of = np.asarray(nodes.nearest(soak.degc))
    sd, found = layout.prior_sd, {}
    for node in sorted(set(node_of.tolist())):
        at = node_of == node
        variances = _variances(noise, soak, int(at.sum()), frame.force_convention)
        matrix, vector = np.zeros((len(layout), len(layout))), np.zeros(len(layout))
        for rows, values, variance in (
            (of_force[at], soak.force[at] - force, variances[0]),
            (of_rate[at], soak.rate[at], variances[1]),
        ):
            scaled = (rows * sd).reshape(-1, len(layout))
            matrix += scaled.T @ scaled / variance
            vector += scaled.T @ values.ravel() / variance
        found[node] = Information(matrix, vector)
    return found


def _variances(noise: DataSheet, soak: Soak, count: int, convention: str) -> tuple[float, float]:
    """Of a mean's force and rate. Bias instability does not average over a node's `count` means."""
    force = noise.mean_force_variance(MEAN_S, soak.samples, convention)
    rate = noise.rate_density**2 / MEAN_S
    accel = (noise.accel_bias_instability_ug or 0.0) * MICRO_G
    gyro = (noise.gyro_bias_instability_deg_per_h or 0.0) * DEG_PER_H
    return force + count * accel**2, rate + count * gyro**2
