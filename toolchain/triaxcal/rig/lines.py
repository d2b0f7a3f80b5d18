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
from triaxcal.rig.frames import Frames

LINE_ID = 1
"""ID of the frames that lines become."""
LINE_MESSAGE = "Line"
SKIPPED = "-"
MOST_COLUMNS = 8
_BYTES, _PAYLOAD = 8, 64
_INT32 = range(-(2**31), 2**31)
_NAME = pattern(r"-|[A-Za-z_]\w*", 'a name, or "-"', '"x"')


@dataclass(frozen=True, kw_only=True)
class LineFormat:
    """[lines]: lines of text in place of a bus: a serial port, a voltmeter.

    Attributes
    ----------
    columns
        Names of the columns in their order, "-" for one that is not used; at most 8 are used. In
        [signals] they are "Line.x" and so on.
    integers
        Columns that are whole numbers, as a counter.
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
        listed(_NAME, range(4, 65), "a list of 4 to 64 names"),
        example='["x", "y", "z", "temperature"]',
    )
    integers: tuple[str, ...] = setting(
        listed(_NAME, range(9), "a list of names"), (), example='["counter"]'
    )
    separator: str = setting(TEXT, ",")
    decimal: str = setting(word((".", ",")), ".")
    begin: tuple[str, ...] = setting(
        listed(line(), range(65), "a list of texts"), (), example='["CONF:VOLT:DC 10"]'
    )
    ask: str = setting(TEXT, "", example='"READ?"')
    end: str = setting(TEXT, "\n")

    @property
    def used(self) -> tuple[str, ...]:
        """Columns that are used."""
        return tuple(name for name in self.columns if name != SKIPPED)

    @property
    def length(self) -> int:
        """Bytes of a payload."""
        return _BYTES * len(self.used)

    def payload(self, text: bytes) -> bytes:
        """Payload of a line; empty where it has another number of columns.

        A column that is no number is NaN, or the highest integer.
        """
        words = text.decode("ascii", "replace").strip()
        fields = words.split(None if self.separator.isspace() else self.separator)
        if len(fields) != len(self.columns):
            return b""
        values = zip(self.columns, fields, strict=True)
        return b"".join(self._packed(name, field) for name, field in values if name != SKIPPED)

    def _packed(self, name: str, field: str) -> bytes:
        if name not in self.integers:
            return struct.pack("<d", self._number(field))
        try:
            value = int(field.strip())
        except ValueError:
            value = _INT32.stop - 1
        return struct.pack("<iI", value if value in _INT32 else _INT32.stop - 1, 0)

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
        tuple(texts),
    )
