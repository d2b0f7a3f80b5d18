"""Measurement records: one row per dwell, units/<UNIT>/measurements.csv."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.model.types import FloatArray


@dataclass(frozen=True)
class Dwell:
    """Mean of the readings while the unit rested in one position at one temperature.

    Attributes
    ----------
    row : int
        Line of the file, for messages; the header is line 1.
    position : str
        "TP1" to "TP6" (fitted), "CP1" to "CP6" (only checked).
    voltage_v : array, shape (3,)
        Mean outputs Ux, Uy, Uz in V.
    count : int or None
        Number of independent readings in the mean; None when the file does not say.
    sd_v : array, shape (3,), or None
        Standard deviation of one reading, V.
    """

    row: int
    position: str
    temp_degc: float
    voltage_v: FloatArray
    count: int | None
    sd_v: FloatArray | None

    @property
    def variance_of_mean_v2(self) -> FloatArray | None:
        """Variance of the mean, shape (3,), V^2: sd^2 / count; None when not recorded."""
        if self.sd_v is None or self.count is None:
            return None
        return self.sd_v**2 / self.count


@dataclass(frozen=True)
class MeasurementSet:
    """All dwells of one file, in its order; `source` names the file in messages."""

    source: str
    dwells: tuple[Dwell, ...]
