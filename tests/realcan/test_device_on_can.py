"""`triaxcal device` and the example node on real SocketCAN. `make test-can`."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyxcp")
pytest.importorskip("can")

import can

from device.bridge import Bridge, both, running
from device.node import POWER_FAILED, Node
from realcan.conftest import WORK, ip
from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.openbus import open_bus

pytestmark = pytest.mark.skipif(not WORK, reason="`make test-can` runs these on real SocketCAN")

INTERRUPTED = int(os.environ.get("TRIAXCAL_CAN_INTERRUPTED", "100"))
"""Downloads; fewer in the guest, where each takes seconds."""
FLASH_BYTES = 4096
FIRST_FRAMES, FRAMES = 8, 500
"""Of a download, with the reading before and most of that behind it; the store is at about 370."""
BOUND_S = 0.5
"""Until the node has bound its socket; what it misses is repeated."""


@pytest.fixture
def node(tmp_path: Path) -> Node:
    folder = Path(WORK or "") / "xcp"
    return Node(folder / "node", tmp_path / "flash.bin", folder / "samples.bin")


def file(name: str) -> bytes:
    return (Path(WORK or "") / "xcp" / f"{name}.bin").read_bytes()


@contextlib.contextmanager
def on(node: Node, device: str, stop: int | None = None) -> Iterator[None]:
    with node.on_can(device, stop):
        time.sleep(BOUND_S)
        yield


@contextlib.contextmanager
def linked(device: str, cut: int | None = None, answer_s: float = 0.5, store_s: float = 60.0):
    """A link by SocketCAN; from frame number `cut` on nothing that it sends arrives."""
    from triaxcal.device.link import Link

    bus = open_bus(f"socketcan:{device}", fd=False)
    if cut is not None:
        send, sent = bus.send, iter(range(cut))

        def until_cut(message, timeout=None):
            if next(sent, None) is not None:
                send(message, timeout)

        bus.send = until_cut
    with contextlib.closing(Link(bus, device, answer_s=answer_s, store_s=store_s)) as link:
        yield link


def refused(do: Callable[[], object]) -> str:
    with pytest.raises(RefusedError) as caught:
        do()
    return str(caught.value)


def verified(link, count: int) -> None:
    """Samples of the node are those that Python computed, bit for bit."""
    from triaxcal.device.compare import take_samples

    with np.load(Path(WORK or "") / "xcp" / "samples.npz") as expected:
        codes = np.column_stack([expected["temps"], expected["raw"]]).tolist()
        answers = zip(expected["accel"].tolist(), expected["status"].tolist(), strict=True)
        rows = dict(zip(map(tuple, codes), answers, strict=True))
    found = take_samples(link, count)
    for temp, raw, accel, status in zip(
        found.temp.tolist(),
        found.raw.tolist(),
        found.accel.tolist(),
        found.status.tolist(),
        strict=True,
    ):
        assert (accel, status) == rows[temp, *raw]


def test_flashed_and_verified(vcan: str, node: Node) -> None:
    from triaxcal.device.unit import flash, identify, require_in_use

    with contextlib.ExitStack() as power:
        power.enter_context(on(node, vcan))

        def power_cycle() -> None:
            power.close()
            power.enter_context(on(node, vcan))

        with linked(vcan) as link:
            assert identify(link).part is None
            info = flash(link, file("old"), "old.bin", power_cycle=power_cycle)
            assert (info.slot, info.sequence) == (0, 1)
            found = require_in_use(link, file("old"), "OLD")
            assert (found.serial, found.epk) == ("OLD", "OLD 0123456789abcdef")
            verified(link, 40)


def test_frames_are_lost_and_come_twice(vcan: str, second: str, node: Node) -> None:
    """A relay between two devices: the kernel itself loses nothing."""
    from triaxcal.device.unit import flash, identify

    with on(node, second), socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as far:
        far.bind((second,))
        near = lambda: can.Bus(interface="socketcan", channel=vcan)  # noqa: E731
        relay = Bridge(near, far, both(0.02, 7))
        with running(relay), linked(vcan, answer_s=0.3) as link:
            flash(link, file("old"), "old.bin")
            assert identify(link).content == file("old")
            verified(link, 5)
            assert relay.frames > 500


def test_interrupted_downloads(vcan: str, node: Node) -> None:
    """The cable or the power, from begin to end: the old or the new one is in use each time."""
    from triaxcal.device.unit import flash, identify

    with on(node, vcan), linked(vcan) as link:
        flash(link, file("old"), "old.bin")
    before = node.flash.read_bytes()
    found = {"OLD": 0, "NEW": 0}
    for attempt in range(INTERRUPTED):
        node.flash.write_bytes(before)
        part = attempt / (INTERRUPTED - 1)
        cut, stop = FIRST_FRAMES + int(part * FRAMES), None
        if attempt % 2:
            cut, stop = None, int(part * (FLASH_BYTES + len(file("new")) + 40))
        with (
            on(node, vcan, stop),
            contextlib.suppress(RefusedError),
            linked(vcan, cut, answer_s=0.1, store_s=0.3) as link,
        ):
            flash(link, file("new"), "new.bin", replaces="OLD")
        with on(node, vcan), linked(vcan) as link:
            in_use = identify(link)
        assert in_use.content == file(in_use.serial.lower())
        found[in_use.serial] += 1
    assert min(found.values()) > 0
    assert sum(found.values()) == INTERRUPTED


def test_power_fails_between_erase_and_write(vcan: str, node: Node) -> None:
    from triaxcal.device.unit import flash, identify

    with on(node, vcan), linked(vcan) as link:
        flash(link, file("old"), "old.bin")
        flash(link, file("old"), "old.bin")  # both slots: there is something to erase
    with on(node, vcan, FLASH_BYTES), linked(vcan, answer_s=0.1, store_s=0.3) as link:
        assert "0.3 s after the store was ordered" in refused(
            lambda: flash(link, file("new"), "new.bin", replaces="OLD")
        )
    assert node.code == POWER_FAILED
    with on(node, vcan), linked(vcan) as link:
        assert identify(link).content == file("old")
        flash(link, file("new"), "new.bin", replaces="OLD")
        assert identify(link).content == file("new")


def test_no_node_with_these_ids(vcan: str, node: Node) -> None:
    from triaxcal.device.link import Link

    with on(node, vcan):
        bus = open_bus(f"socketcan:{vcan}", fd=False)
        told = refused(lambda: Link(bus, vcan, 0x660, 0x661, answer_s=0.05))
    assert told.startswith("vcan0, node 0x660, CONNECT: no answer within 0.05 s, 5 times; check")


def test_wrong_node_and_wrong_shape(vcan: str, node: Node) -> None:
    from triaxcal.device.unit import flash, identify

    node.program = node.program.with_name("node-17")
    with on(node, vcan), linked(vcan) as link:
        told = refused(lambda: flash(link, file("new"), "new.bin"))
        assert "new.bin: constants of NEW; expected SN-17, which vcan0, node 0x650 has" in told
        told = refused(lambda: flash(link, file("other"), "other.bin", replaces="SN-17"))
        assert told.startswith("other.bin: shape ")
        assert identify(link).part is None
    assert set(node.flash.read_bytes()) == {0xFF}


def test_the_device_goes_down(vcan: str, node: Node) -> None:
    with on(node, vcan), linked(vcan, answer_s=0.1) as link:
        ip("set", vcan, "down")
        assert "vcan0" in refused(link.info)
        ip("set", vcan, "up")


def test_the_command(vcan: str, node: Node, tmp_path: Path) -> None:
    from click.testing import CliRunner

    from triaxcal.cli.main import main

    path = tmp_path / "new.bin"
    shutil.copy(Path(WORK or "") / "xcp" / "new.bin", path)
    with on(node, vcan):
        for arguments, told in (
            (["flash", str(path)], "is in use from slot 0, read back and equal"),
            (["identify"], "EPK             NEW 0123456789abcdef"),
        ):
            done = CliRunner().invoke(
                main, ["device", *arguments, "--bus", vcan], catch_exceptions=False
            )
            assert told in done.output
