"""The whole road for one unit: from its folder to its constants and what else was seen."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.progress import Progress
from triaxcal.dynamic.agreement import recordings_differ, refuse_others
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.description import DynamicDescription, read_dynamic
from triaxcal.dynamic.missing import Effect, missing_effects
from triaxcal.dynamic.observability import Observability, observability
from triaxcal.dynamic.otherunits import refuse_other_misalignments
from triaxcal.dynamic.overtemperature import (
    OverTemperature,
    Solved,
    Temperatures,
    solve_over_temperature,
)
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.several import read_recordings
from triaxcal.dynamic.temperatures import Recorded, recorded_temperatures, refuse_beyond
from triaxcal.dynamic.thermalnodes import nodes_of
from triaxcal.dynamic.upright import upright
from triaxcal.model.thermal.registry import AUTO
from triaxcal.unit.thermal import ThermalChoice


@dataclass(frozen=True)
class DynamicUnit:
    """A calibrated unit.

    Attributes
    ----------
    unit : DynamicDescription
    result : DynamicResult
    seen : Observability
    off : tuple of Effect
        Effects that are switched off, tested on the recording.
    findings : tuple of str
        What of the recording was left out, repaired or not used.
    range_degc : tuple of two floats, or None
        Working temperatures: those of [device], else of the recording; None where it has none.
    recorded_degc : tuple of two floats, or None
        Lowest and highest temperature that was recorded.
    recording : ImuRecording or None
        None for a plan.
    gyro_range_degc : tuple of two floats, or None
        As `range_degc`, by the gyros' own thermometer; None where they have none.
    over : OverTemperature, or None
        The curves of the constants, where they follow the temperature.
    terms : DynamicResult, or None
        The filter's result then: `result` has the constants at the reference temperature.
    """

    unit: DynamicDescription
    result: DynamicResult
    seen: Observability
    off: tuple[Effect, ...]
    findings: tuple[str, ...]
    range_degc: tuple[float, float] | None = None
    recorded_degc: tuple[float, float] | None = None
    recording: ImuRecording | None = field(default=None, repr=False)
    over: OverTemperature | None = None
    terms: DynamicResult | None = field(default=None, repr=False)
    gyro_range_degc: tuple[float, float] | None = None

    @property
    def filtered(self) -> DynamicResult:
        """The filter's own result: with its terms over temperature, where it has some."""
        return self.result if self.terms is None else self.terms


def calibrate_unit(folder: Path, progress: Progress | None = None) -> DynamicUnit:
    """Calibrate the unit in `folder` from the recording that its unit.toml names.

    Raises
    ------
    RefusedError
        As `read_dynamic`, `read_recordings` and `calibrate_dynamic`.
    """
    return calibrate_described(read_dynamic(folder), progress)


def calibrate_described(unit: DynamicDescription, progress: Progress | None = None) -> DynamicUnit:
    """Calibrate the unit of a description from its recording.

    Raises
    ------
    RefusedError
        As `read_recordings`, `recorded_temperatures` and `calibrate_dynamic`; where the working
        range is beyond the temperatures that were recorded; where recordings are of two units.
    """
    report = progress or (lambda _step, _part: None)
    unit, whole = upright(unit, read_recordings(unit))
    recording, temperatures = whole, recorded_temperatures(whole)
    unknown = refuse_beyond(unit, temperatures)
    full, over = _solve(unit, recording, temperatures, report)
    if over is not None:
        recording, unknown = over.recording, (*unknown, *over.over.findings)
    functions = None if over is None else over.functions
    moved = temperatures if recording is whole else recorded_temperatures(recording)
    if over is not None and temperatures is not None and recording.starts_s:
        assert moved is not None
        refuse_other_misalignments(recording, moved, over.over.known)
    differ = refuse_others(recordings_differ(recording, full, moved, functions))
    result = full if over is None else over.shown
    off = missing_effects(recording, full, lambda part: report("effects off", part))
    seen = observability(result.layout, result.covariance)
    recorded = None if temperatures is None else temperatures.ends_degc
    range_degc = recorded if unit.device is None else unit.device.range_degc
    gyro_range_degc = None
    if temperatures is not None and temperatures.gyro is not None:
        ends = temperatures.gyro_ends_degc
        gyro_range_degc = ends if unit.device is None else unit.device.gyro_range
    findings = (*recording.findings, *result.survey.findings, *unknown, *differ)
    about = unit, result, seen, off, findings, range_degc, recorded, recording
    done = DynamicUnit(*about) if over is None else DynamicUnit(*about, over.over, full)
    return replace(done, gyro_range_degc=gyro_range_degc)


def _solve(
    unit: DynamicDescription,
    recording: ImuRecording,
    recorded: Recorded | None,
    report: Progress,
) -> tuple[DynamicResult, Solved | None]:
    """The solution with all its states, and its curves where constants follow the temperature."""
    stated = thermal_choice_of(unit, recorded)
    if stated is not None and recorded is not None:
        at = Temperatures(recorded, stated, unit.reference_degc, str(unit.path))
        solved = solve_over_temperature(recording, unit.noise, unit.state_blocks(), at, report)
        return solved.full, solved
    result = calibrate_dynamic(
        recording,
        unit.noise,
        unit.state_blocks(),
        reference_degc=unit.reference_degc,
        progress=lambda number, part: report(f"pass {number + 1}", part),
    )
    return result, None


def thermal_choice_of(unit: DynamicDescription, recorded: Recorded | None) -> ThermalChoice | None:
    """What unit.toml states of functions over temperature, or that they are to be chosen.

    Raises
    ------
    RefusedError
        When functions are stated and no temperature was recorded.
    """
    if unit.thermal is not None:
        if recorded is None:
            raise RefusedError(
                f"{unit.path}, [thermal]",
                "given, and no temperature is recorded",
                expected="temp_column in [dynamic], or temp_degc of each [[dynamic.recording]]",
            )
        return unit.thermal
    linear = any(b.needs == "temp_degc" for b in unit.state_blocks())
    if recorded is None or len(unit.recordings) == 1 or linear:
        return None
    several = len(nodes_of(recorded, unit.reference_degc).degc) > 1
    return ThermalChoice(AUTO) if several else None
