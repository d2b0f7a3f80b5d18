"""Texts over VISA: SCPI and its like, on Ethernet, USB, GPIB or a serial line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from triaxcal.base.keys import setting
from triaxcal.base.kinds import FLAG, TEXT, line
from triaxcal.rig.hands.instrument import Driver, Order, filled, numbers_in
from triaxcal.rig.hands.visa import Visa


@dataclass(frozen=True)
class _Settings:
    """Keys of the driver.

    Attributes
    ----------
    scpi_resource
        Driver scpi: VISA resource.
    scpi_library
        Driver scpi: VISA library: "@py" is pyvisa-py, "" the maker's.
    scpi_set
        Driver scpi: text that gives the order.
    scpi_answers
        Driver scpi: it answers to the order, as with OK.
    scpi_read
        Driver scpi: question for what is.
    scpi_end
        Driver scpi: end of a line.
    """

    scpi_resource: str = setting(line(), "", example='"TCPIP::192.168.1.20::5025::SOCKET"')
    scpi_library: str = setting(TEXT, "@py")
    scpi_set: str = setting(line(), "", example='"TEMP {degc:.2f}"')
    scpi_answers: bool = setting(FLAG, False)
    scpi_read: str = setting(line(), "", example='"TEMP?"')
    scpi_end: str = setting(TEXT, "\n")


class _Scpi:
    """One VISA resource."""

    def __init__(self, settings: _Settings, timeout_s: float) -> None:
        self._settings = settings
        self._visa = Visa(
            settings.scpi_resource, settings.scpi_library, settings.scpi_end, timeout_s
        )

    def write(self, order: Order) -> None:
        """Send the text that sets."""
        text = filled(self._settings.scpi_set, order)
        if self._settings.scpi_answers:
            self._visa.query(text)
        else:
            self._visa.write(text)

    def read(self) -> tuple[float, ...]:
        """Numbers of the answer."""
        asked = self._settings.scpi_read
        return numbers_in(self._visa.query(asked), asked)

    def close(self) -> None:
        """Close the resource."""
        self._visa.close()


def _open(settings: Any, timeout_s: float) -> _Scpi:
    return _Scpi(settings, timeout_s)


ENTRY = Driver(
    "scpi",
    "SCPI over VISA",
    "Texts over VISA, by PyVISA.",
    _Settings,
    _open,
    needs=("scpi_resource", "scpi_set"),
    texts=("scpi_set",),
    packages=("pyvisa",),
    reads="scpi_read",
    rank=30,
)
