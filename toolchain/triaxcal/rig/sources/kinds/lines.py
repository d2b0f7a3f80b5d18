"""Lines of text on a serial port."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.base.extras import refuse_missing_packages
from triaxcal.base.tomltable import did_you_mean, shown
from triaxcal.rig.bus.busname import channel_and_options
from triaxcal.rig.description.lines import LineFormat
from triaxcal.rig.sources.linesource import LineSource
from triaxcal.rig.sources.source import LINES, PACE_S, WAIT_S, Source, SourceKind, Wanted

_PREFIX = "lines:"
_FORM = "lines:port,option=value,..."
_LONGEST = 4096
"""Bytes without an end of a line: another bit rate gives such."""
_ASK_S = 1.0
"""An answer to `ask` has to come within this time; then it is asked again."""
_OPTIONS = {
    "baudrate": int,
    "bytesize": int,
    "parity": str,
    "stopbits": float,
    "xonxoff": int,
    "rtscts": int,
    "dsrdtr": int,
}
"""Options of pyserial's class, with their types."""


class _SerialPort:
    """A serial port, and what has come of a line."""

    def __init__(self, port: Any, lines: LineFormat) -> None:
        self._port = port
        self._lines = lines
        self._rest = b""
        self._asked: float | None = None
        for text in lines.begin:
            self._send(text)

    def lines(self) -> Sequence[bytes]:
        """Lines that have come."""
        self._ask()
        came = self._port.read(1)
        if came:
            time.sleep(PACE_S)
            came += self._port.read(self._port.in_waiting)
        *whole, self._rest = (self._rest + came).replace(b"\r", b"\n").split(b"\n")
        if len(self._rest) > _LONGEST:
            whole, self._rest = [*whole, self._rest], b""
        found = [text for text in whole if text]
        if found:
            self._asked = None
        return found

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def _ask(self) -> None:
        now = time.monotonic()
        if self._lines.ask and (self._asked is None or now - self._asked > _ASK_S):
            self._send(self._lines.ask)
            self._asked = now

    def _send(self, text: str) -> None:
        self._port.write((text + self._lines.end).encode("ascii"))


def _connected(name: str, options: dict[str, Any], lines: LineFormat) -> _SerialPort:
    import serial  # noqa: PLC0415  optional
    from serial.tools import list_ports  # noqa: PLC0415  optional

    try:
        port = serial.serial_for_url(name, timeout=WAIT_S, write_timeout=1.0, **options)
        return _SerialPort(port, lines)
    except (OSError, ValueError) as error:
        found = ", ".join(port.device for port in list_ports.comports()) or "none found"
        raise RefusedError(
            name, f"cannot be opened: {error}", remedy=f"serial ports: {found}"
        ) from error


def _open(wanted: Wanted) -> Source:
    refuse_missing_packages(wanted.bus, ("serial",), "instruments")
    assert wanted.lines is not None
    lines = wanted.lines
    name, given = channel_and_options(wanted.bus.removeprefix(_PREFIX), _FORM)
    options = {option: _value(option, text) for option, text in given.items()}
    return LineSource(name, lines, lambda: _connected(name, options, lines))


def _value(option: str, text: str) -> Any:
    if option not in _OPTIONS:
        raise UsageError(
            "--bus",
            f"found {shown(option)}{did_you_mean(option, _OPTIONS)}",
            expected=f"{_FORM}, option one of " + ", ".join(_OPTIONS),
        )
    try:
        return _OPTIONS[option](text)
    except ValueError as error:
        raise UsageError("--bus", f"found {option}={text}", expected="a number") from error


ENTRY = SourceKind(
    name="lines",
    label="lines:port,option=value",
    doc="lines of text on a serial port, as lines:/dev/ttyUSB0,baudrate=115200",
    takes=lambda bus: bus.startswith(_PREFIX),
    open=_open,
    rank=40,
    speaks=LINES,
)
