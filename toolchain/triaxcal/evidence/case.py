"""What is examined: a recording, the noise that is stated, and what was found from both."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import ImuRecording


@dataclass(frozen=True)
class Case:
    """A recording and its solution."""

    recording: ImuRecording
    noise: DataSheet
    result: DynamicResult
