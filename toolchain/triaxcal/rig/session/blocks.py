"""Blocks: the samples of one second in a few numbers, sums in exact integers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from triaxcal.model.types import FloatArray, IntArray
from triaxcal.rig.bus.frames import ERR_FLAG, ID_MASK
from triaxcal.rig.samples.samples import (
    BAD_CRC,
    CONFLICT,
    DUPLICATE,
    INVALID,
    LOST_FRAME,
    ORPHAN,
    Samples,
)

_COLUMNS = ("number", "t_ns", "codes", "status", "jump")


@dataclass(frozen=True)
class Trouble:
    """What went wrong on the bus: frames counted, error frames' bits or-ed."""

    bad_crc: int = 0
    orphans: int = 0
    duplicates: int = 0
    invalid: int = 0
    lost_frames: int = 0
    conflicts: int = 0
    error_frames: int = 0
    error_bits: int = 0

    def __add__(self, other: Trouble) -> Trouble:
        return Trouble(
            self.bad_crc + other.bad_crc,
            self.orphans + other.orphans,
            self.duplicates + other.duplicates,
            self.invalid + other.invalid,
            self.lost_frames + other.lost_frames,
            self.conflicts + other.conflicts,
            self.error_frames + other.error_frames,
            self.error_bits | other.error_bits,
        )


@dataclass(frozen=True)
class Block:
    """One second of samples.

    Attributes
    ----------
    index : int
        Seconds since the first sample, by the samples' numbers.
    t_ns : int
        Arrival of its first sample.
    count, lost : int
        Samples that came and that did not.
    total : tuple of three int or float
        Sums of the codes; x, y, z. Exact of integers, rounded once of floats.
    variance : tuple of three float
        Variance of the codes about their mean, code^2.
    clipped : int
        Samples at an end of the ADC's range, on any axis.
    stuck : tuple of three bool
        The axis gave one and the same code all the time.
    jumps : int
        Samples whose counters do not fit the one before.
    status : int
        Status bytes, or-ed.
    temp_code : float or None
        Mean code of the thermometer; None when none came.
    """

    index: int
    t_ns: int
    count: int
    lost: int
    total: tuple[float, float, float]
    variance: tuple[float, float, float]
    clipped: int
    stuck: tuple[bool, bool, bool]
    jumps: int
    status: int
    temp_code: float | None
    trouble: Trouble

    @property
    def mean(self) -> FloatArray:
        """Mean codes, shape (3,)."""
        return np.array(self.total, np.float64) / self.count


class BlockBuilder:
    """Cuts samples into blocks; a block is complete when a sample of a later one comes.

    Parameters
    ----------
    code_ends : pair of int
        Lowest and highest code of the ADC; a sample there is clipped.
    """

    def __init__(self, rate_hz: int, code_ends: tuple[int, int]) -> None:
        self._rate_hz = rate_hz
        self._ends = code_ends
        self._open: dict[str, IntArray] | None = None
        nothing = np.zeros(0, np.int64)
        self._temps: tuple[IntArray, np.ndarray] = (nothing, nothing)
        self._trouble: tuple[IntArray, IntArray] = (nothing, nothing)

    def feed(self, samples: Samples) -> list[Block]:
        """Blocks that these samples complete."""
        columns = {name: getattr(samples, name) for name in _COLUMNS}
        if self._open is not None:
            columns = {n: np.concatenate([self._open[n], columns[n]]) for n in _COLUMNS}
        temps = (
            np.concatenate([self._temps[0], samples.temp_number]),
            np.concatenate([self._temps[1], samples.temp_code]),
        )
        trouble = (
            np.concatenate([self._trouble[0], samples.trouble_number]),
            np.concatenate([self._trouble[1], samples.trouble]),
        )
        if not len(columns["number"]):
            self._open, self._temps, self._trouble = columns, temps, trouble
            return []
        second = columns["number"] // self._rate_hz
        cuts = np.flatnonzero(np.diff(second)) + 1
        edges = [0, *cuts.tolist(), len(second)]
        temp_second = temps[0] // self._rate_hz
        trouble_second = trouble[0] // self._rate_hz
        blocks = []
        for start, end in pairwise(edges[:-1]):
            index = int(second[start])
            codes = temps[1][temp_second == index]
            rows = {name: column[start:end] for name, column in columns.items()}
            # What came before the first sample belongs to the first block.
            mine = trouble_second <= index
            blocks.append(self._block(index, rows, codes, trouble[1][mine]))
            trouble = (trouble[0][~mine], trouble[1][~mine])
            trouble_second = trouble_second[~mine]
        self._open = {name: column[edges[-2] :] for name, column in columns.items()}
        current = temp_second >= second[-1]
        self._temps = (temps[0][current], temps[1][current])
        self._trouble = trouble
        return blocks

    def _block(
        self, index: int, rows: dict[str, IntArray], temps: IntArray, trouble: IntArray
    ) -> Block:
        codes = rows["codes"]
        count = len(codes)
        x, y, z = (_exact(codes[:, axis]) for axis in range(3))
        return Block(
            index=index,
            t_ns=int(rows["t_ns"][0]),
            count=count,
            lost=self._rate_hz - count,
            total=(x[0], y[0], z[0]),
            variance=(x[1], y[1], z[1]),
            clipped=int(((codes <= self._ends[0]) | (codes >= self._ends[1])).any(axis=1).sum()),
            stuck=(x[2], y[2], z[2]),
            jumps=int(rows["jump"].sum()),
            status=int(np.bitwise_or.reduce(rows["status"])),
            temp_code=_sum(temps) / len(temps) if len(temps) else None,
            trouble=_trouble(trouble),
        )


def _sum(numbers: np.ndarray) -> float:
    """Sum, exact of integers and rounded once of floats, in whatever order they come."""
    return math.fsum(numbers) if numbers.dtype.kind == "f" else int(numbers.sum())


def _exact(codes: np.ndarray) -> tuple[float, float, bool]:
    """Sum and variance of codes (n,), and whether they are all one; by exact integers or sums."""
    count = len(codes)
    if codes.dtype.kind == "f":
        total = math.fsum(codes)
        squares = math.fsum((codes - total / count) ** 2)
        return total, squares / max(count - 1, 1), count > 1 and bool((codes == codes[0]).all())
    first = int(codes[0])
    away = codes - first
    total = int(away.sum())
    # Codes of 24 bits: squares of 2^48 and a few thousand of them stay in 63 bits; wider ones
    # go through Python's integers.
    wide = int(np.abs(away).max()) >= 1 << 25
    squares = sum(int(a) ** 2 for a in away) if wide else int((away * away).sum())
    spread = (squares * count - total * total) / (count * max(count - 1, 1))
    return first * count + total, spread, count > 1 and squares == 0


def _trouble(kinds: IntArray) -> Trouble:
    if not len(kinds):
        return Trouble()
    errors = kinds[kinds >= ERR_FLAG]
    return Trouble(
        bad_crc=int((kinds == BAD_CRC).sum()),
        orphans=int((kinds == ORPHAN).sum()),
        duplicates=int((kinds == DUPLICATE).sum()),
        invalid=int((kinds == INVALID).sum()),
        lost_frames=int((kinds == LOST_FRAME).sum()),
        conflicts=int((kinds == CONFLICT).sum()),
        error_frames=len(errors),
        error_bits=int(np.bitwise_or.reduce(errors)) & ID_MASK if len(errors) else 0,
    )
