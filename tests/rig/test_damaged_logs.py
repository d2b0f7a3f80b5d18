"""Logs of other programs that are cut or have a wrong character: nothing is lost in silence."""

from __future__ import annotations

import can
import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.rig.logs.logfile import Left, read_frames

COUNT = 600


def logged(path):
    """Frames number 0 to `COUNT` - 1, each of which has its number in the payload."""
    with can.Logger(str(path)) as writer:
        for k in range(COUNT):
            writer.on_message_received(
                can.Message(timestamp=1.7e9 + k / 100, arbitration_id=0x123, is_extended_id=False,
                            data=k.to_bytes(8, "big"), channel=1)
            )  # fmt: skip
    return path.read_bytes()


def read(path):
    """Numbers of the frames, and what is said of the log."""
    left, numbers = Left(), []
    for parsed in read_frames(path):
        left.add(parsed)
        data = parsed.frames.data
        numbers += [int.from_bytes(row[:8].tobytes(), "big") for row in data]
    return numbers, left.notes(path.name)


def test_a_blf_is_cut_anywhere(tmp_path):
    """python-can's reader ends at the last whole frame and says nothing."""
    whole = logged(tmp_path / "x.blf")
    path = tmp_path / "cut.blf"
    path.write_bytes(whole)
    assert read(path) == (list(range(COUNT)), [])
    head = 144
    for size in {*range(head, len(whole), len(whole) // 40), len(whole) - 4, len(whole) - 40}:
        path.write_bytes(whole[:size])
        numbers, said = read(path)
        assert numbers == list(range(len(numbers)))
        assert said == [f"cut.blf: cut at byte {size}, the frames behind are lost"]


@pytest.mark.parametrize("suffix", [".asc", ".trc"])
def test_a_line_that_the_reader_cannot_bear_costs_that_line_alone(tmp_path, suffix):
    """A character is spoiled in lines at both ends and in the middle."""
    path = tmp_path / f"x{suffix}"
    whole = logged(path).decode().splitlines(keepends=True)
    places = [i for i, line in enumerate(whole) if "123" in line and " 8 " in line][-COUNT:]
    bad = {0: -4, 1: -4, 250: -8, 300: -8, 301: -8, COUNT - 1: -4}
    lines = list(whole)
    for number, column in bad.items():
        line = lines[places[number]]
        at = len(line) + column if column < 0 else column
        lines[places[number]] = line[:at] + "Z" + line[at + 1 :]
    path.write_text("".join(lines), encoding="utf-8", newline="")
    numbers, said = read(path)
    assert numbers == [k for k in range(COUNT) if k not in bad]
    assert len(said) == 1
    assert said[0].startswith(f"x{suffix}: {len(bad)} lines are no frames")


def test_a_text_in_which_every_line_is_spoiled_is_refused(tmp_path):
    path = tmp_path / "x.trc"
    lines = logged(path).decode().splitlines(keepends=True)
    spoiled = [line.replace("123", "1Z3") if " 8 " in line else line for line in lines]
    path.write_text("".join(spoiled), encoding="utf-8", newline="")
    with pytest.raises(RefusedError, match="damaged, or not a file of ASC"):
        read(path)
