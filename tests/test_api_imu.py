"""The public API of an IMU: its calibration.json as a program meets it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import triaxcal
from triaxcal.delivery.imu import deliver_described
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.layout import Layout

SIM = Path(__file__).parent.parent / "units" / "IMU-SIM"
RANGE_DEGC = (10.0, 40.0)


def document(**changes: Any) -> dict[str, Any]:
    """A calibration.json with a hundredth of each state's prior as its value."""
    layout = Layout((*BASE, *EXTENSIONS["g-drift"].blocks))
    rows = [
        {
            "name": s.name,
            "unit": s.unit,
            "si_per_unit": s.per_unit,
            "value": 0.01 * s.prior_sd * s.per_unit,
            "sd": 1e-4 * s.prior_sd * s.per_unit,
        }
        for s in layout.states
    ]
    found = {
        "format": 1,
        "kind": "dynamic",
        "serial": "I-1",
        "reference_degc": 20.0,
        "range_degc": list(RANGE_DEGC),
        "local_gravity_m_per_s2": 9.81,
        "blocks": ["g-drift"],
        "states": rows,
        "covariance": np.eye(len(rows)).tolist(),
    }
    return found | changes


def written(folder: Path, content: dict[str, Any]) -> Path:
    path = folder / "calibration.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def row(index: int, **changes: Any) -> dict[str, Any]:
    rows = document()["states"]
    rows[index] |= changes
    return document(states=rows)


def swapped() -> dict[str, Any]:
    rows = document()["states"]
    rows[0]["name"], rows[1]["name"] = rows[1]["name"], rows[0]["name"]
    return document(states=rows)


STATES = document()["states"]
NOT_THE_STATES = (
    f", states: not the states of its blocks, in their order; expected {len(STATES)} states, "
    f"{STATES[0]['name']} to {STATES[-1]['name']}"
)
NONE_OF_AN_IMU = ": no calibration.json of an IMU: "
DAMAGED: dict[str, tuple[dict[str, Any], str]] = {
    "format": (document(format=99), ", format: found 99; expected 1"),
    "nan": (row(3, value=float("nan")), ", states: a number is not finite; expected numbers"),
    "infinite sd": (row(3, sd=1e999), ", states: a number is not finite; expected numbers"),
    "swapped": (swapped(), NOT_THE_STATES),
    "fewer": (document(states=STATES[:-1]), NOT_THE_STATES),
    "block": (document(blocks=["warp"]), ", blocks: found 'warp'; expected some of "),
    "zero unit": (row(0, si_per_unit=0), f"{NONE_OF_AN_IMU}ZeroDivisionError"),
    "covariance": (
        document(covariance=[[1.0]]),
        f", covariance: found the shape (1, 1); expected ({len(STATES)}, {len(STATES)})",
    ),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_what_is_no_calibration_of_an_imu_is_refused(name: str, tmp_path: Path) -> None:
    content, expected = DAMAGED[name]
    path = written(tmp_path, content)
    with pytest.raises(triaxcal.RefusedError) as refusal:
        triaxcal.load_imu(path)
    assert str(refusal.value).startswith(f"{path}{expected}")


def test_a_file_of_nested_lists_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "calibration.json"
    path.write_text("[" * 100_000, encoding="utf-8")
    with pytest.raises(triaxcal.RefusedError, match="of an IMU: RecursionError"):
        triaxcal.load_imu(path)


def test_what_was_saved_is_loaded(tmp_path: Path) -> None:
    cal = triaxcal.load_imu(written(tmp_path, document()))
    again = triaxcal.load_imu(cal.save(tmp_path / "again.json"))
    assert (again.range_degc, again.states) == (RANGE_DEGC, cal.states)
    np.testing.assert_array_equal(
        again.constants(25.0).gyro_matrix, cal.constants(25.0).gyro_matrix
    )


WRONG: dict[str, tuple[Callable[[triaxcal.ImuCalibration], object], str]] = {
    "outside": (
        lambda c: c.constants([20.0, 41.0]),
        (
            "temp_degc[1]: found 41 degC; expected 10 to 40 degC, the working range; calibrate "
            "over a wider range: the curves are not extrapolated"
        ),
    ),
    "other length": (
        lambda c: c.apply(np.ones((5, 3)), np.ones((5, 3)), [20, 21]),
        "temp_degc: found the shape (2,); expected one value, or (5,) as the readings have",
    ),
    "one reading": (
        lambda c: c.apply(np.ones(3), np.ones(3), [20, 21]),
        "temp_degc: found the shape (2,); expected one value",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_arguments_are_named(name: str, tmp_path: Path) -> None:
    call, expected = WRONG[name]
    with pytest.raises(triaxcal.RefusedError) as refusal:
        call(triaxcal.load_imu(written(tmp_path, document())))
    assert str(refusal.value) == expected


def test_a_file_of_version_0_1_0_has_no_range(tmp_path: Path) -> None:
    old = document()
    del old["range_degc"]
    cal = triaxcal.load_imu(written(tmp_path, old))
    assert cal.range_degc is None
    assert cal.constants(200.0).accel_matrix.shape == (3, 3)


def test_the_description_that_was_read_is_fitted(tmp_path: Path) -> None:
    """Not the one that lies in the folder by now."""
    imu = triaxcal.read_imu(SIM)
    absent = tmp_path / "absent.csv"
    recordings = (replace(imu.description.recordings[0], file=str(absent)),)
    changed = triaxcal.Imu(replace(imu.description, recordings=recordings), SIM)
    for fit in (triaxcal.fit_imu, lambda i: deliver_described(i.description)):
        with pytest.raises(triaxcal.RefusedError, match=r"absent\.csv"):
            fit(changed)
