"""[adc] of unit.toml: what the raw codes are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import TableKeys, Values, setting
from triaxcal.base.kinds import number, whole
from triaxcal.unit.recording import RecordingLayout

DEFAULT_LSB: Mapping[str, float] = MappingProxyType(
    {"m/s^2": 2.0**-16, "g": 2.0**-20, "mg": 2.0**-10, "count": 1.0, "V": 2.0**-22, "mV": 2.0**-12}
)
"""Reading of one raw code without [adc]: at 24 bits +-128 m/s^2, +-8 g, +-2 V."""
_CODE = whole(-(2**31), 2**31 - 1)


@dataclass(frozen=True)
class Adc:
    """The voltage of a raw code: U = code * full_scale_v / 2^(bits - 1)."""

    bits: int
    full_scale_v: float
    code_min: int
    code_max: int

    @property
    def volts_per_code(self) -> float:
        """Volts of one code."""
        return float(self.full_scale_v / 2 ** (self.bits - 1))

    @property
    def largest_v(self) -> float:
        """Size of the largest voltage that a code stands for."""
        return max(abs(self.code_min), abs(self.code_max)) * self.volts_per_code


def whole_adc(bits: int, full_scale_v: float) -> Adc:
    """Adc whose every code is good."""
    half = 2 ** (bits - 1)
    return Adc(bits, full_scale_v, -half, half - 1)


@dataclass(frozen=True)
class _AdcTable:
    """[adc]: what the raw codes are.

    Attributes
    ----------
    bits
        Width of the signed raw code.
    full_scale_v
        Voltage of the code 2^(bits - 1): U = code * full_scale_v / 2^(bits - 1).
    code_min
        Lowest raw code that the firmware treats as good.
    code_max
        Highest good raw code.
    """

    bits: int = setting(whole(8, 32), unit="bit", example="24")
    full_scale_v: float = setting(number(1e-3, 100.0), unit="V", example="2.5")
    code_min: int | None = setting(_CODE, None, "code", words="-2^(bits - 1)", example="-32000")
    code_max: int | None = setting(_CODE, None, "code", words="2^(bits - 1) - 1", example="32000")


@dataclass(frozen=True)
class _RecordedAdcTable(_AdcTable):
    """[adc]: what the raw codes are.

    Attributes
    ----------
    lsb
        Reading of one raw code, in the unit of the recording; in place of full_scale_v.
    """

    lsb: float | None = setting(
        number(1e-12, 1e6),
        None,
        words="1 count; 2^-16 m/s^2, 2^-20 g, 2^-10 mg, 2^-22 V, 2^-12 mV",
        example="1",
    )


ADC = TableKeys.of(_AdcTable)
RECORDED_ADC = TableKeys.of(_RecordedAdcTable).relaxed()
RECORDED_ADC = RECORDED_ADC.but(bits={"default_words": "16 of counts, else 24"})


def adc_of(values: Values, bits: int | None = None, full_scale_v: float | None = None) -> Adc:
    """Codes of a table [adc]; `bits` and `full_scale_v` stand for those that it leaves out.

    Raises
    ------
    RefusedError
        For a value out of its range, of which the codes are those of `bits`.
    """
    bits = bits or int(values[values.keys["bits"]])
    every = whole_adc(bits, 1.0)
    code = whole(every.code_min, every.code_max)
    ends = {n: replace(values.keys[n], kind=code) for n in ("code_min", "code_max")}
    table = replace(values, keys={**values.keys, **ends}).record(_AdcTable)
    low = every.code_min if table.code_min is None else table.code_min
    high = every.code_max if table.code_max is None else table.code_max
    if low >= high:
        end = "code_min" if "code_min" in values else "code_max"
        raise values.refuse(end, f"code_min below code_max, which are {low} and {high}")
    return Adc(bits, full_scale_v or table.full_scale_v, low, high)


def recorded_adc(recording: RecordingLayout, values: Values) -> Adc:
    """How a raw code stands for a reading of a recording: "V" is the reading's unit.

    Raises
    ------
    RefusedError
        As `adc_of`; where full_scale_v is given for other readings than volts.
    """
    unit = recording.acceleration_unit
    if "full_scale_v" in values:
        if unit != "V" or "lsb" in values or "bits" not in values:
            raise RefusedError(
                values.where("full_scale_v"),
                f'given for a recording in "{unit}"',
                expected=f"lsb, the reading in {unit} of one raw code, and bits",
            )
        return adc_of(values)
    lsb = values[values.keys["lsb"]] or DEFAULT_LSB[unit]
    bits = values[values.keys["bits"]] or (16 if unit == "count" else 24)
    return adc_of(values, bits, lsb * 2.0 ** (bits - 1))
