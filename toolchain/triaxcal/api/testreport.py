"""`make_test_report`: what a test house states of a unit, by what its folder has."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from triaxcal.api.calibration import Calibration, fit
from triaxcal.api.firmware import firmware
from triaxcal.api.unit import Unit
from triaxcal.base.errors import RefusedError, UsageError
from triaxcal.base.publish import publish
from triaxcal.base.tomltable import did_you_mean
from triaxcal.model.types import FloatArray
from triaxcal.performance.shaken import Int32Array, Sensor, Shaken, UInt32Array, shaken
from triaxcal.performance.testreport import STANDARDS, UnitReport, make_report
from triaxcal.performance.vibration import Shake
from triaxcal.report.history import read_history
from triaxcal.report.testreport.document import report_json
from triaxcal.report.testreport.page import report_html
from triaxcal.report.testreport.text import report_text
from triaxcal.uncertainty.history import HISTORY_FOLDER, Repeatability, repeatability
from triaxcal.unit.vibration import Vibration

REPORTS = "reports"
HTML_FILE, JSON_FILE = "report.html", "report.json"
_SEED = 20240229


@dataclass(frozen=True)
class ReportedTests:
    """A test report and its files.

    Attributes
    ----------
    result : UnitReport
        Its `figures` have key, axis, value, interval and how they were measured; `of(key, axis)`
        finds one.
    """

    result: UnitReport

    @cached_property
    def summary(self) -> str:
        """The text that the command line prints."""
        return report_text(self.result)

    @cached_property
    def files(self) -> dict[str, bytes]:
        """The page, and the same as JSON."""
        return {HTML_FILE: report_html(self.result), JSON_FILE: report_json(self.result)}

    def __str__(self) -> str:
        return self.summary

    def __repr__(self) -> str:
        return f"<triaxcal.ReportedTests of {self.result.fitted.unit.name}>"

    def write(self, build: str | Path) -> Path:
        """Write both into `build`/reports/<UNIT>, all of them or none; returns that folder.

        Raises
        ------
        RefusedError
            When the folder holds anything else, or cannot be written.
        """
        target = Path(build) / REPORTS / self.result.fitted.unit.name
        publish(self.files, target)
        return target


def make_test_report(
    unit: Unit, standard: str = next(iter(STANDARDS)), *, calibration: Calibration | None = None
) -> ReportedTests:
    """Report of everything that a unit's folder shows of it, and of what it does not.

    The unit is calibrated from its readings. Recordings of tests are those of [test.NAME] in
    unit.toml, vibrations those of [vibration.NAME], terms from other tests [nonlinearity]. A test
    that cannot be used stands in the report with its reason.

    Parameters
    ----------
    unit : Unit
    standard : str
        "ieee-1293".
    calibration : Calibration or None
        Of the unit, where it has been fitted already.

    Raises
    ------
    RefusedError
        When the unit cannot be calibrated, or the standard is unknown.
    """
    if standard not in STANDARDS:
        raise UsageError(
            "standard",
            f"found {standard!r}{did_you_mean(standard, STANDARDS)}",
            expected="one of " + ", ".join(STANDARDS),
        )
    done = calibration or fit(unit)
    with ExitStack() as stack:
        shake, why = None, ""
        if done.fitted.unit.vibrations:
            shake, why = _shake(done, stack)
        result = make_report(
            done.fitted, done.verdict, unit.folder, standard,
            days=_days(unit), shake=shake, why_not_shaken=why,
        )  # fmt: skip
    return ReportedTests(result)


def _shake(done: Calibration, stack: ExitStack) -> tuple[Shake | None, str]:
    """Runs the compiled C of a calibration at T0; None and why where there is none."""
    try:
        made = firmware(done)
        compiled = stack.enter_context(made.compiled())
    except RefusedError as refusal:
        return None, f"the C was not run: {refusal}"
    sensor = done.fitted.unit.temperature_sensor
    code = np.int32(round((done.fitted.unit.t0_degc - sensor.degc_at_zero) / sensor.degc_per_code))

    def run(raw: Int32Array) -> tuple[Int32Array, UInt32Array]:
        return compiled.apply(raw, code)

    def shake(vibration: Vibration, static_g: FloatArray, model: Sensor) -> Shaken:
        return shaken(vibration, static_g, model, run, made.lsb_g, seed=_SEED)

    return shake, ""


def _days(unit: Unit) -> Repeatability | None:
    """From calibration to calibration; None without a history."""
    if unit.folder is None or not any((unit.folder / HISTORY_FOLDER).glob("[!.]*")):
        return None
    return repeatability(unit.description, read_history(unit.folder, unit.description))
