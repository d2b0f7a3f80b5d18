"""The whole road for one unit: from its folder to its constants and what else was seen."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.progress import Progress
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.description import DynamicDescription, read_dynamic
from triaxcal.dynamic.missing import Effect, missing_effects
from triaxcal.dynamic.observability import Observability, observability
from triaxcal.dynamic.reading import read_recording


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
    """

    unit: DynamicDescription
    result: DynamicResult
    seen: Observability
    off: tuple[Effect, ...]
    findings: tuple[str, ...]


def calibrate_unit(folder: Path, progress: Progress | None = None) -> DynamicUnit:
    """Calibrate the unit in `folder` from the recording that its unit.toml names.

    Raises
    ------
    RefusedError
        As `read_dynamic`, `read_recording` and `calibrate_dynamic`.
    """
    report = progress or (lambda _step, _part: None)
    unit = read_dynamic(folder)
    recording = read_recording(unit)
    result = calibrate_dynamic(
        recording,
        unit.noise,
        unit.state_blocks(),
        reference_degc=unit.reference_degc,
        progress=lambda number, part: report(f"pass {number + 1}", part),
    )
    off = missing_effects(recording, unit.noise, result, lambda part: report("effects off", part))
    seen = observability(result.layout, result.covariance)
    return DynamicUnit(unit, result, seen, off, recording.findings)
