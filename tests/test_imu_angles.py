"""Angles of a whole IMU: keys, C, API, results, what is known of them, and a planted mistake."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import triaxcal
from builds import PROVENANCE
from test_imu import imu_of, triads
from test_imu_delivery import SIM, change, copied
from triaxcal.base.errors import RefusedError
from triaxcal.base.screentext import wrapped
from triaxcal.cli.main import main
from triaxcal.codegen import imu as codegen
from triaxcal.codegen.angles import GeneratedAngles, render_angles
from triaxcal.codegen.compiler import compile_library
from triaxcal.codegen.imu import ImuBuild, build_imu
from triaxcal.codegen.names import Names
from triaxcal.codegen.routines import start_generated_imu
from triaxcal.delivery.imu import ImuDelivery
from triaxcal.delivery.imuangles import _by_states, _of_constants, not_in_them
from triaxcal.dynamic.blocks import accelnonlinearity
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.blocks.registry import EXTENSIONS
from triaxcal.dynamic.description import read_dynamic
from triaxcal.dynamic.device import Device
from triaxcal.dynamic.imumodel import model_of_states
from triaxcal.dynamic.layout import Layout
from triaxcal.fixedpoint.angles import (
    STATUS_NOT_AT_REST,
    STATUS_SECOND_ANGLE,
    AnglesPlan,
)
from triaxcal.fixedpoint.integer_model import STATUS_SATURATED, STATUS_TEMP_LOW
from triaxcal.model.metrological import force_from_voltage, unpack_constants
from triaxcal.model.orientation import INCLINOMETER, angles_from_force, gravity_direction
from triaxcal.report.imuc import C_FILES
from triaxcal.simulation.unit import write_simulated_unit
from triaxcal.uncertainty.propagation import rows_of
from triaxcal.unit.angles import PITCH_ROLL, ZENITH_TOOL_FACE, AnglesChoice

PROVENANCES = (PROVENANCE, PROVENANCE)
ANGLES_FILES = {"triax_angles.h", "triax_angles.c"}


def device_of(folder: Path, more: str) -> Device:
    unit = copied(folder / "IMU-SIM")
    change(unit, "unit.toml", "accel_bits = 21", f"{more}\naccel_bits = 21")
    device = read_dynamic(unit).device
    assert device is not None
    return device


# ---- keys ----


def test_the_keys_are_those_of_firmware(tmp_path: Path) -> None:
    found = device_of(tmp_path, 'angles = "zenith-tool-face"\nrest_within_g = 0.1')
    assert found.angles == AnglesChoice(ZENITH_TOOL_FACE, 0.1)
    plain = read_dynamic(SIM).device
    assert plain is not None
    assert plain.angles is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('angles = "zenith"', "[device] angles: found 'zenith'"),
        ('angles = "pitch-roll"\nrest_within_g = 1.5', "[device] rest_within_g: found 1.5"),
        ("second_angle_from_deg = 0", "[device] second_angle_from_deg: found 0"),
    ],
)
def test_wrong_keys_are_refused(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(RefusedError) as refusal:
        device_of(tmp_path, text)
    assert message in str(refusal.value)


# ---- the C ----


@pytest.fixture(scope="module")
def build() -> ImuBuild:
    return build_imu(imu_of(), triads(), PROVENANCES, 1000, choice=AnglesChoice(PITCH_ROLL))


def test_an_imu_has_the_angles_of_its_accelerometer(build: ImuBuild) -> None:
    plain = build_imu(imu_of(), triads(), PROVENANCES, 1000)
    assert (plain.angles, plain.angles_check) == (None, None)
    assert set(build.files) - set(plain.files) == ANGLES_FILES
    assert {name: build.files[name] for name in plain.files} == plain.files
    assert build.angles == AnglesPlan(AnglesChoice(PITCH_ROLL), build.accel.shape.output_q)
    assert build.angles_check is not None
    assert build.angles_check.total > 90_000
    assert max(build.angles_check.largest_units) > 15


def test_the_bits_of_the_angles_are_none_of_both_triads(build: ImuBuild, tmp_path: Path) -> None:
    header = build.files["triax_comp.h"].decode() + build.files["triax_imu.h"].decode()
    defined = [line.split() for line in header.splitlines() if "#define TRIAX_STATUS_" in line]
    values = {int(words[2].rstrip("u")) for words in defined if words[2].rstrip("u").isdigit()}
    assert {STATUS_TEMP_LOW, STATUS_SATURATED} <= values
    own = STATUS_SECOND_ANGLE | STATUS_NOT_AT_REST
    assert not any(own & (value | value * codegen.GYRO_STATUS) for value in values)
    for name, content in build.files.items():
        (tmp_path / name).write_bytes(content)
    assert build.angles is not None
    library = start_generated_imu(tmp_path, tmp_path).load()
    g = 1 << build.angles.output_q
    accel = np.array([[0, 0, g], [-g, 0, 0], [0, 0, 0], [0, g, 0]], np.int32)
    angle, status = GeneratedAngles(library, build.angles).run(accel)
    assert status.tolist() == [0, STATUS_SECOND_ANGLE, own, 0]
    degrees = angle * (360 / 2**32)
    assert np.abs(degrees - [[0, 0], [90, 0], [0, 0], [0, 90]]).max() < 0.015 / 3600


@pytest.mark.parametrize("pair", [PITCH_ROLL, ZENITH_TOOL_FACE])
def test_the_example_of_the_guide_compiles(pair: str, tmp_path: Path) -> None:
    page = (SIM.parents[1] / "docs" / "how-to" / "angles.md").read_text(encoding="utf-8")
    blocks = [text.partition("```")[0] for text in page.split("```c\n")[1:]]
    (example,) = [block for block in blocks if "triax_imu" in block]
    made = build_imu(imu_of(), triads(), PROVENANCES, 100, choice=AnglesChoice(pair))
    for name, content in made.files.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "example.c").write_text(example)
    sources = [path for path in tmp_path.glob("*.c") if "selftest" not in path.name]
    assert compile_library(sources, tmp_path / "example", [tmp_path]).load().imu_sample


@pytest.mark.parametrize(
    ("old", "new"), [("83443u", "83442u"), ("TRIAX_STATUS_NOT_AT_REST", "TRIAX_STATUS_OK")]
)
def test_a_planted_mistake_in_the_angles_is_refused(
    old: str, new: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def planted(plan: AnglesPlan, names: Names) -> dict[str, str]:
        texts = render_angles(plan, names)
        assert old in texts["triax_angles.c"]
        return {**texts, "triax_angles.c": texts["triax_angles.c"].replace(old, new)}

    monkeypatch.setattr(codegen, "render_angles", planted)
    with pytest.raises(RefusedError, match="cross-check of triax_angles, vector"):
        build_imu(imu_of(), triads(), PROVENANCES, 100, choice=AnglesChoice(ZENITH_TOOL_FACE))


# ---- a delivery ----


@pytest.fixture(scope="module")
def delivered(tmp_path_factory: pytest.TempPathFactory) -> tuple[triaxcal.Delivered, Path]:
    """IMU-SIM with angles and a prefix, from a short recording."""
    base = tmp_path_factory.mktemp("angles")
    unit = copied(base / "IMU-ANGLES")
    change(unit, "unit.toml", "0.0078125", "0.125")
    toml = unit / "unit.toml"
    toml.write_text(f'{toml.read_text()}angles = "zenith-tool-face"\nprefix = "north"\n')
    write_simulated_unit(unit)
    return triaxcal.deliver(unit, base / "build"), unit


def test_files_and_what_was_shown(delivered: tuple[triaxcal.Delivered, Path]) -> None:
    done, _ = delivered
    assert {"north_angles.h", "north_angles.c"} <= set(done.files)
    assert {"*_angles.h", "*_angles.c"} <= set(C_FILES)
    shown = json.loads((done.folder / "verification.json").read_text())["angles"]
    assert [e["angle"] for e in shown["errors"]] == ["zenith", "tool face"]
    for error in shown["errors"]:
        assert 0 < error["largest_seen_units"] <= error["bound_units"]
    assert "  angles        zenith and tool face; proven within 0.0139 and " in done.summary
    page = (done.folder / "dynamic.html").read_text()
    assert "Angles, zenith and tool face" in page


def made_of(done: triaxcal.Delivered) -> ImuDelivery:
    assert isinstance(done.calibration, triaxcal.ImuCalibration)
    made = done.calibration._delivery
    assert made is not None
    return made


def test_uncertainty_is_that_of_constants_drawn_from_their_covariance(
    delivered: tuple[triaxcal.Delivered, Path],
) -> None:
    """Through the model and the angles themselves, at T0."""
    made = made_of(delivered[0])
    known = made.angles
    assert known is not None
    result, device = made.done.result, read_dynamic(delivered[1]).device
    assert device is not None
    rng = np.random.default_rng(7)
    row = int(np.argmin(np.abs(known.first_deg - 40.0)))
    grid = np.array([[known.first_deg[row], s] for s in np.arange(0.0, 360.0, 5.0)])
    force = gravity_direction(INCLINOMETER, np.radians(grid))

    def constants(p: np.ndarray) -> np.ndarray:
        about = result.frame.reference_degc, result.frame.gravity, device.range_degc
        return model_of_states(result.layout, p, *about).accel.constants_at(20.0)

    K, U0 = unpack_constants(constants(result.p))
    readings = force @ K.T + U0
    draws = rng.multivariate_normal(result.p, result.covariance, 1500, method="svd")
    away = np.empty((len(draws), len(grid), 2))
    for i, p in enumerate(draws):
        turned = angles_from_force(INCLINOMETER, force_from_voltage(constants(p), readings))
        away[i] = (turned - np.radians(grid) + np.pi) % (2.0 * np.pi) - np.pi
    sd = np.degrees(away.std(axis=0)) * 3600
    sd[:, 1] *= np.hypot(force[:, 0], force[:, 1])
    # The codes add less than 1 %. A standard deviation of 1500 draws is within 2 %, the largest of
    # 72 up to 5 % high.
    for expanded, one in zip(known.at_t0[row], sd.max(axis=0), strict=True):
        assert 1.96 / 1.08 < expanded / one < 1.96 * 1.05
    assert np.array_equal(known.over_range, known.at_t0)  # no temperature block


def test_the_uncertainty_is_stated(delivered: tuple[triaxcal.Delivered, Path]) -> None:
    done, _ = delivered
    known = made_of(done).angles
    assert known is not None
    shown = json.loads((done.folder / "verification.json").read_text())["angles"]["uncertainty"]
    assert shown["expanded_uncertainty_over_range_arcsec"] == known.over_range.tolist()
    missing = "changes of the constants with temperature, of which none was estimated"
    assert shown["not_in_it"][-1] == missing
    page = (done.folder / "dynamic.html").read_text()
    largest = [f"{u:.2g}" for u in known.over_range.max(axis=0)]
    assert f"zenith within ± {largest[0]} arcsec, tool face within ± {largest[1]} " in page
    assert missing in page
    assert (
        f"uncertainty (95 %) {largest[0]} and {largest[1]} arcsec, tool face divided by"
        in done.summary
    )
    assert "the sine of the angle between axis z and the plumb line" in done.summary
    # The folder's path is one word: it stands on its own line, however long it is.
    lines = wrapped(done.summary, 80).splitlines()
    assert all(len(line) <= 80 or line.split()[-1].startswith(str(done.folder)) for line in lines)


def test_an_effect_that_the_c_does_not_correct_is_named(
    delivered: tuple[triaxcal.Delivered, Path],
) -> None:
    done = made_of(delivered[0]).done
    layout = Layout((*done.result.layout.blocks, accelnonlinearity.BLOCK))
    more = replace(done, result=replace(done.result, layout=layout))
    (named,) = set(not_in_them(more)) - set(not_in_them(done))
    assert named == "nonlinearity of the accelerometers, which the C does not correct"


def test_states_become_errors_of_the_constants_at_each_temperature() -> None:
    """Against the slopes of the model itself, with temperature coefficients."""
    layout = Layout((*BASE, *EXTENSIONS["accelerometer-thermal"].blocks))
    rng = np.random.default_rng(1)
    factor = rng.normal(size=(len(layout), len(layout))) * layout.prior_sd[:, None]
    temps = np.array([-40.0, 20.0, 60.0])
    found = _of_constants(_by_states(layout, factor @ factor.T, temps - 20.0))
    zero = np.zeros(len(layout))
    rows = []
    for i in range(len(layout)):
        p = zero.copy()
        p[i] = 1.0
        models = (model_of_states(layout, q, 20.0, 9.81, (-40.0, 85.0)).accel for q in (p, zero))
        one, none = (rows_of(model.constants_at(temps)).reshape(3, 12) for model in models)
        rows.append(one - none)
    J = np.stack(rows, axis=-1)
    expected = J @ factor @ factor.T @ np.swapaxes(J, 1, 2)
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


def test_python_gives_the_angles_of_an_imu(delivered: tuple[triaxcal.Delivered, Path]) -> None:
    """Of the calibration that was saved, under another prefix and in another arithmetic too."""
    done, _ = delivered
    cal = triaxcal.load_imu(done.folder / "calibration.json")
    fw = triaxcal.firmware_imu(cal)
    name = "north_angles.c"
    assert fw.files[name] == (done.folder / name).read_bytes()
    # A code is 10 micro-g: gravity along z, 30 deg to the side of -x, and none.
    raw = np.array([[0, 0, 100_000], [-50_000, 0, 86_603], [0, 0, 0]])
    accel, _, status = fw.apply(raw, np.zeros((3, 3), int), 160)
    assert not status.any()
    angle, status = fw.angles(accel)
    assert angle.dtype == np.uint32
    assert status[2] & STATUS_NOT_AT_REST
    degrees = angle * (360 / 2**32)
    assert degrees[:2, 0] == pytest.approx([0.0, 30.0], abs=1.0)
    assert abs((degrees[1, 1] + 180) % 360 - 180) < 1.0
    for other in (
        triaxcal.firmware_imu(cal, prefix="left"),
        triaxcal.firmware_imu(cal, arithmetic="thumb1"),
    ):
        assert f"{other.prefix}_angles.c" in other.files
        again, flags = other.angles(accel)
        assert np.array_equal(again, angle)
        assert np.array_equal(flags, status)
    assert other.angles_plan.halves
    with pytest.raises(RefusedError, match="accel: "):
        fw.angles([[1, 2]])


def test_the_command_writes_them_under_another_prefix(
    delivered: tuple[triaxcal.Delivered, Path], tmp_path: Path
) -> None:
    folder = tmp_path / "c"
    arguments = ["firmware", str(delivered[0].folder), "--prefix", "left", "--into", str(folder)]
    done = CliRunner().invoke(main, arguments, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert {"left_angles.h", "left_angles.c"} <= {p.name for p in folder.iterdir()}


def without_angles(document: dict[str, object]) -> None:
    del document["firmware"]["device"]["angles"]  # type: ignore[attr-defined]


def no_angles(document: dict[str, object]) -> None:
    document["firmware"]["device"]["angles"] = None  # type: ignore[index]


@pytest.mark.parametrize("change_of", [without_angles, no_angles])
def test_a_file_without_angles_has_none(
    change_of: Callable[[dict[str, object]], None],
    delivered: tuple[triaxcal.Delivered, Path],
    tmp_path: Path,
) -> None:
    """As every file of an earlier triaxcal."""
    document = json.loads((delivered[0].folder / "calibration.json").read_text())
    change_of(document)
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps(document))
    fw = triaxcal.firmware_imu(triaxcal.load_imu(path))
    assert not [name for name in fw.files if "angles" in name]
    with pytest.raises(RefusedError) as refusal:
        fw.angles([[0, 0, 1]])
    assert str(refusal.value) == (
        "angles: unit IMU-ANGLES states none; expected [device] angles = "
        '"zenith-tool-face" or "pitch-roll"; state it in unit.toml'
    )
