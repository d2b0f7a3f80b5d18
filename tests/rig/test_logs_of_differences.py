"""Logs whose times are differences; CAN FD frames in a database, which has no flag for them."""

from __future__ import annotations

import can
import numpy as np
import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.rig.logs.logfile import Left, read_frames
from triaxcal.rig.records.replay import chunks


def shown(times, path):
    """What `candump -t` shows of frames at these times."""
    lines = [f" ({t:010.6f})  can0  123   [2]  01 {i % 256:02X}\n" for i, t in enumerate(times)]
    path.write_text("".join(lines))
    return path


RNG = np.random.default_rng(4)
STEPS = 0.01 + RNG.uniform(-0.001, 0.001, 200)
TIMES = np.concatenate([[0.0], np.cumsum(STEPS)])


EVEN = np.full(5000, 0.01)
EVEN[2500:] += 1e-6


@pytest.mark.parametrize("steps", [STEPS, np.full(50, 0.01), EVEN])
def test_differences_are_refused_as_a_session_and_noted_elsewhere(tmp_path, steps):
    path = shown([0.0, *steps], tmp_path / "x.log")
    with pytest.raises(RefusedError, match="differences, as of `candump -t d`; expected times"):
        list(chunks(path, None, [], Left()))
    left = Left()
    for parsed in read_frames(path):
        left.add(parsed)
    (note,) = left.notes(path)
    assert note.startswith(f"{path}: the times begin at 0 and do not rise")


@pytest.mark.parametrize("start", [0.0, 5.0])
def test_times_since_the_start_are_times(tmp_path, start):
    path = shown(start + TIMES, tmp_path / "x.log")
    (frames,) = chunks(path, None, [], Left())
    np.testing.assert_allclose(frames.t_ns / 1e9, start + TIMES, atol=1e-6)


def test_a_coarse_clock_gives_times(tmp_path):
    times = np.floor(TIMES * 5) / 5
    (frames,) = chunks(shown(times, tmp_path / "x.log"), None, [], Left())
    assert len(np.unique(frames.t_ns)) > 5


def test_some_frames_out_of_order_are_no_differences(tmp_path):
    times = TIMES.copy()
    times[20:24:2], times[21:25:2] = TIMES[21:25:2], TIMES[20:24:2]
    left = Left()
    list(chunks(shown(times, tmp_path / "x.log"), None, [], left))
    assert left.falls == 2
    assert left.notes("x.log") == []


def test_long_frames_of_a_database_are_can_fd(tmp_path):
    path = tmp_path / "x.db"
    sizes = (8, 12, 64, 2)
    with can.Logger(str(path)) as logger:
        for i, size in enumerate(sizes):
            logger(can.Message(timestamp=1.7e9 + i, arbitration_id=0x55, is_extended_id=False,
                               is_fd=size > 8, data=bytes(range(size))))  # fmt: skip
    (parsed,) = read_frames(path)
    assert parsed.bad_lines == 0
    assert parsed.frames.length.tolist() == list(sizes)
    assert parsed.frames.fd.tolist() == [False, True, True, False]
    assert parsed.frames.data[2].tolist() == list(range(64))
