"""The test report of a unit: all chapters, each test that fails with its reason in its place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from triaxcal.base.errors import RefusedError
from triaxcal.delivery.fitted import Fitted
from triaxcal.delivery.verdict import Verdict
from triaxcal.noise.study import NoiseStudy
from triaxcal.performance.composite import composite_chapter
from triaxcal.performance.equation import equation_chapter
from triaxcal.performance.figures import Chapter, Drawing, Figure
from triaxcal.performance.hysteresis import hysteresis_chapter, hysteresis_figures
from triaxcal.performance.known import known
from triaxcal.performance.noise import noise_chapter, noise_of
from triaxcal.performance.nonlinear import nonlinear
from triaxcal.performance.poweron import PowerOn, power_on, temperature_notes, warm_up_chapter
from triaxcal.performance.recorded import Recorded, read_test
from triaxcal.performance.repeatability import repeatability_chapter
from triaxcal.performance.temperature import temperature_chapter
from triaxcal.performance.vibration import Shake, vibration_chapter
from triaxcal.uncertainty.history import Repeatability
from triaxcal.unit.recordedtest import HYSTERESIS, POWER_ON, REST, StatedTest

STANDARDS = {"ieee-1293": "Figures and symbols as accelerometer houses report by IEEE Std 1293"}
"""Whose figures and symbols a report follows, and what its page says of that."""
T = TypeVar("T")


@dataclass(frozen=True)
class UnitReport:
    """What was measured of a unit, and what was not.

    Attributes
    ----------
    fitted : Fitted
    verdict : Verdict
    standard : str
        One of `STANDARDS`.
    chapters : tuple of Chapter
    files : mapping
        SHA-256 of the recordings of tests, by name.
    """

    fitted: Fitted
    verdict: Verdict
    standard: str
    chapters: tuple[Chapter, ...]
    files: dict[str, str] = field(default_factory=dict)

    @property
    def figures(self) -> tuple[Figure, ...]:
        """Those of all chapters."""
        return tuple(f for chapter in self.chapters for f in chapter.figures)

    def of(self, key: str, axis: str = "") -> Figure:
        """Figure of a key and an axis.

        Raises
        ------
        RefusedError
            When there is none.
        """
        for figure in self.figures:
            if figure.key == key and figure.axis in {axis, ""}:
                return figure
        raise RefusedError(
            "figure", f"none {key!r} of axis {axis!r}", expected="a figure of the report"
        )


@dataclass
class _Tests:
    """The tests of one kind, read, and why others could not be."""

    kind: str
    read: list[tuple[StatedTest, tuple[Recorded, ...]]] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)

    def each(self, made: Callable[[StatedTest, tuple[Recorded, ...]], T]) -> list[T]:
        """What is made of each; a refusal joins the reasons."""
        found = []
        for test, recorded in self.read:
            try:
                found.append(made(test, recorded))
            except RefusedError as refusal:
                self.reasons.append(str(refusal))
        return found

    @property
    def why(self) -> str:
        """Why nothing was measured."""
        return "; ".join(self.reasons) or f"no [test.NAME] of kind {self.kind} in unit.toml"

    @property
    def notes(self) -> list[str]:
        """What readers of the chapter should know, reasons and findings of the files."""
        findings = [f for _, recorded in self.read for r in recorded for f in r.findings]
        return [*self.reasons, *findings]


def make_report(
    fitted: Fitted,
    verdict: Verdict,
    folder: Path | None,
    standard: str,
    *,
    days: Repeatability | None = None,
    shake: Shake | None = None,
    why_not_shaken: str = "",
) -> UnitReport:
    """Report of a calibrated unit and the tests that its unit.toml states.

    Parameters
    ----------
    folder : Path or None
        Of the unit; None of one without a folder, whose tests cannot be read.
    days : Repeatability or None
        From calibration to calibration.
    shake : callable or None
        Runs the C on a vibration.
    """
    unit, calibration = fitted.unit, fitted.calibration
    done, terms = (
        known(unit, fitted.measurements, calibration),
        nonlinear(calibration, unit.nonlinearity),
    )
    switched, resting, cycled = (
        _read(fitted, folder, kind) for kind in (POWER_ON, REST, HYSTERESIS)
    )
    noise: list[tuple[StatedTest, NoiseStudy]] = resting.each(
        lambda test, recorded: (test, noise_of(test, _only(test, recorded)))
    )
    first = noise[0][1] if noise else None
    on: list[PowerOn] = switched.each(power_on)
    cycles = cycled.each(
        lambda test, recorded: hysteresis_figures(test, _only(test, recorded), first)
    )
    figures = [f for cycle in cycles for f in cycle[0]]
    notes = [n for cycle in cycles for n in cycle[1]]
    drawings: list[Drawing] = [d for cycle in cycles for d in cycle[2]]
    chapters = (
        equation_chapter(done, terms),
        repeatability_chapter(calibration, on, switched.why, days),
        warm_up_chapter(on, _warm_up_notes(on, switched), switched.why),
        hysteresis_chapter(
            figures, [*(cycled.notes if cycles else []), *notes], drawings, cycled.why
        ),
        temperature_chapter(done),
        noise_chapter(noise, resting.reasons, resting.why),
        composite_chapter(done, terms, verdict),
        vibration_chapter(done, terms, unit.vibrations, shake, why_not_shaken),
    )
    files = {
        f"{test.table}: {r.source}": r.sha256
        for tests in (switched, resting, cycled)
        for test, recorded in tests.read
        for r in recorded
    }
    return UnitReport(fitted, verdict, standard, chapters, files)


def _warm_up_notes(on: list[PowerOn], switched: _Tests) -> list[str]:
    return [*switched.notes, *(note for one in on for note in temperature_notes(one))] if on else []


def _only(test: StatedTest, recorded: tuple[Recorded, ...]) -> Recorded:
    """The one file of a test."""
    if len(recorded) > 1:
        raise RefusedError(
            f"{test.where} file",
            f"{len(recorded)} files",
            expected=f"one file of a test of kind {test.keys.kind}",
            remedy="make a [test.NAME] of each",
        )
    return recorded[0]


def _read(fitted: Fitted, folder: Path | None, kind: str) -> _Tests:
    found = _Tests(kind)
    for test in fitted.unit.tests:
        if test.keys.kind != kind:
            continue
        if folder is None:
            found.reasons.append(f"{test.where}: the unit has no folder to read it from")
            continue
        try:
            found.read.append((test, read_test(fitted.unit, fitted.calibration, folder, test)))
        except RefusedError as refusal:
            found.reasons.append(str(refusal))
    return found
