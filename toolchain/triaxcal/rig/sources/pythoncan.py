"""Any interface of python-can."""

from __future__ import annotations

from triaxcal.rig.source import Source, SourceKind, Wanted


def _open(wanted: Wanted) -> Source:
    from triaxcal.rig.canbus import BusSource  # noqa: PLC0415
    from triaxcal.rig.openbus import open_bus  # noqa: PLC0415

    return BusSource(open_bus(wanted.bus, wanted.fd), wanted.bus)


ENTRY = SourceKind(
    name="python-can",
    label="interface:channel,option=value",
    doc="anything that python-can supports, as pcan:PCAN_USBBUS1,bitrate=500000; config:lab for a "
    "section of its configuration file",
    takes=lambda bus: True,  # noqa: ARG005
    open=_open,
    rank=900,
)
