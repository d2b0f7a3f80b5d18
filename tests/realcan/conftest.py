"""CAN devices of the kernel. `make test-can`."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator

import pytest

WORK = os.environ.get("TRIAXCAL_CAN_WORK")


def ip(*arguments: str) -> None:
    subprocess.run(["ip", "link", *arguments], check=True, capture_output=True, text=True)


@pytest.fixture
def vcan() -> Iterator[str]:
    ip("add", "dev", "vcan0", "type", "vcan")
    ip("set", "vcan0", "mtu", "72", "up")
    yield "vcan0"
    subprocess.run(["ip", "link", "del", "vcan0"], check=False, capture_output=True)


@pytest.fixture
def second() -> Iterator[str]:
    """Another device, which is not connected to the first."""
    ip("add", "dev", "vcan1", "type", "vcan")
    ip("set", "vcan1", "up")
    yield "vcan1"
    subprocess.run(["ip", "link", "del", "vcan1"], check=False, capture_output=True)
