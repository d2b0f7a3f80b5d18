"""A CAN device of Linux, by the bench's own receiver."""

from __future__ import annotations

import socket

from triaxcal.base.errors import RefusedError
from triaxcal.rig.sources.source import Source, SourceKind, Wanted


def _device(bus: str) -> str:
    return bus.removeprefix("socketcan:")


def _open(wanted: Wanted) -> Source:
    from triaxcal.rig.bus.busload import rates_of_device  # noqa: PLC0415
    from triaxcal.rig.sources.socketcan import SocketSource, can_socket  # noqa: PLC0415

    device = _device(wanted.bus)
    if not hasattr(socket, "AF_CAN"):
        raise RefusedError(
            f"--bus {wanted.bus}",
            "this system has no SocketCAN",
            expected="an interface of python-can, as pcan:PCAN_USBBUS1",
        )
    source = SocketSource(device, lambda: can_socket(device, wanted.fd))
    source.rates = rates_of_device(device)
    return source


ENTRY = SourceKind(
    name="socketcan",
    label="can0",
    doc="a CAN device of Linux",
    takes=lambda bus: not {":", ","} & set(_device(bus)),
    open=_open,
    rank=30,
)
