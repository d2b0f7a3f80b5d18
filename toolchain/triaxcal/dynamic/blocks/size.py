"""Positions of the proof masses of accelerometers 2 and 3 against that of 1, which is M, P2 (16).

Accelerometer i at rho feels a_i . (w' x rho + w x (w x rho)) more than M, w against inertial
space, w' its rate of change, a_i its sensitive axis, row i of A = 1 + Gamma. Only one component is
felt, so this is no change of a velocity as for the lever arm; but with E_i = A^-1 e_i a_i^T,
C = L^T and dC/dt = C [w_E] (w_E against the Earth),

    integral C E_i [w'] rho = ends of (C E_i [w] rho) - integral C [w_E] E_i [w] rho,

so again no angular acceleration is needed.
"""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.blocks.attitude import skew
from triaxcal.dynamic.blocks.block import AXIS, Signals, State, StateBlock, extension
from triaxcal.model.types import FloatArray

_MASSES = (1, 2)


def _felt(matrix: FloatArray, signals: Signals) -> FloatArray:
    """E_i matrix for each mass side by side, shape (n, 3, 6)."""
    A = np.eye(3) if signals.triad is None else signals.triad
    out = np.linalg.inv(A)
    along = A @ matrix
    each = [out[:, [i]] * along[:, [i]] for i in _MASSES]
    felt: FloatArray = np.concatenate(each, axis=2)
    return felt


def _ends(signals: Signals) -> FloatArray:
    return _felt(skew(signals.rate), signals)


def _rest(signals: Signals) -> FloatArray:
    rate = skew(signals.rate)
    rest: FloatArray = _felt(rate @ rate, signals) - skew(signals.turn) @ _felt(rate, signals)
    return rest


BLOCK = StateBlock(
    "accelerometer-positions",
    "positions of accelerometers 2 and 3",
    tuple(
        State(f"rho{i}_{j}", "mm", 1e-3, 200.0, f"accelerometer {AXIS[i]} along {AXIS[j]}")
        for i in (2, 3)
        for j in (1, 2, 3)
    ),
    motion=_rest,
    edges=_ends,
)
ENTRY = extension(BLOCK, "Accelerometers 2 and 3 are not where accelerometer 1 is.")
