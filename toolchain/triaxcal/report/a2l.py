"""triax_calib.a2l: the constants for XCP tools, as ASAM MCD-2 MC (ASAP2) 1.7.

A CHARACTERISTIC for each word of `triax_calib_t`: the temperature range, where each segment starts
and has its origin, and each coefficient. They stand at SYMBOL_LINK of the constants with their byte
offset. In a delivery the addresses are 0, and the tool that includes the fragment fills them in;
with the linked program (`codegen.elf`) they are final, and so they are for a node with
`firmware_ref/xcp`, which has MEASUREMENTs too. Of an IMU one file has both triads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from triaxcal import __version__
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.constants import Provenance
from triaxcal.codegen.elf import Linked
from triaxcal.codegen.names import names_of
from triaxcal.codegen.templates import environment
from triaxcal.delivery.firmware import Firmware
from triaxcal.device.ids import expected_for, is_node_id
from triaxcal.device.layout import CHANGE, SAMPLE
from triaxcal.fixedpoint.plan import Plan
from triaxcal.report.a2l_node import NODE_COMMANDS, Place, measurements, place_of
from triaxcal.report.a2l_words import Method, Word, plan_words
from triaxcal.unit.thermometer import TemperatureSensor

_COMMANDS = {"GET_ID": 250, "SET_MTA": 246, "UPLOAD": 245, "SHORT_UPLOAD": 244, "DOWNLOAD": 240}
"""Commands of XCP that reading and changing the constants takes, by their codes."""
_ADJUST = "byte order and alignment of the target: adjust to it"


@dataclass(frozen=True)
class XcpOnCan:
    """How a tool reaches the device.

    Attributes
    ----------
    master, slave : int
        CAN identifiers of commands and of answers; with bit 31 they are extended ones.
    bitrate : int or None
        Of the bus, in bit/s; None is not stated.
    """

    master: int
    slave: int
    bitrate: int | None = None

    @property
    def context(self) -> dict[str, int | None]:
        """The same, checked.

        Raises
        ------
        RefusedError
            For what is no identifier, the same one twice, or no bit rate.
        """
        ids = self.master, self.slave
        for wrong in (i for i in ids if not is_node_id(i)):
            raise RefusedError("CAN identifier", f"found {wrong:#x}", expected=expected_for(wrong))
        if self.master == self.slave:
            raise RefusedError(
                "CAN identifiers", f"0x{self.master:X} twice", expected="two identifiers"
            )
        if self.bitrate is not None and not 1000 <= self.bitrate <= 1_000_000:
            raise RefusedError(
                "bitrate", f"found {self.bitrate} bit/s", expected="1000 to 1000000, as CAN has"
            )
        return {"master": self.master, "slave": self.slave, "bitrate": self.bitrate}


@dataclass(frozen=True)
class Triad:
    """Constants of one triad as a tool sees them.

    Attributes
    ----------
    plan : Plan
    sensor : TemperatureSensor
    inputs_sha256 : str
        Of the constants: a part of their name.
    place : Linked, Place or None
        Where they stand in a program or a node; None leaves the addresses 0.
    """

    plan: Plan
    sensor: TemperatureSensor
    inputs_sha256: str
    place: Linked | Place | None = None

    @property
    def words(self) -> list[Word]:
        """What a tool may change."""
        return plan_words(self.plan, self.sensor)

    @property
    def name(self) -> str:
        """What every name in the file begins with."""
        return names_of(self.plan).triad.upper()

    @property
    def symbol(self) -> str:
        """Name of the constants."""
        if isinstance(self.place, Place):
            return "constants in triax_calib.bin"
        own = f"{names_of(self.plan).unit(self.inputs_sha256)}_calib_constants"
        return self.place.symbol if self.place else own


def calib_a2l(
    firmware: Firmware, linked: Linked | None = None, xcp: XcpOnCan | None = None
) -> bytes:
    """Text of the file of a unit; `linked` are its constants in a program."""
    sensor, provenance = firmware.fitted.unit.temperature_sensor, firmware.provenance
    triad = Triad(firmware.plan, sensor, provenance.inputs_sha256, linked)
    return linked_a2l((triad,), provenance, xcp)


def linked_a2l(
    triads: Sequence[Triad], provenance: Provenance, xcp: XcpOnCan | None = None
) -> bytes:
    """Text of a project with one module; `triads` are one, or accelerometer and gyro."""
    linked = triads[0].place
    assert not isinstance(linked, Place)
    little = linked is None or linked.little_endian
    context = {
        "epk_address": linked.epk_address if linked else None,
        "byte_order": "MSB_LAST" if little else "MSB_FIRST",
        "byte_order_text": "byte order of the linked program" if linked else _ADJUST,
        "commands": _COMMANDS,
        "node": None,
    }
    return _rendered(triads, provenance, [], context, xcp)


def node_a2l(firmware: Firmware, xcp: XcpOnCan) -> bytes:
    """Text of the file for a node with `firmware_ref/xcp`: what its addresses are is known."""
    signals, methods = measurements(firmware)
    plan, sensor = firmware.plan, firmware.fitted.unit.temperature_sensor
    context = {
        "epk_address": None,
        "byte_order": "MSB_LAST",
        "byte_order_text": "as the node has it, whatever its core",
        "commands": NODE_COMMANDS,
        "node": {
            "measurements": signals,
            "change_extension": CHANGE,
            "sample_extension": SAMPLE,
        },
    }
    triads = (Triad(plan, sensor, firmware.provenance.inputs_sha256, place_of(plan)),)
    return _rendered(triads, firmware.provenance, methods, context, xcp)


def _rendered(
    triads: Sequence[Triad],
    provenance: Provenance,
    methods: list[Method],
    context: dict[str, Any],
    xcp: XcpOnCan | None,
) -> bytes:
    of_words = [word.method for triad in triads for word in triad.words]
    shared = {
        "version": __version__,
        "inputs": provenance.inputs_sha256[:16],
        "serial": provenance.serial,
        "epk": provenance.epk,
        "TRIAD": triads[0].name,
        "triads": triads,
        "methods": list({m.name: m for m in [*of_words, *methods]}.values()),
        "xcp": xcp.context if xcp else None,
    }
    template = environment().get_template("a2l/triax_calib.a2l.j2")
    return template.render(shared | context).encode()
