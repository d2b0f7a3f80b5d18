"""The shapes whose generated C is tried: plans of the shipped units and of variants of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.progress import Progress
from triaxcal.base.tomltable import has_table
from triaxcal.codegen.angles import angles_plan, render_angles
from triaxcal.codegen.constants import Provenance, render_constants
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.imu import ImuBuild
from triaxcal.codegen.names import Names, names_of
from triaxcal.codegen.render import arithmetic_of, render_routine, routine_file
from triaxcal.codegen.selftest import render_selftest
from triaxcal.delivery.imu import deliver_imu_c
from triaxcal.delivery.inputs import inputs_sha256
from triaxcal.delivery.order import choose_functions
from triaxcal.delivery.unit import deliver
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.fixedpoint.angles import AnglesPlan
from triaxcal.fixedpoint.gyro import make_gyro_plan
from triaxcal.fixedpoint.plan import Plan
from triaxcal.model.methods.imu import EXAMPLE_SENSITIVITY, ImuCompensation
from triaxcal.model.terms import EXAMPLE_RATE, EXAMPLE_TERMS, NO_TERMS, Terms
from triaxcal.readings.measurements import MEASUREMENTS_FILE, MeasurementSet, read_measurements
from triaxcal.unit.angles import PITCH_ROLL, ZENITH_TOOL_FACE, AnglesChoice
from triaxcal.unit.arithmetic import HIGH_WORDS
from triaxcal.unit.description import UnitDescription, read_unit
from triaxcal.unit.folder import find_unit


@dataclass(frozen=True)
class Case:
    """One shape: a plan, its generated files and its image.

    Attributes
    ----------
    name : str
        Of the shape.
    note : str
        What is particular about it.
    files : dict
        triax_comp.h and .c, triax_calib.h and .c, triax_selftest.h and .c, triax_angles.h and .c
        where there are angles.
    angles : AnglesPlan or None
        Of the device's angles, where it makes them.
    """

    name: str
    note: str
    plan: Plan
    files: dict[str, str]
    image: bytes
    angles: AnglesPlan | None = None

    def in_form(self, arithmetic: str) -> Case:
        """The same with the files of another arithmetic."""
        if arithmetic == self.plan.arithmetic:
            return self
        plan = replace(self.plan, arithmetic=arithmetic)
        files, angles = self.files | render_routine(plan), None
        if self.angles is not None:
            angles = angles_plan(self.angles.choice, plan)
            files |= render_angles(angles, names_of(plan))
        return replace(self, plan=plan, files=files, angles=angles)

    @property
    def sources(self) -> list[str]:
        """Names of the C files that a firmware needs, the routine first."""
        routine = routine_file(self.plan, arithmetic_of(self.plan))
        angles = [self.names.file("triax_angles.c")] if self.angles is not None else []
        return [routine, self.names.file("triax_calib.c"), *angles]

    @property
    def selftest(self) -> str:
        """Name of the C file of the self-test."""
        return self.names.file("triax_selftest.c")

    @property
    def names(self) -> Names:
        """Names in the C."""
        return names_of(self.plan)


Change = Callable[[UnitDescription], UnitDescription]
CUBIC = "cubic"
ORDER_4 = "order 4"
CUBIC_LEFT = "cubic, left-justified"
HIGH = {name: f"{name}, high words" for name in (CUBIC, CUBIC_LEFT)}
QUADRATIC, RATE, GYRO = "quadratic terms", "dT/dt", "gyro"
RATE_ALONE = "cubic, dT/dt"
ANGLES = {pair: f"angles: {pair}" for pair in (ZENITH_TOOL_FACE, PITCH_ROLL)}
_TERMS = {
    QUADRATIC: EXAMPLE_TERMS,
    RATE: replace(EXAMPLE_TERMS, rate=EXAMPLE_RATE),
    RATE_ALONE: replace(NO_TERMS, rate=EXAMPLE_RATE),
}


def _order_3(unit: UnitDescription) -> UnitDescription:
    return replace(unit, model_error_max_micro_g=10.0)


def _order_4(unit: UnitDescription) -> UnitDescription:
    return replace(unit, model_error_max_micro_g=1.0)


def _left_justified(unit: UnitDescription) -> UnitDescription:
    return replace(unit, adc=replace(unit.adc, bits=32, code_min=-(2**31), code_max=2**31 - 1))


def _high_words(unit: UnitDescription) -> UnitDescription:
    return replace(unit, arithmetic=HIGH_WORDS)


def _odd_range(unit: UnitDescription) -> UnitDescription:
    adc = replace(unit.adc, code_min=-8_000_000, code_max=8_000_000)
    return replace(_order_4(unit), adc=adc)


_SHAPES: tuple[tuple[str, str, str, Change], ...] = (
    (CUBIC, "AT-SIM", "AT-SIM as shipped: N(T) of order 3", lambda u: u),
    (CUBIC_LEFT, "AT-SIM", "raw codes that fill int32", lambda u: _left_justified(_order_3(u))),
    (HIGH[CUBIC], "AT-SIM", "sums of high words, order 3", _high_words),
    (HIGH[CUBIC_LEFT], "AT-SIM", "the same, raw codes that fill int32", lambda u: _high_words(
        _left_justified(_order_3(u)))),
    (ORDER_4, "AT-SIM", "within 1 micro-g: N(T) of order 4", _order_4),
    ("AT-CHERNIAK", "AT-CHERNIAK", "as shipped: piecewise", lambda u: u),
    ("inverse", "AT-SIM", "K(T) inverted on the device", lambda u: replace(u, method="inverse")),
    ("saturating", "AT-SIM", "output_q 28: no spare bits", lambda u: replace(
        _order_4(u), output_q=28)),
    ("no spare bit", "AT-SIM", "output_q 27", lambda u: replace(_order_4(u), output_q=27)),
    ("odd range", "AT-SIM", "raw codes -8000000 to 8000000", _odd_range),
    (QUADRATIC, "AT-SIM", "18 quadratic terms, order 3", _order_3),
    (RATE, "AT-SIM", "a term in dT/dt and quadratic terms, inverse", lambda u: replace(
        u, method="inverse")),
    (RATE_ALONE, "AT-SIM", "a term in dT/dt, order 3", _order_3),
    (GYRO, "AT-SIM", "a gyro with g-sensitivity, order 3", _order_3),
    ("16 bits", "AT-SIM", "16-bit raw codes", lambda u: replace(_order_4(u), adc=replace(
        u.adc, bits=16, code_min=-(2**15), code_max=2**15 - 1))),
    ("fine thermometer", "AT-SIM", "110000 temperature codes", lambda u: replace(
        _order_4(u), temperature_sensor=replace(u.temperature_sensor, degc_per_code=0.001))),
    (ANGLES[ZENITH_TOOL_FACE], "AT-SIM", "with zenith and tool face", lambda u: replace(
        _order_4(u), angles=AnglesChoice(ZENITH_TOOL_FACE))),
    (ANGLES[PITCH_ROLL], "AT-CHERNIAK", "with pitch and roll", lambda u: replace(
        u, angles=AnglesChoice(PITCH_ROLL))),
)  # fmt: skip


def shipped_cases(units: Path) -> tuple[Case, ...]:
    """Every shape of the matrix, from the units AT-SIM and AT-CHERNIAK in folder `units`.

    Raises
    ------
    RefusedError
        When a unit is refused, or the cubic shapes are not of order 3 and of high words where
        their name says so.
    """
    cases = tuple(
        made_case(units / unit, name, note, change, _TERMS.get(name, NO_TERMS))
        for name, unit, note, change in _SHAPES
    )
    for case in cases[:4]:
        found = case.plan.shape.order, case.plan.shape.high_words
        if found != (expected := (3, case.name in HIGH.values())):
            raise RefusedError(
                f"shape {case.name}",
                f"order and high words are {found}",
                expected=f"{expected}",
                remedy="the measurements of AT-SIM have changed: choose another error limit",
            )
    return cases


def unit_case(folder: Path) -> Case:
    """The shape of the unit in `folder`, with the terms that its fit has.

    Raises
    ------
    RefusedError
        As `deliver`.
    """
    made = deliver(folder)
    texts = {f: c.decode() for f, c in made.files.items() if f.endswith((".h", ".c"))}
    name, plan = folder.absolute().name, made.plan
    return Case(name, "as described", plan, texts, image_bytes(plan), made.firmware.angles)


def unit_cases(folder: Path, progress: Progress | None = None) -> tuple[Case, ...]:
    """The shape of the unit in `folder`; of an IMU those of accelerometer and gyro.

    Raises
    ------
    RefusedError
        When the unit's files are refused, or its calibration; for an IMU without [device].
    """
    if has_table(find_unit(folder), "dynamic"):
        return imu_cases(folder.absolute().name, deliver_imu_c(folder, progress).build)
    return (unit_case(folder),)


def imu_cases(name: str, build: ImuBuild) -> tuple[Case, Case]:
    """The shapes of both triads of an IMU; its angles are made with the accelerometer's."""
    gyro = f"{names_of(build.gyro).triad}_"
    texts = {f: c.decode() for f, c in build.files.items() if f.endswith((".h", ".c"))}
    of_gyro = {f: text for f, text in texts.items() if f.startswith(gyro)}
    of_accel = {f: text for f, text in texts.items() if f not in of_gyro}
    accel = Case(
        f"{name}, accelerometer", "", build.accel, of_accel, image_bytes(build.accel), build.angles
    )
    return accel, Case(f"{name}, gyro", "", build.gyro, of_gyro, image_bytes(build.gyro))


@cache
def _calibrated(folder: Path) -> tuple[UnitDescription, MeasurementSet, Calibration]:
    unit = read_unit(folder)
    measurements = read_measurements(folder / MEASUREMENTS_FILE, unit)
    return unit, measurements, calibrate(unit, measurements)


def made_case(folder: Path, name: str, note: str, change: Change, terms: Terms) -> Case:
    """A shape from the measurements of the unit in `folder`, its description changed.

    Raises
    ------
    RefusedError
        When the unit's files are refused.
    """
    described, measurements, calibration = _calibrated(folder)
    unit, calibration = change(described), replace(calibration, terms=terms)
    functions = choose_functions(unit, measurements, calibration)
    compensation, plan = functions.compensation, functions.plan
    if name == GYRO:
        # The curves of the accelerometer with rad/s for g: a rate of some hundred deg/s.
        imu = ImuCompensation(compensation, compensation, EXAMPLE_SENSITIVITY)
        plan = make_gyro_plan(imu, replace(unit, output_q=18), unit.output_q)
    files = render_routine(plan)
    words = f"shape {name}: {note}" if note else f"shape {name}"
    provenance = Provenance(unit.serial, inputs_sha256(folder), (words,))
    files |= render_constants(plan, unit.temperature_sensor, provenance)
    files |= render_selftest(plan, provenance)
    angles = None
    if unit.angles is not None and not plan.shape.gyro:
        angles = angles_plan(unit.angles, plan)
        files |= render_angles(angles, names_of(plan))
    return Case(name, note, plan, files, image_bytes(plan), angles)
