"""A bus of python-can by its name."""

from __future__ import annotations

import can

from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.base.tomltable import did_you_mean, shown


def open_bus(name: str, fd: bool) -> can.BusABC:
    """Bus of a name such as "pcan:PCAN_USBBUS1", through python-can.

    Raises
    ------
    UsageError
        When python-can has no such interface.
    RefusedError
        When the channel cannot be opened; lists those that can be found.
    """
    interface, _, channel = name.partition(":")
    if interface not in can.VALID_INTERFACES:
        known = sorted(can.VALID_INTERFACES)
        raise UsageError(
            "--bus",
            f"found {shown(interface)}{did_you_mean(interface, known)}",
            expected="a CAN device, or interface:channel, interface one of " + ", ".join(known),
        )
    try:
        return can.Bus(interface=interface, channel=channel or None, fd=fd)
    except Exception as error:  # each driver raises what its maker chose
        found = can.detect_available_configs(interface)
        channels = ", ".join(str(c.get("channel")) for c in found[:20]) or "none found"
        raise RefusedError(
            name, f"cannot be opened: {error}", remedy=f"channels of {interface}: {channels}"
        ) from error
