"""What signals are by the names that makers give them; guesses, for proposals alone."""

from __future__ import annotations

import re

COUNTER = re.compile(r"c(ou)?nt|seq|alive|rolling|mc$", re.IGNORECASE)
CRC = re.compile(r"crc|check", re.IGNORECASE)
VALID = re.compile(r"valid|ok$|good", re.IGNORECASE)
STATUS = re.compile(r"stat|sts|valid|qual|merit|err|fault|fail|diag", re.IGNORECASE)
