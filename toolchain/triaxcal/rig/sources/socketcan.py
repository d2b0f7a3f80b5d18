"""A CAN device of Linux, by the bench's own receiver."""

from __future__ import annotations

from triaxcal.rig.source import Source, SourceKind, Wanted


def _device(bus: str) -> str:
    return bus.removeprefix("socketcan:")


def _open(wanted: Wanted) -> Source:
    from triaxcal.rig.socketcan import SocketSource, can_socket  # noqa: PLC0415

    device = _device(wanted.bus)
    return SocketSource(device, lambda: can_socket(device, wanted.fd))


ENTRY = SourceKind(
    name="socketcan",
    label="can0",
    doc="a CAN device of Linux",
    takes=lambda bus: not {":", ","} & set(_device(bus)),
    open=_open,
    rank=30,
)
