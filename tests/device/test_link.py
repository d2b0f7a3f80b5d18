"""Identify, read, flash and verify on python-can's virtual bus, with pyxcp as the master."""

from __future__ import annotations

import contextlib
import struct
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest

pytest.importorskip("pyxcp")
pytest.importorskip("can")

import can

from builds import PROVENANCE, Builds, Built
from device.bridge import CHANNELS, both, bridged, doubling, linked, losing
from device.conftest import file_of
from device.node import POWER_FAILED, REQUEST, RESPONSE, Node, build_node, write_samples
from plans import vectors
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.device.compare import compare, take_samples
from triaxcal.device.layout import FILE, RAM_PAGE
from triaxcal.device.link import Link
from triaxcal.device.unit import flash, identify, require_in_use
from triaxcal.rig.bus.openbus import open_bus

FLASH_BYTES = 4096
LATE_S = 0.03
"""Of an answer in tests that lose frames; the bridge passes one on within some milliseconds."""


@pytest.fixture(scope="module")
def program(unit: Built, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_node(unit, tmp_path_factory.mktemp("node") / "xcp_node")


@pytest.fixture
def node(program: Path, unit: Built, tmp_path: Path) -> Node:
    temp, raw = vectors(unit.plan, Random(5), 60)
    write_samples(tmp_path / "samples.bin", np.array(temp), np.array(raw))
    return Node(program, tmp_path / "flash.bin", tmp_path / "samples.bin")


def refused(do: Callable[[], object]) -> str:
    with pytest.raises(RefusedError) as caught:
        do()
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_from_an_empty_flash_to_a_verified_device(node: Node, unit: Built) -> None:
    file = file_of(unit, "UNIT-1")
    with linked(node) as link:
        found = identify(link)
        assert (found.hardware, found.firmware, found.part, found.serial) == (
            "", "xcp-node 1", None, "",
        )  # fmt: skip
        assert found.epk == PROVENANCE.epk
        info = flash(link, file, "a file")
        assert (info.slot, info.sequence) == (0, 1)
        found = require_in_use(link, file, "UNIT-1")
        assert found.content == file
        assert found.serial == "UNIT-1"
        assert found.epk == replace(PROVENANCE, serial="UNIT-1").epk
        samples = take_samples(link, 50)
        assert len(samples) == 50
        agreement = compare(samples, python_routine(unit.plan), unit.plan.shape.output_q)
        assert (agreement.differing, agreement.largest_lsb, agreement.first) == (0, 0, "")
        assert 0 < agreement.flagged <= 50
    # It lasts, and a second one takes the other slot.
    with linked(node) as link:
        assert identify(link).content == file
        info = flash(link, file, "a file")
        assert (info.slot, info.sequence) == (1, 2)


def test_a_wrong_result_is_found(node: Node, unit: Built) -> None:
    with linked(node) as link:
        samples = take_samples(link, 5)
    samples.accel[3, 1] += 2
    found = compare(samples, python_routine(unit.plan), unit.plan.shape.output_q)
    assert (found.differing, found.largest_lsb) == (1, 2)
    assert found.first.startswith(f"sample 3, temp_code {samples.temp[3]}, raw_code ")


def test_the_length_of_the_mean(node: Node, unit: Built) -> None:
    with linked(node) as link:
        samples = take_samples(link, 4)
    one_g = 1 << unit.plan.shape.output_q
    samples.accel[:] = [[0, 0, one_g + k] for k in (-3, -1, 1, 3)]
    found = compare(samples, python_routine(unit.plan), unit.plan.shape.output_q)
    assert found.length_error_g == pytest.approx(0.0, abs=1e-12)
    assert found.mean_g == pytest.approx((0.0, 0.0, 1.0), abs=1e-12)
    # sd of -3, -1, 1, 3 is sqrt(20 / 3); of their mean half of it.
    assert found.length_sd_g == pytest.approx((20 / 3) ** 0.5 / 2 / one_g)
    found = compare(samples, python_routine(unit.plan), unit.plan.shape.output_q, 1.25)
    assert found.length_error_g == pytest.approx(-0.25)


def test_power_cycle(node: Node, unit: Built) -> None:
    """Another process with the same flash: its connection and its RAM are lost."""
    old, new = file_of(unit, "UNIT-1"), file_of(unit, "UNIT-2")
    with contextlib.ExitStack() as power:
        name = power.enter_context(bridged(node))
        link = Link(open_bus(name, fd=False), name)

        def power_cycle() -> None:
            power.close()
            power.enter_context(bridged(node, channel=name.removeprefix("virtual:")))

        def lost() -> None:
            power.close()
            node.flash.write_bytes(before)
            power_cycle()

        with contextlib.closing(link):
            assert flash(link, old, "a file", power_cycle=power_cycle).sequence == 1
            before = node.flash.read_bytes()
            assert refused(lambda: flash(link, new, "a file", "UNIT-1", power_cycle=lost)).endswith(
                "after the power cycle its flash holds another calibration"
            )


# ---- a disturbed bus ----


@pytest.mark.parametrize("kind", [losing, doubling, both])
def test_frames_are_lost_and_come_twice(
    node: Node, unit: Built, kind: Callable[..., Callable[[int, bytes], list[bytes]]]
) -> None:
    files = [file_of(unit, "UNIT-1"), file_of(unit, "UNIT-2")]
    with linked(node, kind(0.02, 7), answer_s=LATE_S) as link:
        for file in files:
            flash(link, file, "a file", replaces="UNIT-1")
            assert identify(link).content == file
        samples = take_samples(link, 10)
    found = compare(samples, python_routine(unit.plan), unit.plan.shape.output_q)
    assert found.differing == 0


def interrupted(node: Node, unit: Built, count: int, seed: int) -> dict[str, int]:
    """Cut the cable, or the power while it stores, at random; what was in use afterwards."""
    rng = Random(seed)
    old, new = file_of(unit, "OLD"), file_of(unit, "NEW")
    with linked(node) as link:
        flash(link, old, "a file")
    before = node.flash.read_bytes()
    found = {"old": 0, "new": 0, "neither": 0}
    for _ in range(count):
        node.flash.write_bytes(before)
        cut, stop = rng.randrange(8, 900), None
        if rng.random() < 0.5:
            cut, stop = 10**9, rng.randrange(FLASH_BYTES + len(new) + 40)

        def fault(number: int, data: bytes, cut: int = cut) -> list[bytes]:
            if number >= cut:
                raise ConnectionResetError
            return [data]

        with (
            contextlib.suppress(RefusedError),
            linked(node, fault, stop, answer_s=0.02, store_s=0.3) as link,
        ):
            flash(link, new, "a file", replaces="OLD")
        assert node.code in (0, POWER_FAILED)
        with linked(node) as link:
            content = identify(link).content
            found["old" if content == old else "new" if content == new else "neither"] += 1
    return found


@pytest.mark.parametrize("stop", [100, FLASH_BYTES + 100], ids=["erasing", "writing"])
def test_power_that_fails_while_it_stores(node: Node, unit: Built, stop: int) -> None:
    old, new = file_of(unit, "OLD"), file_of(unit, "NEW")
    with linked(node) as link:
        flash(link, old, "a file")
    notes: list[str] = []
    with linked(node, stop=stop, answer_s=0.02, store_s=0.3) as link:
        text = refused(lambda: flash(link, new, "a file", "OLD", None, notes.append))
    assert node.code == POWER_FAILED
    assert text.endswith(
        ", node 0x650: has not answered, 0.3 s after the store was ordered; after a power-up the "
        "calibration before is in use, or the new one, never neither: check power and cable, and "
        "run the command again"
    )
    (note,) = notes
    assert note.endswith(", node 0x650: no answer; it may be erasing: 0.3 s to wait")
    with linked(node) as link:
        assert identify(link).content == old
        flash(link, new, "a file", "OLD")
        assert identify(link).content == new


def test_interrupted_downloads(node: Node, unit: Built) -> None:
    found = interrupted(node, unit, 8, 1)
    assert found["neither"] == 0
    assert found["old"] > 0


@pytest.mark.long
def test_a_hundred_interrupted_downloads(node: Node, unit: Built) -> None:
    found = interrupted(node, unit, 100, 2)
    assert found["neither"] == 0
    assert min(found["old"], found["new"]) > 0


# ---- what does not belong together ----


def test_a_calibration_of_another_shape(node: Node, built: Builds) -> None:
    other = next(name for name in built.plans if name == "direct-cubic-24-bit")
    file = file_of(built[other], "UNIT-1")
    with linked(node) as link:
        text = refused(lambda: flash(link, file, "other.bin"))
        assert identify(link).part is None
    assert text.startswith("other.bin: shape ")
    assert f"{len(file)} bytes; expected shape " in text
    assert "triax_comp.c" in text


def test_a_calibration_of_another_unit(node: Node, unit: Built) -> None:
    mine, other = file_of(unit, "UNIT-1"), file_of(unit, "UNIT-2")
    with linked(node) as link:
        flash(link, mine, "mine.bin")
        text = refused(lambda: flash(link, other, "other.bin"))
        assert text.startswith("other.bin: constants of UNIT-2; expected UNIT-1, which ")
        assert text.endswith("if it was exchanged, say --replaces UNIT-1")
        assert "UNIT-3" not in text
        refused(lambda: flash(link, other, "other.bin", replaces="UNIT-3"))
        assert identify(link).content == mine
        flash(link, other, "other.bin", replaces="UNIT-1")
        assert identify(link).content == other
        text = refused(lambda: require_in_use(link, mine, "UNIT-1"))
        assert "a calibration of UNIT-2 in flash; expected that of UNIT-1" in text


def test_hardware_that_knows_its_serial_number(node: Node, unit: Built, tmp_path: Path) -> None:
    node.program = build_node(unit, tmp_path / "named", '-DNODE_SERIAL="UNIT-7"')
    with linked(node) as link:
        text = refused(lambda: flash(link, file_of(unit, "UNIT-1"), "a file"))
        assert "expected UNIT-7" in text
        flash(link, file_of(unit, "UNIT-7"), "a file")
        assert identify(link).serial == "UNIT-7"


@pytest.mark.parametrize("content", [b"", b"TRXC", b"\0" * 600])
def test_a_file_that_is_no_calibration(node: Node, content: bytes) -> None:
    with linked(node) as link:
        assert refused(lambda: flash(link, content, "x.bin")).startswith("x.bin, ")


def test_what_is_in_ram_is_not_verified(node: Node, unit: Built) -> None:
    file = file_of(unit, "UNIT-1")
    with linked(node) as link:
        flash(link, file, "a file")
        link.choose(RAM_PAGE)
        link.use(RAM_PAGE)
        assert "in RAM" in refused(lambda: require_in_use(link, file, "UNIT-1"))


def test_a_damaged_download_is_refused_by_the_node(node: Node, unit: Built) -> None:
    file = bytearray(file_of(unit, "UNIT-1"))
    file[100] ^= 1
    with linked(node) as link:
        link.choose(RAM_PAGE)
        link.write(bytes(file))
        assert "ERR_PAGE_NOT_VALID: the page holds no calibration" in refused(link.store)
        assert "ERR_PAGE_NOT_VALID" in refused(lambda: link.use(RAM_PAGE))


def test_an_address_outside_of_flash(node: Node, unit: Built) -> None:
    with linked(node) as link:
        size = len(file_of(unit, "UNIT-1"))
        assert "the address is outside of what the node has" in refused(
            lambda: link.read(FILE, size - 3, 4)
        )
        link.choose(RAM_PAGE)
        assert "the address is outside" in refused(lambda: link.write(b"x" * (size + 1)))


# ---- nodes that are none, or none of ours ----


@contextlib.contextmanager
def answering(answer: Callable[[bytes], bytes]) -> Iterator[str]:
    """A bus with a node on it that answers every frame so."""
    channel, stop = f"device-{next(CHANNELS)}", threading.Event()
    bus = can.Bus(interface="virtual", channel=channel)

    def run() -> None:
        while not stop.is_set():
            message = bus.recv(0.01)
            data = answer(bytes(message.data)) if message else b""
            if data and message is not None and message.arbitration_id == REQUEST:
                bus.send(can.Message(arbitration_id=RESPONSE, data=data, is_extended_id=False))

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield f"virtual:{channel}"
    finally:
        stop.set()
        thread.join(5)
        bus.shutdown()


def test_a_bus_is_closed_when_the_master_takes_no_such_id() -> None:
    bus = can.Bus(interface="virtual", channel="no-such-id")
    with pytest.raises(Exception, match="2048"):
        Link(bus, "a bus", 0x800)
    with pytest.raises(can.CanOperationError):
        bus.send(can.Message(arbitration_id=1))


def connect(name: str) -> None:
    with contextlib.closing(Link(open_bus(name, fd=False), name, answer_s=0.02)):
        pass


CONNECTED = bytes([0xFF, 1, 0, 8, 8, 0, 1, 1])


def late(data: bytes) -> bytes:
    time.sleep(0.03)
    return CONNECTED if data[0] == 0xFF else b"\xff"


def foreign(data: bytes) -> bytes:
    return {0xFF: CONNECTED, 0xF6: b"\xff", 0xFC: b"\xfe\0"}.get(data[0], b"\xfe\x22")


def of_version_2() -> Callable[[bytes], bytes]:
    """Everything right but the version of its information."""
    info, address = struct.pack("<8I", 2, *range(7)), 0

    def answer(data: bytes) -> bytes:
        nonlocal address
        if data[0] == 0xF6:
            address = int.from_bytes(data[4:8], "little")
        if data[0] == 0xF5:
            return b"\xff" + info[address : address + data[1]]
        if data[0] == 0xF3:
            return b"\xff\x09\0\0" + struct.pack("<I", zlib.crc32(info))
        return foreign(data)

    return answer


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (lambda _: b"", "CONNECT: no answer within 0.02 s, 5 times; check the node's power"),
        (late, "no answer within 0.02 s, 5 times"),
        (lambda _: b"\xfe\x10", "CONNECT: the node answers ERR_CMD_BUSY: see the XCP standard"),
        (lambda _: b"\xff", "CONNECT: an answer that belongs to another command, 5 times"),
        (foreign, "an XCP node, but its answer to a read of extension 1 is an error; expected"),
        (of_version_2(), "an XCP node, but its information has version 2; expected"),
    ],
    ids=["silent", "late", "busy", "short", "foreign", "version"],
)
def test_nodes_that_are_none_of_ours(answer: Callable[[bytes], bytes], text: str) -> None:
    with answering(answer) as name:
        assert text in refused(lambda: connect(name))
