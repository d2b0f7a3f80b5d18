"""K3 from poses whose force is known."""

from __future__ import annotations

import numpy as np

from triaxcal.fitting.core.cubes import Cubes, cubes_of
from triaxcal.fitting.table.candidates import TablePoses, TableRow, thermal_design
from triaxcal.fitting.table.oriented import TRACELESS
from triaxcal.model.terms import products


def table_cubes(row: TableRow, poses: TablePoses) -> list[Cubes | None]:
    """K3 of each axis, beside the constants and, where they are fitted, the products.

    To first order a component of the force is linear in the constants of its own output.
    """
    design = thermal_design(row.fit.shape, row.trial.gains, poses)
    if row.trial.quadratic:
        design = np.concatenate([design, products(poses.target) @ TRACELESS.T], axis=1)
    basis, _ = np.linalg.qr(design)
    dof = float(len(basis) - basis.shape[1])
    return [
        cubes_of(axis, row.own_g[:, i], cube, basis @ (basis.T @ cube), dof)
        for i, axis in enumerate("xyz")
        for cube in [poses.force[:, i : i + 1] ** 3]
    ]
