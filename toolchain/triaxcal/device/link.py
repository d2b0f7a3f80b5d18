"""One node on a bus: reading, writing and storing.

What was read or written counts only when the node's CRC over it is the same.
"""

from __future__ import annotations

import struct
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import can

from triaxcal.base.errors import RefusedError
from triaxcal.device.layout import (
    FILE,
    INFO,
    INFO_SIZE,
    INFO_VERSION,
    REQUEST_ID,
    RESPONSE_ID,
    SAMPLE,
)
from triaxcal.device.master import Command
from triaxcal.device.orders import ATTEMPTS, AnsweredError, Orders, SilentError

T = TypeVar("T")

NO_SLOT = 2
BUSY, DONE = 1, 2
"""Status of a store, as triax_store.h has it."""
ANSWER_S = 0.5
"""Longest time for an answer. Nodes answer in milliseconds."""
STORE_S = 30.0
"""Longest time for a store. Erasing a large sector takes seconds, in which a node may be silent."""
_UPLOAD, _DOWNLOAD = 7, 6
_FOR_XCP, _FOR_APPLICATION = 0x02, 0x01
_STORE_CAL_REQ = 1
_ASCII, _EPK, _VERSION = 0, 5, 128

_STORE_MEANINGS = {
    3: "its loader refuses the calibration",
    4: "the flash cannot be erased",
    5: "the flash cannot be written",
}


@dataclass(frozen=True)
class Info:
    """What a node says of itself: words of address extension 1.

    `slot` is the one in use; without one it is NO_SLOT, plus 1 and 2 for the slots that have a
    record nevertheless.
    """

    version: int
    shape: int
    file_size: int
    slot: int
    sequence: int
    store: int
    slot_size: int
    page_used: int

    @property
    def without(self) -> str:
        """Why no slot is in use; "" where one is."""
        if self.slot < NO_SLOT:
            return ""
        return {
            0: "no calibration",
            1: "a damaged calibration in slot 0, slot 1 is blank",
            2: "a damaged calibration in slot 1, slot 0 is blank",
        }.get(self.slot - NO_SLOT, "damaged calibrations in both slots")


class Link:
    """A node behind a bus of python-can, connected.

    Parameters
    ----------
    bus : can.BusABC
        Open; closed with the link.
    name : str
        The bus, for messages.
    request_id, response_id : int
        CAN ids of what the node takes and sends.
    answer_s, store_s : float
        Longest time for an answer and for a store, seconds.

    Raises
    ------
    RefusedError
        When no node answers, or the node is none of triaxcal's.
    """

    def __init__(
        self,
        bus: can.BusABC,
        name: str,
        request_id: int = REQUEST_ID,
        response_id: int = RESPONSE_ID,
        *,
        answer_s: float = ANSWER_S,
        store_s: float = STORE_S,
    ) -> None:
        self.name = f"{name}, node {request_id:#x}"
        self._store_s = store_s
        try:
            self._orders = Orders(bus, self.name, request_id, response_id, answer_s)
        except BaseException:
            bus.shutdown()
            raise
        try:
            self.connect()
        except BaseException:
            self.close()
            raise

    def connect(self) -> Info:
        """CONNECT, as after a power cycle too."""
        self._orders.connect()
        try:
            info = self.info()
        except AnsweredError as error:
            raise self._foreign(f"its answer to a read of extension {INFO} is an error") from error
        if info.version != INFO_VERSION:
            raise self._foreign(f"its information has version {info.version}")
        return info

    def _foreign(self, found: str) -> RefusedError:
        return RefusedError(
            self.name,
            f"an XCP node, but {found}",
            expected=f"firmware_ref/xcp, version {INFO_VERSION}",
            remedy="check --request-id and --response-id",
        )

    def close(self) -> None:
        """Disconnect, and close the bus."""
        self._orders.close()

    def info(self) -> Info:
        """What the node says of itself now."""
        return Info(*struct.unpack("<8I", self.read(INFO, 0, INFO_SIZE)))

    def texts(self) -> tuple[str, str, str]:
        """Serial number of the hardware, version of its firmware, EPK of the calibration in use.

        Each is "" where the node has none.
        """
        return self._text(_ASCII), self._text(_VERSION), self._text(_EPK)

    def _text(self, kind: int) -> str:
        def ask() -> bytes:
            (length,) = struct.unpack(
                "<3xI", self._orders.request(Command.GET_ID, bytes([kind]), 7)
            )
            if length > 256:
                raise ValueError(length)
            data = b""
            while len(data) < length:
                data += self._upload(min(_UPLOAD, length - len(data)))
            return data

        return self._orders.repeat("GET_ID", ask).decode(errors="replace")

    def use(self, page: int) -> None:
        """Let the application take its constants from a page."""
        self._set_page(_FOR_APPLICATION, page)

    def choose(self, page: int) -> None:
        """Read and write a page from now on."""
        self._set_page(_FOR_XCP, page)

    def _set_page(self, mode: int, page: int) -> None:
        data = bytes([mode, 0, page])
        self._orders.repeat(
            "SET_CAL_PAGE", lambda: self._orders.request(Command.SET_CAL_PAGE, data)
        )

    def read(self, extension: int, address: int, size: int) -> bytes:
        """Bytes from an address on.

        Raises
        ------
        RefusedError
            When the node gives none, or others each time.
        """
        for _ in range(ATTEMPTS):
            data = self._read_once(extension, address, size)
            # A new sample is taken where address 0 is set.
            skipped = 1 if extension == SAMPLE else 0
            if self._crc(extension, address + skipped, size - skipped) == zlib.crc32(
                data[skipped:]
            ):
                return data
            self._orders.synchronise()
        raise self._disturbed("read")

    def write(self, data: bytes) -> None:
        """Write the RAM page from its first byte on, and check its CRC."""
        for _ in range(ATTEMPTS):
            self._write_once(data)
            if self._crc(FILE, 0, len(data)) == zlib.crc32(data):
                return
            self._orders.synchronise()
        raise self._disturbed("written")

    def _disturbed(self, what: str) -> RefusedError:
        return RefusedError(
            self.name,
            f"what is {what} has another CRC in the node, {ATTEMPTS} times",
            remedy="look for a second node or master with these CAN ids",
        )

    def store(self, note: Callable[[str], None] | None = None) -> Info:
        """Have the RAM page stored in flash, and wait until it is.

        `note` gets a line when the node is silent for long.

        Raises
        ------
        RefusedError
            When the node refuses or fails, or is not ready in time.
        """
        end = time.monotonic() + self._store_s
        with suppress(SilentError):
            request = bytes([_STORE_CAL_REQ, 0, 0])
            self._orders.repeat(
                "SET_REQUEST", lambda: self._orders.request(Command.SET_REQUEST, request)
            )
        info: Info | None = None
        while info is None or info.store == BUSY:
            if time.monotonic() > end:
                raise self._not_stored("still stores" if info else "has not answered")
            try:
                info = self.info()
            except SilentError:
                info = None
                if note:
                    note(f"{self.name}: no answer; it may be erasing: {self._store_s:g} s to wait")
                note = None
        if info.store != DONE:
            raise RefusedError(
                self.name,
                f"has not stored: {_STORE_MEANINGS.get(info.store, 'no store was begun')}",
                remedy="the calibration before is still in use",
            )
        return info

    def _not_stored(self, found: str) -> RefusedError:
        return RefusedError(
            self.name,
            f"{found}, {self._store_s:g} s after the store was ordered",
            remedy="after a power-up the calibration before is in use, or the new one, never "
            "neither: check power and cable, and run the command again",
        )

    def _read_once(self, extension: int, address: int, size: int) -> bytes:
        data = b""
        while len(data) < size:
            at, count = address + len(data), min(_UPLOAD, size - len(data))
            step = self._placed(extension, at, partial(self._upload, count))
            data += self._orders.repeat("UPLOAD", step)
        return data

    def _write_once(self, data: bytes) -> None:
        for at in range(0, len(data), _DOWNLOAD):
            part = data[at : at + _DOWNLOAD]
            order = bytes([len(part)]) + part
            step = self._placed(FILE, at, partial(self._orders.request, Command.DOWNLOAD, order))
            self._orders.repeat("DOWNLOAD", step)

    def _placed(self, extension: int, address: int, then: Callable[[], T]) -> Callable[[], T]:
        """An order whose address is set before it, so that it can be repeated."""

        def run() -> T:
            place = struct.pack("<2xBI", extension, address)
            self._orders.request(Command.SET_MTA, place)
            return then()

        return run

    def _upload(self, count: int) -> bytes:
        return self._orders.request(Command.UPLOAD, bytes([count]), count)

    def _crc(self, extension: int, address: int, size: int) -> int:
        order = partial(self._orders.request, Command.BUILD_CHECKSUM, struct.pack("<3xI", size), 7)
        answer = self._orders.repeat("BUILD_CHECKSUM", self._placed(extension, address, order))
        return int.from_bytes(answer[3:7], "little")
