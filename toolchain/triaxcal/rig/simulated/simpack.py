"""Payloads of the simulated rig, made by cantools.

The bench must not be checked by its own reading of a bus description. cantools encodes every bit
of every signal once; a payload is the sum of those of its bits. So the places of all bits are
cantools', and many payloads are made at once.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from cantools.database.can import Message, Signal

from triaxcal.model.types import IntArray
from triaxcal.rig.bus.frames import ByteArray

_FLOATS = {16: ("<u2", "<f2"), 32: ("<u4", "<f4"), 64: ("<u8", "<f8")}


class Packer:
    """Packs one message.

    Parameters
    ----------
    selected : mapping
        Raw values of the multiplexers.
    """

    def __init__(self, message: Message, selected: Mapping[str, int]) -> None:
        self._message = message
        self._selected = dict(selected)
        self._masks: dict[str, ByteArray] = {}
        self._base = self._encoded({})

    def pack(self, raw: Mapping[str, IntArray]) -> ByteArray:
        """Payloads (n, size) of raw integers (n,) by signal; of a float, its bits."""
        count = len(next(iter(raw.values())))
        data = np.repeat(self._base[None], count, axis=0)
        for name, numbers in raw.items():
            masks = self._of(name)
            places = np.arange(len(masks), dtype=np.uint64)
            bits = (numbers.astype(np.uint64)[:, None] >> places) & np.uint64(1)
            data += bits.astype(np.uint8) @ masks
        return data

    def _of(self, name: str) -> ByteArray:
        """What each bit of a signal adds to the payload, (bits, size)."""
        if name not in self._masks:
            signal = self._message.get_signal_by_name(name)
            rows = [
                self._encoded({name: _of_bit(signal, bit)}) ^ self._base
                for bit in range(signal.length)
            ]
            self._masks[name] = np.array(rows, np.uint8)
        return self._masks[name]

    def _encoded(self, values: Mapping[str, float]) -> ByteArray:
        zero: dict[str, float] = {s.name: 0.0 if s.is_float else 0 for s in self._message.signals}
        data = self._message.encode(
            {**zero, **self._selected, **values}, scaling=False, strict=False
        )
        return np.frombuffer(data, np.uint8)


def _of_bit(signal: Signal, bit: int) -> float:
    """Raw value of which one bit is set."""
    if signal.is_float:
        whole, kind = _FLOATS[signal.length]
        return float(np.array([1 << bit], whole).view(kind)[0])
    if signal.is_signed and bit == signal.length - 1:
        return -(1 << bit)
    return 1 << bit
