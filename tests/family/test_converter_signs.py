"""Signs and order of columns: codes as the converter gives them give the right acceleration."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from family_cases import directions, log, write_unit

import triaxcal
from builds import UNITS
from triaxcal.delivery.fittedimu import turned_columns
from triaxcal.dynamic.description import read_dynamic
from triaxcal.fitting.converter import input_words
from triaxcal.model.types import FloatArray

CODES_PER_UNIT = 1000.0
ORDER = (1, 0, 2)
SIGNS = np.array([-1.0, 1.0, -1.0])
TURNED = (
    'acceleration = ["-ACC2", "ACC1", "-ACC3"]\nacceleration_unit = "count"\ntime = "t"\n{more}'
)
HEADER = "t,ACC1,ACC2,ACC3"
FACES = """section = "face"
faces = {up = "+z", right = "-y", down = "-z", left = "+y", back = "-x", front = "+x"}
rows = "sections"
"""
FACE_NAMES = ("up", "right", "down", "left", "back", "front")


def converter(rows: FloatArray) -> FloatArray:
    """The converter's own codes of readings x, y, z: its ACC2 is -x, ACC1 is y, ACC3 is -z."""
    codes = np.rint(rows[:, 1:] * CODES_PER_UNIT) * SIGNS
    own = np.empty_like(codes)
    own[:, list(ORDER)] = codes
    return np.column_stack([rows[:, 0], own])


def unit_of_poses(folder: Path) -> Path:
    return write_unit(
        folder, converter(log(directions(24), sd=0.005)), TURNED.format(more=""), header=HEADER
    )


def unit_of_faces(folder: Path) -> Path:
    rows = converter(log(directions(6), hold_s=4.0, sd=0.005))
    # Half a second of turning belongs to neither face.
    start_s = np.arange(6) * 5.0
    lines = [
        ",".join([*(f"{v:.9g}" for v in row), name])
        for name, start in zip(FACE_NAMES, start_s, strict=True)
        for row in rows[(rows[:, 0] >= start) & (rows[:, 0] < start + 3.9)]
    ]
    text = "\n".join([HEADER + ",face", *lines])
    return write_unit(folder, text, TURNED.format(more=FACES))


@pytest.mark.parametrize("made", [unit_of_poses, unit_of_faces])
def test_the_converters_own_codes_give_the_acceleration(
    made: Callable[[Path], Path], tmp_path: Path
) -> None:
    cal = triaxcal.fit(triaxcal.read_unit(made(tmp_path / "U")))
    firmware = triaxcal.firmware(cal)
    truth = directions(40, seed=5)[6:]
    readings = log(truth, hold_s=0.1, sd=0.0)
    held = readings[[round(k * 1.1 * 50) + 2 for k in range(len(truth))]]
    codes = converter(held)[:, 1:][:, list(ORDER)]  # in the order in which unit.toml names them
    with firmware.compiled() as compiled:
        accel, status = compiled.apply(codes.astype(np.int32), 0)
    assert not (status & ~np.uint32(3)).any()
    length = np.linalg.norm(truth, axis=1, keepdims=True)
    # The frame of poses is free: a few mrad of K's turn; signs and order would be errors of 1 g.
    np.testing.assert_allclose(accel * firmware.lsb_g, truth / length, atol=0.02)
    np.testing.assert_allclose(cal.apply(codes, 20.0), accel * firmware.lsb_g, atol=1e-3)


def test_header_passport_and_json_name_the_columns(tmp_path: Path) -> None:
    folder = unit_of_poses(tmp_path / "units" / "U")
    triaxcal.deliver(folder, tmp_path / "build")
    built = tmp_path / "build" / "U"
    header = (built / "triax_calib.h").read_text()
    top = header[: header.index("*/")]
    assert "raw_code[0], x: column ACC2 as the converter gives it; the constants turn its" in top
    assert "raw_code[1], y: column ACC1 as the converter gives it\n" in top
    for name in ("calibration.json", "passport.json"):
        assert json.loads((built / name).read_bytes())["inputs"] == ["-ACC2", "ACC1", "-ACC3"]
    assert "column ACC2 as the converter gives it" in (built / "passport.html").read_text()
    K, _ = triaxcal.load(built / "calibration.json").constants(20.0)
    assert (np.sign(np.diag(K)) == SIGNS).all()


def test_the_verdict_and_the_poses_of_a_loaded_calibration_have_the_converters_signs(
    tmp_path: Path,
) -> None:
    cal = triaxcal.fit(triaxcal.read_unit(unit_of_poses(tmp_path / "U")))
    again = triaxcal.load(cal.save(tmp_path / "calibration.json"))
    assert str(again.verdict) == str(cal.verdict)
    recording = again.fitted.calibration.recording
    assert recording is not None
    errors = np.linalg.norm(again.apply(recording.poses.readings, 20.0), axis=1) - 1.0
    np.testing.assert_allclose(errors, recording.residual_g, atol=1e-9)
    assert again.uncertainty(20.0).expanded == pytest.approx(cal.uncertainty(20.0).expanded)


def test_uncertainty_does_not_depend_on_the_signs_of_columns(tmp_path: Path) -> None:
    """The same poses with and without a minus: the same budgets of every component."""
    rows = converter(log(directions(24), sd=0.005))
    bare = np.column_stack([rows[:, 0], rows[:, 1], -rows[:, 2], -rows[:, 3]])
    names = 'acceleration = ["ACC2", "ACC1", "ACC3"]\nacceleration_unit = "count"\ntime = "t"\n'
    plain = triaxcal.fit(
        triaxcal.read_unit(write_unit(tmp_path / "P" / "U", bare, names, header=HEADER))
    )
    turned = triaxcal.fit(triaxcal.read_unit(unit_of_poses(tmp_path / "T" / "U")))
    np.testing.assert_allclose(
        turned.constants(20.0)[0], plain.constants(20.0)[0] * SIGNS[:, None], rtol=1e-6, atol=1e-3
    )
    for quantity in ("a_x", "a_y", "a_z", "|a|"):
        for direction in ((0.6, 0.0, 0.8), (0.5, -0.7, 0.5), (1.0, 1.0, 1.0)):
            budgets = [c.uncertainty(20.0, direction, quantity) for c in (turned, plain)]
            assert budgets[0].expanded == pytest.approx(budgets[1].expanded, rel=1e-6)


def test_the_lowest_code_of_a_turned_column_fits_its_width(tmp_path: Path) -> None:
    """-32768 of a column with a minus is a reading of +32768, but 16 bits of the converter."""
    rows = converter(log(directions(24), sd=0.005))
    rows[:, 1:] *= 32768.0 / np.abs(rows[:, 1:]).max()
    rows[0, 2] = -32768.0
    folder = write_unit(tmp_path / "U", np.rint(rows * [50, 1, 1, 1]) / [50, 1, 1, 1],
                        TURNED.format(more=""), header=HEADER)  # fmt: skip
    assert triaxcal.fit(triaxcal.read_unit(folder)).fitted.unit.adc.bits == 16


def test_a_name_of_a_column_cannot_end_the_comment() -> None:
    words = input_words(("-a*/ int x; /*", "b\\", "3"), "raw_code")
    assert words[0].startswith("raw_code[0], x: column a__ int x_ __ as")
    assert all("*" not in line and "\\" not in line for line in words)
    assert input_words((), "raw_code") == []


def test_an_imus_header_says_which_codes_to_negate() -> None:
    unit = read_dynamic(UNITS / "IMU-SIM")
    assert turned_columns(unit) == []
    turned = [
        replace(q, columns=("ax", "ay", "az"), convert=lambda v: v * [1.0, -9.8, 1.0])
        if q.name == "force"
        else q
        for q in unit.quantities
    ]
    lines = turned_columns(replace(unit, quantities=tuple(turned)))
    assert lines == ["raw x, y, z of the force: columns ax, -ay, az; - is -code"]
