"""Calibration of triaxial accelerometers and whole IMUs, from readings to proven integer C.

    import triaxcal

    unit = triaxcal.read_unit("units/AT-SIM")
    cal = triaxcal.fit(unit)
    K, U0 = cal.constants(20.0)
    firmware = triaxcal.firmware(cal)
    firmware.write("out")

Nothing here prints. What a user can cause is a `RefusedError`. A name is imported when it is first
used, so that `import triaxcal` alone takes no longer than importing numpy.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from triaxcal.api.calibration import Calibration, Diagnosis, fit, load
    from triaxcal.api.certificate import check_certificate, sign_certificate, verify_certificate
    from triaxcal.api.delivered import delivered_firmware
    from triaxcal.api.delivery import Delivered, deliver, update
    from triaxcal.api.diagnosis import diagnose
    from triaxcal.api.export import ExportedFiles, export
    from triaxcal.api.files import copy_example, examples, key_schema, write_first_file
    from triaxcal.api.firmware import CompiledFirmware, Firmware, firmware
    from triaxcal.api.image import CalibrationImage, read_image
    from triaxcal.api.imu import (
        Imu,
        ImuCalibration,
        ImuConstants,
        ImuState,
        fit_imu,
        read_imu,
    )
    from triaxcal.api.imufile import load_imu
    from triaxcal.api.imufirmware import ImuFirmware, firmware_imu
    from triaxcal.api.installation import installation
    from triaxcal.api.noise import study_noise
    from triaxcal.api.pair import LivePair, cross_coupling
    from triaxcal.api.series import SeriesResult, calibrate_series, learn_priors
    from triaxcal.api.studies import (
        MeasurementPlan,
        compare_history,
        find_poses,
        plan_measurements,
        plan_motion,
        simulate,
        simulate_series,
        study_drift,
    )
    from triaxcal.api.study import Study
    from triaxcal.api.table import TableGrid, study_angle_errors
    from triaxcal.api.testreport import ReportedTests, make_test_report
    from triaxcal.api.unit import Unit, read_unit
    from triaxcal.api.verification import Verification, certify, verify_unit
    from triaxcal.base.errors import RefusedError, UsageError
    from triaxcal.delivery.imuverdict import ImuVerdict
    from triaxcal.delivery.verdict import LimitCheck, Verdict
    from triaxcal.report.dcc.signed import Signature
    from triaxcal.report.installation import Installation, InstalledPart
    from triaxcal.uncertainty.budget import Budget
    from triaxcal.uncertainty.check import FieldCheck
    from triaxcal.uncertainty.updated import FieldUpdate
    from triaxcal.unit.examples import ExampleUnit

__version__ = "0.2.0.dev0"

__all__ = [
    "Budget", "Calibration", "CalibrationImage", "CompiledFirmware", "Delivered", "Diagnosis",
    "ExampleUnit", "ExportedFiles", "FieldCheck", "FieldUpdate", "Firmware", "Imu",
    "ImuCalibration", "ImuConstants", "ImuFirmware", "ImuState", "ImuVerdict", "Installation",
    "InstalledPart", "LimitCheck", "LivePair", "MeasurementPlan", "RefusedError", "ReportedTests",
    "SeriesResult", "Signature", "Study", "TableGrid", "Unit", "UsageError", "Verdict",
    "Verification", "__version__", "calibrate_series", "certify", "check_certificate",
    "compare_history", "copy_example", "cross_coupling", "deliver", "delivered_firmware",
    "diagnose", "examples", "export", "find_poses", "firmware", "firmware_imu", "fit", "fit_imu",
    "installation", "key_schema", "learn_priors", "load", "load_imu", "make_test_report",
    "plan_measurements", "plan_motion", "read_image", "read_imu", "read_unit", "sign_certificate",
    "simulate", "simulate_series", "study_angle_errors", "study_drift", "study_noise", "update",
    "verify_certificate", "verify_unit", "write_first_file",
]  # fmt: skip

_MODULES = {
    "triaxcal.api.calibration": ("Calibration", "Diagnosis", "fit", "load"),
    "triaxcal.api.certificate": ("check_certificate", "sign_certificate", "verify_certificate"),
    "triaxcal.api.delivered": ("delivered_firmware",),
    "triaxcal.api.delivery": ("Delivered", "deliver", "update"),
    "triaxcal.api.diagnosis": ("diagnose",),
    "triaxcal.api.export": ("ExportedFiles", "export"),
    "triaxcal.api.files": ("copy_example", "examples", "key_schema", "write_first_file"),
    "triaxcal.api.firmware": ("CompiledFirmware", "Firmware", "firmware"),
    "triaxcal.api.image": ("CalibrationImage", "read_image"),
    "triaxcal.api.imu": (
        "Imu", "ImuCalibration", "ImuConstants", "ImuState", "fit_imu", "read_imu",
    ),
    "triaxcal.api.imufile": ("load_imu",),
    "triaxcal.api.imufirmware": ("ImuFirmware", "firmware_imu"),
    "triaxcal.api.installation": ("installation",),
    "triaxcal.report.installation": ("Installation", "InstalledPart"),
    "triaxcal.unit.examples": ("ExampleUnit",),
    "triaxcal.api.noise": ("study_noise",),
    "triaxcal.api.pair": ("LivePair", "cross_coupling"),
    "triaxcal.api.series": ("SeriesResult", "calibrate_series", "learn_priors"),
    "triaxcal.api.studies": (
        "MeasurementPlan", "compare_history", "find_poses",
        "plan_measurements", "plan_motion", "simulate", "simulate_series", "study_drift",
    ),
    "triaxcal.api.study": ("Study",),
    "triaxcal.api.table": ("TableGrid", "study_angle_errors"),
    "triaxcal.api.testreport": ("ReportedTests", "make_test_report"),
    "triaxcal.api.unit": ("Unit", "read_unit"),
    "triaxcal.api.verification": ("Verification", "certify", "verify_unit"),
    "triaxcal.base.errors": ("RefusedError", "UsageError"),
    "triaxcal.delivery.imuverdict": ("ImuVerdict",),
    "triaxcal.delivery.verdict": ("LimitCheck", "Verdict"),
    "triaxcal.report.dcc.signed": ("Signature",),
    "triaxcal.uncertainty.budget": ("Budget",),
    "triaxcal.uncertainty.check": ("FieldCheck",),
    "triaxcal.uncertainty.updated": ("FieldUpdate",),
}  # fmt: skip
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'triaxcal' has no attribute {name!r}")
    value = getattr(importlib.import_module(_MODULE_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
