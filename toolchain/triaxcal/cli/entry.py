"""Where the console script starts: an interrupt during the imports is caught as well."""

from __future__ import annotations

import gc
import signal
import sys

_COLLECTED_AFTER = 100_000
"""New objects between two collections of cycles: at Python's 700 the imports alone cause hundreds,
and nothing that a command makes in number is part of a cycle."""
INTERRUPTED = "triaxcal: interrupted; nothing half-written was left"


def entry() -> None:
    """Run the command line."""
    gc.set_threshold(_COLLECTED_AFTER)
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
