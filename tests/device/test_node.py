"""The example node as a process: it keeps a calibration in flash, whatever its power does."""

from __future__ import annotations

import socket
import struct
from pathlib import Path
from random import Random

import numpy as np
import pytest

from builds import Built
from device.conftest import file_of
from device.node import POWER_FAILED, Node, ask, build_node, frame, write_samples
from plans import vectors
from triaxcal.codegen.crosscheck import python_routine

OK = b"\xff"


@pytest.fixture(scope="module")
def program(unit: Built, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_node(unit, tmp_path_factory.mktemp("node") / "xcp_node")


@pytest.fixture
def node(program: Path, unit: Built, tmp_path: Path) -> Node:
    temp, raw = vectors(unit.plan, Random(3), 40)
    write_samples(tmp_path / "samples.bin", np.array(temp), np.array(raw))
    return Node(program, tmp_path / "flash.bin", tmp_path / "samples.bin")


def short_uploads(link: socket.socket, size: int, extension: int = 0) -> bytes:
    data = b""
    while len(data) < size:
        count = min(7, size - len(data))
        answer = ask(link, struct.pack("<BBxBI", 0xF4, count, extension, len(data)))
        assert answer[:1] == OK, answer.hex()
        data += answer[1:]
    return data


def flash(link: socket.socket, file: bytes) -> bool:
    """Whether the store has ended; the node may be gone before."""
    ask(link, 0xFF, 0)
    ask(link, 0xEB, 2, 0, 1)
    ask(link, 0xF6, bytes(7))
    for at in range(0, len(file), 6):
        part = file[at : at + 6]
        ask(link, 0xF0, len(part), part)
    ask(link, 0xF9, 1)
    while status := ask(link, 0xFD):
        if status[1] == 0:
            return True
    return False


def read(link: socket.socket, size: int) -> bytes:
    assert ask(link, 0xFF, 0)[:1] == OK
    return short_uploads(link, size)


def test_every_sample_is_that_of_the_python_model(node: Node, unit: Built) -> None:
    routine = python_routine(unit.plan)
    with node.on() as link:
        assert flash(link, file_of(unit, "UNIT-1"))
        for count in range(1, 41):
            row = struct.unpack("<Iii3i3iI", short_uploads(link, 40, extension=2))
            accel, status = routine(np.array(row[1:2], np.int32), np.array([row[3:6]], np.int32))
            assert row[0] == count
            assert row[6:9] == tuple(accel[0].tolist())
            assert row[9] == status[0]
    assert node.code == 0


def test_power_fails_while_it_stores(node: Node, unit: Built) -> None:
    """At the ends of each step, and in between."""
    old, new = file_of(unit, "OLD"), file_of(unit, "NEW")
    size, padded = len(new), -(-len(new) // 8) * 8
    last = 4096 + padded + 32
    found = set()
    for stop in (0, 1, 2000, 4095, 4096, 4097, 4096 + padded // 2, 4096 + padded, last - 17, last):
        node.flash.unlink(missing_ok=True)
        with node.on() as link:
            assert flash(link, old)
        with node.on(stop) as link:
            assert flash(link, new) == (stop == last)
        assert node.code == (0 if stop == last else POWER_FAILED)
        with node.on() as link:
            in_use = read(link, size)
            assert in_use in (old, new)
            found.add(in_use)
            assert flash(link, new)
            assert read(link, size) == new
    assert found == {old, new}


def test_frames_of_others_are_passed_over(node: Node) -> None:
    with node.on() as link:
        link.send(frame(b"\xff\0", 0x123))
        link.send(frame(b"\xff\0", 0x651))
        link.send(b"short")
        assert ask(link, 0xFF, 0)[:1] == OK


def test_command_line(node: Node) -> None:
    import subprocess

    for arguments, code in ((["socket"], 2), (["can", "nothing0", "/nowhere/f", "s"], 1)):
        done = subprocess.run(
            [str(node.program), *arguments], capture_output=True, text=True, check=False
        )
        assert done.returncode == code
        assert done.stderr.startswith("xcp_node: ")
