"""Units of the columns of an IMU in SI units, and directions of its axes."""

from __future__ import annotations

import math

from triaxcal.dynamic.noise import MICRO_G

COUNT = "count"
"""Unit of raw counts, whose size unit.toml states."""
UPWARD = ("+x", "-x", "+y", "-y", "+z", "-z")
RATE_UNITS = {"rad/s": 1.0, "deg/s": math.pi / 180, "deg/h": math.pi / 648000, COUNT: math.nan}
ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180, "arcsec": math.pi / 648000}
FORCE_UNITS = {"m/s^2": 1.0, "g": 1e6 * MICRO_G, "mg": 1e3 * MICRO_G, COUNT: math.nan}
VELOCITY_UNITS = {"m/s": 1.0, "mm/s": 1e-3}
