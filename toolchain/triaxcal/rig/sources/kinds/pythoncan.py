"""Any interface of python-can."""

from __future__ import annotations

from triaxcal.rig.sources.source import Source, SourceKind, Wanted


def _open(wanted: Wanted) -> Source:
    from triaxcal.rig.bus.busload import rates_of_options  # noqa: PLC0415
    from triaxcal.rig.bus.openbus import open_bus, settings_of  # noqa: PLC0415
    from triaxcal.rig.sources.canbus import BusSource  # noqa: PLC0415

    source = BusSource(open_bus(wanted.bus, wanted.fd), wanted.bus)
    source.rates = rates_of_options(settings_of(wanted.bus))
    return source


ENTRY = SourceKind(
    name="python-can",
    label="interface:channel,option=value",
    doc="anything that python-can supports, as pcan:PCAN_USBBUS1,bitrate=500000; config:lab for a "
    "section of its configuration file",
    takes=lambda bus: True,  # noqa: ARG005
    open=_open,
    rank=900,
)
