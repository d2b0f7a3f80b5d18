"""A dwell in a test position that the other positions contradict, whatever the limit is.

At each temperature six positions leave each output two degrees of freedom, and every dwell has the
same leverage, 2/3. Opposite positions have equal residuals, so it is unknown which of two is wrong.
"""

from __future__ import annotations

import numpy as np

from triaxcal.fitting.core.grouping import TemperatureGroup
from triaxcal.fitting.core.outliers import worst_outlier
from triaxcal.fitting.tilter.estimators import design_matrix
from triaxcal.model.positions import AXES, TEST_POSITIONS
from triaxcal.unit.description import UnitDescription

_LEFT_OUT = 3.0
"""Held-out error of a dwell, in its residuals: 1 / (1 - 2/3)."""
_WORTH_REPORTING = 0.1
"""Share of the limit at T0: a smaller contradiction is not reported."""


def contradiction(unit: UnitDescription, groups: tuple[TemperatureGroup, ...]) -> tuple[str, ...]:
    """A finding that names the dwells of which one contradicts the others; or none."""
    design = design_matrix(unit.gravity_g)
    residual = []
    for group in groups:
        voltage = np.array([d.voltage_v for d in group.dwells])
        solution = np.linalg.lstsq(design, voltage, rcond=None)[0]
        residual.append((voltage - design @ solution) / np.linalg.norm(solution[:3], axis=0))
    own = np.concatenate(residual)
    found = worst_outlier(own, _LEFT_OUT * own, 12 * len(groups))
    if found is None:
        return ()
    size = _LEFT_OUT * float(np.linalg.norm(own[found.indices[0]]))
    if size < _WORTH_REPORTING * unit.limits.at_t0_g:
        return ()
    group = groups[found.indices[0] // 6]
    dwells = [groups[k // 6].dwells[k % 6] for k in found.indices]
    names = " or ".join(f"{d.position} ({_up(d.position)} up, row {d.row})" for d in dwells)
    finding = (
        f"{names} at {group.temp_degc:.4g} degC contradicts the other positions by "
        f"{size * 1e3:.3g} mg; their residuals are {found.others * 1e3:.2g} mg rms; "
        f"check {'them' if len(dwells) > 1 else 'it'}, and measure again"
    )
    return (finding,)


def _up(position: str) -> str:
    force = TEST_POSITIONS[position]
    axis = int(np.abs(force).argmax())
    return ("+" if force[axis] > 0 else "-") + AXES[axis]
