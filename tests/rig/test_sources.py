"""The receivers: the virtual bus, and our own on a socket pair that stands for a device."""

from __future__ import annotations

import errno
import socket
import time

import numpy as np
import pytest
from click.testing import CliRunner
from rig_cases import rig_of, short_setup

from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.cli.rig import rig
from triaxcal.rig.bus.frames import concatenate
from triaxcal.rig.bus.openbus import open_bus
from triaxcal.rig.records.rawlog import RawLog
from triaxcal.rig.sources.canbus import SimulatedSource
from triaxcal.rig.sources.socketcan import SocketSource, open_refusal, packed
from triaxcal.rig.sources.source import SOURCES, SourceKind, Wanted, kind_of


def same(a, b, names=("can_id", "length", "fd")):
    assert len(a) == len(b)
    for name in names:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    width = min(a.data.shape[1], b.data.shape[1])
    np.testing.assert_array_equal(a.data[:, :width], b.data[:, :width])


@pytest.mark.parametrize("layout", ["classic", "fd"])
def test_the_virtual_bus_carries_every_frame_and_its_time(tmp_path, layout):
    setup = short_setup(tmp_path, layout=layout)
    orders = ("error@1.2:3", "bitflip@1.5:3")
    source, alone = SimulatedSource(rig_of(setup, *orders)), rig_of(setup, *orders)
    for _ in range(3):
        same(source.read(), alone.advance(), ("can_id", "length", "fd", "t_ns"))
    source.close()


class Device:
    """Hands out socket pairs; the test holds the other ends."""

    def __init__(self):
        self.ends = []
        self.there = True

    def connect(self):
        if not self.there:
            raise OSError(errno.ENODEV, "No such device")
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.ends.append(theirs)
        return ours


@pytest.fixture
def device():
    made = Device()
    yield made
    for end in made.ends:
        end.close()


def opened(device):
    source = SocketSource("test0", device.connect)
    source.notes()
    return source


def read_until(source, count, limit_s=20.0):
    parts, end = [], time.monotonic() + limit_s
    while sum(map(len, parts)) < count and time.monotonic() < end:
        parts.append(source.read())
    return concatenate([p for p in parts if len(p)])


@pytest.mark.parametrize("layout", ["classic", "fd"])
def test_our_receiver_reads_the_kernels_frames(tmp_path, device, layout):
    source = opened(device)
    frames = rig_of(short_setup(tmp_path, layout=layout), "error@0.5:2").advance()
    for frame in packed(frames):
        device.ends[0].send(frame)
    same(read_until(source, len(frames)), frames)
    source.close()


def test_frames_of_both_kinds_in_one_burst(tmp_path, device):
    """What is no frame is left out; no byte of a long frame shows behind a short one."""
    source = opened(device)
    classic = rig_of(short_setup(tmp_path)).advance().take(slice(0, 40))
    fd = rig_of(short_setup(tmp_path, layout="fd")).advance().take(slice(0, 40))
    both = concatenate([fd, classic]).take(np.random.default_rng(1).permutation(80))
    for part in (fd, both, classic):
        for i, frame in enumerate(packed(part)):
            device.ends[0].send(frame)
            if i % 7 == 0:
                device.ends[0].send(b"\xff" * 17)
        before = time.time_ns()
        found = read_until(source, len(part))
        same(found, part)
        assert not found.data[:, part.data.shape[1] :].any()
        assert (np.diff(found.t_ns) >= 0).all()
        assert abs(int(found.t_ns[0]) - before) < 60e9
    source.close()


def test_silence_is_told_and_so_is_its_end(tmp_path, device):
    source = opened(device)
    frames = rig_of(short_setup(tmp_path)).advance()
    notes, end = [], time.monotonic() + 20.0
    while not notes and time.monotonic() < end:
        source.read()
        notes += source.notes()
    assert notes[0].startswith("test0: no frames; is the rig on")
    while len(notes) < 2 and time.monotonic() < end:
        device.ends[-1].send(packed(frames)[0])
        source.read()
        notes += source.notes()
    assert notes[-1] == "test0: frames come again"
    source.close()


def test_a_device_that_goes_away_and_comes_back(tmp_path, device):
    source = opened(device)
    frames = rig_of(short_setup(tmp_path)).advance()
    device.there = False
    device.ends[0].close()
    notes, end = [], time.monotonic() + 20.0
    while not notes and time.monotonic() < end:
        source.read()
        notes += source.notes()
    assert len(notes) == 1
    device.there = True
    while len(device.ends) < 2 and time.monotonic() < end:
        source.read()
    assert "test0: the device is back" in source.notes()
    for frame in packed(frames):
        device.ends[1].send(frame)
    same(read_until(source, len(frames)), frames)
    source.close()


def test_a_device_that_is_not_there_is_refused(device):
    device.there = False
    with pytest.raises(RefusedError, match="test0: cannot be opened: no such device; CAN devices"):
        SocketSource("test0", device.connect)


@pytest.mark.parametrize(
    ("number", "said"),
    [(errno.EPERM, "no permission"), (errno.EAFNOSUPPORT, "the kernel has no SocketCAN")],
)
def test_why_a_device_cannot_be_opened(number, said):
    assert said in str(open_refusal("can7", OSError(number, "x")))


def test_an_interface_that_python_can_does_not_know():
    with pytest.raises(UsageError, match=r'found \'pcann\' \(did you mean "pcan"\?\)'):
        open_bus("pcann:X", fd=False)


@pytest.mark.parametrize(
    ("bus", "name"),
    [
        ("virtual", "virtual"), ("virtual:bench", "python-can"), ("can0", "socketcan"),
        ("socketcan:vcan1", "socketcan"), ("pcan:PCAN_USBBUS1", "python-can"),
        ("replay:frames.log", "replay"),
    ],
)  # fmt: skip
def test_the_kind_of_source_that_a_bus_names(bus, name):
    assert kind_of(bus).name == name


def test_a_source_added_at_run_time_is_opened_and_explained():
    toy = SourceKind("toy", "toy", "frames of a test", lambda bus: bus == "toy", lambda _: None, 1)
    with SOURCES.added(toy):
        assert kind_of("toy") is toy
        assert "toy: frames of a test" in CliRunner().invoke(rig, ["run", "--help"]).output
    assert kind_of("toy").name == "socketcan"


def test_an_added_source_is_asked_before_python_can_takes_the_rest():
    own = SourceKind("zlg", "zlg:n", "a test's", lambda bus: bus == "zlg:0", lambda _: None)
    with SOURCES.added(own):
        assert kind_of("zlg:0") is own
        assert kind_of("zlg:1").name == "python-can"


def test_a_log_is_a_source_until_it_ends(tmp_path):
    source_rig, path = rig_of(short_setup(tmp_path)), tmp_path / "x.log"
    frames = [source_rig.advance() for _ in range(2)]
    log = RawLog(path, "can0")
    for part in frames:
        log.append(part)
    log.close()
    with path.open("ab") as more:
        more.write(b"no frame\n")
    wanted = Wanted(f"replay:{path}", False, lambda: source_rig)
    source = kind_of(wanted.bus).open(wanted)
    same(source.read(), concatenate(frames))
    assert source.notes() == [f"{path}: 1 line is no frame; the first: 'no frame'"]
    assert source.notes() == []
    with pytest.raises(RefusedError, match=r"the log has ended; .*`triaxcal rig replay`"):
        source.read()
    source.close()
