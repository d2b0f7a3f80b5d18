"""Samples to the equations of blocks: attitude at the full rate, states at a few points a block.

A block is m consecutive samples, in which the unit turns by no more than about 0.2 rad. In it the
attitude C = L'^T is carried by every sample, P2 (3), and the mean of

    y = C A^-1 (f' - df0 - ...) - (0, 0, g),       A = 1 + Gamma,

is taken over every sample, P2 (8). What multiplies the states changes by a few degrees between
points and multiplies small numbers only, so it is taken at `NODES` points of the block. The
attitude error obeys P2 (6), beta' = hat(u) beta - C nu, and its values between the ends of a block
follow from both ends (the mean of a Brownian bridge), so that

    beta_1 = Phi beta_0 - G p + w
    mean y = H ((1 - l) beta_0 + l beta_1) + (F + H (G/2 - Gm)) p + v

    variance of w: N^2 T;    variance of v: a^2/T + g^2 N^2 T/12

with G the integral of C B^-1 (rate rows), Gm its mean over the block, F the mean of the force
rows, N and a the random walks of angle and velocity, and l the mean place of the samples in the
block. Taking means loses what the turn within a block averages out: less than 1.5 % of the
information of terms at twice the turning rate. It biases nothing: the rows are means as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.dynamic.blocks.attitude import (
    matrix_of,
    quaternion_of,
    quaternion_product,
    rotation_of,
    running_product,
    skew,
)
from triaxcal.dynamic.blocks.block import Signals
from triaxcal.dynamic.window import Window, inverse_of_one_plus
from triaxcal.model.types import FloatArray

NODES = 5


@dataclass(frozen=True)
class BlockEquations:
    """Equations of consecutive blocks, not yet whitened.

    Attributes
    ----------
    duration_s : array, shape (b,)
    Phi, G : arrays, shapes (b, 3, 3), (b, 3, n)
        beta_1 = Phi beta_0 - G p + w.
    G_lag : array, shape (b, 3, n)
        G/2 - Gm: what the constants add to beta in between.
    y, F : arrays, shapes (b, 3), (b, 3, n)
        Mean of (8) and its rows besides those of beta.
    y2, F2 : arrays or None
        The same for the second triad.
    C : array, shape (b + 1, 3, 3)
        L'^T at the ends of the blocks.
    turn_variance, force_variance : arrays, shape (b,)
        Of the turn, rad^2, and of the mean force, (m/s^2)^2, beyond their noise: where samples were
        lost.
    """

    duration_s: FloatArray
    Phi: FloatArray
    G: FloatArray
    G_lag: FloatArray
    y: FloatArray
    F: FloatArray
    y2: FloatArray | None
    F2: FloatArray | None
    C: FloatArray
    turn_variance: FloatArray
    force_variance: FloatArray


@dataclass(frozen=True)
class _Points:
    """Signals, and C at the same points."""

    signals: Signals
    C: FloatArray


@dataclass(frozen=True)
class _Triad:
    """An accelerometer triad: its samples, its reference constants, the kinds of its rows."""

    samples: FloatArray
    A_inverse: FloatArray
    bias: FloatArray
    force: str
    motion: str
    edges: str


@dataclass(frozen=True)
class _Trajectory:
    """Attitude through the blocks.

    Attributes
    ----------
    inner : array, shape (samples, 4)
        Turn since the window's start at the moment, or middle of the interval, of each force.
    nodes, force_nodes, edges : _Points
        At the nodes; the same where the forces stand for; at the ends of what the blocks' forces
        stand for. Instants stand for half an interval on each side.
    """

    inner: FloatArray
    nodes: _Points
    force_nodes: _Points
    edges: _Points


_EXACT = {"accelerometer-bias", "accelerometer-matrix", "second-bias", "second-matrix"}
"""Blocks whose reference values are taken off sample by sample, not at the nodes."""


def equations(window: Window) -> BlockEquations:
    """Equations of the blocks of a window."""
    frame = window.frame
    turns = window.turns[window.inside]
    q = running_product(quaternion_of(turns))
    ends = window.time[window.lead :: frame.block][: window.blocks + 1]
    duration = np.diff(ends)
    inner = np.concatenate([np.eye(3)[None], matrix_of(q[frame.block - 1 :: frame.block])])
    C_ends = window.outward(ends) @ inner
    path = _trajectory(window, q, turns, C_ends)
    G, G_lag = _drift_rows(window, path.nodes, duration)
    y, F = _force_rows(window, _first_triad(window), path, duration)
    y2, F2 = None, None
    if "second-matrix" in frame.layout:
        y2, F2 = _force_rows(window, _second_triad(window), path, duration)
    Phi = np.eye(3) - skew(window.about.earth) * duration[:, None, None]
    turn = window.summed(window.samples.turn_variance)
    force = window.summed(window.samples.force_variance) / frame.block**2
    return BlockEquations(duration, Phi, G, G_lag, y, F, y2, F2, C_ends, turn, force)


def _trajectory(
    window: Window, q: FloatArray, turns: FloatArray, C_ends: FloatArray
) -> _Trajectory:
    frame = window.frame
    part = frame.block // NODES
    middle = slice(part // 2 - 1, None, part)
    C = window.outward(window.time[window.inside][middle]) @ matrix_of(q[middle])
    mean_rate = window.angles[window.inside] / window.step_s[window.inside, None]
    mean_rate = mean_rate.reshape(-1, part, 3).mean(axis=1)
    degc, gyro_degc = (
        delta[window.inside].reshape(-1, part).mean(axis=1)
        for delta in (window.delta_degc, window.gyro_delta_degc)
    )
    spacing_s = part * frame.interval_s
    acceleration = np.gradient(mean_rate, spacing_s, axis=0)
    nodes = _points(window, mean_rate, C, gyro_degc)
    at = window.lead + frame.block * np.arange(window.blocks + 1)
    if frame.force_is_increment:
        q = quaternion_product(q, quaternion_of(-0.5 * turns))
        edges = _points(window, window.edge_rate(0.0), C_ends, window.delta_degc[at])
        own = _points(window, mean_rate, C, degc)
        return _Trajectory(q, nodes, _changing(own, acceleration), edges)
    half_s = frame.interval_s / 2
    edge_rate = window.edge_rate(0.5)
    later = C_ends @ rotation_of((window.edge_rate(0.0) + edge_rate) / 2 * half_s)
    edges = _points(window, edge_rate, later, window.delta_degc[at])
    C_later = C @ rotation_of(mean_rate * half_s)
    later_nodes = _points(window, mean_rate + acceleration * half_s, C_later, degc)
    return _Trajectory(q, nodes, _changing(later_nodes, acceleration), edges)


def _points(window: Window, rate: FloatArray, C: FloatArray, degc: FloatArray) -> _Points:
    """Signals whose force is gravity by the attitude: free of the accelerometers' noise."""
    g = window.frame.gravity
    turn = rate - np.einsum("nji,j->ni", C, window.about.earth)
    return _Points(Signals(rate, turn, C[:, 2, :] * g, degc, g), C)


def _changing(points: _Points, acceleration: FloatArray) -> _Points:
    return _Points(replace(points.signals, acceleration=acceleration), points.C)


def _drift_rows(
    window: Window, nodes: _Points, duration: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """G and G/2 - Gm, shapes (b, 3, n)."""
    layout = window.frame.layout
    G, G_lag = np.zeros((2, window.blocks, 3, len(layout)))
    turned = nodes.C @ window.inverse_b
    part_s = np.repeat(duration / NODES, NODES)[:, None, None]
    # Node i is seen in beta for the NODES - i - 1/2 parts that follow it.
    lag = 0.5 - (np.arange(NODES)[::-1] + 0.5) / NODES
    for block, place in layout.columns("rate"):
        assert block.rate is not None
        pieces = turned @ block.rate(nodes.signals) * part_s
        pieces = pieces.reshape(window.blocks, NODES, 3, -1)
        G[:, :, place] = pieces.sum(axis=1)
        G_lag[:, :, place] = np.einsum("bkij,k->bij", pieces, lag)
    if "north" in layout:
        G[:, [0, 1], layout.place("north")] = np.eye(2) * duration[:, None, None]
    return G, G_lag


def _first_triad(window: Window) -> _Triad:
    bias = window.part("accelerometer-bias")[:3]
    return _Triad(window.samples.force, window.inverse_a, bias, "force", "motion", "edges")


def _second_triad(window: Window) -> _Triad:
    assert window.samples.force2 is not None
    A_inverse = inverse_of_one_plus(window.part("second-matrix").reshape(3, 3))
    bias = window.part("second-bias")[:3]
    return _Triad(window.samples.force2, A_inverse, bias, "force2", "motion2", "edges2")


def _force_rows(
    window: Window, triad: _Triad, path: _Trajectory, duration: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean y (b, 3) and its rows (b, 3, n)."""
    layout, p = window.frame.layout, window.about.p
    y = _mean_force(window, triad, path.inner)
    y[:, 2] -= window.frame.gravity
    F = np.zeros((window.blocks, 3, len(layout)))
    axes = np.linalg.inv(triad.A_inverse).astype(np.float64)
    signals, C = replace(path.force_nodes.signals, triad=axes), path.force_nodes.C
    ends = replace(path.edges.signals, triad=axes)

    def mean(values: FloatArray) -> FloatArray:
        found: FloatArray = values.reshape(window.blocks, NODES, 3, -1).mean(axis=1)
        return found

    loaded = signals
    if any(np.any(p[place]) for _, place in layout.columns(triad.edges)):
        felt, jerk = _felt(window, triad, _Points(signals, C))
        signals = replace(signals, jerk=jerk)
        loaded = replace(signals, force=signals.force + felt)
    for block, place in layout.columns(triad.force):
        F[:, :, place] = mean(C @ triad.A_inverse @ getattr(block, triad.force)(loaded))
        if block.name not in _EXACT:
            y -= F[:, :, place] @ p[place]
    for block, place in layout.columns(triad.motion):
        F[:, :, place] = mean(C @ getattr(block, triad.motion)(signals))
        if getattr(block, triad.edges) is not None:
            velocity = path.edges.C @ getattr(block, triad.edges)(ends)
            F[:, :, place] += np.diff(velocity, axis=0) / duration[:, None, None]
        if block.motion_curve is None:
            y -= F[:, :, place] @ p[place]
        else:
            error = block.motion_curve(signals, p[place])
            y -= mean(np.einsum("nij,nj->ni", C, error))[:, :, 0]
    return y, F


def _felt(window: Window, triad: _Triad, nodes: _Points) -> tuple[FloatArray, FloatArray]:
    """Force besides gravity, m/s^2, and how fast it changes, m/s^3, on the instrument axes (n, 3).

    By differences between nodes: they enter times a small constant or a delay.
    """
    frame, p = window.frame, window.about.p
    signals, C = nodes.signals, nodes.C
    velocity, force = np.zeros((2, len(C), 3))
    for block, place in frame.layout.columns(triad.edges):
        velocity += getattr(block, triad.edges)(signals) @ p[place]
        force += getattr(block, triad.motion)(signals) @ p[place]
    spacing_s = frame.block // NODES * frame.interval_s
    velocity, rest = np.einsum("nij,knj->kni", C, np.stack([velocity, force]))
    outside = rest + np.gradient(velocity, spacing_s, axis=0)
    change = np.gradient(outside, spacing_s, axis=0)
    felt, jerk = np.einsum("nji,knj->kni", C, np.stack([outside, change]))
    return felt, jerk - np.cross(signals.turn, felt)


def _mean_force(window: Window, triad: _Triad, inner: FloatArray) -> FloatArray:
    """Mean of C A^-1 (f' - df0) over each block, every sample, shape (b, 3)."""
    frame, inside = window.frame, window.inside
    force = window.measured(triad.samples, frame.force_is_increment)[inside]
    force = (force - triad.bias) @ triad.A_inverse.T
    time = window.time[inside]
    if frame.force_is_increment:
        # Mean over an interval against the value at half of its turn, to second order: the arc's
        # bend, and, while the rate changes, half of the turn is not in the mean attitude.
        step = window.step_s[inside]
        turn, change = window.turns[inside], window.turn_change[inside]
        force = force - (np.cross(turn, np.cross(turn, force)) + np.cross(change, force)) / 24
        time = time - step / 2
    turned = np.einsum("nij,nj->ni", matrix_of(inner), force)
    means = turned.reshape(window.blocks, frame.block, 3).mean(axis=1)
    middle = time.reshape(window.blocks, frame.block).mean(axis=1)
    result: FloatArray = np.einsum("bij,bj->bi", window.outward(middle), means)
    return result
