"""Lines of text, of a serial port or an instrument, as frames of one message.

What a line says goes through the pipeline of CAN: its columns are the signals of a message "Line",
float64 or 32-bit integers in a payload of 64 bytes, and rig.toml names them as it names others.
The text itself stays beside the frame, and is what the evidence log keeps.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.base.keys import setting
from triaxcal.base.kinds import TEXT, line, listed, pattern, word
from triaxcal.rig.bus.frames import FD_LENGTHS, Frames
from triaxcal.rig.description.layout import FrameLayout
from triaxcal.rig.description.signals import Signal

LINE_ID = 1
"""ID of the frames that lines become."""
LINE_MESSAGE = "Line"
SKIPPED = "-"
MOST_COLUMNS = 8
_BYTES, _PAYLOAD = 8, 64
_INTEGERS = {True: ("<i", -(2**31), 2**31), False: ("<I", 0, 2**32)}
_NAME = pattern(r"-|[A-Za-z_]\w*", 'a name, or "-"', '"x"')
_NAMES = listed(_NAME, range(9), "a list of names")


@dataclass(frozen=True, kw_only=True)
class LineFormat:
    """[lines]: lines of text in place of a bus: a board on a serial port, a voltmeter.

    Attributes
    ----------
    columns
        Names of the columns in their order, "-" for one that is not used; at most 8 are used. In
        [signals] they are "Line.x" and so on.
    integers
        Columns that are whole numbers, as codes of an ADC.
    counters
        Columns that are whole numbers without a sign, as a counter, a clock, a status.
    separator
        Between two columns; " " is any white space.
    decimal
        Decimal mark.
    begin
        Texts that are sent once, after opening.
    ask
        Text that is sent for each line; without it they come by themselves.
    end
        End of a line that is sent.
    """

    columns: tuple[str, ...] = setting(
        listed(_NAME, range(3, 65), "a list of 3 to 64 names"),
        example='["x", "y", "z", "temperature"]',
    )
    integers: tuple[str, ...] = setting(_NAMES, (), words="none", example='["x", "y", "z"]')
    counters: tuple[str, ...] = setting(_NAMES, (), words="none", example='["count"]')
    separator: str = setting(TEXT, ",")
    decimal: str = setting(word((".", ",")), ".")
    begin: tuple[str, ...] = setting(
        listed(line(), range(65), "a list of texts"), (), words="none", example='["CONF:VOLT 10"]'
    )
    ask: str = setting(TEXT, "", words="none", example='"READ?"')
    end: str = setting(TEXT, "\n")

    @property
    def used(self) -> tuple[str, ...]:
        """Columns that are used."""
        return tuple(name for name in self.columns if name != SKIPPED)

    @property
    def layout(self) -> FrameLayout:
        """Layout of the message that a line becomes."""
        signals = {name: self._signal(name, i) for i, name in enumerate(self.used)}
        return FrameLayout(LINE_MESSAGE, LINE_ID, self._size, True, signals)

    @property
    def _size(self) -> int:
        size = _BYTES * len(self.used)
        return next(length for length in FD_LENGTHS if length >= size)

    def _signal(self, name: str, place: int) -> Signal:
        whole = name in (*self.integers, *self.counters)
        bits, start = 32 if whole else 64, 8 * _BYTES * place
        return Signal(name, start, bits, True, name not in self.counters, is_float=not whole)

    def payload(self, text: bytes) -> bytes:
        """Payload of a line; empty where it has another form.

        A column that is no number is NaN; without its whole numbers a line is none.
        """
        words = text.decode("ascii", "replace").strip()
        fields = words.split(None if self.separator.isspace() else self.separator)
        if len(fields) != len(self.columns):
            return b""
        values = zip(self.columns, fields, strict=True)
        packed = [self._packed(name, field) for name, field in values if name != SKIPPED]
        return b"" if b"" in packed else b"".join(packed).ljust(self._size, b"\0")

    def _packed(self, name: str, field: str) -> bytes:
        if name not in (*self.integers, *self.counters):
            return struct.pack("<d", self._number(field))
        form, low, high = _INTEGERS[name in self.integers]
        try:
            value = int(field)
        except ValueError:
            return b""
        return struct.pack(form, value).ljust(_BYTES, b"\0") if low <= value < high else b""

    def _number(self, field: str) -> float:
        try:
            value = float(field.strip().replace(self.decimal, "."))
        except ValueError:
            return math.nan
        return value if math.isfinite(value) else math.nan


def frames_of_lines(lines: LineFormat, t_ns: Sequence[int], texts: Sequence[bytes]) -> Frames:
    """Frames of lines; one that is none has a payload of no length."""
    payloads = [lines.payload(text) for text in texts]
    count = len(texts)
    data = b"".join(payload.ljust(_PAYLOAD, b"\0") for payload in payloads)
    return Frames(
        np.array(t_ns, np.int64),
        np.full(count, LINE_ID, np.uint32),
        np.array([len(payload) for payload in payloads], np.uint8),
        np.ones(count, np.bool_),
        np.frombuffer(data, np.uint8).reshape(count, _PAYLOAD),
        texts=tuple(texts),
    )
