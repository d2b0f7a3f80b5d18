"""[temperature_sensor] of unit.toml: what the codes of the thermometer are."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, setting
from triaxcal.base.kinds import number


@dataclass(frozen=True)
class TemperatureSensor:
    """[temperature_sensor]: what the codes of the thermometer are.

    Attributes
    ----------
    degc_per_code
        T = code * degc_per_code + degc_at_zero; at most 131 072 codes in the working range,
        each of which is proved and tested.
    degc_at_zero
        Temperature of the code 0.
    """

    degc_per_code: float = setting(number(1e-6, 10.0), unit="degC", example="0.0078125")
    degc_at_zero: float = setting(number(-1e4, 1e4), 0.0, "degC")

    def degc(self, code: float) -> float:
        """Temperature of a code."""
        return code * self.degc_per_code + self.degc_at_zero

    def code(self, temp_degc: float) -> int:
        """Nearest code of a temperature."""
        return round((temp_degc - self.degc_at_zero) / self.degc_per_code)


TEMPERATURE_SENSOR = TableKeys.of(TemperatureSensor)
