r"""The evidence log of a source that speaks in lines: each line as it came, with its time.

(1620692699.796900) ttyUSB0 0.1002,-0.5500,0.0249,23.41

What is not printable, and the backslash, stand as \xHH.
"""

from __future__ import annotations

import re
from collections.abc import Generator
from functools import partial
from pathlib import Path

from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.description.lines import LineFormat, frames_of_lines
from triaxcal.rig.logs.candump import NS_PER_US, Parsed, format_frames, read_log
from triaxcal.rig.logs.candump_lines import shown_line
from triaxcal.rig.logs.logfile import read_frames

_LINE = re.compile(rb"\((\d{10})\.(\d{6})\) \S+ ([ -~]*)")
_ODD = re.compile(rb"[^ -\[\]-~]")
_ESCAPED = re.compile(rb"\\x([0-9A-F]{2})")


def log_text(frames: Frames, channel: str) -> bytes:
    """Lines of a log; times are cut to whole microseconds."""
    if frames.texts is None:
        return format_frames(frames, channel)
    name = "_".join(channel.split()).encode("ascii", "replace")
    lines = []
    for t_us, text in zip((frames.t_ns // NS_PER_US).tolist(), frames.texts, strict=True):
        plain = _ODD.sub(lambda odd: b"\\x%02X" % odd[0][0], text)
        lines.append(b"(%d.%06d) %s %s\n" % (t_us // 10**6, t_us % 10**6, name, plain))
    return b"".join(lines)


def frames_of_log(path: Path, lines: LineFormat | None) -> Generator[Parsed, None, None]:
    """Frames of the log of a rig: of lines in a format, or of any log of frames.

    Raises
    ------
    RefusedError
        When the file cannot be read, is damaged, or a package is missing.
    """
    return read_frames(path) if lines is None else read_log(path, parse=partial(parsed, lines))


def parsed(lines: LineFormat, text: bytes) -> Parsed:
    """Frames of the whole lines of a log's text."""
    whole = text[: text.rfind(b"\n") + 1].split(b"\n")[:-1]
    found = [match for match in map(_LINE.fullmatch, whole) if match]
    times = [(int(m[1]) * 10**6 + int(m[2])) * NS_PER_US for m in found]
    texts = [_ESCAPED.sub(lambda odd: bytes([int(odd[1], 16)]), m[3]) for m in found]
    frames = frames_of_lines(lines, times, texts)
    bad = next((text for text in whole if not _LINE.fullmatch(text)), None)
    first = "" if bad is None else shown_line(bad)
    return Parsed(frames, len(whole), len(whole) - len(found), first_bad=first)
