"""What a series shows: distributions, units far from the others, drift between runs of a rig.

Outliers. x is far out when |x - median| > f s, s = 1.4826 MAD, robust against the outliers
themselves. For normal data the largest of n values of m quantities should stay below f with 95 %
(Bonferroni): f is the two-sided normal quantile at 0.05 / (n m), widened by 1 + 3.5 / sqrt(n) for
the scatter of the MAD, whose relative standard deviation is 1.17 / sqrt(n): three of them, which
the smallest of 36 is within 19 times of 20.

Drift. The placement pattern (uncertainty.scatter) is the tilter's own, so its mean over the units
of a run is the tilter's, with the standard error s / sqrt(units), s pooled within the runs. A run
is compared with the run before it on its rig; constants at T0 likewise. z beyond the quantile at
0.05 over all comparisons is reported.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np

from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray

MAD_TO_SD = 1.4826
FEWEST_UNITS = 20
"""With fewer units outliers are not searched: the MAD is uncertain by a quarter or more."""
FEWEST_IN_RUN = 3
_RISK = 0.05
_SCALES = {
    "V": ((1e3, "mV"), (1e6, "µV"), (1e9, "nV")),
    "mV": ((1.0, "mV"), (1e3, "µV"), (1e6, "nV")),
    "g": ((1e3, "mg"), (1e6, "µg"), (1e9, "ng")),
    "mg": ((1.0, "mg"), (1e3, "µg"), (1e6, "ng")),
    "m/s^2": ((1.0, "m/s²"), (1e3, "mm/s²"), (1e6, "µm/s²")),
}
_POWERS = ((1.0, ""), (1e3, "10⁻³ "), (1e6, "10⁻⁶ "))
"""Of a unit without smaller ones, as counts."""
_MAD_MARGIN = 3.5


@dataclass(frozen=True)
class Quantity:
    """One number of every unit.

    Attributes
    ----------
    name, unit : str
        In words.
    values : array, shape (units,)
        In `unit`.
    """

    name: str
    unit: str
    values: FloatArray

    @property
    def median(self) -> float:
        """Middle value."""
        return float(np.median(self.values))

    @property
    def spread(self) -> float:
        """Standard deviation as the MAD gives it."""
        return MAD_TO_SD * float(np.median(np.abs(self.values - self.median)))


@dataclass(frozen=True)
class Outlier:
    """A unit far from the others in one quantity, by so many spreads."""

    unit: str
    quantity: str
    value: float
    of_unit: str
    spreads: float


@dataclass(frozen=True)
class Run:
    """Units measured on one rig on one day, against the run before on that rig.

    Attributes
    ----------
    pattern_arcsec : float
        Rms of the placement pattern's mean, as the tilts of half-sums that give it.
    worst, shift, of_unit, z : str, float, str, float
        The quantity that differs most from the run before, by how much and how many of its
        standard errors; empty and 0 where there is nothing to compare with.
    told : bool
        Whether z is significant over all comparisons; its name is that of the key in series.json.
    """

    rig: str
    date: str
    units: int
    pattern_arcsec: float
    worst: str
    shift: float
    of_unit: str
    z: float
    told: bool


def triads(records: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Records of accelerometers."""
    return [r for r in records if "states" not in r]


def imus(records: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Records of IMUs."""
    return [r for r in records if "states" in r]


def alike(records: Sequence[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """Records by what can be compared, the most first: the unit of readings, an IMU's states."""
    groups: dict[tuple[str, ...], list[dict[str, Any]]] = defaultdict(list)
    for r in triads(records):
        groups[(r["reading_unit"],)].append(r)
    for r in imus(records):
        groups[("", *(f"{s['name']} {s['unit']}" for s in r["states"]))].append(r)
    return sorted(groups.values(), key=len, reverse=True)


def _scales(reading_unit: str) -> tuple[tuple[float, str], ...]:
    """Factors and units in which constants and their two coefficients are shown."""
    if reading_unit not in _SCALES:
        return tuple((factor, f"{name}{reading_unit}") for factor, name in _POWERS)
    return _SCALES[reading_unit]


def quantities(records: Sequence[dict[str, Any]]) -> list[Quantity]:
    """Quantities of records that are `alike`.

    Of an IMU its states. Else constants at T0 and their two temperature coefficients, 36 in all, in
    mV, µV and nV where the readings are volts.
    """
    if "states" in records[0]:
        values = np.array([[s["value"] for s in r["states"]] for r in records])
        states = enumerate(records[0]["states"])
        return [Quantity(s["label"], s["unit"].replace("^2", "²"), values[:, k]) for k, s in states]
    (f0, u0), (f1, u1), (f2, u2) = _scales(records[0]["reading_unit"])
    at_t0 = np.array([r["at_t0"] for r in records])
    by_temp = np.array([r["temperature_coefficients"] for r in records])
    found = []
    for c, name in enumerate(CONSTANT_NAMES):
        per = "/g" if c < 9 else ""
        found.append(Quantity(name, f"{u0}{per}", at_t0[:, c] * f0))
        found.append(Quantity(f"{name} per °C", f"{u1}{per}/°C", by_temp[:, c, 0] * f1))
        found.append(Quantity(f"{name} per °C²", f"{u2}{per}/°C²", by_temp[:, c, 1] * f2))
    return found


def outlier_factor(units: int, count: int) -> float:
    """f: spreads beyond which one of `count` quantities of a unit is far out."""
    normal = NormalDist().inv_cdf(1.0 - _RISK / (2.0 * units * count))
    return normal * (1.0 + _MAD_MARGIN / math.sqrt(units))


def outliers(records: Sequence[dict[str, Any]], found: Sequence[Quantity]) -> list[Outlier]:
    """Units far from the others, the farthest first; none where there are too few units."""
    if len(records) < FEWEST_UNITS:
        return []
    factor = outlier_factor(len(records), len(found))
    result = []
    for q in found:
        for k in np.flatnonzero(np.abs(q.values - q.median) > factor * q.spread):
            distance = float(q.values[k]) - q.median
            spreads = abs(distance) / q.spread if q.spread else math.inf
            unit = str(records[int(k)]["unit"])
            result.append(Outlier(unit, q.name, float(q.values[k]), q.unit, spreads))
    return sorted(result, key=lambda o: -o.spreads)


def runs(records: Sequence[dict[str, Any]]) -> list[Run]:
    """Runs of tilters by rig and day, each against the run before on its rig.

    Of units whose readings are in one unit.
    """
    records = [r for r in triads(records) if r["placement_pattern_g"] is not None]
    groups: dict[tuple[str, str], list[int]] = defaultdict(list)
    for k, r in enumerate(records):
        if r["rig"] or r["date"]:
            groups[str(r["rig"] or "-"), str(r["date"] or "-")].append(k)
    values, names = _compared(records)
    result = []
    before: dict[str, list[int]] = {}
    for (rig, date), members in sorted(groups.items()):
        others = before.get(rig, [])
        before[rig] = members
        worst, shift, unit, z, told = "", 0.0, "", 0.0, False
        if len(members) >= FEWEST_IN_RUN and len(others) >= FEWEST_IN_RUN:
            sd = _within(values, [ks for key, ks in groups.items() if key[0] == rig])
            error = sd * math.sqrt(1.0 / len(members) + 1.0 / len(others))
            shifts = values[members].mean(axis=0) - values[others].mean(axis=0)
            scores = np.abs(shifts) / np.where(error > 0.0, error, np.inf)
            k = int(np.argmax(scores))
            (worst, unit), shift, z = names[k], float(shifts[k]), float(scores[k])
            comparisons = len(names) * len(groups)
            told = z > NormalDist().inv_cdf(1.0 - _RISK / (2.0 * comparisons))
        pattern = np.mean([records[k]["placement_pattern_g"] for k in members], axis=0)
        arcsec = math.degrees(math.sqrt(float(np.mean(pattern**2)))) * 3600.0
        result.append(Run(rig, date, len(members), arcsec, worst, shift, unit, z, told))
    return result


def _compared(records: Sequence[dict[str, Any]]) -> tuple[FloatArray, list[tuple[str, str]]]:
    """Placement pattern in micro-g and constants at T0, (units, 21), and what they are."""
    factor, unit = _scales(records[0]["reading_unit"] if records else "V")[0]
    pattern = np.array([r["placement_pattern_g"] for r in records]).reshape(-1, 9) * 1e6
    constants = np.array([r["at_t0"] for r in records]).reshape(-1, 12) * factor
    names = [(f"placement, {a} pair seen by {b}", "µg") for a in AXES for b in AXES]
    names += [(name, f"{unit}/g" if c < 9 else unit) for c, name in enumerate(CONSTANT_NAMES)]
    return np.column_stack([pattern, constants]), names


def _within(values: FloatArray, groups: Sequence[Sequence[int]]) -> FloatArray:
    """Standard deviation within groups, pooled over them, of each column."""
    squares = np.zeros(values.shape[1])
    freedom = 0
    for members in groups:
        squares += np.sum((values[members] - values[members].mean(axis=0)) ** 2, axis=0)
        freedom += len(members) - 1
    result: FloatArray = np.sqrt(squares / max(freedom, 1))
    return result
