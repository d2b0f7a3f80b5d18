"""How much the poses, and how much the prior, determine each constant."""

from __future__ import annotations

import numpy as np

from triaxcal.fitting.core.recorded import ConstantShare
from triaxcal.fitting.recorded.trials import Judged
from triaxcal.model.positions import AXES
from triaxcal.model.terms import PRODUCT_NAMES
from triaxcal.unit.recording import RecordingLayout


def constant_shares(
    row: Judged, t0_degc: float, layout: RecordingLayout
) -> tuple[ConstantShare, ...]:
    """The constants at T0 by the fit that knows all terms, each with its prior."""
    fit, posterior = row.fit, row.fit.posterior
    assert posterior is not None
    basis = row.trial.basis_at(t0_degc)
    slopes = np.einsum("apk,p->ak", fit.constants_jacobian(), basis)
    values = fit.constants() @ basis
    unit = layout.acceleration_unit
    named = [
        (f"K{name[1:]}", 3 * AXES.index(name[1]) + AXES.index(name[2]), f"{unit}/g")
        for name in fit.model.gain_names
    ]
    named += [(f"U0{axis}", 9 + i, unit) for i, axis in enumerate(AXES)]
    rows = [slopes[k] for _, k, _ in named]
    found = [float(values[k]) for _, k, _ in named]
    count = len(fit.theta) - len(fit.model.quadratic)
    for k, pattern in enumerate(fit.model.quadratic):
        axis, product = (int(n) for n in np.argwhere(pattern)[0])
        named.append((f"Q{AXES[axis]}.{PRODUCT_NAMES[product]}", k, "g/g^2"))
        rows.append(np.eye(len(fit.theta))[count + k])
        found.append(float(fit.quadratic[axis, product]))
    of = np.array(rows)
    sd = np.sqrt(np.einsum("kp,pq,kq->k", of, posterior.covariance, of))
    before = np.linalg.norm(of @ posterior.prior.factor, axis=1)
    share = posterior.share_of_data(of)
    return tuple(
        ConstantShare(name, in_unit, value, float(sd[k]), float(before[k]), float(share[k]))
        for k, ((name, _, in_unit), value) in enumerate(zip(named, found, strict=True))
    )
