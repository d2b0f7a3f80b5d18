"""CRCs against published check values, AUTOSAR's profiles against the specification's examples.

The values of profiles 1, 2, 4 and 5 for other payloads are those of the package autosar-e2e 1.0.0.
"""

from __future__ import annotations

import numpy as np
import pytest

from triaxcal.rig.description import crc
from triaxcal.rig.description.protection import PROTECTIONS, Guard
from triaxcal.rig.description.signals import Signal


@pytest.mark.parametrize(
    ("model", "check"),
    [
        # Values for the bytes "123456789": AUTOSAR, Specification of CRC Routines; the catalogue
        # of parametrised CRC algorithms (CRC-8/SMBUS, CRC-16/IBM-3740, CRC-32/ISO-HDLC).
        (crc.CRC8_J1850, 0x4B),
        (crc.CRC8_2F, 0xDF),
        (crc.CRC8, 0xF4),
        (crc.CRC16_CCITT, 0x29B1),
        (crc.CRC32_ETHERNET, 0xCBF43926),
        (crc.CRC32_P4, 0x1697D06A),
    ],
)
def test_crcs_have_their_check_values(model, check):
    data = np.frombuffer(b"123456789", np.uint8)[None]
    assert model.of(data).tolist() == [check]


def guard(start, length, little=True, ids=(), *, mode="both", counter=None):
    return Guard(Signal("Crc", start, length, little, False), 0x123, counter, ids, mode)


LOW_NIBBLE = Signal("Counter", 8, 4, True, False)
TO_16 = tuple(range(1, 17))


@pytest.mark.parametrize(
    ("name", "made_with", "payload"),
    [
        # PRS E2E Protocol, examples of the profiles: Data ID 0x123, and the next counter.
        ("e2e-p01", guard(0, 8, ids=(0x123,)), "cc00000000000000"),
        ("e2e-p01", guard(0, 8, ids=(0x123,)), "9101000000000000"),
        ("e2e-p01", guard(0, 8, ids=(0x123,), mode="nibble"), "2a10000000000000"),
        ("e2e-p01", guard(0, 8, ids=(0x123,), mode="nibble"), "7711000000000000"),
        ("e2e-p02", guard(0, 8, ids=TO_16, counter=LOW_NIBBLE), "1b01000000000000"),
        ("e2e-p02", guard(0, 8, ids=TO_16, counter=LOW_NIBBLE), "9802000000000000"),
        # Data ID 0x0A0B0C0D; its CRC comes high byte first.
        ("e2e-p04", guard(71, 32, False, (0x0A0B0C0D,)), "001000000a0b0c0d862b055600000000"),
        ("e2e-p05", guard(0, 16, ids=(0x1234,)), "1cca000000000000"),
        # By autosar-e2e.
        ("e2e-p01", guard(0, 8, ids=(0x123,)), "8201020304050607"),
        ("e2e-p01", guard(0, 8, ids=(0x123,), mode="low"), "8001020304050607"),
        (
            "e2e-p01",
            guard(0, 8, ids=(0x123,), mode="alternating", counter=LOW_NIBBLE),
            "1101020304050607",
        ),
        (
            "e2e-p01",
            guard(0, 8, ids=(0x123,), mode="alternating", counter=LOW_NIBBLE),
            "ce00000000000000",
        ),
        ("e2e-p01", guard(0, 8, ids=(0x123,), mode="nibble"), "6411020304050607"),
        ("e2e-p02", guard(0, 8, ids=TO_16, counter=LOW_NIBBLE), "0e00000000000000"),
    ],
)
def test_profiles_of_autosar_give_the_published_values(name, made_with, payload):
    protection, data = PROTECTIONS[name], np.frombuffer(bytes.fromhex(payload), np.uint8)[None]
    sent = made_with.signal.raw(data)
    assert protection.crc(made_with, data).tolist() == sent.tolist()
    for bit in range(8 * data.shape[1]):
        flipped = data.copy()
        flipped[0, bit // 8] ^= 1 << bit % 8
        assert protection.crc(made_with, flipped) != made_with.signal.raw(flipped), bit


def test_a_payload_under_another_data_id_is_found():
    data = np.frombuffer(bytes.fromhex("001000000a0b0c0d862b055600000000"), np.uint8)[None]
    other = guard(71, 32, False, (0x0A0B0C0E,))
    assert PROTECTIONS["e2e-p04"].crc(other, data).tolist() == [-1]
    data = np.frombuffer(bytes.fromhex("2a10000000000000"), np.uint8)[None]
    other = guard(0, 8, ids=(0x223,), mode="nibble")
    assert PROTECTIONS["e2e-p01"].crc(other, data).tolist() == [-1]


@pytest.mark.parametrize("name", [n for n in PROTECTIONS.names if not n.startswith("e2e")])
@pytest.mark.parametrize("place", [0, 3, 7])
def test_a_plain_crc_may_stand_anywhere(name, place):
    """Against crccheck, whose CRC of the other bytes it is."""
    crccheck = pytest.importorskip("crccheck.crc")
    models = {
        "tilter": crccheck.Crc8Autosar, "sae-j1850": crccheck.Crc8SaeJ1850,
        "crc-8h2f": crccheck.Crc8Autosar, "crc-8": crccheck.Crc8Smbus,
        "crc-16": crccheck.Crc16Ibm3740, "crc-32": crccheck.Crc32,
        "crc-32p4": crccheck.Crc32Autosar,
    }  # fmt: skip
    bits = PROTECTIONS[name].bits[0]
    made_with = guard(8 * place, bits)
    data = np.random.default_rng(3).integers(0, 256, (20, 16), dtype=np.uint8)
    before = (0x123).to_bytes(2, "little") if name == "tilter" else b""
    for row in data:
        others = row[:place].tobytes() + row[place + bits // 8 :].tobytes()
        expected = models[name].calc(before + others)
        assert PROTECTIONS[name].crc(made_with, row[None]).tolist() == [expected]
