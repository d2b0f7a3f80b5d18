"""Dwells in test positions -> groups of six, one group a nominal temperature.

The file does not say which nominal temperature a dwell belongs to: it is read off the dwells.
Sorted by temperature, a gap wider than `GROUP_GAP_DEGC` starts the next group. A chamber holds its
temperature to a few tenths of a degree and calibration temperatures lie tens of degrees apart, so
2 degC parts them with a wide margin on both sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS
from triaxcal.model.thermal.shape import GROUP_GAP_DEGC
from triaxcal.model.types import FloatArray
from triaxcal.readings.measurements import Dwell, MeasurementSet

FEW_READINGS = 10
"""A dwell with fewer does not know its own standard deviation to better than a quarter."""


@dataclass(frozen=True)
class TemperatureGroup:
    """The six test positions at one nominal temperature.

    Attributes
    ----------
    temp_degc : float
        Mean of the six dwells' temperatures.
    dwells : tuple of six Dwell
        TP1 to TP6; means over the runs, where there are several.
    runs : tuple of tuples of six Dwell
        Where every position was measured several times: the k-th dwells of the six, in the order of
        the file, for each k. Empty for one run.
    """

    temp_degc: float
    dwells: tuple[Dwell, ...]
    runs: tuple[tuple[Dwell, ...], ...] = ()

    @property
    def measured(self) -> tuple[Dwell, ...]:
        """The dwells as they were measured, of all runs."""
        return tuple(d for run in self.runs for d in run) or self.dwells


@dataclass(frozen=True)
class GroupedReadings:
    """The groups as arrays; axes are (group, position TP1..TP6, output x, y, z).

    Attributes
    ----------
    temps_degc : array, shape (G,)
        Temperatures of the groups, rising.
    dwell_temps_degc : array, shape (G, 6)
    voltage_v : array, shape (G, 6, 3)
    variance_v2 : array, shape (G, 6, 3), or None
        Variances of the readings; None unless every dwell has its statistics.
    variance_dof : float
        Degrees of freedom of one of them.
    pooled : bool
        Whether each output's are one and the same, from all dwells, but for the counts.
    """

    temps_degc: FloatArray
    dwell_temps_degc: FloatArray
    voltage_v: FloatArray
    variance_v2: FloatArray | None
    variance_dof: float = math.inf
    pooled: bool = False

    def select(self, groups: list[int]) -> GroupedReadings:
        """Only the groups with these indices."""
        variance = None if self.variance_v2 is None else self.variance_v2[groups]
        return GroupedReadings(
            self.temps_degc[groups],
            self.dwell_temps_degc[groups],
            self.voltage_v[groups],
            variance,
            self.variance_dof,
            self.pooled,
        )


def group_dwells(measurements: MeasurementSet, t0_degc: float) -> tuple[TemperatureGroup, ...]:
    """Groups of the dwells in test positions, by rising temperature.

    Raises
    ------
    RefusedError
        When a position is missing or doubled at a temperature, or no temperature is at T0.
    """
    source = measurements.source
    rows = [d for d in measurements.dwells if d.position in TEST_POSITIONS]
    if not rows:
        raise RefusedError(
            source,
            "no dwell in a test position",
            expected="TP1 to TP6 at each calibration temperature",
        )
    clusters = _clusters(rows)
    for cluster in clusters:
        if not _runs(cluster):
            _refuse_doubled(source, cluster)
        _refuse_drift(source, cluster)
    # The smallest first: one row with a wrong temperature spoils two groups, and shows there.
    for cluster in sorted(clusters, key=len):
        _refuse_incomplete(source, cluster)
    groups = tuple(_group(cluster) for cluster in clusters)
    nearest = min(abs(group.temp_degc - t0_degc) for group in groups)
    if nearest > GROUP_GAP_DEGC:
        found = ", ".join(f"{group.temp_degc:.6g}" for group in groups)
        raise RefusedError(
            source,
            f"no dwells at T0 = {t0_degc:g} degC; temperatures found: {found} degC",
            expected=f"TP1 to TP6 within {GROUP_GAP_DEGC:g} degC of T0",
            remedy="measure there, or correct [thermal] t0_degc in unit.toml",
        )
    return groups


def _refuse_drift(source: str, cluster: list[Dwell]) -> None:
    first, last = cluster[0], cluster[-1]
    spread = last.temp_degc - first.temp_degc
    if spread > GROUP_GAP_DEGC:
        raise RefusedError(
            f"{source}, rows {first.row} and {last.row}",
            f"{spread:.3g} degC between dwells that belong to one temperature "
            f"({first.temp_degc:.4g} to {last.temp_degc:.4g} degC)",
            expected=f"at most {GROUP_GAP_DEGC:g} degC over the six positions, and more than that "
            "to the next temperature",
            remedy="wait for the chamber to settle, and measure that temperature again; or leave "
            "out temperatures that are too near to each other",
        )


def check_position_dwells(measurements: MeasurementSet) -> tuple[Dwell, ...]:
    """Dwells in check positions, in the order of the file; each alone."""
    return tuple(d for d in measurements.dwells if d.position in CHECK_POSITIONS)


def grouped_readings(
    groups: tuple[TemperatureGroup, ...], volts_per_code: float
) -> GroupedReadings:
    """Arrays of the groups.

    The variance of a mean is sd^2 / count. Readings that scatter by less than half a code are
    rounded alike, which no count averages out: code^2 / 12 is added whole. With fewer than
    `FEW_READINGS` in a dwell the sd are pooled over all dwells of an output, GUM H.3.6: three
    readings know their own to a half, and weights that follow it make the fit worse than stated.
    """
    rounding = volts_per_code**2 / 12.0
    dwells = [d for group in groups for d in group.dwells]
    recorded = [(d.sd_v, d.count) for d in dwells if d.sd_v is not None and d.count is not None]
    known = len(recorded) == len(dwells)
    counts = np.array([count for _, count in recorded])
    sd_v = np.array([sd for sd, _ in recorded])
    dof = float(counts.min() - 1) if known else math.inf
    pooled = known and counts.max() > 1 and int(counts.min()) < FEW_READINGS
    if pooled:
        dof = float(np.sum(counts - 1))
        sd_v = np.broadcast_to(np.sqrt((counts - 1) @ sd_v**2 / dof), sd_v.shape)
    variances = (
        sd_v**2 / counts[:, None] + np.where(sd_v < 0.5 * volts_per_code, rounding, 0.0)
        if known
        else None
    )
    return GroupedReadings(
        temps_degc=np.array([group.temp_degc for group in groups]),
        dwell_temps_degc=np.array([[d.temp_degc for d in group.dwells] for group in groups]),
        voltage_v=np.array([[d.voltage_v for d in group.dwells] for group in groups]),
        variance_v2=None if variances is None else variances.reshape(len(groups), 6, 3),
        variance_dof=max(dof, 1.0),
        pooled=pooled,
    )


def _clusters(rows: list[Dwell]) -> list[list[Dwell]]:
    # The row breaks ties, so that equal temperatures keep the order of the file.
    ordered = sorted(rows, key=lambda d: (d.temp_degc, d.row))
    clusters = [[ordered[0]]]
    for before, dwell in pairwise(ordered):
        if dwell.temp_degc - before.temp_degc > GROUP_GAP_DEGC:
            clusters.append([])
        clusters[-1].append(dwell)
    return clusters


def _group(cluster: list[Dwell]) -> TemperatureGroup:
    runs = _runs(cluster)
    dwells = tuple(sorted(cluster, key=lambda d: d.position))
    if runs:
        dwells = tuple(_mean_of([run[k] for run in runs]) for k in range(len(TEST_POSITIONS)))
    first = dwells[0].temp_degc
    # Offsets from the first: the mean of six equal temperatures is then exactly that one.
    mean = first + sum(d.temp_degc - first for d in dwells) / len(dwells)
    return TemperatureGroup(temp_degc=mean, dwells=dwells, runs=runs)


def _runs(cluster: list[Dwell]) -> tuple[tuple[Dwell, ...], ...]:
    """Complete runs at one temperature, two or more, each TP1 to TP6; none where there is one."""
    of_position = [
        sorted((d for d in cluster if d.position == p), key=lambda d: d.row)
        for p in sorted(TEST_POSITIONS)
    ]
    counts = {len(dwells) for dwells in of_position}
    return tuple(zip(*of_position, strict=True)) if len(counts) == 1 and min(counts) > 1 else ()


def _mean_of(dwells: list[Dwell]) -> Dwell:
    """The mean of dwells in one position, with the variance of their mean where all have theirs."""
    first, n = dwells[0], len(dwells)
    variances = [d.variance_of_mean_v2 for d in dwells]
    known = [v for v in variances if v is not None]
    counts = [d.count for d in dwells if d.count is not None]
    complete = len(known) == len(counts) == n
    count = sum(counts) if complete else None
    sd_v = np.sqrt(sum(known) / n**2 * sum(counts)) if complete else None
    # Offsets from the first: the mean of equal temperatures is then exactly that one.
    temp = first.temp_degc + math.fsum(d.temp_degc - first.temp_degc for d in dwells) / n
    voltage = np.mean([d.voltage_v for d in dwells], axis=0)
    return Dwell(
        row=first.row,
        position=first.position,
        temp_degc=temp,
        voltage_v=voltage,
        count=count,
        sd_v=sd_v,
    )


def _refuse_doubled(source: str, cluster: list[Dwell]) -> None:
    seen: dict[str, Dwell] = {}
    for dwell in sorted(cluster, key=lambda d: d.row):
        first = seen.setdefault(dwell.position, dwell)
        if first is not dwell:
            raise RefusedError(
                f"{source}, rows {first.row} and {dwell.row}",
                f"{dwell.position} twice at one temperature "
                f"({first.temp_degc:.6g} and {dwell.temp_degc:.6g} degC)",
                expected="each position once, or all six equally often; temperatures within "
                f"{GROUP_GAP_DEGC:g} degC of the next are one",
                remedy="remove one of the rows, or correct its position or temperature",
            )


def _refuse_incomplete(source: str, cluster: list[Dwell]) -> None:
    present = {d.position: d.row for d in cluster}
    missing = [p for p in TEST_POSITIONS if p not in present]
    if missing:
        there = ", ".join(f"{p} (row {present[p]})" for p in sorted(present))
        temp = sum(d.temp_degc for d in cluster) / len(cluster)
        raise RefusedError(
            source,
            f"{', '.join(missing)} missing at {temp:.6g} degC, where there is only {there}",
            expected="TP1 to TP6 at each calibration temperature",
            remedy="measure what is missing, or correct the position or temperature of a row",
        )
