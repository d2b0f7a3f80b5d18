"""Registers by Modbus TCP or RTU."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import setting
from triaxcal.base.kinds import line, listed, number, whole, word
from triaxcal.rig.hands.instrument import Driver, Order

_TYPES = ("int16", "uint16", "int32", "uint32", "float32", "float64")
_REGISTERS = listed(whole(0, 65535), range(1, 4), "a list of 1 to 3 whole numbers from 0 to 65535")
_PORT = 502


@dataclass(frozen=True)
class _Settings:
    """Keys of the driver.

    Attributes
    ----------
    modbus_address
        Driver modbus: host:port for TCP, or a serial port for RTU.
    modbus_baud
        Driver modbus: bit rate of the serial port.
    modbus_device
        Driver modbus: number of the device.
    modbus_set
        Driver modbus: holding register of each number that is set, counted from 0.
    modbus_read
        Driver modbus: register of each number that is read.
    modbus_read_from
        Driver modbus: kind of the registers that are read.
    modbus_type
        Driver modbus: type of the numbers.
    modbus_word_order
        Driver modbus: order of the registers of one number.
    modbus_per_unit
        Driver modbus: a number's steps in one unit, as 10 where 235 means 23.5.
    """

    modbus_address: str = setting(line(), "", example='"192.168.1.20:502"')
    modbus_baud: int = setting(whole(300, 4_000_000), 9600, "bit/s")
    modbus_device: int = setting(whole(0, 255), 1)
    modbus_set: tuple[int, ...] = setting(_REGISTERS, (), example="[100]")
    modbus_read: tuple[int, ...] = setting(_REGISTERS, (), example="[200]")
    modbus_read_from: str = setting(word(("holding", "input")), "holding")
    modbus_type: str = setting(word(_TYPES), "int16")
    modbus_word_order: str = setting(word(("big", "little")), "big")
    modbus_per_unit: float = setting(number(1e-6, 1e6), 1.0)


class _Modbus:
    """One device on a line."""

    def __init__(self, settings: _Settings, timeout_s: float) -> None:
        self._settings = settings
        self._client = _client(settings, timeout_s)
        self._type: Any = self._client.DATATYPE[settings.modbus_type.upper()]
        if not self._client.connect():
            raise RefusedError(settings.modbus_address, "cannot be opened: no Modbus there")

    def write(self, order: Order) -> None:
        """Write each number into its registers."""
        settings, integer = self._settings, "int" in self._settings.modbus_type
        if len(settings.modbus_set) != len(order.numbers):
            raise RefusedError(
                "modbus_set",
                f"{len(settings.modbus_set)} registers",
                expected=f"{len(order.numbers)}, one for each number",
            )
        for register, value in zip(settings.modbus_set, order.numbers, strict=True):
            steps = value * settings.modbus_per_unit
            values = self._client.convert_to_registers(
                round(steps) if integer else steps, self._type, self._order
            )
            self._asked("write_registers", register, values)

    def read(self) -> tuple[float, ...]:
        """Number of each register that is read."""
        settings = self._settings
        count = self._type.value[1]
        found = []
        for register in settings.modbus_read:
            answer = self._asked(
                f"read_{settings.modbus_read_from}_registers", register, count=count
            )
            value = self._client.convert_from_registers(answer.registers, self._type, self._order)
            found.append(float(value) / settings.modbus_per_unit)
        return tuple(found)

    def close(self) -> None:
        """Close the line."""
        self._client.close()

    @property
    def _order(self) -> Any:
        return self._settings.modbus_word_order

    def _asked(self, what: str, register: int, *values: Sequence[int], **more: int) -> Any:
        from pymodbus.exceptions import ModbusException  # noqa: PLC0415  optional

        place = f"{self._settings.modbus_address}, register {register}"
        device = self._settings.modbus_device
        try:
            answer = getattr(self._client, what)(register, *values, device_id=device, **more)
        except ModbusException as error:
            raise RefusedError(place, f"no answer: {error}") from error
        if answer.isError():
            raise RefusedError(place, f"refused by the instrument: {answer}")
        return answer


def _client(settings: _Settings, timeout_s: float) -> Any:
    from pymodbus.client import ModbusSerialClient, ModbusTcpClient  # noqa: PLC0415  optional

    # One try: how often something is tried again is the bench's decision.
    address, options = settings.modbus_address, {"timeout": timeout_s, "retries": 0}
    host, colon, port = address.rpartition(":")
    if address.startswith("/") or address.upper().startswith("COM"):
        return ModbusSerialClient(address, baudrate=settings.modbus_baud, **options)
    return ModbusTcpClient(
        host if colon else address, port=int(port) if colon else _PORT, **options
    )


ENTRY = Driver(
    "modbus",
    "Modbus",
    "Registers by Modbus TCP or RTU, by pymodbus.",
    _Settings,
    _Modbus,
    needs=("modbus_address", "modbus_set"),
    packages=("pymodbus",),
    reads="modbus_read",
    rank=40,
)
