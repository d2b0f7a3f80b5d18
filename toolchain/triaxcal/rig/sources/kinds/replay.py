"""Frames of a log, as fast as they are read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from triaxcal.rig.sources.source import EITHER, LogEndedError, SourceKind, Wanted

if TYPE_CHECKING:
    from triaxcal.rig.bus.busload import BitRates
    from triaxcal.rig.bus.frames import Frames
    from triaxcal.rig.description.lines import LineFormat

_PREFIX = "replay:"


class LogSource:
    """Source of the frames that a log holds."""

    def __init__(self, path: Path, lines: LineFormat | None = None) -> None:
        from triaxcal.rig.logs.linelog import frames_of_log  # noqa: PLC0415
        from triaxcal.rig.logs.logfile import Left  # noqa: PLC0415

        self.name = str(path)
        self.rates: BitRates | None = None
        self._parts = frames_of_log(path, lines)
        self._new = Left
        self._left = Left()

    def read(self) -> Frames:
        """Frames of the next part of the log.

        Raises
        ------
        LogEndedError
            When the log has ended.
        RefusedError
            When the log cannot be read.
        """
        part = next(self._parts, None)
        if part is None:
            remedy = "`triaxcal rig replay` makes the records of a whole session from its log"
            raise LogEndedError(self.name, "the log has ended", remedy=remedy)
        self._left.add(part)
        return part.frames

    def notes(self) -> list[str]:
        """Lines that are no frames."""
        said, self._left = self._left.notes(self.name), self._new()
        return said

    def close(self) -> None:
        """Close the log."""
        self._parts.close()


def _open(wanted: Wanted) -> LogSource:
    return LogSource(Path(wanted.bus.removeprefix(_PREFIX)), wanted.lines)


ENTRY = SourceKind(
    name="replay",
    label="replay:LOG",
    doc="the frames of a log",
    takes=lambda bus: bus.startswith(_PREFIX),
    open=_open,
    rank=20,
    speaks=EITHER,
)
