"""The XCP slave, command by command."""

from __future__ import annotations

import ctypes
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from random import Random

import pytest

from builds import PROVENANCE, Built
from device.conftest import file_of
from triaxcal.codegen.identity import identity_of
from triaxcal.codegen.image_layout import Layout

Ask = Callable[..., bytes]

SYNCH, BUSY, UNKNOWN, SYNTAX, RANGE, WRITE, DENIED = 0x00, 0x10, 0x20, 0x21, 0x22, 0x23, 0x24
PAGE, MODE, SEGMENT = 0x26, 0x27, 0x28
OK = b"\xff"
FOREVER, STAYS = 0xFFFFFFFF, 0x100
ENDS = (-(2**31), -1, 0, 1, 2**31 - 1)


def error(code: int) -> bytes:
    return bytes([0xFE, code])


def mta(address: int, extension: int = 0) -> bytes:
    return struct.pack("<BxxBI", 0xF6, extension, address)


def short_upload(size: int, address: int, extension: int = 0) -> bytes:
    return struct.pack("<BBxBI", 0xF4, size, extension, address)


@pytest.fixture
def ask(harness: ctypes.CDLL) -> Ask:
    """A node without a calibration in flash, connected."""
    harness.harness_reset(8)
    harness.harness_power_up()

    def receive(*command: int | bytes) -> bytes:
        sent = b"".join(c if isinstance(c, bytes) else bytes([c]) for c in command)
        answer = ctypes.create_string_buffer(8)
        size = harness.harness_receive(sent, len(sent), answer)
        return answer.raw[:size]

    assert receive(0xFF, 0)[:1] == OK
    return receive


@pytest.fixture
def file(unit: Built) -> bytes:
    return file_of(unit, "UNIT-1")


@pytest.fixture
def flashed(harness: ctypes.CDLL, ask: Ask, file: bytes) -> Ask:
    harness.harness_store(file, FOREVER, STAYS)
    return ask


def read(ask: Ask, size: int, address: int = 0, extension: int = 0) -> bytes:
    assert ask(mta(address, extension)) == OK
    data = b""
    while len(data) < size:
        answer = ask(0xF5, min(7, size - len(data)))
        assert answer[:1] == OK
        data += answer[1:]
    return data


def download(ask: Ask, data: bytes) -> None:
    assert ask(0xEB, 0x02, 0, 1) == OK
    assert ask(mta(0)) == OK
    for at in range(0, len(data), 6):
        part = data[at : at + 6]
        assert ask(0xF0, len(part), part) == OK


def test_connect(ask: Ask) -> None:
    assert ask(0xFF, 0) == bytes([0xFF, 1, 0, 8, 8, 0, 1, 1])
    assert ask(0xFF, 1) == error(RANGE)


def test_nothing_is_answered_before_connect(ask: Ask) -> None:
    assert ask(0xFE) == OK
    for command in range(0xFF):
        assert ask(command, b"\0" * 7) == b""
    assert ask() == b""
    assert ask(0xFF, 0, b"\0" * 7) == b""


def test_what_it_does_not_know(ask: Ask) -> None:
    known = {
        0xFF, 0xFE, 0xFD, 0xFC, 0xFA, 0xF9, 0xF6, 0xF5, 0xF4, 0xF3, 0xF0, 0xEB, 0xEA, 0xE4,
    }  # fmt: skip
    for command in set(range(256)) - known:
        assert ask(command, b"\0" * 7) == error(UNKNOWN)


@pytest.mark.parametrize(
    ("command", "size"),
    [
        (0xFA, 2), (0xF9, 2), (0xF6, 8), (0xF5, 2), (0xF4, 8), (0xF3, 8), (0xF0, 3),
        (0xEB, 4), (0xEA, 3), (0xE4, 5),
    ],
)  # fmt: skip
def test_a_cut_command(ask: Ask, command: int, size: int) -> None:
    for length in range(1, size):
        assert ask(command, b"\0" * (length - 1)) == error(SYNTAX)


def test_synch_has_an_answer_of_its_own(ask: Ask) -> None:
    assert ask(0xFC) == error(SYNCH)


@pytest.mark.parametrize(
    ("kind", "text"),
    [(0, b"SN 17"), (128, b"fw 1.2"), (5, b"EPK 17"), (1, b""), (200, b"")],
)
def test_identity(ask: Ask, kind: int, text: bytes) -> None:
    answer = ask(0xFA, kind)
    assert answer == struct.pack("<BBxxI", 0xFF, 0, len(text))
    if text:
        assert ask(0xF5, len(text)) == OK + text
        assert ask(0xF5, 1) == error(RANGE)
        assert ask(mta(0, 0xFF)) == error(RANGE)


def epk(ask: Ask) -> bytes:
    size = int.from_bytes(ask(0xFA, 5)[4:], "little")
    text = b""
    while len(text) < size:
        text += ask(0xF5, min(7, size - len(text)))[1:]
    return text


def test_the_epk_is_that_of_the_calibration_in_use(flashed: Ask, unit: Built) -> None:
    """As TRIAX_CALIB_EPK of its delivery states it."""
    hash_ = PROVENANCE.inputs_sha256[:16].encode()
    assert epk(flashed) == b"UNIT-1 " + hash_
    download(flashed, file_of(unit, "S" * 64))
    assert epk(flashed) == b"UNIT-1 " + hash_
    assert flashed(0xEB, 0x01, 0, 1) == OK
    assert epk(flashed) == b"S" * 64 + b" " + hash_
    assert replace(PROVENANCE, serial="UNIT-1").epk == "UNIT-1 0123456789abcdef"


def test_flash_that_is_empty_cannot_be_read(ask: Ask) -> None:
    assert ask(short_upload(1, 0)) == error(DENIED)
    assert ask(0xEB, 0x01, 0, 0) == error(PAGE)
    assert ask(0xE4, 0, 0, 0, 1) == error(PAGE)


def test_read(flashed: Ask, file: bytes) -> None:
    assert read(flashed, len(file)) == file
    assert flashed(0xF5, 1) == error(RANGE)
    assert flashed(mta(0)) == OK
    crc = flashed(0xF3, b"\0\0\0", struct.pack("<I", len(file)))
    assert crc == struct.pack("<BBxxI", 0xFF, 9, zlib.crc32(file))
    assert flashed(short_upload(4, 8)) == OK + file[8:12]


@pytest.mark.parametrize("address", [0, 1, 2**31, 2**32 - 1])
@pytest.mark.parametrize("extension", [0, 1, 2, 3, 4, 0x80])
def test_outside_of_what_is_there(flashed: Ask, file: bytes, address: int, extension: int) -> None:
    limit = {0: len(file), 1: 32, 2: 40, 3: len(file)}.get(extension, 0)
    where = address if address > 1 else limit - 3 + address if limit else 0
    fits = where + 3 <= limit
    assert (flashed(short_upload(3, where, extension))[:1] == OK) == fits
    assert flashed(short_upload(0, 0, extension)) == error(RANGE)
    assert flashed(short_upload(8, 0, extension)) == error(RANGE)
    assert flashed(mta(where, extension)) == OK
    assert flashed(0xEB, 0x02, 0, 1) == OK
    answer = flashed(0xF0, 3, b"abc")
    assert answer == (OK if fits and extension == 0 else error(RANGE))


def test_flash_is_not_written_by_download(flashed: Ask, file: bytes) -> None:
    assert flashed(mta(0)) == OK
    assert flashed(0xF0, 1, b"x") == error(WRITE)
    assert flashed(0xE4, 0, 1, 0, 0) == error(PAGE)
    assert flashed(0xF0, 5, b"abc") == error(SYNTAX)
    assert read(flashed, len(file)) == file


def test_download_try_store(harness: ctypes.CDLL, unit: Built, flashed: Ask) -> None:
    new = file_of(unit, "UNIT-2")
    used = ctypes.create_string_buffer(len(new))
    download(flashed, new)
    assert read(flashed, len(new)) == new
    # The application goes on with flash until it is switched.
    harness.harness_used(used)
    assert used.raw != new
    assert flashed(0xEB, 0x01, 0, 1) == OK
    harness.harness_used(used)
    assert used.raw == new
    assert (flashed(0xEA, 1, 0)[3], flashed(0xEA, 2, 0)[3]) == (1, 1)
    # Stored, and back on flash.
    assert flashed(0xF9, 1) == OK
    assert flashed(0xFD)[1] == 1
    assert flashed(mta(0)) == OK
    assert flashed(0xF0, 1, b"x") == error(BUSY)
    assert flashed(0xE4, 0, 0, 0, 1) == error(BUSY)
    while harness.harness_background():
        assert flashed(0xFD)[1] == 1
    assert flashed(0xFD)[1] == 0
    assert flashed(0xEA, 1, 0)[3] == 0
    assert flashed(0xEB, 0x02, 0, 0) == OK
    assert read(flashed, len(new)) == new
    info = struct.unpack("<8I", read(flashed, 32, 0, 1))
    assert info[2:8] == (len(new), 1, 2, 2, 1024, 0)
    # After a power cycle too, and the RAM page is a copy.
    harness.harness_power_up()
    flashed(0xFF, 0)
    assert read(flashed, len(new)) == new
    assert flashed(0xEB, 0x02, 0, 1) == OK
    assert read(flashed, len(new)) == new


def test_a_half_download_is_neither_used_nor_stored(flashed: Ask, unit: Built, file: bytes) -> None:
    new = file_of(unit, "UNIT-2")
    for size in range(6, len(new), 90):
        assert flashed(0xE4, 0, 0, 0, 1) == OK
        # A byte that surely differs at the end of the half download.
        download(flashed, new[:size] + bytes([file[size] ^ 0xFF]))
        assert flashed(0xEB, 0x01, 0, 1) == error(PAGE)
        assert flashed(0xF9, 1) == error(PAGE)
    assert flashed(0xEB, 0x02, 0, 0) == OK
    assert read(flashed, len(file)) == file


def test_pages(flashed: Ask) -> None:
    assert flashed(0xEB, 0x00, 0, 0) == error(MODE)
    assert flashed(0xEB, 0x04, 0, 0) == error(MODE)
    assert flashed(0xEB, 0x02, 1, 0) == error(SEGMENT)
    assert flashed(0xEB, 0x83, 9, 0) == OK  # all segments
    assert flashed(0xEB, 0x01, 0, 1) == error(PAGE)  # nothing was downloaded to RAM
    assert flashed(0xEB, 0x02, 0, 2) == error(PAGE)
    assert flashed(0xEA, 3, 0) == error(MODE)
    assert flashed(0xEA, 1, 1) == error(SEGMENT)
    assert flashed(0xE4, 0, 0, 1, 1) == error(SEGMENT)
    assert flashed(0xE4, 0, 0, 0, 0) == error(WRITE)
    assert flashed(0xF9, 2) == error(RANGE)


def test_a_sample_is_one_sample(flashed: Ask) -> None:
    """Taken when address 0 is set; reading on takes no other."""
    names = "<Iii3i3iI"
    first = struct.unpack(names, read(flashed, 40, 0, 2))
    assert first[1:] == (-2, 0, 0, 0, -(2**31), 2**31 - 1, 0, 0, 4)
    assert flashed(short_upload(4, 36, 2)) == OK + struct.pack("<I", 4)
    second = struct.unpack(names, read(flashed, 40, 0, 2))
    # A byte that was read before is of the next sample.
    assert second[0] == first[0] + 2


def test_signals_that_are_read_in_turn_are_of_one_sample(flashed: Ask) -> None:
    """A tool that polls addresses, in whatever order, and the count among them or not."""

    def polled(*addresses: int) -> int:
        for address in addresses:
            flashed(short_upload(4, address, 2))
        return harness_count()

    def harness_count() -> int:
        return int.from_bytes(read(flashed, 4, 0, 2), "little")

    before = harness_count()
    # Setting address 0 takes one: the last call. The first two rounds take one each.
    assert polled(24, 28, 32, 4, 24, 28, 4, 32) == before + 2
    assert polled(32, 4) == before + 3


# ---- changes by a calibration tool ----


def test_a_changed_constant(harness: ctypes.CDLL, flashed: Ask, unit: Built, file: bytes) -> None:
    used = ctypes.create_string_buffer(len(file))
    at = 4 * (15 + 2 + 3)  # c_0 of Nxx: header, range, first, origin and gain before it
    (word,) = struct.unpack_from("<i", file, at)
    assert word == unit.plan.segments[0].coefficients[0, 0]
    changed = struct.pack("<i", word - 1000)
    assert flashed(mta(at, 3)) == OK
    assert flashed(0xF0, 4, changed) == error(WRITE)
    assert flashed(0xEB, 0x02, 0, 1) == OK
    assert flashed(0xE4, 0, 0, 0, 1) == OK
    assert flashed(mta(at, 3)) == OK
    assert flashed(0xF0, 4, changed) == OK
    # The application has flash until it is switched, then each change at once.
    assert flashed(0xEB, 0x01, 0, 1) == OK
    harness.harness_used(used)
    found = used.raw
    assert found == read(flashed, len(file)) == read(flashed, len(file), 0, 3)
    image, before = found[: len(unit.image)], file[: len(unit.image)]
    assert image[:-4] == before[:at] + changed + before[at + 4 : -4]
    identity = identity_of(found)  # both CRCs
    assert identity is not None
    assert (identity.serial, identity.inputs_sha256) == ("UNIT-1", "0" * 64)
    assert epk(flashed) == b"UNIT-1 " + b"0" * 16
    for part in (2, 2):  # in pieces too, from the address on
        flashed(mta(at, 3))
        assert flashed(0xF0, part, file[at : at + part]) == OK
        assert flashed(0xF0, 4 - part, file[at + part : at + 4]) == OK
    harness.harness_used(used)
    assert used.raw[: len(before)] == before


def test_what_could_overflow_is_not_taken(flashed: Ask, file: bytes) -> None:
    """Every word, against what fixed-point.md lets a loader accept."""
    layout = Layout(header=15, segments=1, order=2, inverse=False)
    flashed(0xEB, 0x03, 0, 0)
    flashed(0xE4, 0, 0, 0, 1)
    flashed(0xEB, 0x03, 0, 1)
    rng, count = Random(9), int.from_bytes(file[8:12], "little") // 4
    words = list(struct.unpack_from(f"<{count}i", file))
    results = set()
    for _ in range(3000):
        index = rng.randrange(count + 2)
        near = words[min(index, count - 1)] + rng.randint(-9, 9)
        value = rng.choice([*ENDS, rng.randint(*ENDS[:: len(ENDS) - 1]), near])
        value = min(max(value, ENDS[0]), ENDS[-1])
        tried = [*words[:index], value, *words[index + 1 :]]
        # The header tells the shape: what is there may be written again.
        same = 3 <= index < 15 and value == words[index]
        fits = same or (15 <= index < count - 1 and layout.is_safe(tried))
        flashed(mta(4 * index, 3))
        answer = flashed(0xF0, 4, struct.pack("<i", value))
        assert answer == (OK if fits else error(RANGE)), (index, value)
        if fits:
            words[index] = value
        results.add(fits)
    found = read(flashed, 4 * count, 0, 3)
    assert list(struct.unpack(f"<{count - 1}i", found[:-4])) == words[:-1]
    assert results == {True, False}


def test_a_half_download_cannot_be_changed(flashed: Ask, unit: Built) -> None:
    download(flashed, file_of(unit, "UNIT-2")[:60])
    half = read(flashed, 100)
    flashed(mta(80, 3))
    assert flashed(0xF0, 4, bytes(4)) == error(RANGE)
    assert read(flashed, 100) == half
