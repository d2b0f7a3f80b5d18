"""Sensitivities against those of the data sheet, [sensor] nominal_v_per_g, before any fit.

A sensitivity is the length of a row of K, so that a sensor turned against its case has the same.
Signs are judged with the order of the positions (`fitting.tilter.plausibility`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.grouping import TemperatureGroup
from triaxcal.fitting.tilter.estimators import constants_of, estimator_operators
from triaxcal.model.metrological import unpack_constants
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.unit.description import UnitDescription

_ALIKE = 0.1
"""Ratios of the three outputs that differ by less than this have one cause."""


def refuse_other_sensitivity(
    unit: UnitDescription, source: str, groups: Sequence[TemperatureGroup]
) -> None:
    """Refuse sensitivities that are not the nominal ones.

    Raises
    ------
    RefusedError
        With both, and what would explain their ratio.
    """
    if unit.nominal_v_per_g is None:
        return
    nominal = np.abs(unit.nominal_v_per_g)
    operator = estimator_operators("equation-10", unit.gravity_g, None, 1)[0]
    for group in groups:
        voltage = np.array([d.voltage_v for d in group.dwells])
        found = np.linalg.norm(unpack_constants(constants_of(operator, voltage))[0], axis=1)
        ratios = found / nominal
        wrong = [i for i in range(3) if abs(ratios[i] - 1.0) > unit.nominal_tolerance]
        if not wrong:
            continue
        names = ", ".join(f"U{AXES[i]} {found[i]:.4g}" for i in wrong)
        stated = ", ".join(f"{nominal[i]:.4g}" for i in wrong)
        percent = 100.0 * unit.nominal_tolerance
        raise RefusedError(
            f"{source}, rows {', '.join(str(d.row) for d in group.dwells)}",
            f"sensitivity at {group.temp_degc:.4g} degC: {names} V/g, "
            f"{ratios[wrong[0]]:.3g} times the nominal one",
            expected=f"{stated} V/g within {percent:g} % ([sensor] nominal_v_per_g)",
            remedy=_remedy(ratios, wrong),
        )


def _remedy(ratios: FloatArray, wrong: list[int]) -> str:
    if len(wrong) < 3 or ratios.max() / ratios.min() > 1.0 + _ALIKE:
        which = " and ".join(f"U{AXES[i]}" for i in wrong)
        return f"check gain and wiring of {which}, and nominal_v_per_g"
    ratio = float(np.mean(ratios))
    text = "all three outputs alike: [adc] full_scale_v, bits or a gain before the converter"
    power = round(math.log2(ratio))
    if power and abs(ratio / 2.0**power - 1.0) < _ALIKE:
        factor = f"{2.0**power:g}" if power > 0 else f"1/{2.0**-power:g}"
        text += f" is off by the factor {factor}"
    else:
        text += f" is off by the factor {ratio:.3g}"
    return text + ", or nominal_v_per_g is"
