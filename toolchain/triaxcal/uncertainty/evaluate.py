"""All sources of one unit, and the budgets that can be asked of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.metrological import CONSTANT_NAMES
from triaxcal.model.types import BoolArray, FloatArray
from triaxcal.readings.measurements import MeasurementSet
from triaxcal.uncertainty.budget import Budget, budget
from triaxcal.uncertainty.coverage import coverage_factor, with_offset
from triaxcal.uncertainty.device_sources import Device, device_sources
from triaxcal.uncertainty.exchanged import exchanged_source
from triaxcal.uncertainty.model_sources import thermal_model
from triaxcal.uncertainty.orientation import DIRECTIONS, QUANTITIES, force_variance, weights
from triaxcal.uncertainty.propagation import ROWS, Curves, propagation
from triaxcal.uncertainty.recording_sources import recording_sources
from triaxcal.uncertainty.rig_sources import rig_sources
from triaxcal.uncertainty.run_sources import run_source
from triaxcal.uncertainty.scatter import Scatter, scatter
from triaxcal.uncertainty.source import Source
from triaxcal.uncertainty.terms_sources import pair_source, square_form_source, squares_source
from triaxcal.unit.description import UnitDescription

LENGTH = 3
"""Index of |a| among the components of the force."""
TEMPERATURES = 23
"""Of the working range, evenly, besides T0 and the calibrated ones."""
_SUSPICIOUS = 3.0
"""Residuals this many times a stated squareness give a warning."""


@dataclass(frozen=True)
class Uncertainty:
    """Uncertainty of one unit at temperatures `temps_degc`, shape (n,), rising.

    Attributes
    ----------
    t0_index : int
        Where T0 is in `temps_degc`.
    sources : tuple of Source
    scatter : Scatter or None
        What the residuals say of a tilter's positions; None for a recording.
    warnings : tuple of str
        Where what was stated contradicts the data.
    units : tuple of str
        Of the twelve constants.
    """

    temps_degc: FloatArray
    t0_index: int
    sources: tuple[Source, ...]
    scatter: Scatter | None
    warnings: tuple[str, ...]
    units: tuple[str, ...] = ("V/g",) * 9 + ("V",) * 3

    @cached_property
    def constants_u(self) -> FloatArray:
        """Expanded uncertainty (95 %) of the twelve constants, shape (n, 12), V/g and V."""
        each = [_sd(s.constants)[:, list(ROWS)] for s in self._of_constants()]
        return _expanded(np.stack(each), self._of_constants())

    def of_constants(self, slopes: FloatArray, kept: BoolArray) -> FloatArray:
        """Expanded uncertainty (95 %) of functions of the twelve constants, shape (m, k).

        Parameters
        ----------
        slopes : array, shape (m, k, 12)
            Their derivatives, in the order of `CONSTANT_NAMES`, at the m kept temperatures.
        kept : array, shape (n,)
        """
        order, each = np.array(ROWS), []
        for s in self._of_constants():
            assert s.constants is not None
            covariance = s.constants[kept][:, order[:, None], order]
            variance = np.einsum("mka,mab,mkb->mk", slopes, covariance, slopes)
            each.append(np.sqrt(np.maximum(variance, 0.0)))
        return _expanded(np.stack(each), self._of_constants())

    @cached_property
    def force_u(self) -> FloatArray:
        """Expanded uncertainty of the force at 1 g, shape (n, directions, 4), g.

        The four are its components x, y, z and its length; directions are `DIRECTIONS`.
        """
        return self.force_u_in(DIRECTIONS)

    def force_u_in(self, directions: FloatArray) -> FloatArray:
        """The same in other directions, unit vectors (directions, 3)."""
        sources = [s for s in self.sources if s.force is not None]
        variance = [force_variance(s.force, directions) for s in sources if s.force is not None]
        each = np.sqrt(np.maximum(np.stack(variance), 0.0))
        return _expanded(each, sources)

    def force_sums_u(self, weights_of: Callable[[int], FloatArray]) -> FloatArray:
        """Expanded uncertainty of linear functions of D, shape (n, m).

        Parameters
        ----------
        weights_of : callable
            Their weights, shape (m, 3 columns), for a D of so many columns; `weights` has D.
        """
        sources, each = [s for s in self.sources if s.force is not None], []
        for s in sources:
            assert s.force is not None
            W = weights_of(s.force.shape[-1] // 3)
            variance = np.einsum("mi,tij,mj->tm", W, s.force, W, optimize=True)
            each.append(np.sqrt(np.maximum(variance, 0.0)))
        return _expanded(np.stack(each), sources)

    @cached_property
    def least_standard_g(self) -> float:
        """Least over temperature of the standard uncertainties of a_x, a_y, a_z and |a|, in g.

        Each in its worst orientation, without known offsets.
        """
        variance = sum(
            force_variance(s.force, DIRECTIONS)
            for s in self.sources
            if s.force is not None and not s.offset
        )
        return math.sqrt(float(np.max(variance, axis=1).min()))

    @property
    def worst_over_temperature(self) -> FloatArray:
        """Expanded uncertainty in the worst orientation, (n, 4): a_x, a_y, a_z, |a|, in g."""
        result: FloatArray = self.force_u.max(axis=1)
        return result

    @property
    def length_g(self) -> tuple[float, float]:
        """Expanded uncertainty (95 %) of |a| at T0 and over the range, worst orientation, in g."""
        length = self.force_u[:, :, LENGTH]
        return float(length[self.t0_index].max()), float(length.max())

    def _of_constants(self) -> list[Source]:
        return [s for s in self.sources if s.constants is not None]

    def constant_budget(self, constant: int, temp: int) -> Budget:
        """Budget of one of the twelve constants at one of the temperatures."""
        row = ROWS[constant]
        variances = [
            None if s.constants is None else float(s.constants[temp, row, row])
            for s in self.sources
        ]
        return self._budget(CONSTANT_NAMES[constant], self.units[constant], temp, variances)

    def force_budget(self, quantity: int, temp: int, direction: FloatArray) -> Budget:
        """Budget of a component of the force (0 to 2), or of its length (3), at 1 g."""
        variances: list[float | None] = []
        for s in self.sources:
            if s.force is None:
                variances.append(None)
                continue
            w = weights(direction[None], s.force.shape[-1] // 3)[0, quantity]
            variances.append(float(w @ s.force[temp] @ w))
        return self._budget(QUANTITIES[quantity], "g", temp, variances)

    def _budget(self, quantity: str, unit: str, temp: int, variances: list[float | None]) -> Budget:
        """Budget from the sources' variances; None where one is unknown or does not act."""
        found = [
            (s, None if v is None else math.sqrt(max(v, 0.0)))
            for s, v in zip(self.sources, variances, strict=True)
            if s.unknown or v is not None
        ]
        return budget(f"{quantity} at {self.temps_degc[temp]:.4g} °C", unit, found)

    def worst_component(self) -> tuple[int, int, int]:
        """Temperature, direction and component (0 to 2) with the largest uncertainty."""
        found = np.unravel_index(
            int(np.argmax(self.force_u[:, :, :3])), self.force_u[:, :, :3].shape
        )
        return int(found[0]), int(found[1]), int(found[2])

    def worst_length(self) -> tuple[int, int]:
        """Temperature and direction where |a| is most uncertain."""
        found = np.unravel_index(int(np.argmax(self.force_u[:, :, 3])), self.force_u.shape[:2])
        return int(found[0]), int(found[1])


def uncertainty(
    unit: UnitDescription,
    measurements: MeasurementSet,
    calibration: Calibration,
    device: Device | None,
    temps_degc: FloatArray | None = None,
) -> Uncertainty:
    """Evaluate every source; without a device only the calibration's and the codes'.

    `temps_degc`, shape (n,), must rise and hold T0; None takes the working range.
    """
    temps = _temperatures(unit, calibration) if temps_degc is None else temps_degc
    t0_index = int(np.argmin(np.abs(temps - unit.t0_degc)))
    units = (calibration.gain_unit,) * 9 + (calibration.reading_unit,) * 3
    if calibration.recording is not None:
        curves = Curves(unit, measurements, calibration, temps)
        found = recording_sources(curves, calibration.recording)
        found += [*pair_source(curves), *device_sources(curves, device)]
        return Uncertainty(temps, t0_index, tuple(found), None, (), units)
    p = propagation(unit, measurements, calibration, temps)
    s = scatter(p)
    sources = [
        *rig_sources(p, s),
        *run_source(p),
        thermal_model(p, s),
        *squares_source(p),
        *square_form_source(p),
        *pair_source(p),
        *exchanged_source(unit, calibration),
        *device_sources(p, device),
    ]
    return Uncertainty(temps, t0_index, tuple(sources), s, tuple(_warnings(unit, s)), units)


def _temperatures(unit: UnitDescription, calibration: Calibration) -> FloatArray:
    low, high = calibration.range_degc
    inside = [p.temp_degc for p in calibration.points if low < p.temp_degc < high]
    t0 = [unit.t0_degc] if low <= unit.t0_degc <= high else []
    # A group near T0 is shown at T0 itself.
    inside = [t for t in inside if abs(t - unit.t0_degc) > 0.5]
    temps = np.concatenate([np.linspace(low, high, TEMPERATURES), inside, t0])
    return np.array(sorted(set(temps.tolist())))  # np.unique imports numpy.ma


def _warnings(unit: UnitDescription, s: Scatter) -> Iterator[str]:
    stated = unit.stated.squareness_arcsec
    found = math.degrees(s.squareness_rad) * 3600.0
    if stated is not None and found > _SUSPICIOUS * stated and s.squareness_rad > s.resolution_rad:
        yield (
            f"squareness_arcsec = {stated:g} is stated, but the residuals show {found:.3g} arcsec: "
            "the uncertainty is too small"
        )


def _sd(covariance: FloatArray | None) -> FloatArray:
    assert covariance is not None
    result: FloatArray = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    return result


def _expanded(each: FloatArray, sources: list[Source]) -> FloatArray:
    """k u of standard uncertainties (sources, ...), by Welch-Satterthwaite; about known offsets."""
    offsets = np.array([s.offset for s in sources])
    half_width = _random(each[~offsets], [s.dof for s in sources if not s.offset])
    if not offsets.any():
        return half_width
    return with_offset(half_width, np.sqrt((each[offsets] ** 2).sum(axis=0)))


def _random(each: FloatArray, dofs: list[float]) -> FloatArray:
    variance = np.sum(each**2, axis=0)
    scale = float(np.max(each)) or 1.0
    # Scaled so that no fourth power underflows.
    loss = np.tensordot(1.0 / np.array(dofs), (each / scale) ** 4, axes=1)
    dof = (variance / scale**2) ** 2 / np.maximum(loss, 1e-300)
    whole: list[float] = np.floor(np.minimum(dof, 1e9)).ravel().tolist()
    factors = {d: coverage_factor(d) for d in set(whole)}
    k = np.array([factors[d] for d in whole]).reshape(dof.shape)
    result: FloatArray = k * np.sqrt(variance)
    return result
