"""From run to run: how far the constants of the next run are from the mean of those measured."""

from __future__ import annotations

import math

import numpy as np

from triaxcal.uncertainty.propagation import Curves
from triaxcal.uncertainty.source import STUDENT, Source, from_factor


def run_source(p: Curves) -> list[Source]:
    """Repeatability between the runs of one file; none where there is one run.

    The unit in use is in a run of its own: sqrt(1 + 1 / n) of the standard deviation of one run
    about the mean of n. The same deviation at all temperatures is the worst case of the curves.
    """
    runs = p.calibration.runs
    if runs is None:
        return []
    grow = math.sqrt(1.0 + 1.0 / runs.runs)
    sizes = np.full((3, 4), runs.cross_ratio)
    sizes[range(3), range(3)] = runs.scale_ratio
    sizes[:, 3] = runs.bias_g
    scale = np.abs(p.rows[:, range(3), range(3)])
    sds = (scale[:, :, None] * sizes * grow).reshape(len(p.temps_degc), 12)
    constants, force = from_factor(p, sds[:, :, None] * np.eye(12))
    return [
        Source(
            key="runs",
            name="the repeatability from run to run",
            unit="g",
            advice="find what changes between the runs: mounting, power cycles, hysteresis",
            origin=f"scatter of the complete runs, {runs.dof} degrees of freedom a constant",
            sd=runs.bias_g * grow,
            distribution=STUDENT,
            dof=float(3 * runs.dof),
            constants=constants,
            force=force,
        )
    ]
