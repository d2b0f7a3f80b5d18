"""A bus of python-can by its name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import can

from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.base.tomltable import did_you_mean, shown
from triaxcal.rig.bus.busname import channel_and_options

_CONFIG = "config"
_FORM = "interface:channel,option=value,... or config:section"


@dataclass(frozen=True)
class BusName:
    """What a name such as "pcan:PCAN_USBBUS1,bitrate=500000" says.

    Attributes
    ----------
    interface, channel : str
        Of python-can; "" where its configuration says them.
    section : str
        Of python-can's configuration file; "" for [default].
    options : mapping
        Texts as they stand; python-can makes numbers of them.
    """

    interface: str
    channel: str
    section: str
    options: dict[str, str]


def bus_name(name: str) -> BusName:
    """Interface, channel and options of a bus.

    Raises
    ------
    UsageError
        When python-can has no such interface, or an option is given twice.
    """
    interface, _, rest = name.partition(":")
    channel, options = channel_and_options(rest, _FORM)
    if interface == _CONFIG:
        return BusName("", "", channel, options)
    if interface not in can.VALID_INTERFACES:
        known = sorted(can.VALID_INTERFACES)
        raise UsageError(
            "--bus",
            f"found {shown(interface)}{did_you_mean(interface, known)}",
            expected=f"a CAN device, or {_FORM}, interface one of " + ", ".join(known),
        )
    return BusName(interface, channel, "", options)


def open_bus(name: str, fd: bool) -> can.BusABC:
    """Bus of a name such as "pcan:PCAN_USBBUS1,bitrate=500000", through python-can.

    What the name does not say comes from python-can's environment and configuration files.

    Parameters
    ----------
    fd : bool
        The frames are CAN FD's; an option "fd" takes precedence.

    Raises
    ------
    UsageError
        When python-can has no such interface.
    RefusedError
        When the channel cannot be opened; lists those that can be found.
    """
    said = bus_name(name)
    wanted: dict[str, Any] = {"fd": fd} if fd or said.interface else {}
    try:
        return can.Bus(
            said.channel or None,
            said.interface or None,
            said.section or None,
            **{**wanted, **said.options},
        )
    except Exception as error:  # each driver raises what its maker chose
        raise _refusal(name, said, error) from error


def settings_of(name: str) -> dict[str, str]:
    """What name and configuration files of python-can say of a bus, as text."""
    said = bus_name(name)
    given = {"interface": said.interface, "channel": said.channel, **said.options}
    try:
        found = can.util.load_config(
            config={key: value for key, value in given.items() if value},
            context=said.section or None,
        )
    except (can.CanError, ValueError):
        return dict(said.options)
    return {str(key): str(value) for key, value in found.items()}


def _refusal(name: str, said: BusName, error: Exception) -> RefusedError:
    if not said.interface:
        section = f"[{said.section or 'default'}]"
        remedy = f"state interface and channel in {section} of python-can's configuration file"
    else:
        found = can.detect_available_configs(said.interface)
        channels = ", ".join(str(c.get("channel")) for c in found[:20]) or "none found"
        remedy = f"channels of {said.interface}: {channels}"
    return RefusedError(name, f"cannot be opened: {error}", remedy=remedy)
