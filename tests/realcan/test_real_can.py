"""On real SocketCAN: vcan0, and can0 to can1 where there are controllers. `make test-can`."""

from __future__ import annotations

import socket
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from realcan.conftest import WORK, ip
from triaxcal.rig.bus.frames import Frames, concatenate
from triaxcal.rig.description.dbc import default_dbc, read_dbc
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.description.shippedrigs import find_description
from triaxcal.rig.node.fil import exchange
from triaxcal.rig.plan.plan import LAYOUTS
from triaxcal.rig.simulated.simframes import FrameMaker
from triaxcal.rig.sources import socketcan
from triaxcal.rig.sources.port import SocketPort
from triaxcal.rig.sources.source import Wanted, kind_of

pytestmark = pytest.mark.skipif(not WORK, reason="`make test-can` runs these on real SocketCAN")
LIMIT_S = 60.0


def opened(device: str, fd: bool = False) -> socketcan.SocketSource:
    """The source of a CAN device, by the registry."""
    source = kind_of(device).open(Wanted(device, fd, lambda: pytest.fail("a CAN device")))
    assert isinstance(source, socketcan.SocketSource)
    return source


def some_frames(seconds=2, layout="classic", rate=100):
    maker = FrameMaker(read_description(find_description(LAYOUTS[layout])), rate, 0)
    rng = np.random.default_rng(1)
    parts = []
    for second in range(seconds):
        codes = rng.integers(-(2**23), 2**23, (rate, 3))
        parts.append(maker.frames(codes, rng.integers(-5000, 9000, 10), second, 1))
    return concatenate(parts)


def send(device, frames, fd=False):
    link = socketcan.can_socket(device, fd)
    try:
        for frame in socketcan.packed(frames):
            while True:
                try:
                    link.send(frame)
                    break
                except OSError:  # ENOBUFS: the device's queue is full
                    time.sleep(0.002)
    finally:
        link.close()


def read_until(source, done):
    parts, notes, end = [], [], time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        parts.append(source.read())
        notes += source.notes()
        if done(sum(map(len, parts)), notes):
            break
    got = [p for p in parts if len(p)]
    return concatenate(got), notes


def same(a, b):
    assert len(a) == len(b)
    for name in ("can_id", "length", "fd"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    width = min(a.data.shape[1], b.data.shape[1])
    np.testing.assert_array_equal(a.data[:, :width], b.data[:, :width])


@pytest.mark.parametrize("layout", ["classic", "fd"])
def test_every_frame_arrives_with_the_kernels_time(vcan, layout):
    frames = some_frames(layout=layout)
    source = opened(vcan, fd=layout == "fd")
    before = time.time_ns()
    send(vcan, frames, fd=layout == "fd")
    found, _ = read_until(source, lambda count, _: count >= len(frames))
    same(found, frames)
    assert (np.diff(found.t_ns) >= 0).all()
    assert before <= found.t_ns[0] <= found.t_ns[-1] <= time.time_ns()
    assert source.dropped == 0
    source.close()


def test_what_the_kernel_drops_is_counted_exactly(vcan, monkeypatch):
    monkeypatch.setattr(socketcan, "QUEUE_BYTES", 1 << 16)
    frames = some_frames(5)
    source = opened(vcan)
    assert "the queue holds" in source.notes()[0]
    send(vcan, frames)
    first, _ = read_until(source, lambda count, _: count > 50)
    # The count comes with the next frame that finds room.
    send(vcan, frames.take(slice(0, 1)))
    rest, notes = read_until(source, lambda _, notes: bool(notes))
    assert source.dropped > 0
    assert len(first) + len(rest) + source.dropped == len(frames) + 1
    assert f"the kernel dropped {source.dropped} frames" in " ".join(notes)
    source.close()


def test_error_frames_are_seen(vcan):
    source = opened(vcan)
    one = some_frames(1).take(slice(0, 1))
    bus_off = Frames(one.t_ns, np.array([0x20000040], np.uint32), one.length, one.fd, one.data)
    send(vcan, bus_off)
    found, _ = read_until(source, lambda count, _: count >= 1)
    assert found.is_error.tolist() == [True]
    assert int(found.can_id[0]) & 0x40
    source.close()


def test_a_link_that_goes_down_and_up(vcan):
    source = opened(vcan)
    ip("set", vcan, "down")
    _, notes = read_until(source, lambda _, notes: bool(notes))
    assert "the link is down" in notes[0]
    ip("set", vcan, "up")
    frames, end = some_frames(1), time.monotonic() + LIMIT_S
    found = []
    while not found and time.monotonic() < end:
        send(vcan, frames)
        found = [p for p in (source.read() for _ in range(3)) if len(p)]
    assert found
    source.close()


def test_a_device_that_is_taken_away_and_comes_back(vcan):
    source = opened(vcan)
    ip("del", vcan)
    _, notes = read_until(source, lambda _, notes: bool(notes))
    assert notes
    ip("add", "dev", vcan, "type", "vcan")
    ip("set", vcan, "up")
    frames, found, end = some_frames(1), [], time.monotonic() + LIMIT_S
    while not found and time.monotonic() < end:
        send(vcan, frames)
        found = [p for p in (source.read() for _ in range(3)) if len(p)]
    assert found
    assert "the device is back" in " ".join(source.notes() + notes)
    source.close()


@pytest.mark.parametrize("node", ["plain", "angles"])
def test_firmware_in_the_loop_bit_for_bit(vcan, node):
    work = Path(WORK) / node
    with np.load(work / "answers.npz") as recorded:
        answers = {name: recorded[name] for name in recorded.files}
    at = [0]

    def routine(_, raw):
        rows = slice(at[0], at[0] + len(raw))
        np.testing.assert_array_equal(answers["raw"][rows], raw)
        at[0] += len(raw)
        return answers["values"][rows], answers["status"][rows]

    process = subprocess.Popen([str(work / "rig_node"), "can", vcan])
    try:
        link = socketcan.can_socket(vcan, fd=False)
        link.setsockopt(socket.SOL_SOCKET, 33, 4 << 20)
        time.sleep(1.0)  # until the node has bound its socket
        dbc = read_dbc(default_dbc(), angles=node == "angles")
        done = exchange(SocketPort(link), dbc, answers["temps"], answers["raw"], routine)
        assert done.samples == 5000
        link.close()
    finally:
        process.terminate()
        process.wait(20)


def test_between_two_controllers():
    if not all(Path(f"/sys/class/net/{d}").exists() for d in ("can0", "can1")):
        pytest.skip("no can0 and can1 here; the emulated machine has them")
    for device in ("can0", "can1"):
        ip("set", device, "type", "can", "bitrate", "500000")
        ip("set", device, "up")
    source = opened("can1")
    frames = some_frames(1).take(slice(0, 150))
    parts = []
    for start in range(0, len(frames), 10):  # the controller holds 64 bytes: give it time
        send("can0", frames.take(slice(start, start + 10)))
        parts.append(read_until(source, lambda count, _: count >= 10)[0])
    same(concatenate(parts), frames)
    source.close()
