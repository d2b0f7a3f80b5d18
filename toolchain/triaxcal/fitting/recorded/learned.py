"""Priors of a type of sensor, learned from a series of its recordings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from triaxcal.fitting.recorded.calibrate import fit_of_all_terms
from triaxcal.fitting.recorded.scalar import GROUPS
from triaxcal.fitting.recorded.scales import ScaleEvidence, scales_of
from triaxcal.readings.samples import read_samples
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.priors import Priors
from triaxcal.unit.recording import RecordingLayout


def unit_poses(unit: UnitDescription, layout: RecordingLayout, folder: Path) -> ScaleEvidence:
    """One unit's poses, from the recording in its folder, linearised about all terms.

    Raises
    ------
    RefusedError
        When it cannot be read, or its poses carry no calibration.
    """
    samples = read_samples(folder, layout, unit.temperature_sensor)
    return ScaleEvidence(*fit_of_all_terms(unit, layout, samples))


@dataclass(frozen=True)
class LearnedPriors:
    """Scales that a series shows.

    Attributes
    ----------
    priors : Priors
    factors : dict
        By key: factor within which the scale is known, of one standard deviation.
    units : int
    log_evidence, log_evidence_before : float
        With these priors and with the defaults; the hyperprior is not in them.
    """

    priors: Priors
    factors: dict[str, float]
    units: int
    log_evidence: float
    log_evidence_before: float

    @property
    def toml(self) -> str:
        """Section [priors] for unit.toml."""
        head = f"[priors]  # learned from {self.units} units"
        lines = [
            f"{key} = {getattr(self.priors, key):.2g}  # within a factor of {self.factors[key]:.2g}"
            for key in GROUPS
        ]
        return "\n".join([head, *lines]) + "\n"


def learn(units: Sequence[ScaleEvidence]) -> LearnedPriors:
    """The most probable scales, about the defaults."""
    default = Priors()
    found = scales_of(units, default)

    def evidence(priors: Priors) -> float:
        return math.fsum(unit.log_evidence(priors) for unit in units)

    return LearnedPriors(
        found.priors, found.factors, len(units), evidence(found.priors), evidence(default)
    )
