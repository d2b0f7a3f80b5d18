"""The whole road for one unit: records, fit, plan, C, proof, cross-check, residuals, files.

Nothing is written here but in a temporary folder; `triaxcal.publish` puts the files in place.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.codegen.compiler import Compilation
from triaxcal.codegen.crosscheck import CrossCheck, cross_check, vector_sets
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.render import CONSTANTS_FILE, Provenance, render_constants, render_routine
from triaxcal.codegen.routines import (
    Generated,
    Reference,
    Routine,
    start_generated,
    start_reference,
)
from triaxcal.codegen.tryout import MethodResult, Residual, model_error_g, run_on_dwells
from triaxcal.errors import RefusedError
from triaxcal.fit.calibrate import Calibration, calibrate
from triaxcal.fixedpoint.plan import Plan, make_plan
from triaxcal.fixedpoint.proof import Bound, prove
from triaxcal.model.compensation import Compensation, compensate
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.positions import AXES, TEST_POSITIONS
from triaxcal.model.types import FloatArray
from triaxcal.records import MEASUREMENTS_FILE, MeasurementSet, read_measurements
from triaxcal.unitfile import METHODS, UNIT_FILE, UnitDescription, read_unit

IMAGE_FILE = "triax_calib.bin"


@dataclass(frozen=True)
class Delivery:
    """Everything about one unit that has passed.

    Attributes
    ----------
    compensation, plan : of the unit's method
    model_error_g : float
        Largest error of the compensation against K(T)^-1 (U - U0(T)) at any temperature code and
        any raw code, in g.
    bound : Bound
        Proven error of the arithmetic.
    check : CrossCheck
        Vectors on which three implementations agreed.
    methods : tuple of MethodResult
        Residuals at the unit's own dwells: before, the unit's method, then the others.
    compiler : str
        Version of the compiler.
    files : dict
        Name and content of what the firmware takes.
    """

    unit: UnitDescription
    measurements: MeasurementSet
    inputs_sha256: str
    calibration: Calibration
    compensation: Compensation
    plan: Plan
    model_error_g: float
    bound: Bound
    check: CrossCheck
    methods: tuple[MethodResult, ...]
    compiler: str
    files: dict[str, bytes]


def deliver(folder: Path) -> Delivery:
    """Calibrate the unit in `folder`, generate its C and check it.

    Raises
    ------
    RefusedError
        When the data or the result is refused, or a tool is missing.
    """
    with tempfile.TemporaryDirectory(prefix="triaxcal-") as name, _compilations() as started:
        work = Path(name)
        unit = read_unit(folder)
        started.append(start_reference(work))
        measurements = read_measurements(folder / MEASUREMENTS_FILE, unit)
        calibration = calibrate(unit, measurements)
        compensation = compensation_of(unit, calibration, unit.method)
        plan = make_plan(compensation, unit)
        inputs = inputs_sha256(folder)
        files = _firmware_files(unit, calibration, compensation, plan, inputs)
        for file, content in files.items():
            (work / file).write_bytes(content)
        started.append(start_generated(work, work))
        bound = prove(plan)
        sets = vector_sets(plan)
        reference, generated = Reference(started[0].load()), Generated(started[1].load())
        image = files[IMAGE_FILE]
        check = cross_check(plan, sets, generated, reference.routine(image), image)
        _refuse_wrong_bound(unit, bound, check)
        routines = {unit.method: generated.run, **_other_routines(unit, calibration, reference)}
        thermal, range_degc = calibration.thermal, calibration.range_degc
        methods = run_on_dwells(unit, thermal, range_degc, measurements, routines)
        compiler = generated.compiler
    delivery = Delivery(
        unit, measurements, inputs, calibration, compensation, plan,
        model_error_g(unit, thermal, plan), bound, check, methods, compiler, files,
    )  # fmt: skip
    _refuse_beyond_limits(delivery)
    return delivery


def compensation_of(unit: UnitDescription, calibration: Calibration, method: str) -> Compensation:
    """The functions that the device evaluates for one method."""
    adc = unit.adc
    voltage_max_v = max(abs(adc.code_min), abs(adc.code_max)) * adc.volts_per_code
    return compensate(
        calibration.thermal,
        method,
        calibration.range_degc,
        voltage_max_v,
        unit.model_error_max_micro_g * 1e-6,
    )


def inputs_sha256(folder: Path) -> str:
    """Hash of the unit's two files, the same wherever the folder lies."""
    digest = hashlib.sha256()
    for name in (UNIT_FILE, MEASUREMENTS_FILE):
        digest.update(hashlib.sha256((folder / name).read_bytes()).digest())
    return digest.hexdigest()


@contextmanager
def _compilations() -> Iterator[list[Compilation]]:
    """Compilations that are stopped when anything else fails."""
    started: list[Compilation] = []
    try:
        yield started
    finally:
        for compilation in started:
            compilation.cancel()


def _firmware_files(
    unit: UnitDescription,
    calibration: Calibration,
    compensation: Compensation,
    plan: Plan,
    inputs: str,
) -> dict[str, bytes]:
    low, high = calibration.range_degc
    summary = (
        f"method {compensation.method}: {plan.shape.form} form, {low:g} to {high:g} degC",
        f"functions of order {plan.shape.order} on {plan.shape.segments} segment(s)",
        f"thermal model: {calibration.shape.label}, bias estimator {calibration.estimator}",
        f"raw code: {unit.adc.bits} bits for {unit.adc.full_scale_v:g} V full scale",
        "code32 is a raw code left-justified to 32 bits",
    )
    provenance = Provenance(unit.serial, inputs, (*summary, *_constants_at_t0(calibration)))
    texts = render_routine(plan)
    texts[CONSTANTS_FILE] = render_constants(plan, unit.temperature_sensor, provenance)
    files = {name: text.encode() for name, text in texts.items()}
    files[IMAGE_FILE] = image_bytes(plan)
    return files


def _constants_at_t0(calibration: Calibration) -> list[str]:
    t0_degc = calibration.thermal.t0_degc
    K, U0 = unpack_constants(calibration.thermal.constants_at(t0_degc))
    return [f"at {t0_degc:g} degC, K x, y, z in V/g and U0 in V:"] + [
        f"  {axis}  {K[i, 0]:+.9f} {K[i, 1]:+.9f} {K[i, 2]:+.9f}   {U0[i]:+.9f}"
        for i, axis in enumerate(AXES)
    ]


def _other_routines(
    unit: UnitDescription, calibration: Calibration, reference: Reference
) -> dict[str, Routine | RefusedError]:
    """The methods that the unit did not choose, run by the reference C."""
    routines: dict[str, Routine | RefusedError] = {}
    for method in METHODS:
        if method == unit.method:
            continue
        try:
            plan = make_plan(compensation_of(unit, calibration, method), unit)
        except RefusedError as refusal:
            routines[method] = refusal
        else:
            routines[method] = reference.routine(image_bytes(plan))
    return routines


def _refuse_wrong_bound(unit: UnitDescription, bound: Bound, check: CrossCheck) -> None:
    if check.largest_error_lsb > bound.lsb:
        raise RefusedError(
            f"unit {unit.name}",
            f"a sample is {check.largest_error_lsb:.4f} LSB off",
            expected=f"at most the proven {bound.lsb:.4f} LSB",
            remedy="the proof is wrong: this is a fault in triaxcal, report it",
        )


def _refuse_beyond_limits(delivery: Delivery) -> None:
    """P1 (13): the residual of the unit's own method against its limits."""
    chosen = next(m for m in delivery.methods if m.method == delivery.unit.method)
    limits = delivery.unit.limits
    for residual in chosen.residuals:
        at_t0 = residual.at_t0
        limit, key = (
            (limits.at_t0_g, "limits.at_t0_g")
            if at_t0
            else (limits.over_range_g, "limits.over_range_g")
        )
        if abs(residual.error_g) > limit:
            raise RefusedError(
                f"{delivery.measurements.source}, row {residual.dwell.row}",
                f"| |a| - g | = {abs(residual.error_g) * 1e3:.3f} mg in {residual.dwell.position} "
                f"at {residual.dwell.temp_degc:.1f} degC after compensation, "
                f"{abs(residual.error_g) / limit:.3g} times the limit",
                expected=f"at most {limit * 1e3:g} mg ({key})",
                remedy=_why(delivery, residual),
            )


def _why(delivery: Delivery, residual: Residual) -> str:
    """What the residual comes from, and what to do about it.

    The same dwell is compensated with the constants of its own temperature alone, then with the
    fitted curves and no error of the method: the first step that leaves most of it is to blame.
    """
    calibration, dwell = delivery.calibration, residual.dwell
    gravity_g, error_g = delivery.unit.gravity_g, abs(residual.error_g)

    def length_error_g(constants: FloatArray) -> float:
        force = force_from_voltage(constants, dwell.voltage_v)
        return abs(float(np.linalg.norm(force)) - gravity_g)

    point = min(calibration.points, key=lambda p: abs(p.temp_degc - dwell.temp_degc))
    own_g = length_error_g(point.constants)
    curve_g = length_error_g(calibration.thermal.constants_at(dwell.temp_degc))
    if dwell.position in TEST_POSITIONS and own_g > 0.5 * error_g:
        return (
            f"noise or placement: the constants of this temperature alone leave "
            f"{own_g * 1e3:.3g} mg; measure that dwell again"
        )
    if curve_g > 0.5 * error_g:
        return (
            f"the thermal function: the fitted curves ({calibration.shape.label}) leave "
            f"{curve_g * 1e3:.3g} mg; choose a better one, or measure at more temperatures"
        )
    return (
        f"the method {delivery.unit.method}: the fitted curves alone leave {curve_g * 1e3:.3g} mg; "
        'choose method = "matrix", or lower model_error_max_micro_g'
    )
