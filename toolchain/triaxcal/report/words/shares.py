"""How much poses and priors determine each constant, in short rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.recorded import ConstantShare

_OWN_SQUARES = ("Qx.xx", "Qy.yy", "Qz.zz")


@dataclass(frozen=True)
class ShareRow:
    """One row, in words; `value` is of squares and products that the C leaves out.

    K, U0 and the others stand above as the C has them, a little off the fit with all terms.
    """

    name: str
    value: str
    sd: str
    prior_sd: str
    data: str
    prior: str


def share_rows(calibration: Calibration) -> tuple[ShareRow, ...]:
    """Scale factors, cross terms, biases and own squares; the other products in one row."""
    recording = calibration.recording
    if recording is None or not recording.shares:
        return ()
    products = [s for s in recording.shares if s.name[0] == "Q" and s.name not in _OWN_SQUARES]
    used = calibration.terms.quadratic
    rows = [_row(s, used) for s in recording.shares if s not in products]
    if products:
        worst, best = (pick(s.data for s in products) for pick in (min, max))
        rows.append(
            ShareRow(
                f"{len(products)} other products",
                f"up to {max(abs(s.value) for s in products) * 1e3:.2g} mg/g^2",
                f"{max(s.sd for s in products) * 1e3:.2g} mg/g^2",
                f"{max(s.prior_sd for s in products) * 1e3:.2g} mg/g^2",
                _between(worst, best),
                _between(1.0 - best, 1.0 - worst),
            )
        )
    return tuple(rows)


def _row(share: ConstantShare, used: Mapping[str, float]) -> ShareRow:
    scale, unit = (1e3, "mg/g^2") if share.name[0] == "Q" else (1.0, share.unit)
    value, sd, prior_sd = (scale * v for v in (share.value, share.sd, share.prior_sd))
    return ShareRow(
        share.name,
        f"{value:+.3g} {unit}" if share.name[0] == "Q" and share.name not in used else "above",
        f"{sd:.2g} {unit}",
        f"{prior_sd:.2g} {unit}",
        _percent(share.data),
        _percent(1.0 - share.data),
    )


def _between(low: float, high: float) -> str:
    ends = [f"{low:.0%}", f"{high:.0%}"]
    return " to ".join(dict.fromkeys(ends))


def _percent(share: float) -> str:
    if 0.0 < share < 0.001:
        return "< 0.1%"
    return "> 99.9%" if 0.999 < share < 1.0 else f"{share:.1%}"
