"""What is at which address of a node: triax_xcp.h in Python. Words are little-endian."""

from __future__ import annotations

from dataclasses import dataclass

REQUEST_ID, RESPONSE_ID = 0x650, 0x651
"""CAN ids of the example node."""
FILE, INFO, SAMPLE, CHANGE = 0, 1, 2, 3
"""Address extensions."""
FLASH_PAGE, RAM_PAGE = 0, 1
INFO_SIZE, SAMPLE_SIZE = 32, 40
INFO_VERSION = 1


@dataclass(frozen=True)
class Signal:
    """A word of a sample: its name, whether it is signed, and what it is."""

    name: str
    signed: bool
    text: str


SIGNALS = (
    Signal("count", False, "number of the sample"),
    Signal("temp_code", True, "temperature code, as triax_set_temperature took it"),
    Signal("rate_code", True, "rate of temperature, 0 without a term in dT/dt"),
    *(Signal(f"raw_{axis}", True, f"raw code {axis}, as triax_apply took it") for axis in "xyz"),
    *(Signal(f"accel_{axis}", True, f"specific force {axis}, compensated") for axis in "xyz"),
    Signal("status", False, "status of triax_set_temperature and triax_apply"),
)
"""The words of a sample in their order, from address 0 on."""
SAMPLE_FORMAT = "<" + "".join("i" if signal.signed else "I" for signal in SIGNALS)
"""The same for `struct`."""
