"""What codes are before anything is calibrated: by the plan, the unit, the bus description."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.description.recorded import VOLTAGES, Recorded
from triaxcal.rig.plan.plan import SessionPlan
from triaxcal.unit.description import UnitDescription

_SCALE_TOLERANCE = 0.2
"""By which the plan's scale and the bus description's may differ; sensitivities spread less."""
_DEGC_TOLERANCE = 0.5
"""By which the temperatures of unit.toml and of the bus description may differ in its range."""

COARSE_MICRO_G = 200.0
"""With larger codes the noise of an accelerometer at rest may stay within one code."""


@dataclass(frozen=True)
class Coding:
    """How recorded values become codes of unit.toml; raw integers stay as they are.

    Attributes
    ----------
    axes : tuple of three floats
        Code = value * factor.
    temperature : tuple of two floats
        Code = value * first + second.
    """

    axes: tuple[float, float, float] = (1.0, 1.0, 1.0)
    temperature: tuple[float, float] = (1.0, 0.0)


AS_SENT = Coding()


@dataclass(frozen=True)
class Nominal:
    """Nominal meaning of codes.

    Attributes
    ----------
    micro_g_per_code : array, shape (3,)
        Signed.
    zero_code : array, shape (3,)
        Code at 0 g; 0 where the bus description says nothing of it.
    step_code : array, shape (3,)
        Step to which readings are rounded: 1 of raw integers, 0 of floats.
    """

    micro_g_per_code: FloatArray
    zero_code: FloatArray
    step_code: FloatArray

    @property
    def fine(self) -> tuple[bool, bool, bool]:
        """Which axes show noise at rest: the same reading for a second means that one is stuck."""
        step_micro_g = np.abs(self.micro_g_per_code) * self.step_code
        x, y, z = ((step_micro_g > 0.0) & (step_micro_g < COARSE_MICRO_G)).tolist()
        return x, y, z


def coding_of(rig: RigDescription, unit: UnitDescription) -> Coding:
    """How a rig's values become codes of a unit."""
    per_code = unit.adc.volts_per_code
    x, y, z = (
        1.0 if not axis.as_value or axis.is_code else VOLTAGES.get(axis.unit, 1.0) / per_code
        for axis in rig.axes
    )
    temperature = (1.0, 0.0)
    what, sensor = rig.temperature, unit.temperature_sensor
    if what is not None and what.as_value and what.degc is not None:
        scale, zero = what.degc
        step = sensor.degc_per_code
        temperature = scale / step, (zero - sensor.degc_at_zero) / step
    return Coding((x, y, z), temperature)


def nominal_of(rig: RigDescription, unit: UnitDescription, plan: SessionPlan) -> Nominal:
    """Nominal scale of a rig's codes.

    Raises
    ------
    RefusedError
        Where nothing states it, or plan and bus description contradict each other.
    """
    coding = coding_of(rig, unit)
    by_bus = [_g_of_code(axis, factor) for axis, factor in zip(rig.axes, coding.axes, strict=True)]
    zero = np.array([0.0 if g is None else g[1] for g in by_bus])
    step = np.array(
        [_step(axis, factor) for axis, factor in zip(rig.axes, coding.axes, strict=True)]
    )
    stated = plan.volts_per_g or unit.nominal_v_per_g
    if stated is None:
        unknown = [a for a, g in zip(AXES, by_bus, strict=True) if g is None]
        if unknown:
            raise RefusedError(
                f"{plan.source}, [rig] volts_per_g",
                "missing",
                expected=f"the nominal scale: {rig.bus_file.name} states no acceleration as the "
                f"unit of {', '.join(unknown)}",
            )
        return Nominal(np.array([1e6 * g[0] for g in by_bus if g is not None]), zero, step)
    micro_g = 1e6 * unit.adc.volts_per_code / np.array(stated)
    for axis, what, known, scale in zip(AXES, rig.axes, by_bus, micro_g, strict=True):
        if known is not None and abs(scale / (1e6 * known[0]) - 1.0) > _SCALE_TOLERANCE:
            turned = (
                " (with the other sign the positions are exchanged)" if scale * known[0] < 0 else ""
            )
            raise RefusedError(
                f"{plan.source}, [rig] volts_per_g",
                f"one code of {axis} is {scale:.6g} micro-g{turned}",
                expected=f"about {1e6 * known[0]:.6g}, what {rig.bus_file.name} says of "
                f"{what.label}",
                remedy=f"correct volts_per_g, [adc] of {unit.source}, or the unit in rig.toml",
            )
    return Nominal(micro_g, zero, step)


def _step(axis: Recorded, factor: float) -> float:
    """Step of an axis's readings in codes; 0 of a float, whose steps nothing states."""
    if axis.signal.is_float:
        return 0.0
    return abs(axis.signal.scale * factor) if axis.as_value else 1.0


def _g_of_code(axis: Recorded, factor: float) -> tuple[float, float] | None:
    """One code in g, and the code at 0 g, by the bus description."""
    known = axis.g
    return None if known is None else (known[0] / factor, known[1] * factor)


def refuse_unfit(rig: RigDescription, unit: UnitDescription) -> None:
    """Refuse a rig whose signals cannot hold the codes of a unit.

    Raises
    ------
    RefusedError
        Where a signal is narrower than the unit's ADC; where unit.toml and the bus description
        make different temperatures of a code; where there is no temperature.
    """
    adc = unit.adc
    for axis, what in zip(AXES, rig.axes, strict=True):
        low, high = what.signal.ends
        if what.as_value or (low <= adc.code_min and adc.code_max <= high):
            continue
        bits = high.bit_length() + 1
        raise RefusedError(
            f"{rig.name}, {axis}",
            f"{what.label} holds {low} to {high}",
            expected=f"the codes {adc.code_min} to {adc.code_max} of {unit.source}, [adc]",
            remedy=f"for codes as they are sent: bits = {bits}, code_min = {low}, "
            f"code_max = {high}",
        )
    if rig.temperature is None:
        raise RefusedError(
            f"{rig.name}, [signals] temperature",
            "missing",
            expected="the signal of the unit's temperature",
            remedy="a thermometer of another make on the same bus: more_files",
        )
    _refuse_other_degrees(rig, rig.temperature, unit)


def _refuse_other_degrees(rig: RigDescription, what: Recorded, unit: UnitDescription) -> None:
    if what.as_value or what.degc is None:
        return
    scale, zero = what.degc
    sensor = unit.temperature_sensor
    for temp_degc in unit.range_degc or (-40.0, 85.0):
        theirs = sensor.degc((temp_degc - zero) / scale)
        if abs(theirs - temp_degc) > _DEGC_TOLERANCE:
            raise RefusedError(
                f"{unit.source}, [temperature_sensor]",
                f"makes {theirs:.2f} degC of the code that is {temp_degc:g} degC by "
                f"{rig.bus_file.name}, {what.label}",
                expected=f"degc_per_code = {scale:g}, degc_at_zero = {zero:g}",
            )
