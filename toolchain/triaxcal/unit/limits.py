"""[limits] of unit.toml: what is accepted."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, setting
from triaxcal.base.kinds import number
from triaxcal.unit.thermal import near_t0

AT_T0, OVER_RANGE = "at T0", "over the range"
"""Where each of both limits holds, in words."""
WHERE = {"limits.at_t0_g": AT_T0, "limits.over_range_g": OVER_RANGE}

_OF_A_RECORDING = {"default": 0.02}
"""g. The limits of P1 (13) are those of a navigation accelerometer."""


@dataclass(frozen=True)
class Limits:
    """[limits]: what is accepted.

    Attributes
    ----------
    at_t0_g
        Largest | |a| - g | that is accepted at T0, P1 (13).
    over_range_g
        The same over the working range.
    """

    at_t0_g: float = setting(number(1e-9, 1.0), 3e-4, "g")
    over_range_g: float = setting(number(1e-9, 1.0), 10e-4, "g")

    def at(self, temp_degc: float, t0_degc: float) -> tuple[float, str]:
        """Limit at a temperature, g, and its key."""
        if near_t0(temp_degc, t0_degc):
            return self.at_t0_g, "limits.at_t0_g"
        return self.over_range_g, "limits.over_range_g"


LIMITS = TableKeys.of(Limits)
RECORDED_LIMITS = LIMITS.but(at_t0_g=_OF_A_RECORDING, over_range_g=_OF_A_RECORDING)
