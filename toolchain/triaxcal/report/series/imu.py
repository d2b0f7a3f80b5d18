"""One IMU of a series: its files, and what the page needs of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from triaxcal.delivery.imu import ImuDelivery, deliver_imu
from triaxcal.dynamic.blocks import north
from triaxcal.report.dynamic import dynamic_files

IMU = "IMU"
"""Kind of its records."""


def imu_files_and_record(folder: Path) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Content of what build/<UNIT>/ receives, by name; and the record.

    Raises
    ------
    RefusedError
        As `deliver_imu`.
    """
    made = deliver_imu(folder)
    return dynamic_files(made), imu_record(made)


def imu_record(made: ImuDelivery) -> dict[str, Any]:
    """What the series needs of one IMU; plain JSON."""
    unit, result = made.done.unit, made.done.result
    verdict = made.verdict
    last = result.passes[-1]
    return {
        "unit": unit.name,
        "serial": unit.serial,
        "kind": IMU,
        "rig": unit.measured.rig,
        "date": unit.measured.date.isoformat() if unit.measured.date else None,
        "result": verdict.result,
        "verdict": verdict.words,
        "reference_degc": unit.reference_degc,
        "range_degc": made.done.range_degc and list(made.done.range_degc),
        "blocks": list(unit.blocks),
        "chi_square_per_freedom": last.chi_square / last.freedom,
        "states": [
            {
                "name": state.name,
                "label": state.label,
                "block": block.title,
                "unit": state.unit,
                "value": float(result.p[i]) / state.per_unit,
                "sd": float(result.sd[i]) / state.per_unit,
            }
            for block in result.layout.blocks
            if block is not north.BLOCK  # the place's, not the unit's
            for i, state in enumerate(block.states, result.layout.place(block.name).start)
        ],
    }
