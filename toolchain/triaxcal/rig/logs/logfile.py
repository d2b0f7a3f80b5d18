"""Frames of a log in any format: the one way in which `rig` reads a file of frames.

To add a format, put one file into rig/logs/kinds/ that defines `ENTRY`, a `LogFormat`.
"""

from __future__ import annotations

import gzip
import shutil
import tempfile
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError, reason_of, refused_by_system
from triaxcal.base.registry import Registry
from triaxcal.rig.logs.candump import Parsed
from triaxcal.rig.logs.textlog import ARCHIVE_ERRORS, damaged_archive

_GZIP = ".gz"
_HEAD_BYTES = 64
_FALLS = 0.1
"""Share of the frames with an earlier time than the one before, from which on they are no times."""
_FRAMES_PER_S = 200_000
"""More than the shortest frames of several buses."""
_FRAMES_MIN = 20
_DIFFERENCES = "the times begin at 0 and do not rise: they are differences, as of `candump -t d`"


@dataclass(frozen=True)
class LogFormat:
    """A format of logs: an entry of `LOG_FORMATS`.

    Attributes
    ----------
    name, label, doc : str
        Name; for readers; what of a frame it does not have.
    takes : callable
        Whether a file of this name, ".gz" taken off, and first bytes is one.
    read : callable
        Frames of a file, a piece at a time. What it raises, other than RefusedError, means that
        the file is damaged.
    unpacks : bool
        Whether it reads compressed files itself.
    rank : int
        Formats of a lower one are asked first.
    """

    name: str
    label: str
    doc: str
    takes: Callable[[str, bytes], bool]
    read: Callable[[Path], Generator[Parsed, None, None]]
    unpacks: bool = False
    rank: int = 100


LOG_FORMATS = Registry("log format", "triaxcal.rig.logs.kinds", LogFormat, ("takes", "read"))


@dataclass
class Left:
    """What of a log was left out, added up while it is read.

    Attributes
    ----------
    lines : int
        Lines that are no frame.
    first : str
        The first of them, where it can be shown.
    untimed : int
        Frames without a time.
    frames : int
        Those that were not left out.
    falls : int
        Frames with a time before that of the frame before.
    cut : str
        What the file lacks at its end.
    """

    lines: int = 0
    first: str = ""
    untimed: int = 0
    frames: int = 0
    falls: int = 0
    cut: str = ""
    _from_zero: bool = field(default=False, repr=False)
    _last_ns: int = field(default=0, repr=False)
    _latest_ns: int = field(default=0, repr=False)
    _rises: int = field(default=0, repr=False)

    def add(self, parsed: Parsed) -> None:
        """Count those of one more piece."""
        self.lines += parsed.bad_lines
        t_ns = parsed.frames.t_ns
        if len(t_ns):
            if not self.frames:
                self._from_zero, self._last_ns = int(t_ns[0]) == 0, int(t_ns[0])
            self.falls += int((np.diff(t_ns, prepend=self._last_ns) < 0).sum())
            self._last_ns = int(t_ns[-1])
            latest_ns = np.maximum.accumulate(np.maximum(t_ns, self._latest_ns))
            self._rises += int((np.diff(latest_ns, prepend=self._latest_ns) > 0).sum())
            self._latest_ns = int(latest_ns[-1])
        self.frames += len(t_ns)
        self.untimed += parsed.untimed
        self.first = self.first or parsed.first_bad
        self.cut = self.cut or parsed.cut

    @property
    def are_differences(self) -> bool:
        """Whether the times are those since the frame before.

        They begin at 0, and then they fall again and again, are all the same, or leave no time for
        so many frames.
        """
        if not self._from_zero or self.untimed or not self._latest_ns or self.frames < _FRAMES_MIN:
            return False
        crowded = self.frames > _FRAMES_PER_S * self._latest_ns * 1e-9
        return self._rises == 1 or crowded or self.falls > _FALLS * self.frames

    def refuse_differences(self, path: Path | str) -> None:
        """Refuse differences of times in place of times.

        Raises
        ------
        RefusedError
            Where they are.
        """
        if self.are_differences:
            raise RefusedError(
                str(path),
                _DIFFERENCES,
                expected="times",
                remedy="record with `candump -l` or `candump -t a`",
            )

    def notes(self, path: Path | str) -> list[str]:
        """One line each, for the user."""
        said = []
        if self.lines:
            what = "line is no frame" if self.lines == 1 else "lines are no frames"
            first = f"; the first: {self.first}" if self.first else ""
            said.append(f"{path}: {self.lines} {what}{first}")
        if self.cut:
            said.append(f"{path}: {self.cut}")
        if self.untimed:
            said.append(f"{path}: {self.untimed} frames have no time, 0 is taken")
        if self.are_differences:
            said.append(f"{path}: {_DIFFERENCES}")
        return said


def read_frames(path: Path) -> Generator[Parsed, None, None]:
    """Frames of a log, a piece at a time; its format is found by its name and first bytes.

    Raises
    ------
    RefusedError
        When the file cannot be read, is damaged, or a package is missing.
    """
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
        name = path.name.lower()
        packed = head.startswith(b"\x1f\x8b")
        if packed:
            name = name.removesuffix(_GZIP)
            with gzip.open(path) as file:
                head = file.read(_HEAD_BYTES)
        kind = next(k for k in LOG_FORMATS if k.takes(name, head))
        if packed and not kind.unpacks:
            with _unpacked(path, name) as plain:
                yield from _read(kind, plain, path)
        else:
            yield from _read(kind, path, path)
    except ARCHIVE_ERRORS as error:
        raise damaged_archive(path, error) from error
    except OSError as error:
        raise refused_by_system(path, "read", error) from error


def _read(kind: LogFormat, path: Path, named: Path) -> Generator[Parsed, None, None]:
    try:
        yield from kind.read(path)
    except (RefusedError, GeneratorExit):
        raise
    except Exception as error:  # a reader of others raises what its maker chose
        text = reason_of(error) if isinstance(error, OSError) else str(error)
        raise RefusedError(
            str(named),
            f"damaged, or not {kind.label}: {text or type(error).__name__}",
            expected=kind.label,
        ) from error


@contextmanager
def _unpacked(path: Path, inner: str) -> Iterator[Path]:
    """The file that a compressed one holds, under its own name."""
    with tempfile.TemporaryDirectory(prefix="triaxcal-") as folder:
        plain = Path(folder) / inner
        with gzip.open(path) as packed, plain.open("wb") as file:
            shutil.copyfileobj(packed, file)
        yield plain
