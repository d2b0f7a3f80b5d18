"""How busy a bus is: bits of the frames, and the bit rates that they are sent at.

Source: ISO 11898-1:2015, 10.4 (frame formats) and 10.5 (stuffing). The number of stuff bits
depends on the payload; half of the most that can be is taken.
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass

import numpy as np

from triaxcal.rig.bus.frames import BRS, Frames

_CLASSIC = 47
"""Bits around the payload with an ID of 11 bits, the 3 between two frames included."""
_STUFFED = 34
"""Of them, those that are stuffed."""
_LONG_ID = 20
_FD_SLOW = 17 + 13
"""Of CAN FD: before the switch of the bit rate, and from the CRC delimiter on."""
_FD_LONG_ID = 19
_FD_FAST = 1 + 4 + 4
"""ESI, length code, count of stuff bits."""
_LOOK_S = 2.0


@dataclass(frozen=True)
class BitRates:
    """Bit rates of a bus in bit/s; `data` is that of CAN FD behind the switch, None without."""

    nominal: int
    data: int | None = None

    def load(self, bits: float, fast_bits: float) -> float:
        """Part of the time that bits a second at either rate take."""
        return bits / self.nominal + fast_bits / (self.data or self.nominal)


def bits_of(frames: Frames) -> tuple[float, float]:
    """Bits of frames at the nominal rate, and at that of the data."""
    extended, _, error = frames.flags
    payload = 8.0 * np.where(frames.flags[1] | error, 0, frames.length)
    classic = _CLASSIC + payload + (_STUFFED - 1 + payload) / 8.0 + _LONG_ID * extended
    crc = np.where(frames.length > 16, 21 + 7, 17 + 6)
    fast = _FD_FAST + crc + payload + payload / 8.0
    slow = _FD_SLOW + _FD_SLOW / 8.0 + _FD_LONG_ID * extended
    switched = frames.fd & ((frames.marks & BRS) != 0)
    nominal = np.where(frames.fd, slow + np.where(switched, 0.0, fast), classic)
    return float(nominal.sum()), float(fast[switched].sum())


def rates_of_device(device: str) -> BitRates | None:
    """Bit rates that a CAN device of Linux was set up with; None where they are not known."""
    try:
        said = subprocess.run(
            ["ip", "-json", "-details", "link", "show", "dev", device],
            capture_output=True, check=False, timeout=_LOOK_S,
        )  # fmt: skip
        info = json.loads(said.stdout)[0]["linkinfo"]["info_data"]
        data = info.get("data_bittiming", {}).get("bitrate")
        return BitRates(int(info["bittiming"]["bitrate"]), int(data) if data else None)
    except (OSError, ValueError, LookupError, TypeError, subprocess.TimeoutExpired):
        return None


def rates_of_options(options: dict[str, str]) -> BitRates | None:
    """Bit rates among the options of a bus of python-can; None where they do not say one."""
    try:
        nominal = int(options["bitrate"])
        data = options.get("data_bitrate")
        return BitRates(nominal, int(data) if data else None) if nominal > 0 else None
    except (KeyError, ValueError):
        return None
