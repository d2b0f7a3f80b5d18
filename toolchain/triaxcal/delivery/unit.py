"""The whole road for one unit: records, fit, plan, C, proof, cross-check, residuals, files.

Nothing is written here but in a temporary folder; `triaxcal.base.publish` puts the files in place.
"""

from __future__ import annotations

from contextlib import ExitStack
from ctypes import CDLL
from dataclasses import dataclass, replace
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.angles_check import AnglesCheck, check_angles
from triaxcal.codegen.compiler import Compilation, library_folder, reference_under_way
from triaxcal.codegen.crosscheck import CrossCheck, cross_check, vector_sets
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.image_cases import check_images, image_cases
from triaxcal.codegen.objects import SharedObjects
from triaxcal.codegen.routines import (
    Generated,
    Int32Array,
    Reference,
    Routine,
    routines_of,
    start_generated,
)
from triaxcal.codegen.selftest import check_selftest
from triaxcal.codegen.tryout import MethodResult, run_on_dwells
from triaxcal.delivery.firmware import Firmware, make_firmware, rate_codes
from triaxcal.delivery.fitted import Fitted, fit_folder, refuse_beyond_limits
from triaxcal.delivery.order import compensation_of
from triaxcal.delivery.verdict import Verdict
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.tilter.acceptance import dwells_in_range
from triaxcal.fixedpoint.plan import Plan, make_plan
from triaxcal.fixedpoint.proof import Bound
from triaxcal.model.methods.registry import METHODS
from triaxcal.unit.description import UnitDescription, read_unit


@dataclass(frozen=True)
class Delivery(Fitted):
    """Everything about one unit that has passed.

    Attributes
    ----------
    firmware : Firmware
    check : CrossCheck
        Vectors on which three implementations agreed.
    methods : tuple of MethodResult
        Residuals at the unit's own dwells: before, the unit's method, then the others.
    compiler : str
        The compiler and its version.
    angles_check : AnglesCheck or None
        Of the angles, where the device makes them.
    """

    firmware: Firmware
    check: CrossCheck
    methods: tuple[MethodResult, ...]
    compiler: str
    angles_check: AnglesCheck | None = None

    @property
    def chosen(self) -> MethodResult:
        """Residuals of the unit's own method."""
        return next(m for m in self.methods if m.method.name == self.unit.method)

    @property
    def plan(self) -> Plan:
        """The integers that the device evaluates."""
        return self.firmware.plan

    @property
    def model_error_g(self) -> float:
        """Largest error of the compensation against the fitted model."""
        return self.firmware.model_error_g

    @property
    def bound(self) -> Bound:
        """Proven error of the arithmetic."""
        return self.firmware.bound

    @property
    def verdict(self) -> Verdict:
        """Verdict on the unit with its firmware."""
        return self.firmware.verdict

    @property
    def files(self) -> dict[str, bytes]:
        """Name and content of what the firmware takes."""
        return self.firmware.files


def deliver(
    folder: Path,
    reference: Reference | Compilation | None = None,
    objects: SharedObjects | None = None,
) -> Delivery:
    """Calibrate the unit in `folder`, generate its C and check it.

    `reference` is the handwritten C, which does not depend on the unit, where its compilation has
    been started already. `objects` are what units of a series have in common.

    Raises
    ------
    RefusedError
        When the data or the result is refused, or a tool is missing.
    """
    with ExitStack() as stack:
        unit = read_unit(folder)
        if reference is None:
            reference = stack.enter_context(reference_under_way())
        return deliver_fitted(fit_folder(unit, folder), reference, objects)


def deliver_fitted(
    fitted: Fitted, reference: Reference | Compilation, objects: SharedObjects | None = None
) -> Delivery:
    """As `deliver`, for a calibration that was made."""
    with ExitStack() as stack:
        work = stack.enter_context(library_folder())
        refuse_beyond_limits(fitted)
        unit = fitted.unit
        firmware = make_firmware(fitted)
        plan = firmware.plan
        for file, content in firmware.files.items():
            (work / file).write_bytes(content)
        compilation = start_generated(work, work, plan.prefix, objects)
        stack.callback(compilation.cancel)
        bound = firmware.bound
        sets = vector_sets(plan)
        image = image_bytes(plan)
        cases = image_cases(plan, image)
        # The compiler was at work meanwhile.
        ours = compilation.load()
        theirs = reference.load() if isinstance(reference, Compilation) else reference.library
        tried = routines_of(plan.rate, ours, theirs)
        check = cross_check(plan, sets, tried[0], tried[1].routine(image), image)
        check = replace(check, images=check_images(plan, cases, *tried))
        check_selftest(plan, firmware.provenance, ours)
        angles_check = check_angles(firmware.angles, ours) if firmware.angles else None
        _refuse_wrong_bound(unit, bound, check)
        methods = _on_dwells(fitted, plan, ours, Reference(theirs))
        compiler = compilation.compiler.called(Generated(ours).compiler)
    parts = unit, fitted.measurements, fitted.inputs_sha256, fitted.calibration
    delivery = Delivery(*parts, firmware, check, methods, compiler, angles_check)
    _refuse_beyond_limits(delivery)
    return delivery


def _on_dwells(
    fitted: Fitted, plan: Plan, generated: CDLL, reference: Reference
) -> tuple[MethodResult, ...]:
    """Residuals at the unit's own dwells: before, by the compiled C, and by the other methods."""
    unit, calibration = fitted.unit, fitted.calibration
    dwells = dwells_in_range(unit, calibration.range_degc, fitted.measurements)
    rates = rate_codes(unit, dwells)
    own = routines_of(plan.rate, generated, reference.library, rates)[0]
    routines = {unit.method: own.run, **_other_routines(unit, calibration, reference, rates)}
    source = fitted.measurements.source
    return run_on_dwells(unit, calibration.thermal, source, dwells, routines)


def _other_routines(
    unit: UnitDescription, calibration: Calibration, reference: Reference, rates: Int32Array
) -> dict[str, Routine | RefusedError]:
    """The methods that the unit did not choose, run by the reference C."""
    routines: dict[str, Routine | RefusedError] = {}
    for method in METHODS.names:
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
    for residual in delivery.chosen.residuals:
        dwell, error_g = residual.dwell, abs(residual.error_g)
        limit, key = unit.limits.at(dwell.temp_degc, unit.t0_degc)
        if error_g > limit:
            raise RefusedError(
                f"{delivery.measurements.source}, row {dwell.row}",
                f"| |a| - g | = {error_g * 1e3:.4g} mg in {dwell.position} at "
                f"{dwell.temp_degc:.4g} degC by the compiled C, {error_g / limit:.3g} "
                "times the limit; the fitted model is within it",
                expected=f"at most {limit * 1e3:g} mg ({key})",
                remedy=(
                    f"method {delivery.chosen.method.label} is within "
                    f"{delivery.model_error_g * 1e3:.3g} mg of the model, its LSB is "
                    f"{1e3 / 2**unit.output_q:.3g} mg: choose another "
                    "compensation.method or a higher output_q"
                ),
            )
