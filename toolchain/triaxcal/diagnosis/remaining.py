"""What is left of the contradiction when a mistake is undone: errors that no fit has seen."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from triaxcal.diagnosis.core.curves import powers
from triaxcal.diagnosis.core.readings import Readings
from triaxcal.fitting.tilter.heldout import LEAST_TEMPERATURES
from triaxcal.model.types import FloatArray

_MOST_G = 1000.0
"""Beyond it constants have no meaning, and the figure has none."""
_CURVES = {1: "a straight line", 2: "a quadratic", 3: "a cubic"}


@dataclass(frozen=True)
class Remaining:
    """Errors in positions of temperatures that a polynomial has not seen, of some readings.

    They are computed when somebody asks: a series asks for the answer alone.
    """

    readings: Readings = field(compare=False, repr=False)

    @property
    def curve(self) -> str:
        """The polynomial that predicts best: "a quadratic"."""
        return self._best[0]

    @property
    def held_out_g(self) -> float:
        """Rms over the outputs at each inner temperature held out in turn; NaN with too few."""
        return self._best[1]

    @cached_property
    def checks_g(self) -> float:
        """Rms of |a| - g in check positions; NaN without any."""
        return _of_checks(self.readings, self._best[2])

    @cached_property
    def _best(self) -> tuple[str, float, int]:
        return _best_curve(self.readings)

    @property
    def held_out(self) -> str:
        """For a table."""
        return in_words(self.held_out_g) if np.isfinite(self.held_out_g) else "-"

    @property
    def checks(self) -> str:
        """For a table."""
        return in_words(self.checks_g) if np.isfinite(self.checks_g) else "-"

    def __str__(self) -> str:
        parts = []
        if np.isfinite(self.held_out_g):
            parts.append(f"{self.curve} leaves {self.held_out} held out")
        if np.isfinite(self.checks_g):
            parts.append(f"{self.checks} in the checks")
        return ", ".join(parts) or "nothing is held out"


def in_words(value_g: float) -> str:
    """In micro-g or mg, to two digits."""
    if value_g < 0.9995e-3:
        return (
            f"{value_g * 1e6:.2g} micro-g" if value_g < 99.5e-6 else f"{value_g * 1e6:.0f} micro-g"
        )
    if value_g > _MOST_G:
        return f"above {_MOST_G:g} g"
    return f"{value_g * 1e3:.3g} mg" if value_g < 0.9995 else f"{value_g:.3g} g"


def _best_curve(readings: Readings) -> tuple[str, float, int]:
    """The polynomial that predicts best, its held-out error in g, and its order."""
    test = readings.test
    blocks = [b for b in readings.blocks if test[readings.of_block(b)].all()]
    parts = [readings.of_block(b) for b in blocks]
    temps = np.array([readings.temps_degc[p].mean() for p in parts])
    inner = [k for k in range(len(parts)) if temps.min() + 1 < temps[k] < temps.max() - 1]
    best = ("", np.nan, 1)
    for order, name in _CURVES.items():
        errors = [_predicted(readings, parts, temps, k, order) for k in inner]
        known = [e for e in errors if e is not None]
        if not known or len(known) < len(inner):
            continue
        rms = float(np.sqrt(np.mean(np.concatenate(known) ** 2)))
        if not best[1] <= rms:
            best = (name, rms, order)
    # Of three temperatures, two determine but a line: `calib` holds nothing out either.
    enough = len(np.unique(np.round(temps / 3.0))) >= LEAST_TEMPERATURES
    return best if enough else (best[0], float("nan"), best[2])


def _predicted(
    readings: Readings, parts: list[np.ndarray], temps: FloatArray, k: int, order: int
) -> FloatArray | None:
    """Errors at block `k` of curves through the others."""
    near = np.abs(temps - temps[k]) < 3.0
    train = np.any([p for p, n in zip(parts, near, strict=True) if not n], axis=0)
    # A fit that passes every other temperature has not been tried by any of them.
    if len(np.unique(np.round(temps[~near] / 3.0))) < order + 1:
        return None
    coefficients = np.linalg.lstsq(
        _design(readings, train, order), readings.outputs[train], rcond=None
    )[0]
    own = parts[k]
    return np.asarray(
        (readings.outputs[own] - _design(readings, own, order) @ coefficients).ravel()
    )


def _design(readings: Readings, own: np.ndarray, order: int) -> FloatArray:
    one = np.column_stack([np.ones(int(own.sum())), readings.force[own]])
    basis = powers(readings.temps_degc[own], readings.t0_degc)[:, : order + 1]
    return np.asarray(np.einsum("nc,np->ncp", one, basis).reshape(len(one), -1))


def _of_checks(readings: Readings, order: int) -> float:
    test = readings.test
    if test.all():
        return float("nan")
    coefficients = np.linalg.lstsq(
        _design(readings, test, order), readings.outputs[test], rcond=None
    )[0].reshape(4, order + 1, 3)
    basis = powers(readings.temps_degc[~test], readings.t0_degc)[:, : order + 1]
    at = np.einsum("cpi,np->nic", coefficients, basis)
    try:
        force = np.linalg.solve(at[:, :, 1:], (readings.outputs[~test] - at[:, :, 0])[:, :, None])[
            :, :, 0
        ]
    except np.linalg.LinAlgError:
        return float("nan")
    return float(np.sqrt(np.mean((np.linalg.norm(force, axis=1) - 1.0) ** 2)))
