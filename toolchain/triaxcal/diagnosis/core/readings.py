"""Dwells of a tilter as arrays in units of g, in the order in which they were measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.model.thermal.shape import GROUP_GAP_DEGC
from triaxcal.model.types import BoolArray, FloatArray, IntArray
from triaxcal.readings.measurements import Dwell, MeasurementSet
from triaxcal.unit.description import UnitDescription

POSITIONS = tuple(TEST_POSITIONS)
FORCES = np.array(list(TEST_POSITIONS.values()), dtype=np.float64)
_UNSTATED_SD_G = 30e-6
"""Standard deviation of a mean that the file does not state; its factor is then free."""
_BY_HAND_SD_G = 5e-3
"""The same of labelled faces of a recording: a hand places them within some mrad."""
_LEAST_SD_G = 2e-6


@dataclass(frozen=True)
class Readings:
    """Dwells of one unit.

    Attributes
    ----------
    rows : array of int, shape (n,)
        Lines of the file.
    positions : tuple of str
        "TP1" to "TP6", "CP1" to "CP6".
    test : array of bool, shape (n,)
        Whether the dwell is in a test position, whose direction is known.
    temps_degc : array, shape (n,)
    outputs : array, shape (n, 3)
        In g: divided by `volts_per_g`.
    sd : array, shape (n, 3)
        Stated standard deviation of the mean, g.
    stated : bool
        Whether the file states it.
    force : array, shape (n, 3)
        Direction of the force, local g: of the position, or in a check position as the unit sees
        it with the constants of a first fit.
    block : array of int, shape (n,)
        Which dwells belong together: one kind of position, one temperature, measured in one go.
        Numbered in the order of the file.
    order : array of int, shape (n,)
        Place of the dwell within its block.
    t0_degc : float
    volts_per_g : array, shape (3,)
        Sensitivities that the readings show, with the signs that the unit should have.
    polarity : bool
        Whether the signs of the outputs are stated.
    """

    rows: IntArray
    positions: tuple[str, ...]
    test: BoolArray
    temps_degc: FloatArray
    outputs: FloatArray
    sd: FloatArray
    stated: bool
    force: FloatArray
    block: IntArray
    order: IntArray
    t0_degc: float
    volts_per_g: FloatArray
    polarity: bool

    def __len__(self) -> int:
        return len(self.rows)

    def but(self, **changes: object) -> Readings:
        """The same with other arrays."""
        return replace(self, **changes)  # type: ignore[arg-type]

    @cached_property
    def blocks(self) -> tuple[int, ...]:
        """Numbers of the blocks, in the order of measuring."""
        return tuple(int(b) for b in np.unique(self.block))

    @cached_property
    def test_blocks(self) -> dict[int, FloatArray]:
        """Outputs of the blocks that have all test positions, by POSITIONS, each (6, 3)."""
        names = np.array(self.positions)
        found = {}
        for block in self.blocks:
            own = np.flatnonzero(self.block == block)
            rows = [own[names[own] == name] for name in POSITIONS]
            if all(len(r) == 1 for r in rows):
                found[block] = self.outputs[np.concatenate(rows)]
        return found

    def of_block(self, block: int) -> BoolArray:
        """Mask of the dwells of a block."""
        return np.asarray(self.block == block)

    def block_degc(self, block: int) -> float:
        """Mean temperature of a block."""
        return self._blocks_degc[block]

    @cached_property
    def _blocks_degc(self) -> dict[int, float]:
        return {b: float(self.temps_degc[self.block == b].mean()) for b in self.blocks}

    @cached_property
    def rising(self) -> FloatArray:
        """+1 for dwells of a block reached by heating, -1 by cooling, shape (n,).

        The first block has the direction in which the second one follows, and so has a block that
        is measured at the temperature of the one before.
        """
        means = np.array([self.block_degc(b) for b in self.blocks])
        steps = np.diff(means)
        signs = np.concatenate([[0.0], np.where(np.abs(steps) > GROUP_GAP_DEGC, np.sign(steps), 0)])
        for k in reversed(range(len(signs) - 1)):
            signs[k] = signs[k] or signs[k + 1]
        signs[signs == 0] = 1.0
        return np.asarray(signs[np.searchsorted(self.blocks, self.block)])


def readings_of(unit: UnitDescription, measurements: MeasurementSet) -> Readings:
    """Dwells in units of g, whatever is wrong with them."""
    dwells = sorted(measurements.dwells, key=lambda d: d.row)
    test = np.array([d.position in TEST_POSITIONS for d in dwells])
    temps = np.array([d.temp_degc for d in dwells])
    volts = np.array([d.voltage_v for d in dwells])
    force = np.array([_direction(d) for d in dwells])
    scale = _volts_per_g(unit, volts[test], force[test])
    block, order = _blocks(dwells)
    variances = [d.variance_of_mean_v2 for d in dwells]
    stated = all(v is not None for v in variances)
    unstated = _UNSTATED_SD_G if unit.recording is None else _BY_HAND_SD_G
    sd = np.full(volts.shape, unstated)
    if stated:
        code = unit.adc.volts_per_code / np.sqrt(12.0)
        rounded = [
            code if d.sd_v is not None and (d.sd_v < unit.adc.volts_per_code / 2).any() else 0.0
            for d in dwells
        ]
        variance_v2 = np.array(variances) + np.square(rounded)[:, None]
        sd = np.sqrt(variance_v2 / scale**2 + _LEAST_SD_G**2)
    return Readings(
        rows=np.array([d.row for d in dwells]),
        positions=tuple(d.position for d in dwells),
        test=test,
        temps_degc=temps,
        outputs=volts / scale,
        sd=sd,
        stated=stated,
        force=force,
        block=block,
        order=order,
        t0_degc=unit.t0_degc,
        volts_per_g=scale,
        polarity=unit.polarity is not None,
    )


def _direction(dwell: Dwell) -> FloatArray:
    return np.array(TEST_POSITIONS.get(dwell.position, (0, 0, 0)), dtype=np.float64)


def _volts_per_g(unit: UnitDescription, volts: FloatArray, force: FloatArray) -> FloatArray:
    """Sensitivity of each output along its own axis, shape (3,); of the strongest if it is dead.

    The signs are those of the description; without one +, or - where all that answer show it.
    """
    each = np.array([[_half_span(volts[:, i], force[:, j]) for j in range(3)] for i in range(3)])
    own, size = np.diag(each), np.linalg.norm(each, axis=1)
    strongest = max(float(size.max()), float(np.abs(volts).max()) / 10.0, 1e-12)
    alive = size > 0.2 * strongest
    size = np.where(alive, size, strongest)
    if unit.polarity is not None:
        return np.asarray(size * np.array(unit.polarity), dtype=np.float64)
    return np.asarray(-size if (own[alive] < 0).all() else size)


def _half_span(volts: FloatArray, force: FloatArray) -> float:
    up, down = volts[force > 0.5], volts[force < -0.5]
    if not len(up) or not len(down):
        return 0.0
    return float(np.median(up) - np.median(down)) / 2.0


def _blocks(dwells: list[Dwell]) -> tuple[IntArray, IntArray]:
    """Block and place in it of each dwell, which are in the order of the file."""
    names: list[tuple[str, int, int]] = [("", 0, 0)] * len(dwells)
    for kind in ("T", "C"):
        own = [k for k, d in enumerate(dwells) if d.position[0] == kind]
        clusters = _clusters([dwells[k].temp_degc for k in own])
        seen: dict[tuple[int, str], int] = {}
        for k, cluster in zip(own, clusters, strict=True):
            turn = seen.setdefault((cluster, dwells[k].position), 0)
            seen[cluster, dwells[k].position] += 1
            names[k] = (kind, cluster, turn)
    members: dict[tuple[str, int, int], list[int]] = {}
    for k, name in enumerate(names):
        members.setdefault(name, []).append(k)
    block, order = np.zeros(len(dwells), dtype=int), np.zeros(len(dwells), dtype=int)
    for number, ks in enumerate(sorted(members.values(), key=lambda ks: float(np.mean(ks)))):
        block[ks] = number
        order[ks] = np.arange(len(ks))
    return block, order


def _clusters(temps_degc: list[float]) -> list[int]:
    """Number of the temperature that each belongs to."""
    by_temp = np.argsort(temps_degc, kind="stable")
    gaps = np.diff(np.array(temps_degc)[by_temp]) > GROUP_GAP_DEGC
    numbers = np.zeros(len(temps_degc), dtype=int)
    numbers[by_temp] = np.concatenate([[0], np.cumsum(gaps)]) if len(temps_degc) else []
    return [int(n) for n in numbers]


def rows_in_words(rows: IntArray) -> str:
    """Lines of a file: "row 7", "rows 13-18", "rows 2, 5, 9"."""
    return f"row{'s' * (len(rows) != 1)} {in_runs(rows)}"


def in_runs(numbers: IntArray) -> str:
    """Numbers, of which those that follow each other are one run: "2, 5-9"."""
    runs: list[list[int]] = []
    for number in sorted(int(n) for n in numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{r[0]}-{r[-1]}" if len(r) > 1 else str(r[0]) for r in runs)
