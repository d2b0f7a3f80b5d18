"""The simulated rig: what its positions, its gravity and its thermometer truly are.

The draws come from a generator of their own, so that a perfect rig leaves every other draw as it
is without one. Tilts are exact rotations, not the linear ones of the uncertainty's propagation.
"""

from __future__ import annotations

import numpy as np

from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.model.types import FloatArray
from triaxcal.simulation.tilts import truth_force_g
from triaxcal.simulation.truth import Imperfections
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

_RADIANS = np.pi / 180.0 / 3600.0
_STREAM = 1
_SHARED_STREAM = 2


class Rig:
    """One rig, drawn from its imperfections by a seed.

    With `rig_seed` it is the rig of all that state the same one; repeatability stays by `seed`.

    Attributes
    ----------
    gravity_g : float
        True local gravity in g of 9.80665 m/s^2.
    thermometer_offset_degc : float
        What the thermometer shows too much.
    """

    def __init__(
        self,
        imperfections: Imperfections,
        stated_gravity_g: float,
        seed: int,
        rig_seed: int | None = None,
    ) -> None:
        # A rig of its own by `seed`; the rig of others by `rig_seed`, with dwells of its own.
        own = np.random.Generator(np.random.PCG64([seed, _STREAM]))
        shared = own
        if rig_seed is not None:
            shared = np.random.Generator(np.random.PCG64([rig_seed, _SHARED_STREAM]))
        self._random = own
        draw = shared.standard_normal
        sd_g = imperfections.gravity_sd_m_per_s2 / STANDARD_GRAVITY_M_PER_S2
        self.gravity_g = stated_gravity_g + sd_g * float(draw())
        self.thermometer_offset_degc = imperfections.thermometer_offset_sd_degc * float(draw())
        self._level = rotation(imperfections.level_sd_arcsec * _RADIANS * draw(3))
        tilts = imperfections.squareness_sd_arcsec * _RADIANS * draw((6, 3))
        self._square = dict(zip(TEST_POSITIONS, map(rotation, tilts), strict=True))
        self._repeatability = imperfections.repeatability_sd_arcsec * _RADIANS

    def force_g(self, position: str) -> FloatArray:
        """Specific force of the next dwell in a position, shape (3,), axis order x, y, z, in g."""
        force = truth_force_g(position, self.gravity_g)
        if position in self._square:
            force = self._square[position] @ force
        dwell = rotation(self._repeatability * self._random.standard_normal(3))
        result: FloatArray = dwell @ self._level @ force
        return result


def rotation(vector: FloatArray) -> FloatArray:
    """Rotation matrix (3, 3) of a rotation vector (3,) in radians, by Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    result: FloatArray = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return result
