"""An instrument by VISA that answers with a line of readings: a voltmeter with scanner."""

from __future__ import annotations

from collections.abc import Sequence

from triaxcal.base.errors import UsageError
from triaxcal.base.extras import refuse_missing_packages
from triaxcal.base.tomltable import shown
from triaxcal.rig.bus.busname import channel_and_options
from triaxcal.rig.description.lines import LineFormat
from triaxcal.rig.sources.linesource import LineSource
from triaxcal.rig.sources.source import LINES, Source, SourceKind, Wanted

_PREFIX = "visa:"
_FORM = "visa:resource,library=...,timeout=..."
_TIMEOUT_S = 5.0


class _Instrument:
    """A VISA resource that is asked for each line."""

    def __init__(self, resource: str, library: str, timeout_s: float, lines: LineFormat) -> None:
        from triaxcal.rig.hands.visa import Visa  # noqa: PLC0415  optional

        self._visa = Visa(resource, library, lines.end, timeout_s)
        self._ask = lines.ask
        for text in lines.begin:
            self._visa.write(text)

    def lines(self) -> Sequence[bytes]:
        """The next line."""
        text = self._visa.query(self._ask) if self._ask else self._visa.read()
        return [text.strip().encode("ascii", "replace")]

    def close(self) -> None:
        """Close the resource."""
        self._visa.close()


def _open(wanted: Wanted) -> Source:
    refuse_missing_packages(wanted.bus, ("pyvisa",), "instruments")
    assert wanted.lines is not None
    lines = wanted.lines
    resource, options = channel_and_options(wanted.bus.removeprefix(_PREFIX), _FORM)
    library = options.pop("library", "@py")
    try:
        timeout_s = float(options.pop("timeout", _TIMEOUT_S))
    except ValueError as error:
        raise UsageError("--bus", "timeout is no number", expected=_FORM) from error
    if options:
        raise UsageError("--bus", f"found {shown(next(iter(options)))}", expected=_FORM)
    return LineSource(resource, lines, lambda: _Instrument(resource, library, timeout_s, lines))


ENTRY = SourceKind(
    name="visa",
    label="visa:resource",
    doc="an instrument by VISA that answers with a line of readings, as visa:GPIB0::22::INSTR",
    takes=lambda bus: bus.startswith(_PREFIX),
    open=_open,
    rank=50,
    speaks=LINES,
)
