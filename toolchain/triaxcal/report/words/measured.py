"""What was measured, in words: the tilter's dwells, or the poses of a recording."""

from __future__ import annotations

from triaxcal.delivery.unit import Delivery
from triaxcal.report.words.temperatures import degrees

_MOST_NAMED = 14
"""Temperatures; of more, their number and range are said."""


def measured_words(delivery: Delivery) -> str:
    """One line for summary and passport."""
    calibration, dwells = delivery.calibration, delivery.measurements.dwells
    recording = calibration.recording
    if recording is None:
        checks = len(calibration.check_dwells)
        of_check = f"{checks} check dwells" if checks else "no check dwells"
        temps = _temperatures([degrees(p.temp_degc) for p in calibration.points])
        return f"{len(dwells)} dwells: six positions at {temps}; {of_check}"
    refused = len(recording.poses.refused)
    name = recording.poses.source.replace("\\", "/").rpartition("/")[2]
    words = f"{len(dwells)} poses of {name}, {recording.route}"
    if refused:
        first = recording.poses.refused[0]
        words += f"; {refused} stretches at rest refused (pose {first.number}: {first.reason}"
        words += "; `triaxcal poses` lists all)" if refused > 1 else ")"
    return words


def _temperatures(named: list[str]) -> str:
    if len(named) <= _MOST_NAMED:
        return f"{', '.join(named)} degC"
    return f"{len(named)} temperatures, {named[0]} to {named[-1]} degC"
