"""One unit of a series, made where it is: a worker's whole task."""

from __future__ import annotations

import tempfile
import traceback
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal import __version__
from triaxcal.base.errors import RefusedError
from triaxcal.batch.order import Order, Outcome, refused
from triaxcal.batch.plan import is_imu
from triaxcal.batch.toolchain import toolchain
from triaxcal.codegen.compiler import start_reference
from triaxcal.codegen.objects import SharedObjects
from triaxcal.codegen.routines import Reference
from triaxcal.delivery.inputs import files_sha256
from triaxcal.delivery.unit import Delivery, deliver
from triaxcal.device.record import DeviceRecord, parsed_record
from triaxcal.model.curves import ThermalModel
from triaxcal.model.types import FloatArray
from triaxcal.report.files import all_files
from triaxcal.report.passport.content import Passport, passport
from triaxcal.report.series.imu import imu_files_and_record
from triaxcal.unit.recordingfile import is_in_folder

_GRID = 23


def make_unit(order: Order) -> Outcome:
    """The unit's files and record; a refusal in one line for whatever goes wrong with it."""
    if order.toolchain != toolchain():
        return refused(
            order,
            f"{order.folder}: sent to a worker with triaxcal {toolchain()}, expected "
            f"{order.toolchain}; install the same there",
        )
    with tempfile.TemporaryDirectory(prefix="triaxcal-") as scratch:
        here = Path(order.folder).absolute()
        folder = Path(scratch) / order.name if order.inputs else here
        try:
            for name, content in order.inputs.items():
                if not is_in_folder(name):
                    raise RefusedError(str(folder / name), "lies outside of the unit's folder")
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).write_bytes(content)
            make = imu_files_and_record if is_imu(folder) else partial(_triad, order)
            files, record = make(folder)
            order.refuse_change(files_sha256((folder / file for file in order.files), ""))
            return Outcome(order.name, order.key, "", files, record)
        except RefusedError as refusal:
            return refused(order, str(refusal).replace(str(folder), order.folder))
        except Exception as fault:
            # One unit's fault must not stop a thousand; the place is kept for a report.
            frame = traceback.extract_tb(fault.__traceback__)[-1]
            return refused(
                order,
                f"{order.folder}: fault in triaxcal {__version__} at "
                f"{Path(frame.filename).name}:{frame.lineno}: {type(fault).__name__}: {fault}; "
                "please report it with the unit's folder",
            )


def _triad(order: Order, folder: Path) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Files and record of an accelerometer."""
    delivery = deliver(folder, _reference(), _objects())
    made = passport(delivery, {}, _device(order))
    return all_files(delivery, made), unit_record(made)


def _device(order: Order) -> DeviceRecord | None:
    """The device that was verified, with this delivery or an earlier one."""
    return parsed_record(order.device, f"{order.name}, its device") if order.device else None


@cache
def _reference() -> Reference:
    """The handwritten C, compiled once a worker: it is the same for every unit."""
    # Windows removes no file of a loaded library: the series' own folder takes it along.
    with tempfile.TemporaryDirectory(prefix="triaxcal-", ignore_cleanup_errors=True) as folder:
        return Reference(start_reference(Path(folder)).load())


@cache
def _objects() -> SharedObjects:
    """What the C of units of one shape has in common, compiled once a worker."""
    return SharedObjects()


def unit_record(made: Passport) -> dict[str, Any]:
    """What the series needs of one unit; plain JSON."""
    d, u = made.delivery, made.uncertainty
    thermal, measured = d.calibration.thermal, d.unit.measured
    return {
        "unit": d.unit.name,
        "serial": d.unit.serial,
        "kind": _kind(d),
        "rig": measured.rig,
        "date": measured.date.isoformat() if measured.date else None,
        "result": made.verdict.result,
        "verdict": made.verdict.words,
        "reading_unit": d.calibration.reading_unit,
        "t0_degc": thermal.t0_degc,
        "range_degc": list(d.calibration.range_degc),
        "thermal_model": d.calibration.shape.label,
        "acceptance": [
            {
                "where": a.where,
                "limit_g": a.limit_g,
                "largest_residual_g": a.largest_g,
                "expanded_uncertainty_g": a.uncertainty_g,
            }
            for a in made.acceptance
        ],
        "worst_source": _worst_source(made),
        "at_t0": thermal.constants_at(thermal.t0_degc).tolist(),
        "temperature_coefficients": coefficients(thermal, d.calibration.range_degc).tolist(),
        "at_t0_expanded_uncertainty": u.constants_u[u.t0_index].tolist(),
        # A recording of poses has no tilter to judge.
        "placement_pattern_g": None if u.scatter is None else u.scatter.pattern_g.tolist(),
        "bound_lsb": d.bound.lsb,
        "vectors": d.check.total,
        "shape": _shape(d),
    }


def _kind(delivery: Delivery) -> str:
    """What the constants were fitted to."""
    if delivery.unit.recording is None:
        return "tilter"
    return "faces" if delivery.calibration.recording is None else "poses"


def coefficients(thermal: ThermalModel, range_degc: tuple[float, float]) -> FloatArray:
    """First and second coefficient of each constant, shape (12, 2), per degC and per degC^2.

    Of the parabola c(T0) + b dT + c dT^2 nearest to the curve over the range in least squares, so
    that units with different thermal functions can be compared.
    """
    temps = np.linspace(*range_degc, _GRID)
    change = thermal.constants_at(temps) - thermal.constants_at(thermal.t0_degc)
    dt = temps - thermal.t0_degc
    scale = float(np.max(np.abs(dt)))
    design = np.column_stack([dt / scale, (dt / scale) ** 2])
    found: FloatArray = np.linalg.lstsq(design, change)[0].T / np.array([scale, scale**2])
    return found


def _worst_source(made: Passport) -> str:
    worst = made.length_budget.worst
    return worst.source.name if worst else ""


def _shape(delivery: Delivery) -> str:
    shape = delivery.plan.shape
    return f"{delivery.chosen.method.label}, order {shape.order}, {shape.segments} segment(s)"
