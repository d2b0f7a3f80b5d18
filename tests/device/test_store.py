"""Two slots of flash: whenever the power fails, the old or the new calibration is in use."""

from __future__ import annotations

import ctypes
import itertools

import pytest

from builds import Built
from device.conftest import file_of

FOREVER, STAYS = 0xFFFFFFFF, 0x100
IDLE, BUSY, DONE, REFUSED, NOT_ERASED, NOT_WRITTEN = range(6)
NO_SLOT = 2


def in_use(harness: ctypes.CDLL, size: int) -> tuple[int, bytes]:
    file = ctypes.create_string_buffer(size)
    slot = harness.harness_in_use(file)
    return slot, file.raw


def start(harness: ctypes.CDLL, unit: int = 8) -> None:
    harness.harness_reset(unit)
    assert harness.harness_power_up() == 0


@pytest.mark.parametrize(
    ("unit_bytes", "torn", "before"),
    [
        *itertools.product((8,), (STAYS, 0x00, 0xA5), (1, 2)),
        *itertools.product((1, 32), (0xA5,), (2,)),
        (8, 0xA5, 0),
    ],
)
def test_power_fails_at_every_byte(
    harness: ctypes.CDLL, unit: Built, unit_bytes: int, torn: int, before: int
) -> None:
    """`before`: stores before: 0 (nothing in flash), 1 (slot 0 in use), 2 (slot 1, 0 is older)."""
    old, new = file_of(unit, "OLD-1"), file_of(unit, "NEW-2")
    found = (ctypes.c_uint32 * 4)()
    positions = harness.harness_every_byte(old, new, unit_bytes, torn, before, found)
    with_old, with_new, neither, failed_again = found
    padded = -(-len(new) // unit_bytes) * unit_bytes
    assert positions == 1024 + padded + 32 + 1  # erased, written, recorded; one without failure
    assert neither == 0
    assert failed_again == 0
    # New only when the last byte of the record that is not 0xFF is there: 16 of its 32 bytes.
    assert 1 <= with_new <= 17
    assert with_old + with_new == positions


def test_slots_take_turns(harness: ctypes.CDLL, unit: Built) -> None:
    start(harness)
    files = [file_of(unit, f"UNIT-{i}") for i in range(5)]
    assert in_use(harness, len(files[0]))[0] == NO_SLOT
    for i, file in enumerate(files):
        assert harness.harness_store(file, FOREVER, STAYS) == DONE
        assert in_use(harness, len(file)) == (i % 2, file)
        harness.harness_power_up()
        assert in_use(harness, len(file)) == (i % 2, file)


def test_what_the_loader_refuses_is_not_stored(harness: ctypes.CDLL, unit: Built) -> None:
    start(harness)
    good = file_of(unit, "GOOD")
    harness.harness_store(good, FOREVER, STAYS)
    for at in range(0, len(good), 7):
        damaged = bytearray(good)
        damaged[at] ^= 0x10
        assert harness.harness_store(bytes(damaged), FOREVER, STAYS) == REFUSED
        assert in_use(harness, len(good)) == (0, good)


@pytest.mark.parametrize(("how", "status"), [(1, NOT_ERASED), (2, NOT_WRITTEN)])
def test_flash_that_fails_is_reported(
    harness: ctypes.CDLL, unit: Built, how: int, status: int
) -> None:
    start(harness)
    files = [file_of(unit, serial) for serial in "ABC"]
    for file in files[:2]:
        assert harness.harness_store(file, FOREVER, STAYS) == DONE
    harness.harness_break(how)
    assert harness.harness_store(files[2], FOREVER, STAYS) == status
    harness.harness_power_up()
    assert in_use(harness, len(files[1])) == (1, files[1])


@pytest.mark.parametrize("unit_bytes", [0, 3, 64])
def test_a_wrong_unit_is_refused(harness: ctypes.CDLL, unit_bytes: int) -> None:
    harness.harness_reset(unit_bytes)
    assert harness.harness_power_up() == 1
