"""Where the console script starts: an interrupt during the imports is caught as well."""

from __future__ import annotations

import signal
import sys

INTERRUPTED = "triaxcal: interrupted; nothing half-written was left"


def entry() -> None:
    """Run the command line."""
    try:
        # The same clean way out for a closed terminal and a polite kill as for Ctrl-C.
        for name in ("SIGTERM", "SIGHUP"):  # Windows has no SIGHUP
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), signal.default_int_handler)
        from triaxcal.cli.main import run  # noqa: PLC0415

        run()
    except KeyboardInterrupt:
        print(INTERRUPTED, file=sys.stderr)
        sys.exit(1)
