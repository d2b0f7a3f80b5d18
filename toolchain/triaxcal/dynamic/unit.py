"""The whole road for one unit: from its folder to its constants and what else was seen."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from triaxcal.base.progress import Progress
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.description import DynamicDescription, read_dynamic
from triaxcal.dynamic.missing import Effect, missing_effects
from triaxcal.dynamic.observability import Observability, observability
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.several import read_recordings
from triaxcal.dynamic.temperatures import recorded_temperatures, refuse_beyond
from triaxcal.dynamic.upright import upright


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
        What was left out or repaired when the recording was read.
    range_degc : tuple of two floats, or None
        Working temperatures: those of [device], else of the recording; None where it has none.
    recorded_degc : tuple of two floats, or None
        Lowest and highest temperature that was recorded.
    recording : ImuRecording or None
        None for a plan.
    """

    unit: DynamicDescription
    result: DynamicResult
    seen: Observability
    off: tuple[Effect, ...]
    findings: tuple[str, ...]
    range_degc: tuple[float, float] | None = None
    recorded_degc: tuple[float, float] | None = None
    recording: ImuRecording | None = field(default=None, repr=False)


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
        range is beyond the temperatures that were recorded.
    """
    report = progress or (lambda _step, _part: None)
    unit, recording = upright(unit, read_recordings(unit))
    temperatures = recorded_temperatures(recording)
    unknown = refuse_beyond(unit, temperatures)
    result = calibrate_dynamic(
        recording,
        unit.noise,
        unit.state_blocks(),
        reference_degc=unit.reference_degc,
        progress=lambda number, part: report(f"pass {number + 1}", part),
    )
    off = missing_effects(recording, result, lambda part: report("effects off", part))
    seen = observability(result.layout, result.covariance)
    recorded = None if temperatures is None else temperatures.ends_degc
    range_degc = recorded if unit.device is None else unit.device.range_degc
    findings = (*recording.findings, *unknown)
    return DynamicUnit(unit, result, seen, off, findings, range_degc, recorded, recording)
