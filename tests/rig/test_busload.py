"""Load of a bus: bits by the standard, rates of the bus that is there."""

from __future__ import annotations

import json
import subprocess

import numpy as np
import pytest

from triaxcal.rig.bus.busload import BitRates, bits_of, rates_of_device, rates_of_options
from triaxcal.rig.bus.frames import BRS, EFF_FLAG, RTR_FLAG, Frames
from triaxcal.rig.bus.openbus import settings_of


def frame(can_id, length, fd=False, marks=0):
    width = 64 if fd else 8
    return Frames(
        np.zeros(1, np.int64), np.array([can_id], np.uint32), np.array([length], np.uint8),
        np.array([fd]), np.zeros((1, width), np.uint8), np.array([marks], np.uint8),
    )  # fmt: skip


# Least bits of ISO 11898-1, the most stuff bits, counted by hand: a frame of an 11-bit ID without
# payload has 47 bits, of which 34 are stuffed after five equal ones: (34 - 1) / 4 = 8 more at most.
@pytest.mark.parametrize(
    ("one", "least", "most"),
    [
        (frame(0x100, 0), 47, 47 + 8),
        (frame(0x100, 8), 111, 111 + 24),
        (frame(0x100 | EFF_FLAG, 8), 131, 131 + 29),
        (frame(0x100 | RTR_FLAG, 8), 47, 47 + 8),
    ],
)
def test_classic_frames_have_their_bits(one, least, most):
    bits, fast = bits_of(one)
    assert fast == 0
    assert least <= bits <= most


def test_the_data_of_can_fd_go_at_their_own_rate():
    slow, fast = bits_of(frame(0x100, 64, fd=True, marks=BRS))
    # 17 bits before and 13 after; 1 ESI, 4 length, 512 data, 4 count, 21 CRC, 7 fixed stuff bits.
    assert 30 <= slow <= 30 + 5
    assert 549 <= fast <= 549 + 129
    whole, none = bits_of(frame(0x100, 64, fd=True))
    assert none == 0
    assert whole == pytest.approx(slow + fast)
    # 10k frames/s of 64 bytes fill 1M/8M, as measured on a bus.
    assert BitRates(1_000_000, 8_000_000).load(1e4 * slow, 1e4 * fast) == pytest.approx(
        1.0, abs=0.2
    )


def test_half_the_bit_rate_is_twice_the_load():
    assert BitRates(500_000).load(1e5, 0.0) == 2 * BitRates(1_000_000).load(1e5, 0.0) == 0.2


def test_the_rates_of_a_device_are_what_it_was_set_up_with(monkeypatch):
    said = [{"linkinfo": {"info_data": {"bittiming": {"bitrate": 250_000},
                                        "data_bittiming": {"bitrate": 2_000_000}}}}]  # fmt: skip

    def run(command, **_):
        assert command[-2:] == ["dev", "can7"]
        return subprocess.CompletedProcess(command, 0, json.dumps(said).encode())

    monkeypatch.setattr("subprocess.run", run)
    assert rates_of_device("can7") == BitRates(250_000, 2_000_000)
    said[0] = {"ifname": "can7"}  # a virtual device has none
    assert rates_of_device("can7") is None


def test_a_device_that_is_not_there_has_no_rates():
    assert rates_of_device("none-such0") is None


@pytest.mark.parametrize(
    ("name", "rates"),
    [
        ("pcan:PCAN_USBBUS1,bitrate=500000", BitRates(500_000)),
        ("pcan:1,bitrate=500000,data_bitrate=2000000", BitRates(500_000, 2_000_000)),
        ("virtual:x", None),
        ("virtual:x,bitrate=fast", None),
    ],
)
def test_the_rates_of_python_cans_options(name, rates):
    assert rates_of_options(settings_of(name)) == rates
