"""A dwell in a test position that the other positions contradict, told however wide the limit is.

At each temperature six positions leave each output two degrees of freedom, and every dwell has the
same leverage, 2/3. Opposite positions have equal residuals: of two nobody can say which is wrong.
"""

from __future__ import annotations

import numpy as np

from triaxcal.fitting.core.grouping import TemperatureGroup
from triaxcal.fitting.core.outliers import worst_outlier
from triaxcal.fitting.tilter.estimators import design_matrix
from triaxcal.model.positions import AXES, TEST_POSITIONS
from triaxcal.unit.description import UnitDescription

_LEFT_OUT = 3.0
"""Error of a dwell left out, of its residual: 1 / (1 - 2/3)."""
_WORTH_TELLING = 0.1
"""Of the limit at T0: a smaller contradiction is no one's concern."""


def contradiction(unit: UnitDescription, groups: tuple[TemperatureGroup, ...]) -> tuple[str, ...]:
    """Names the dwells of which one contradicts the others, if there are any."""
    design = design_matrix(unit.gravity_g)
    residual = []
    for group in groups:
        voltage = np.array([d.voltage_v for d in group.dwells])
        solution = np.linalg.lstsq(design, voltage, rcond=None)[0]
        residual.append((voltage - design @ solution) / np.abs(np.diag(solution[:3])))
    own = np.concatenate(residual)
    found = worst_outlier(own, _LEFT_OUT * own, 12 * len(groups))
    if found is None:
        return ()
    size = _LEFT_OUT * float(np.linalg.norm(own[found.indices[0]]))
    if size < _WORTH_TELLING * unit.limits.at_t0_g:
        return ()
    group = groups[found.indices[0] // 6]
    dwells = [groups[k // 6].dwells[k % 6] for k in found.indices]
    names = " or ".join(f"{d.position} ({_up(d.position)} up, row {d.row})" for d in dwells)
    told = (
        f"{names} at {group.temp_degc:.4g} degC contradicts the other positions by "
        f"{size * 1e3:.3g} mg, where they are within {found.others * 1e3:.2g} mg rms; "
        f"look at {'them' if len(dwells) > 1 else 'it'}, and measure again"
    )
    return (told,)


def _up(position: str) -> str:
    force = TEST_POSITIONS[position]
    axis = int(np.abs(force).argmax())
    return ("+" if force[axis] > 0 else "-") + AXES[axis]
