"""AVR: int of 16 bits."""

import re

from triaxcal.targets.cores.core import Core

_LINE = re.compile(r"^(?:\x1b\[[0-9;]*m)*(\w+ [0-9a-f]{8})\.(?:\x1b\[[0-9;]*m)*$", re.MULTILINE)
"""A line of the serial port as simavr reports it: in colour, with a dot for its end."""


def _printed(_output: str, errors: str) -> str:
    return "".join(f"{line}\n" for line in _LINE.findall(errors))


ENTRY = Core(
    "AVR",
    "AVR (16-bit int)",
    "ATmega1284P (128 KB of flash, 16 KB of RAM) under simavr.",
    "avr-gcc",
    "avr",
    ("-mmcu=atmega1284p",),
    ("simavr", "-m", "atmega1284p", "-f", "16000000"),
    {},
    no_long_multiply=True,
    compilers=("gcc",),
    vectors=512,
    printed=_printed,
    rank=9,
)
