"""The simulated rig on a virtual bus."""

from __future__ import annotations

from triaxcal.rig.sources.source import Source, SourceKind, Wanted


def _open(wanted: Wanted) -> Source:
    from triaxcal.rig.sources.canbus import SimulatedSource  # noqa: PLC0415

    return SimulatedSource(wanted.rig())


ENTRY = SourceKind(
    name="virtual",
    label="virtual",
    doc="the simulated rig",
    takes=lambda bus: bus == "virtual",
    open=_open,
    rank=10,
    simulated=True,
)
