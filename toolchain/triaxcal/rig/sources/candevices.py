"""The CAN network devices of this machine; Linux alone has any."""

from __future__ import annotations

from pathlib import Path

_CAN_DEVICE = "280"  # ARPHRD_CAN
_NETWORK = Path("/sys/class/net")


def can_devices() -> list[str]:
    """Names of the CAN network devices of this machine."""
    if not _NETWORK.is_dir():
        return []
    types = ((d.name, d / "type") for d in sorted(_NETWORK.iterdir()))
    return [
        name
        for name, kind in types
        if kind.is_file() and kind.read_text(encoding="utf-8").strip() == _CAN_DEVICE
    ]
