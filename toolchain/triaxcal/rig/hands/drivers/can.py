"""Signals on a CAN bus: set by a message, read by a signal."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import setting
from triaxcal.base.kinds import line, listed, number, pattern
from triaxcal.base.tomltable import did_you_mean
from triaxcal.rig.hands.instrument import Driver, Order

_SIGNALS = listed(
    pattern(r"\w+\.\w+", "message.signal", '"Chamber.SetPoint"'),
    range(1, 4),
    "a list of 1 to 3 texts message.signal",
)


@dataclass(frozen=True)
class _Settings:
    """Keys of the driver.

    Attributes
    ----------
    can_bus
        Driver can: bus of the instrument, as --bus has it.
    can_dbc
        Driver can: DBC, KCD, SYM or ARXML file of its messages.
    can_set
        Driver can: signal of each number that is set. The message's other signals have their
        initial value, or 0.
    can_read
        Driver can: signal of each number that is read.
    can_period_s
        Driver can: the message is sent again after this time; 0 sends it once.
    """

    can_bus: str = setting(line(), "", example='"can1"')
    can_dbc: str = setting(line(), "", example='"chamber.dbc"')
    can_set: tuple[str, ...] = setting(_SIGNALS, (), example='["Chamber.SetPoint"]')
    can_read: tuple[str, ...] = setting(_SIGNALS, (), example='["Chamber.Temperature"]')
    can_period_s: float = setting(number(0.0, 60.0), 0.0, "s")


class _CanInstrument:
    """Messages of one instrument on a bus."""

    def __init__(self, settings: _Settings, timeout_s: float) -> None:
        from triaxcal.rig.bus.openbus import open_bus  # noqa: PLC0415

        self._settings = settings
        self._timeout_s = timeout_s
        self._messages = _messages(settings)
        fd = any(message.is_fd for message in self._messages.values())
        bus = settings.can_bus
        self._bus = open_bus(bus if ":" in bus else f"socketcan:{bus}", fd)
        self._sending: Any = None

    def write(self, order: Order) -> None:
        """Send the messages with these signals."""
        values: dict[str, dict[str, float]] = {}
        if len(self._settings.can_set) != len(order.numbers):
            raise RefusedError(
                "can_set",
                f"{len(self._settings.can_set)} signals",
                expected=f"{len(order.numbers)}, one for each number",
            )
        for place, value in zip(self._settings.can_set, order.numbers, strict=True):
            message, _, signal = place.partition(".")
            values.setdefault(message, {})[signal] = value
        self._stop()
        for name, signals in values.items():
            self._send(self._messages[name], signals)

    def _send(self, message: Any, signals: dict[str, float]) -> None:
        import can  # noqa: PLC0415

        rest = {s.name: s.initial or 0 for s in message.signals}
        try:
            frame = can.Message(
                arbitration_id=message.frame_id,
                is_extended_id=message.is_extended_frame,
                is_fd=message.is_fd,
                data=message.encode({**rest, **signals}, scaling=True),
            )
            if self._settings.can_period_s:
                self._sending = self._bus.send_periodic(frame, self._settings.can_period_s)
            else:
                self._bus.send(frame, self._timeout_s)
        except Exception as error:  # a value that does not fit, a bus that does not take it
            raise RefusedError(
                f"{self._settings.can_bus}, {message.name}", f"cannot be sent: {error}"
            ) from error

    def read(self) -> tuple[float, ...]:
        """Value of each signal from a message that comes now."""
        import can  # noqa: PLC0415

        wanted = [place.partition(".")[::2] for place in self._settings.can_read]
        found: dict[str, Any] = {}
        end = time.monotonic() + self._timeout_s
        try:
            while self._bus.recv(0) is not None:
                pass  # what has waited is old
            while any(message not in found for message, _ in wanted):
                left = end - time.monotonic()
                frame = self._bus.recv(left) if left > 0.0 else None
                if frame is None:
                    break
                frame_id = (frame.arbitration_id, frame.is_extended_id)
                for name, _ in wanted:
                    message = self._messages[name]
                    if (message.frame_id, message.is_extended_frame) == frame_id:
                        found[name] = message.decode(frame.data, decode_choices=False)
        except (can.CanError, OSError) as error:
            raise RefusedError(self._settings.can_bus, f"cannot be read: {error}") from error
        missing = sorted({message for message, _ in wanted} - set(found))
        if missing:
            raise RefusedError(
                f"{self._settings.can_bus}, {', '.join(missing)}",
                f"no message within {self._timeout_s:g} s",
            )
        return tuple(float(found[message][signal]) for message, signal in wanted)

    def close(self) -> None:
        """Shut the bus down."""
        self._stop()
        self._bus.shutdown()

    def _stop(self) -> None:
        if self._sending is not None:
            self._sending.stop()
            self._sending = None


def _messages(settings: _Settings) -> dict[str, Any]:
    """Messages that the keys name, by name."""
    from triaxcal.rig.description.busfile import read_bus_file  # noqa: PLC0415

    path = Path(settings.can_dbc)
    database: Any = read_bus_file(path).database
    return dict(_named(database, path, [*settings.can_set, *settings.can_read]))


def _named(database: Any, path: Path, places: Sequence[str]) -> Any:
    known = {m.name: m for m in database.messages}
    for place in places:
        name, _, signal = place.partition(".")
        message = known.get(name)
        signals = [s.name for s in message.signals] if message else []
        if signal not in signals:
            there = did_you_mean(signal if message else name, signals or list(known))
            raise RefusedError(str(path), f"has no {place}{there}", expected="message.signal")
        yield name, message


ENTRY = Driver(
    "can",
    "CAN signals",
    "Signals on a CAN bus, by cantools.",
    _Settings,
    _CanInstrument,
    needs=("can_bus", "can_dbc", "can_set"),
    files=("can_dbc",),
    packages=("can", "cantools"),
    reads="can_read",
    rank=50,
)
