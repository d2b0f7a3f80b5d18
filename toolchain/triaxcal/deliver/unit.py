"""The whole road for one unit: records, fit, plan, C, proof, cross-check, residuals, files.

Nothing is written here but in a temporary folder; `triaxcal.base.publish` puts the files in place.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.compiler import Compilation
from triaxcal.codegen.crosscheck import CrossCheck, cross_check, vector_sets
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.image_cases import check_images
from triaxcal.codegen.render import CONSTANTS_FILE, Provenance, render_constants, render_routine
from triaxcal.codegen.routines import (
    Generated,
    Int32Array,
    Reference,
    Routine,
    routines_of,
    start_generated,
    start_reference,
)
from triaxcal.codegen.tryout import MethodResult, model_error_g, run_on_dwells
from triaxcal.fit.core.calibration import Calibration
from triaxcal.fit.pair.cross_coupling import stated_pair
from triaxcal.fit.tilter.acceptance import dwells_in_range, refuse_unacceptable
from triaxcal.fit.tilter.calibrate import calibrate
from triaxcal.fixedpoint.arithmetic import INT32_MAX
from triaxcal.fixedpoint.plan import Plan, make_plan
from triaxcal.fixedpoint.proof import Bound, prove
from triaxcal.fixedpoint.rate import RATE_Q
from triaxcal.model.compensation import Compensation, compensate
from triaxcal.model.metrological import unpack_constants
from triaxcal.model.positions import AXES
from triaxcal.readings.measurements import (
    MEASUREMENTS_FILE,
    Dwell,
    MeasurementSet,
    read_measurements,
)
from triaxcal.unit.description import METHODS, UNIT_FILE, UnitDescription, read_unit

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


def deliver(folder: Path, reference: Reference | None = None) -> Delivery:
    """Calibrate the unit in `folder`, generate its C and check it.

    `reference` is the handwritten C, which does not depend on the unit, where it has been compiled
    already.

    Raises
    ------
    RefusedError
        When the data or the result is refused, or a tool is missing.
    """
    with tempfile.TemporaryDirectory(prefix="triaxcal-") as name, _compilations() as started:
        work = Path(name)
        unit = read_unit(folder)
        inputs = inputs_sha256(folder, unit)
        if reference is None:
            started.append(start_reference(work))
        unit, measurements, calibration = _calibrated(unit, folder)
        dwells = dwells_in_range(unit, calibration.range_degc, measurements)
        compensation = compensation_of(unit, calibration, unit.method)
        plan = make_plan(compensation, unit)
        model_error = model_error_g(unit, calibration.thermal, plan)
        _refuse_model_error(unit, plan, model_error)
        if inputs_sha256(folder, unit) != inputs:
            raise RefusedError(str(folder), "changed while it was read", remedy="run it again")
        files = _firmware_files(unit, calibration, compensation, plan, inputs)
        for file, content in files.items():
            (work / file).write_bytes(content)
        started.append(start_generated(work, work))
        bound = prove(plan)
        sets = vector_sets(plan)
        reference = reference or Reference(started[0].load())
        generated = Generated(started[-1].load())
        image = files[IMAGE_FILE]
        tried = routines_of(plan.rate, generated.library, reference.library)
        check = cross_check(plan, sets, tried[0], tried[1].routine(image), image)
        check = replace(check, images=check_images(plan, image, *tried))
        _refuse_wrong_bound(unit, bound, check)
        rates = _rate_codes(unit, dwells)
        own = routines_of(plan.rate, generated.library, reference.library, rates)[0]
        routines = {unit.method: own.run, **_other_routines(unit, calibration, reference, rates)}
        thermal = calibration.thermal
        methods = run_on_dwells(unit, thermal, measurements.source, dwells, routines)
        compiler = generated.compiler
    delivery = Delivery(
        unit, measurements, inputs, calibration, compensation, plan,
        model_error, bound, check, methods, compiler, files,
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
        terms=calibration.terms,
    )


def _calibrated(
    unit: UnitDescription, folder: Path
) -> tuple[UnitDescription, MeasurementSet, Calibration]:
    """Unit, readings and calibration, by the route that unit.toml states."""
    if unit.recording is not None:
        # SciPy's optimizers take as long to import as a whole tilter's calibration does.
        from triaxcal.fit.route import calibrate_recording  # noqa: PLC0415

        return calibrate_recording(unit, unit.recording, folder)
    measurements = read_measurements(folder / MEASUREMENTS_FILE, unit)
    calibration = calibrate(unit, measurements, stated_pair(unit, folder))
    refuse_unacceptable(unit, calibration, measurements)
    return unit, measurements, calibration


def inputs_sha256(folder: Path, unit: UnitDescription | None = None) -> str:
    """Hash of the unit's two files, the same wherever the folder lies."""
    recorded = MEASUREMENTS_FILE
    if unit is not None and unit.recording is not None:
        recorded = unit.recording.file
    pair = () if unit is None or unit.pair is None else (folder / unit.pair.file,)
    return files_sha256(
        (folder / UNIT_FILE, folder / recorded, *pair),
        "put it there, or correct its name in unit.toml",
    )


def files_sha256(paths: Iterable[Path], remedy: str) -> str:
    """Hash of the hashes of files; `remedy` is what to do where one cannot be read."""
    digest = hashlib.sha256()
    for path in paths:
        try:
            with path.open("rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
        except OSError as error:
            raise RefusedError(
                str(path),
                f"cannot be read: {(error.strerror or str(error)).lower()}",
                remedy=remedy,
            ) from error
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
    reading = calibration.reading_unit
    summary = (
        f"method {compensation.method}: {plan.shape.form} form, {low:g} to {high:g} degC",
        f"functions of order {plan.shape.order} on {plan.shape.segments} segment(s)",
        f"thermal model: {calibration.shape.label}, bias estimator {calibration.estimator}",
        f"raw code: {unit.adc.bits} bits for {unit.adc.full_scale_v:g} {reading} full scale",
        "code32 is a raw code left-justified to 32 bits",
        *_reading_note(unit, calibration),
    )
    provenance = Provenance(unit.serial, inputs, (*summary, *_constants_at_t0(calibration)))
    texts = render_routine(plan)
    texts[CONSTANTS_FILE] = render_constants(plan, unit.temperature_sensor, provenance)
    files = {name: text.encode() for name, text in texts.items()}
    files[IMAGE_FILE] = image_bytes(plan)
    return files


def _reading_note(unit: UnitDescription, calibration: Calibration) -> tuple[str, ...]:
    """What a raw code is where the readings are a recording's, and no volts."""
    reading = calibration.reading_unit
    if reading == "V":
        return ()
    code = f"{unit.adc.volts_per_code:.9g} {reading}"
    return (f"raw code = reading / {code}; V below stands for {reading}",)


def _constants_at_t0(calibration: Calibration) -> list[str]:
    t0_degc = calibration.thermal.t0_degc
    K, U0 = unpack_constants(calibration.thermal.constants_at(t0_degc))
    units = f"K x, y, z in {calibration.gain_unit} and U0 in {calibration.reading_unit}"
    return [f"at {t0_degc:g} degC, {units}:"] + [
        f"  {axis}  {K[i, 0]:+.9f} {K[i, 1]:+.9f} {K[i, 2]:+.9f}   {U0[i]:+.9f}"
        for i, axis in enumerate(AXES)
    ]


def _rate_codes(unit: UnitDescription, dwells: Sequence[Dwell]) -> Int32Array:
    """dT/dt of the dwells in codes of the firmware, shape (n,)."""
    code = unit.temperature_sensor.degc_per_code * 2.0**-RATE_Q
    rates = np.rint([d.rate_k_per_s / code for d in dwells])
    return rates.clip(-INT32_MAX, INT32_MAX).astype(np.int32)


def _other_routines(
    unit: UnitDescription, calibration: Calibration, reference: Reference, rates: Int32Array
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
            own = routines_of(plan.rate, reference.library, reference.library, rates)[1]
            routines[method] = own.routine(image_bytes(plan))
    return routines


def _refuse_model_error(unit: UnitDescription, plan: Plan, error_g: float) -> None:
    """The order of N(T) is chosen on a grid; what counts is every temperature code."""
    limit_g = unit.model_error_max_micro_g * 1e-6
    if unit.method == "matrix" and error_g > limit_g:
        raise RefusedError(
            f"{unit.name}/unit.toml, [compensation] model_error_max_micro_g",
            f"N(T) of order {plan.shape.order} is {error_g * 1e6:.4g} micro-g off the fitted model",
            expected=f"at most {limit_g * 1e6:g} micro-g",
            remedy='choose method = "inverse", or allow more',
        )


def _refuse_wrong_bound(unit: UnitDescription, bound: Bound, check: CrossCheck) -> None:
    if check.largest_error_lsb > bound.lsb:
        raise RefusedError(
            f"unit {unit.name}",
            f"a sample is {check.largest_error_lsb:.4f} LSB off",
            expected=f"at most the proven {bound.lsb:.4f} LSB",
            remedy="the proof is wrong: this is a fault in triaxcal, report it",
        )


def _refuse_beyond_limits(delivery: Delivery) -> None:
    """P1 (13) for the compiled C; the fitted model passed, so it is the method or the formats."""
    unit = delivery.unit
    chosen = next(m for m in delivery.methods if m.method == unit.method)
    for residual in chosen.residuals:
        dwell, error_g = residual.dwell, abs(residual.error_g)
        limit, key = unit.limits.at(dwell.temp_degc, unit.t0_degc)
        if error_g > limit:
            raise RefusedError(
                f"{delivery.measurements.source}, row {dwell.row}",
                f"| |a| - g | = {error_g * 1e3:.4g} mg in {dwell.position} at "
                f"{dwell.temp_degc:.4g} degC by the compiled C, {error_g / limit:.3g} "
                "times the limit, which the fitted model keeps",
                expected=f"at most {limit * 1e3:g} mg ({key})",
                remedy=(
                    f"method {unit.method} is within {delivery.model_error_g * 1e3:.3g} mg of the "
                    f"model, its LSB is {1e3 / 2**unit.output_q:.3g} mg: choose another "
                    "compensation.method, a higher output_q or more adc.bits"
                ),
            )
