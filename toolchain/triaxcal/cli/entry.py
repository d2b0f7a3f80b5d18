"""Where the console script starts: an interrupt during the imports is caught as well."""

from __future__ import annotations

import sys

INTERRUPTED = "triaxcal: interrupted; nothing half-written was left"


def entry() -> None:
    """Run the command line."""
    try:
        from triaxcal.cli.main import run  # noqa: PLC0415

        run()
    except KeyboardInterrupt:
        print(INTERRUPTED, file=sys.stderr)
        sys.exit(1)
