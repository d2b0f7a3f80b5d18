"""What an update changed, for the terminal."""

from __future__ import annotations

from pathlib import PurePath

import numpy as np

from triaxcal.base.screentext import table
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.framefree import NAMES, UNITS, relative_scales
from triaxcal.model.types import FloatArray
from triaxcal.uncertainty.updated import FieldUpdate, K


def update_text(serial: str, found: FieldUpdate, before: Calibration) -> str:
    """What changed, and what was found; the summary of a delivery has the findings itself."""
    recording = found.calibration.recording
    findings = () if recording is None else recording.findings
    changed = changed_text(serial, found, before)
    return "\n".join([changed, *(f"found        {finding}" for finding in findings)])


def changed_text(serial: str, found: FieldUpdate, before: Calibration) -> str:
    """Changes of the nine frame-free constants against their uncertainty, and the poses."""
    t0 = before.thermal.t0_degc
    name = PurePath(found.poses.source.replace("\\", "/")).name
    count = len(found.poses)
    poses = f"{count} pose{'s' * (count != 1)}"
    before_mg, now_mg = (_rms(e) for e in (found.error_before_g, found.error_after_g))
    return "\n".join(
        [
            f"{serial} updated by {poses} of {name}; constants at {t0:g} degC",
            "",
            *_table(found, before),
            "  +- is two standard uncertainties (95 %); the options of a drift are one",
            "",
            _length(found),
            f"chi-square   {found.chi_square:.1f}, {count} expected: the poses against the prior",
            f"|a| - g      {before_mg} mg rms here by the constants before, {now_mg} mg now",
        ]
    )


def _length(found: FieldUpdate) -> str:
    sds = found.length_before_g, found.length_allowed_g, found.length_after_g
    before, drifted, now = (f"+-{K * sd * 1e3:.3g}" for sd in sds)
    values = f"{before} mg before, {drifted} mg drifted, {now} mg now"
    return f"|a|          uncertain by {values} (rms over all orientations)"


def _table(found: FieldUpdate, before: Calibration) -> list[str]:
    at_t0 = before.thermal.constants_at(before.thermal.t0_degc)
    scale = relative_scales(at_t0)
    rows = []
    for k, name in enumerate(NAMES):
        by = (found.after[k] - found.before[k]) * scale[k]
        sds = (found.sd_before[k], found.sd_allowed[k], found.sd_after[k])
        rows.append(
            [
                f"  {name}",
                f"{by:+.4g}",
                *(f"{K * sd * abs(scale[k]):.3g}" for sd in sds),
                f"{100 * found.share[k]:.0f} %",
                UNITS[k],
            ]
        )
    head = ["constant", "changed by", "+- before", "+- drifted", "+- now", "by the poses", "unit"]
    return table(head, rows, left=(0, 6))


def _rms(values: FloatArray) -> str:
    return f"{float(np.sqrt(np.mean(np.square(values)))) * 1e3:.3g}"
