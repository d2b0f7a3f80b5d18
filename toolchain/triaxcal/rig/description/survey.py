"""What a log says of the signals of a bus description, before anything is known of the rig.

Three signals are the axes of an accelerometer if, while it rests, the length of their vector is
one: g where their unit is known, and the same in every direction that the log has.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from triaxcal.model.types import FloatArray, IntArray
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.description import hints
from triaxcal.rig.description.description import MessageUse
from triaxcal.rig.description.layout import FrameLayout
from triaxcal.rig.description.protection import PROTECTIONS, Guard
from triaxcal.rig.description.recorded import ACCELERATIONS, CODES, VOLTAGES, folded
from triaxcal.rig.description.rows import rows_of
from triaxcal.rig.description.signals import Signal

_BLOCK_NS = 10**9
_SHORTEST_BITS = 6
"""Fewer bits are no axis."""
_MOST_OF_A_KIND = 24
"""Signals of one kind that are tried in threes: 2024 triads."""
_LEAST_BLOCKS = 3
_QUIET = 0.5
"""Share of the seconds that is taken for rest: the quietest."""
_COUNTS = 0.9
"""Share of the steps of a counter that are 1."""
_MATCHES = 0.98
"""Share of the frames whose CRC is right."""


@dataclass(frozen=True)
class Column:
    """One signal in a log.

    Attributes
    ----------
    label : str
        "Message.Signal".
    t_ns : int64 array, shape (n,)
    numbers : array, shape (n,)
        As they are sent.
    """

    label: str
    signal: Signal
    t_ns: IntArray
    numbers: np.ndarray

    @property
    def values(self) -> FloatArray:
        """Physical values."""
        return np.asarray(self.numbers * float(self.signal.scale) + self.signal.offset, np.float64)


@dataclass(frozen=True)
class Triad:
    """Three signals that may be x, y and z.

    Attributes
    ----------
    norm : float
        Median length of their vector at rest, in g where the unit is known.
    in_g : bool
        The unit is known.
    spread : float
        Standard deviation of the length from second to second at rest, over its median.
    turned_deg : float
        Largest angle between the directions at rest.
    """

    labels: tuple[str, str, str]
    norm: float
    in_g: bool
    spread: float
    turned_deg: float

    @property
    def off(self) -> float:
        """How far it is from an accelerometer at rest: 0 is one; the ranking."""
        return self.spread + (abs(self.norm - 1.0) if self.in_g else 0.0)

    @property
    def tells(self) -> bool:
        """Whether the log says anything of it: its unit is known, or it was turned."""
        return self.in_g or self.turned_deg > 20.0


@dataclass(frozen=True)
class Survey:
    """What was found.

    Attributes
    ----------
    frames : mapping
        Frames by name of message.
    triads : tuple of Triad
        The likeliest first.
    misfits, counters, statuses, crcs : tuples of str
        A sentence each.
    """

    frames: Mapping[str, int]
    triads: tuple[Triad, ...]
    misfits: tuple[str, ...]
    counters: tuple[str, ...]
    statuses: tuple[str, ...]
    crcs: tuple[str, ...]


def survey(layouts: Iterable[FrameLayout], parts: Iterable[Frames]) -> Survey:
    """Look at all signals of a bus description in the frames of a log."""
    uses = [MessageUse(layout) for layout in layouts]
    collected, misfits = _collected(uses, parts)
    columns = [c for use in uses for c in _columns(use.layout, *collected[use.name])]
    return Survey(
        frames={name: len(t_ns) for name, (t_ns, _) in collected.items() if len(t_ns)},
        triads=tuple(sorted(_triads(columns), key=lambda t: (not t.tells, t.off))),
        misfits=tuple(
            f"{name}: {count} frames have another length or kind than the {_kind(use)} described"
            for name, count in misfits.items()
            for use in uses
            if use.name == name
        ),
        counters=tuple(_counters(columns)),
        statuses=tuple(_statuses(columns)),
        crcs=tuple(_crcs(uses, collected)),
    )


Collected = dict[str, tuple[IntArray, np.ndarray]]
"""Times and payloads of each message."""


def _kind(use: MessageUse) -> str:
    return f"{use.layout.sent_bytes} bytes of {'CAN FD' if use.layout.fd else 'classic CAN'}"


def _collected(
    uses: Sequence[MessageUse], parts: Iterable[Frames]
) -> tuple[Collected, Counter[str]]:
    """Frames of each message, and how many have another length or kind than it."""
    misfits: Counter[str] = Counter()
    found: dict[str, list[tuple[IntArray, np.ndarray]]] = defaultdict(list)
    for frames in parts:
        for use in uses:
            good, bad = rows_of(use, frames, 0)
            if len(bad):
                misfits[use.name] += len(bad)
            if len(good):
                found[use.name].append((good.t_ns, good.data[:, : use.layout.size]))
    collected = {
        use.name: (
            np.concatenate([t for t, _ in found[use.name]] or [np.zeros(0, np.int64)]),
            np.concatenate(
                [d for _, d in found[use.name]] or [np.zeros((0, use.layout.size), np.uint8)]
            ),
        )
        for use in uses
    }
    return collected, misfits


def _columns(layout: FrameLayout, t_ns: IntArray, data: np.ndarray) -> Iterator[Column]:
    for name, signal in layout.signals.items():
        if signal.first_byte + signal.byte_count > layout.size:
            continue
        there = np.ones(len(t_ns), np.bool_)
        for condition in layout.multiplexed.get(name, ()):
            there &= condition.holds(data)
        if there.any():
            numbers = signal.number(np.ascontiguousarray(data[there]))
            yield Column(f"{layout.name}.{name}", signal, t_ns[there], numbers)


# ---- triads ----


def _triads(columns: Sequence[Column]) -> Iterator[Triad]:
    kinds: dict[tuple[str, bool], list[tuple[Column, dict[int, tuple[float, float]]]]]
    kinds = defaultdict(list)
    for column in columns:
        unit = folded(column.signal.unit)
        known = unit in ACCELERATIONS or unit in VOLTAGES or unit in CODES or not unit
        if known and column.signal.length >= _SHORTEST_BITS and len(column.numbers) > 1:
            in_g = ACCELERATIONS.get(unit)
            values = column.values * (in_g or 1.0)
            if np.isfinite(values).all():
                kinds[unit, bool(in_g)].append((column, _blocks(column.t_ns, values)))
    for (_, in_g), same in kinds.items():
        for three in combinations(same[:_MOST_OF_A_KIND], 3):
            if not in_g and len({_shape(column.signal) for column, _ in three}) > 1:
                continue  # of unknown units, three alike
            triad = _triad([c.label for c, _ in three], [blocks for _, blocks in three], in_g)
            if triad is not None:
                yield triad


def _shape(signal: Signal) -> tuple[int, bool, bool, float, float]:
    return signal.length, signal.signed, signal.is_float, signal.scale, signal.offset


def _blocks(t_ns: IntArray, values: FloatArray) -> dict[int, tuple[float, float]]:
    """Mean and variance of each second."""
    second = t_ns // _BLOCK_NS
    if (np.diff(second) < 0).any():  # a clock that was set back
        order = np.argsort(second, kind="stable")
        values, second = values[order], second[order]
    keys, start, count = np.unique(second, return_index=True, return_counts=True)
    means = np.add.reduceat(values, start) / count
    variances = np.add.reduceat((values - np.repeat(means, count)) ** 2, start) / count
    return dict(
        zip(keys.tolist(), zip(means.tolist(), variances.tolist(), strict=True), strict=True)
    )


def _triad(
    labels: Sequence[str], blocks: Sequence[dict[int, tuple[float, float]]], in_g: bool
) -> Triad | None:
    seconds = sorted(set(blocks[0]) & set(blocks[1]) & set(blocks[2]))
    if len(seconds) < _LEAST_BLOCKS:
        return None
    means = np.array([[b[s][0] for b in blocks] for s in seconds])
    variances = np.array([sum(b[s][1] for b in blocks) for s in seconds])
    quiet = variances <= np.quantile(variances, _QUIET)
    vectors = means[quiet]
    norms = np.linalg.norm(vectors, axis=1)
    norm = float(np.median(norms))
    if norm == 0.0:
        return None
    directions = vectors / np.maximum(norms, np.finfo(float).tiny)[:, None]
    cosines = np.clip(directions @ directions[int(np.argmin(np.abs(norms - norm)))], -1.0, 1.0)
    x, y, z = labels
    return Triad(
        labels=(x, y, z),
        norm=norm,
        in_g=in_g,
        spread=float(np.std(norms) / norm),
        turned_deg=float(np.degrees(np.arccos(cosines.min()))),
    )


# ---- counters, statuses, CRCs ----


def _counters(columns: Sequence[Column]) -> Iterator[str]:
    for column in columns:
        signal = column.signal
        if signal.is_float or signal.length > 32 or len(column.numbers) < 10:
            continue
        steps = np.diff(column.numbers) % (1 << signal.length)
        ones = float((steps == 1).mean())
        # A counter that turns early: AUTOSAR's profile 1 counts to 14.
        turns = float(((steps == 1) | (column.numbers[1:] == 0)).mean())
        name = column.label.partition(".")[2]
        if max(ones, turns) >= _COUNTS and len(np.unique(column.numbers[:64])) > 2:
            modulus = int(column.numbers.max()) + 1
            early = f", {modulus} values" if ones < turns and modulus < 1 << signal.length else ""
            yield f"{column.label} counts{early}"
        elif hints.COUNTER.search(name) and (steps == 0).all():
            yield f"{column.label} never counts: it is {column.numbers[0]} in every frame"


def _statuses(columns: Sequence[Column]) -> Iterator[str]:
    for column in columns:
        name = column.label.partition(".")[2]
        if column.signal.is_float or not len(column.numbers):
            continue
        first = int(column.numbers[0])
        same = bool((column.numbers == column.numbers[0]).all())
        if hints.VALID.search(name):
            if same and first == 0:
                yield f"{column.label} never becomes valid: it is 0 in every frame"
        elif hints.STATUS.search(name) and same and first != 0:
            yield f"{column.label} never clears: it is {first} in every frame"


def _crcs(uses: Sequence[MessageUse], collected: Collected) -> Iterator[str]:
    for use in uses:
        t_ns, data = collected[use.name]
        if len(t_ns) < 10:
            continue
        for name, signal in use.layout.signals.items():
            for protection in PROTECTIONS:
                aligned = signal.start % 8 == (0 if signal.little_endian else 7)
                if protection.data_ids or signal.length not in protection.bits or not aligned:
                    continue
                guard = Guard(signal, use.layout.frame_id)
                good = protection.crc(guard, data) == signal.raw(np.ascontiguousarray(data))
                if good.mean() >= _MATCHES and len(np.unique(signal.raw(data[:64]))) > 2:
                    yield f'{use.name}.{name} is a CRC, protection = "{protection.name}"'
