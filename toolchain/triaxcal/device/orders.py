"""Orders to a node and their answers, whatever frames are lost or come twice.

An order that gets no answer, or another one than it can have, is repeated after a SYNCH.
"""

from __future__ import annotations

import logging
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

import can

from triaxcal.base.errors import RefusedError
from triaxcal.device.master import (
    Command,
    ConstructError,
    Master,
    XcpResponseError,
    XcpTimeoutError,
    create_application_from_config,
)

T = TypeVar("T")

ATTEMPTS = 5
QUIET_S = 0.02
"""After a disturbance: what is on its way has come by then."""

_MEANINGS = {
    0x20: "it does not know the command",
    0x22: "the address is outside of what the node has",
    0x23: "the page is write-protected",
    0x24: "it has no calibration in flash",
    0x26: "the page holds no calibration that its loader accepts",
}


class SilentError(RefusedError):
    """The node gives no answer, or none that the command can have."""


class AnsweredError(RefusedError):
    """The node answers with an error of XCP."""


class Orders:
    """The way to a node behind a bus of python-can.

    Parameters
    ----------
    bus : can.BusABC
        Open; closed with the orders.
    name : str
        The node, for messages.
    request_id, response_id : int
        CAN ids of what the node takes and sends.
    answer_s : float
        Longest time for an answer, seconds.
    """

    def __init__(
        self, bus: can.BusABC, name: str, request_id: int, response_id: int, answer_s: float
    ) -> None:
        self._name, self._bus, self._answer_s = name, bus, answer_s
        settings = {
            "Transport": {"CAN": {"can_id_master": request_id, "can_id_slave": response_id}},
            "General": {"disable_error_handling": True, "diagnostics_on_failure": False},
        }
        application = create_application_from_config(settings, log_level=logging.CRITICAL)
        application.transport.timeout = answer_s
        self._master = Master("can", config=application, transport_layer_interface=bus)
        self._master.transport.connect()

    def connect(self) -> None:
        """CONNECT, as after a power cycle too."""
        self.repeat("CONNECT", self._master.connect)

    def close(self) -> None:
        """Disconnect, and close the bus."""
        with suppress(XcpTimeoutError, XcpResponseError, ConstructError, can.CanError, OSError):
            self._master.disconnect()
        self._master.close()
        self._bus.shutdown()

    def request(self, command: Command, data: bytes, size: int = 0) -> bytes:
        """The `size` bytes of an answer behind its first.

        pyxcp's own methods for reading wait for ever when an answer is too short, as that to
        another command is.
        """
        self._clear()
        answer = bytes(self._master.transport.request(command, *data))
        if len(answer) != size:
            raise ValueError(answer)
        return answer

    def repeat(self, command: str, ask: Callable[[], T]) -> T:
        """The answer to a command that may be repeated."""
        refused: RefusedError | None = None
        for _ in range(ATTEMPTS):
            try:
                return ask()
            except XcpTimeoutError:
                refused = self._silent(command, f"no answer within {self._answer_s:g} s")
            except XcpResponseError as error:
                refused = self._answered(command, error)
            except (ConstructError, struct.error, ValueError, IndexError, TypeError):
                refused = self._silent(command, "an answer that belongs to another command")
            except (can.CanError, OSError) as error:
                raise RefusedError(self._name, f"the bus cannot be written: {error}") from error
            if command != "CONNECT":  # before which SYNCH has no answer
                self.synchronise()
        assert refused is not None
        raise refused

    def synchronise(self) -> None:
        """Have the node answer a SYNCH, whose answer is that of no other command."""
        for _ in range(2):
            time.sleep(QUIET_S)
            self._clear()
            with suppress(XcpTimeoutError, XcpResponseError, ConstructError):
                if bytes(self._master.transport.request(Command.SYNCH)) == b"\0":
                    break

    def _answered(self, command: str, error: XcpResponseError) -> AnsweredError:
        code = error.get_error_code()
        meaning = _MEANINGS.get(int(code), "see the XCP standard")
        return AnsweredError(f"{self._name}, {command}", f"the node answers {code}: {meaning}")

    def _silent(self, command: str, found: str) -> SilentError:
        return SilentError(
            f"{self._name}, {command}",
            f"{found}, {ATTEMPTS} times",
            remedy="check the node's power, its bit rate, --request-id and --response-id",
        )

    def _clear(self) -> None:
        """Forget answers that nobody waits for."""
        self._master.transport.resQueue.clear()
