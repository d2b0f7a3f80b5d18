"""The record of an update in the field."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Update:
    """That a calibration is one from before, brought up to date by poses from the field.

    Attributes
    ----------
    parents : tuple of str
        inputs_sha256 of the calibrations before it, the oldest first.
    recording : str
        Name of the recording from the field.
    recording_sha256 : str
    poses : int
    gravity_g : float
        Local gravity at the recording.
    bias_drift_g, scale_drift, axes_drift : float
        Standard deviations of the drift that was allowed for: of each bias (g), of each scale
        (relative), of each angle between axes (rad).
    chi_square : float
        Of the poses against the calibration before, drift allowed for; `poses` are expected.
    earlier_sha256 : tuple of str
        Of the recordings of the updates before this one.
    order : int
        Of the functions that the device had before, 0 where it is not known: a larger uncertainty
        is no reason for another C.
    """

    parents: tuple[str, ...]
    recording: str
    recording_sha256: str
    poses: int
    gravity_g: float
    bias_drift_g: float
    scale_drift: float
    axes_drift: float
    chi_square: float
    earlier_sha256: tuple[str, ...] = ()
    order: int = 0
