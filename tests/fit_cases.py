"""Units and measurements for the tests of the fit, made straight from the dataclasses."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from triaxcal.model.metrological import pack_constants, voltage_from_force
from triaxcal.model.positions import TEST_POSITIONS, specific_force_g
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell, MeasurementSet
from triaxcal.unit.adc import Adc
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.limits import Limits
from triaxcal.unit.thermal import ThermalChoice
from triaxcal.unit.thermometer import TemperatureSensor

AUTO = ThermalChoice("auto")

# P1, tables 1 and 2, as printed: V/g and V.
TABLE_TEMPS = (-40.0, 20.0, 70.0)
TABLES_PRINTED = {
    "Kxx": ("-0.55074263", "-0.55060863", "-0.55140269"),
    "Kxy": ("-0.00038930", "-0.00051742", "-0.00042829"),
    "Kxz": ("0.01602241", "0.01639328", "0.01652937"),
    "Kyx": ("-0.01277214", "-0.01322881", "-0.01364519"),
    "Kyy": ("-0.54790681", "-0.54854890", "-0.54933059"),
    "Kyz": ("-0.00074432", "-0.00066841", "-0.00068396"),
    "Kzx": ("-0.01433019", "-0.01466957", "-0.01478830"),
    "Kzy": ("-0.00023161", "-0.00035441", "-0.00027167"),
    "Kzz": ("-0.54832201", "-0.54859224", "-0.54979681"),
    "U0x": ("0.01181219", "0.00449084", "0.00359778"),
    "U0y": ("0.00057544", "-0.00442299", "-0.00643609"),
    "U0z": ("0.00041269", "-0.00347099", "-0.00223732"),
}
TABLES = np.array([[float(v) for v in row] for row in TABLES_PRINTED.values()]).T
"""Constants, shape (3, 12), at `TABLE_TEMPS`."""

SEVEN = (-40.0, -20.0, 0.0, 20.0, 40.0, 55.0, 70.0)

Truth = Callable[[FloatArray], FloatArray]


def unit(**changes: object) -> UnitDescription:
    """AT-TEST: T0 +20 degC, 1 g, everything by itself."""
    base = UnitDescription(
        source="units/AT-TEST/unit.toml",
        name="AT-TEST",
        serial="T-1",
        adc=Adc(24, 2.5, -(2**23), 2**23 - 1),
        temperature_sensor=TemperatureSensor(0.01, 0.0),
        gravity_g=1.0,
        t0_degc=20.0,
        range_degc=None,
        polarity=None,
        estimator="auto",
        thermal=AUTO,
        method="matrix",
        output_q=24,
        model_error_max_micro_g=1.0,
        limits=Limits(3e-4, 10e-4),
    )
    return replace(base, **changes)


def cubic_truth(t0_degc: float = 20.0) -> Truth:
    """Exact cubics of the size of tables 1 and 2, through their values at T0."""
    delta = np.array([-60.0, 50.0])
    values = TABLES[[0, 2]] - TABLES[1]
    # Parabola through the tables, and a cubic term that changes U0 by 1 mV (about 2 mg) at 60 degC.
    linear, square = np.linalg.solve(np.stack([delta, delta**2], axis=1), values)
    cubic = np.array([2e-4, -5e-5, 8e-5, 6e-5, -3e-4, 4e-5, -7e-5, 5e-5, 2e-4, 1e-3, -8e-4, 6e-4])

    def truth(temp_degc: FloatArray) -> FloatArray:
        d = (np.asarray(temp_degc, dtype=np.float64) - t0_degc)[..., None]
        result: FloatArray = TABLES[1] + d * linear + d**2 * square + (d / 60.0) ** 3 * cubic
        return result

    return truth


def tables_truth(temp_degc: FloatArray) -> FloatArray:
    """Tables 1 and 2 at their own temperatures."""
    temp = np.asarray(temp_degc, dtype=np.float64)
    return TABLES[np.searchsorted(TABLE_TEMPS, temp)]


def readings(
    truth: Truth,
    temps_degc: Iterable[float],
    *,
    gravity_g: float = 1.0,
    sd_v: float | FloatArray = 0.0,
    count: int | None = None,
    spread_degc: float = 0.0,
    seed: int = 0,
) -> MeasurementSet:
    """TP1 to TP6 at each temperature, by P1 (9), with Gaussian noise of the means.

    `sd_v` is that of a dwell's mean; with `count` the rows carry their statistics. Temperatures of
    the dwells scatter by `spread_degc`, evenly.
    """
    random = np.random.default_rng(seed)
    dwells: list[Dwell] = []
    for nominal in temps_degc:
        for position in TEST_POSITIONS:
            temp = nominal + spread_degc * random.uniform(-1.0, 1.0)
            force = specific_force_g(position, gravity_g)
            row = len(dwells) + 2
            noise = {"sd_v": sd_v, "count": count, "random": random}
            dwells.append(dwell(truth, row, position, temp, force, **noise))
    return MeasurementSet("measurements.csv", tuple(dwells))


def dwell(
    truth: Truth,
    row: int,
    position: str,
    temp_degc: float,
    force_g: FloatArray,
    *,
    sd_v: float | FloatArray,
    count: int | None,
    random: np.random.Generator,
) -> Dwell:
    """One dwell by P1 (9) with Gaussian noise of its mean."""
    sd = np.broadcast_to(np.asarray(sd_v, dtype=np.float64), (3,))
    voltage = voltage_from_force(truth(np.array(temp_degc)), force_g) + sd * random.normal(size=3)
    recorded = None if count is None else sd * np.sqrt(count)
    return Dwell(row, position, temp_degc, voltage, count, recorded)


def with_checks(
    measurements: MeasurementSet,
    truth: Truth,
    temps_degc: Iterable[float],
    *,
    sd_v: float = 0.0,
    count: int | None = None,
    seed: int = 1,
) -> MeasurementSet:
    """The same with CP1 to CP6, axes tilted by 25 deg, at each of these temperatures."""
    random = np.random.default_rng(seed)
    dwells = list(measurements.dwells)
    c, s = np.cos(np.radians(25.0)), np.sin(np.radians(25.0))
    forces = np.array(
        [[c, s, 0], [-c, 0, s], [0, c, s], [s, -c, 0], [s, 0, c], [0, s, -c]], dtype=np.float64
    )
    for temp in temps_degc:
        for m, force in enumerate(forces):
            row = len(dwells) + 2
            noise = {"sd_v": sd_v, "count": count, "random": random}
            dwells.append(dwell(truth, row, f"CP{m + 1}", temp, force, **noise))
    return MeasurementSet(measurements.source, tuple(dwells))


def random_constants(random: np.random.Generator, cross: float = 0.1) -> FloatArray:
    """One unit's constants, shape (12,), of any size and bias, cross terms up to `cross` of K."""
    scale = 10.0 ** random.uniform(-2, 1)
    K = np.diag(scale * random.uniform(0.5, 2.0, 3)) * random.choice([-1.0, 1.0])
    K = K + scale * cross * 0.5 * random.uniform(-1, 1, (3, 3)) * (1 - np.eye(3))
    return pack_constants(K, scale * random.uniform(-2, 2, 3))
