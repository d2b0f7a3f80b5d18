"""What an A2L says of a node with `firmware_ref/xcp`, whose addresses are those of triax_xcp.h."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.codegen.image import constant_words, header_names
from triaxcal.codegen.names import names_of
from triaxcal.delivery.firmware import Firmware
from triaxcal.device.layout import SIGNALS
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.rate import RATE_Q
from triaxcal.report.a2l_words import Method, temperature_method

NODE_COMMANDS = {
    "GET_ID": 250, "SET_REQUEST": 249, "SET_MTA": 246, "UPLOAD": 245, "SHORT_UPLOAD": 244,
    "BUILD_CHECKSUM": 243, "DOWNLOAD": 240, "SET_CAL_PAGE": 235, "GET_CAL_PAGE": 234,
    "COPY_CAL_PAGE": 228,
}  # fmt: skip
"""Optional commands that triax_xcp.c knows, by their codes."""
_WORD = 4


@dataclass(frozen=True)
class Place:
    """Where the constants stand in triax_calib.bin, and whether flash can be written directly."""

    address: int
    size: int
    writable: bool = False


@dataclass(frozen=True)
class Measurement:
    """A signal: its type in ASAP2, the name of its conversion, and the ends of its values."""

    name: str
    text: str
    type: str
    method: str
    limits: tuple[float, float]
    address: int


def place_of(plan: Plan) -> Place:
    """The constants in the file, behind its header."""
    return Place(_WORD * len(header_names(plan)), _WORD * len(constant_words(plan)))


def measurements(firmware: Firmware) -> tuple[list[Measurement], list[Method]]:
    """The words of a sample, and their conversions."""
    prefix, plan = names_of(firmware.plan).triad.upper(), firmware.plan
    sensor = firmware.fitted.unit.temperature_sensor
    step = sensor.degc_per_code * 2.0**-RATE_Q
    force = Method("FORCE", "result", "g", 2.0**-plan.shape.output_q, 0.0)
    found = {f"accel_{axis}": force for axis in "xyz"} | {
        "temp_code": temperature_method(sensor),
        "rate_code": Method("RATE_RANGE", "rate of temperature", "K/s", step, 0.0),
    }
    methods = {name: method.prefixed(prefix) for name, method in found.items()}
    signals = []
    for i, signal in enumerate(SIGNALS):
        method = methods.get(signal.name)
        ends = (-(2.0**31), 2.0**31 - 1) if signal.signed else (0.0, 2.0**32 - 1)
        signals.append(
            Measurement(
                f"{prefix}_{signal.name}",
                signal.text,
                "SLONG" if signal.signed else "ULONG",
                method.name if method else "NO_COMPU_METHOD",
                method.limits if method else ends,
                _WORD * i,
            )
        )
    return signals, list(methods.values())
