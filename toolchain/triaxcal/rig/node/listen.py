"""A node with a sensor of its own: its raw codes and its results, bit for bit.

The node sends RIG_TEMP, RIG_XY and RIG_Z, or RIG_FD, as every unit on the bench does, and COMP_X,
COMP_Y and COMP_Z with the same Sequence behind them, and COMP_ANGLE_0 and COMP_ANGLE_1 if the unit
has angles. The temperature is that of the last RIG_TEMP before RIG_Z. When one of them is lost,
which only its successor's Sequence shows, the samples between are not compared.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.description.dbc import RigDbc
from triaxcal.rig.description.identity import serial_crc
from triaxcal.rig.node.fil import (
    ANSWER_S,
    Agreement,
    Routine,
    refuse_difference,
    result_signals,
)
from triaxcal.rig.sources.port import Port

_SIGNALS = {
    "RIG_XY": ("Sequence", "AccelX", "AccelY"),
    "RIG_Z": ("Sequence", "AccelZ"),
    "RIG_TEMP": ("Sequence", "TempCode"),
    "RIG_FD": ("Sequence", "AccelX", "AccelY", "AccelZ", "TempCode"),
    "RIG_IDENT": ("Sequence", "SerialCrc"),
}
_TURN = 256
"""Sequence of the results is one byte."""
_BEHIND = 16
"""Samples by which a result may be late: after a turn, another sample has its Sequence."""


Whole = tuple[int, tuple[int, int, int], list[int], list[int]]
"""Temperature code, raw codes, results and status."""


@dataclass
class _Temperature:
    """A RIG_TEMP; `was_last` says whether no other was lost behind it, once that is known."""

    code: int
    sequence: int
    was_last: bool | None = None
    waiting: list[Whole] = field(default_factory=list)


@dataclass
class _Sample:
    temp: _Temperature
    raw: tuple[int, int, int]
    results: dict[str, tuple[int, int]] = field(default_factory=dict)


class Pairing:
    """Samples of a node whose results have come.

    Attributes
    ----------
    whole : list of Whole
        In their order.
    seen : int
        Samples whose raw codes have come, with a temperature before them.
    lost : int
        Samples of which a frame did not come.
    spoiled : int
        Frames with a wrong length or CRC.
    results : tuple of str
        Messages with the results of a sample.
    """

    def __init__(self, dbc: RigDbc, serial: str) -> None:
        self.whole: list[Whole] = []
        self.seen = self.lost = self.spoiled = 0
        self.results = tuple(result_signals(dbc))
        results = {n: ("Sequence", s, "Status") for n, s in result_signals(dbc).items()}
        self._signals = {**_SIGNALS, **results}
        self._layouts = {dbc.messages[n].frame_id: dbc.messages[n] for n in self._signals}
        self._serial = serial
        self._temp: _Temperature | None = None
        self._xy: tuple[int, int, int] | None = None
        self._open: dict[int, _Sample] = {}

    def feed(self, frames: Frames) -> None:
        """Take frames in the order of their arrival.

        Raises
        ------
        RefusedError
            When the node says another serial number.
        """
        rows: list[tuple[int, str, list[int]]] = []
        for frame_id, layout in self._layouts.items():
            places = np.flatnonzero(frames.can_id == frame_id)
            mine = frames.take(places)
            good = layout.valid(mine)
            self.spoiled += int((~good).sum())
            if not good.any():
                continue
            data = mine.data[good]
            table = [layout.raw(signal, data) for signal in self._signals[layout.name]]
            columns = np.column_stack(table).tolist()
            rows += zip(places[good].tolist(), [layout.name] * len(columns), columns, strict=True)
        for _, name, values in sorted(rows):
            self._take(name, values)

    def _take(self, name: str, values: list[int]) -> None:
        sequence, *rest = values
        if name == "RIG_TEMP":
            self._warm(sequence, rest[0])
        elif name == "RIG_XY":
            self.lost += self._xy is not None
            self._xy = (sequence, rest[0], rest[1])
        elif name == "RIG_Z":
            if self._xy is None or self._xy[0] != sequence:
                self.lost += 1
            elif self._temp is not None:
                self._begin(sequence, self._temp, (self._xy[1], self._xy[2], rest[0]))
            self._xy = None
        elif name == "RIG_FD":
            temp = _Temperature(rest[3], 0, was_last=True)
            self._begin(sequence % _TURN, temp, (rest[0], rest[1], rest[2]))
        elif name == "RIG_IDENT":
            self._check(rest[0])
        else:
            self._result(name, sequence, rest[0], rest[1])

    def _warm(self, sequence: int, code: int) -> None:
        before, self._temp = self._temp, _Temperature(code, sequence)
        if before is not None:
            before.was_last = sequence == (before.sequence + 1) % _TURN
            for sample in before.waiting:
                self._keep(before, sample)

    def _keep(self, temp: _Temperature, sample: Whole) -> None:
        if temp.was_last is None:
            temp.waiting.append(sample)
        elif temp.was_last:
            self.whole.append(sample)
        else:
            self.lost += 1

    def _begin(self, sequence: int, temp: _Temperature, raw: tuple[int, int, int]) -> None:
        self.seen += 1
        for late in [s for s in self._open if not 0 < (sequence - s) % _TURN <= _BEHIND]:
            self.lost += 1
            del self._open[late]
        self._open[sequence] = _Sample(temp, raw)

    def _result(self, name: str, sequence: int, value: int, status: int) -> None:
        sample = self._open.get(sequence)
        if sample is None:
            return
        sample.results[name] = value, status
        if len(sample.results) == len(self.results):
            found = [sample.results[each] for each in self.results]
            answer = [a for a, _ in found], [s for _, s in found]
            self._keep(sample.temp, (sample.temp.code, sample.raw, *answer))
            del self._open[sequence]

    def _check(self, serial: int) -> None:
        if serial != serial_crc(self._serial):
            raise RefusedError(
                "RIG_IDENT",
                f"the node has a serial number with the CRC-32 0x{serial:08X}",
                expected=f"that of {self._serial}, 0x{serial_crc(self._serial):08X}",
                remedy="connect this unit, or name the one that is connected",
            )


def listen(port: Port, dbc: RigDbc, samples: int, routine: Routine, serial: str) -> Agreement:
    """Take samples of a node and compare each result with the routine's.

    Raises
    ------
    RefusedError
        When no results come, the node is another unit, or a bit differs.
    """
    start = heard = time.monotonic()
    pairing = Pairing(dbc, serial)
    while len(pairing.whole) < samples:
        before = len(pairing.whole)
        pairing.feed(port.receive(0.1))
        now = time.monotonic()
        if len(pairing.whole) > before:
            heard = now
        elif now - heard > ANSWER_S:
            raise _silent(pairing)
    whole = pairing.whole[:samples]
    temp = np.array([w[0] for w in whole], np.int32)
    raw = np.array([w[1] for w in whole], np.int32)
    values = np.array([w[2] for w in whole], np.int64)
    status = np.array([w[3] for w in whole], np.uint32)
    apart = np.flatnonzero((status != status[:, :1]).any(axis=1))
    if len(apart):
        raise RefusedError(f"sample {apart[0]}", "the results of a sample differ in status")
    refuse_difference(0, temp, raw, (values, status[:, 0]), routine(temp, raw))
    return Agreement(len(whole), time.monotonic() - start, pairing.lost)


def _silent(pairing: Pairing) -> RefusedError:
    found = f"{pairing.seen} samples, {len(pairing.whole)} of them with results"
    if pairing.spoiled:
        found += f", {pairing.spoiled} frames with a wrong CRC or length"
    return RefusedError(
        "the node",
        f"{found}, and no more for {ANSWER_S:g} s",
        expected=f"RIG_TEMP, RIG_XY and RIG_Z (or RIG_FD), then {', '.join(pairing.results)}",
        remedy="a node without a sensor of its own is asked: leave --listen out",
    )
