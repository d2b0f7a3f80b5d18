"""Simulated dwells by exact physics: force -> U = K(T) a + U0(T) -> noise -> codes -> mean.

Every reading is simulated and rounded to a code. The noise is far above one code, so the mean of
the codes is finer than a code and its error is that of the noise alone. The dwell's true
temperature enters the physics; its record is the mean of the thermometer's codes. The rig is
perfect unless truth.toml says otherwise (`triaxcal.simulation.rig`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.readings.measurements import Dwell, MeasurementSet, volts
from triaxcal.simulation.rig import Rig
from triaxcal.simulation.truth import Plan, Truth, codes_of_voltage
from triaxcal.unit.description import UnitDescription


@dataclass(frozen=True)
class CodeDwell:
    """One dwell as it is written to the file.

    Attributes
    ----------
    temp_code : float
        Mean code of the thermometer.
    mean_code, sd_code : tuple of three floats
        Mean, and standard deviation of one reading, of the axes' codes; x, y, z.
    """

    position: str
    temp_code: float
    mean_code: tuple[float, float, float]
    count: int
    sd_code: tuple[float, float, float]


def simulate(unit: UnitDescription, truth: Truth, plan: Plan) -> MeasurementSet:
    """Measurements of a simulated unit in V, just as `read_measurements` would read them.

    Raises
    ------
    RefusedError
        As `simulate_codes`.
    """
    return MeasurementSet(
        source=f"simulation of {unit.name}, seed {plan.seed}",
        dwells=tuple(
            Dwell(
                row=row,
                position=dwell.position,
                temp_degc=unit.temperature_sensor.degc(dwell.temp_code),
                voltage_v=volts(np.array(dwell.mean_code), "code", unit.adc),
                count=dwell.count,
                sd_v=volts(np.array(dwell.sd_code), "code", unit.adc),
            )
            for row, dwell in enumerate(simulate_codes(unit, truth, plan), start=2)
        ),
    )


def simulate_codes(unit: UnitDescription, truth: Truth, plan: Plan) -> tuple[CodeDwell, ...]:
    """Dwells of a simulated unit in codes, the temperature rising once through the whole plan.

    The same seed gives the same dwells: numpy's PCG64, drawn dwell by dwell in the order of
    the result.

    Raises
    ------
    RefusedError
        When a reading would saturate the ADC.
    """
    rng = np.random.Generator(np.random.PCG64(plan.seed))
    steps = [(temp, position) for temp in plan.temperatures_degc for position in TEST_POSITIONS]
    steps += [(temp, cp) for temp in plan.check_temperatures_degc for cp in CHECK_POSITIONS]
    steps.sort(key=lambda step: step[0])  # stable: positions keep their order
    rig = Rig(truth.imperfections, unit.gravity_g, plan.seed, plan.rig_seed)
    return tuple(
        _dwell(unit, truth, rig, rng, plan.readings_per_dwell, position=position, nominal_degc=temp)
        for temp, position in steps
    )


def _dwell(
    unit: UnitDescription,
    truth: Truth,
    rig: Rig,
    rng: np.random.Generator,
    count: int,
    *,
    position: str,
    nominal_degc: float,
) -> CodeDwell:
    temp_degc = nominal_degc + truth.dwell_temp_sd_degc * float(rng.standard_normal())
    sensor = unit.temperature_sensor
    shown_degc = (
        temp_degc
        + rig.thermometer_offset_degc
        + truth.thermometer_sd_degc * rng.standard_normal(count)
    )
    temp_codes = np.rint((shown_degc - sensor.degc_at_zero) / sensor.degc_per_code)
    exact_v = truth.voltage_v(rig.force_g(position), temp_degc)
    readings_v: FloatArray = exact_v + truth.reading_sd_v * rng.standard_normal((count, 3))
    codes = codes_of_voltage(unit.adc, readings_v)
    if np.any(codes == unit.adc.code_min) or np.any(codes == unit.adc.code_max):
        raise RefusedError(
            f"simulation of {unit.name}, {position} at {nominal_degc:g} degC",
            "a reading saturates the ADC",
            remedy="lower the truth's constants or widen [adc]",
        )
    x, y, z = (_mean_and_sd(codes[:, axis]) for axis in range(3))
    return CodeDwell(
        position=position,
        temp_code=_mean_and_sd(temp_codes.astype(np.int64))[0],
        mean_code=(x[0], y[0], z[0]),
        count=count,
        sd_code=(x[1], y[1], z[1]),
    )


def _mean_and_sd(codes: IntArray) -> tuple[float, float]:
    """Mean of codes (n,) and standard deviation of one, to 0.001 code.

    Summed in exact integers, so that the file does not depend on the order of a float sum.
    """
    count = len(codes)
    first = int(codes[0])
    differences = [int(code) - first for code in codes]
    total = sum(differences)
    squares = sum(d * d for d in differences)
    mean = (first * count + total) / count
    variance = (squares * count - total * total) / (count * (count - 1))
    return mean, round(math.sqrt(variance), 3)
