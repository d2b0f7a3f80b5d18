"""pyxcp, without what its import does to the whole program.

It replaces the hooks by which Python prints exceptions and values; here they are put back.
"""

from __future__ import annotations

import sys

_hooks = sys.excepthook, sys.displayhook

from construct.core import ConstructError  # noqa: E402
from pyxcp.config import create_application_from_config  # noqa: E402
from pyxcp.master import Master  # noqa: E402
from pyxcp.types import Command, XcpResponseError, XcpTimeoutError  # noqa: E402

sys.excepthook, sys.displayhook = _hooks

__all__ = [
    "Command",
    "ConstructError",
    "Master",
    "XcpResponseError",
    "XcpTimeoutError",
    "create_application_from_config",
]
