"""The C of an IMU on other cores: both triads, and the angles with the accelerometer's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from builds import PROVENANCE
from targets.test_targets import M3, need, run_on_host
from test_imu import imu_of, triads
from test_imu_delivery import change, copied
from triaxcal.cli.main import main
from triaxcal.codegen.imu import build_imu
from triaxcal.simulation.unit import write_simulated_unit
from triaxcal.targets import matrix
from triaxcal.targets.build import Toolset
from triaxcal.targets.matrix import Build, compare, run_builds
from triaxcal.targets.shapes import Case, imu_cases
from triaxcal.targets.vectors import expected_lines
from triaxcal.unit.angles import ZENITH_TOOL_FACE, AnglesChoice
from triaxcal.unit.arithmetic import LIMBS, PORTABLE


def cases_of(prefix: str = "triax") -> tuple[Case, Case]:
    accel, gyro = (replace(triad, prefix=prefix) for triad in triads())
    choice = AnglesChoice(ZENITH_TOOL_FACE)
    both = (PROVENANCE, PROVENANCE)
    return imu_cases("I", build_imu(imu_of(), (accel, gyro), both, 100, choice=choice))


@pytest.fixture(scope="module")
def cases() -> tuple[Case, Case]:
    return cases_of()


def test_each_triad_has_its_own_files(cases: tuple[Case, Case]) -> None:
    accel, gyro = cases
    assert (accel.name, gyro.name) == ("I, accelerometer", "I, gyro")
    assert not set(accel.files) & set(gyro.files)
    assert all(name in case.files for case in cases for name in (*case.sources, case.selftest))
    assert "triax_angles.c" in accel.sources
    assert ("angles" in expected_lines(accel), "angles" in expected_lines(gyro)) == (True, False)


@pytest.mark.parametrize("arithmetic", [PORTABLE, LIMBS])
@pytest.mark.parametrize("triad", [0, 1])
def test_host_prints_what_python_expects(
    cases: tuple[Case, Case], triad: int, arithmetic: str, tmp_path: Path
) -> None:
    case = cases[triad]
    assert compare(run_on_host(case, tmp_path, arithmetic), expected_lines(case)) == ""


def test_a_fault_in_the_angles_of_an_imu_is_seen(cases: tuple[Case, Case], tmp_path: Path) -> None:
    accel, name = cases[0], "triax_angles.c"
    text = accel.files[name].replace("83443u", "83442u")
    assert text != accel.files[name]
    wrong = replace(accel, files={**accel.files, name: text})
    assert "angles" in compare(run_on_host(wrong, tmp_path), expected_lines(accel))


def test_both_triads_on_a_core_under_a_prefix() -> None:
    need(*M3.tools("gcc"))
    way = Toolset(M3, "gcc", "-O2", PORTABLE)
    assert [o.detail for o in run_builds([Build(c, way) for c in cases_of("north")])] == ["", ""]


def test_the_command_takes_an_imu(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With one build of each triad, in place of all."""
    need(*M3.tools("gcc"))
    every = matrix.unit_builds
    first = next(b for b in every(cases_of()[0]) if b.toolset.core is M3).toolset
    monkeypatch.setattr(matrix, "unit_builds", lambda case: [Build(case, first)])
    unit = copied(tmp_path / "IMU-T")
    change(unit, "unit.toml", "0.0078125", "0.125")
    change(unit, "unit.toml", "accel_bits = 21", 'angles = "pitch-roll"\naccel_bits = 21')
    write_simulated_unit(unit)
    build = tmp_path / "out"
    done = CliRunner().invoke(main, ["target", "test", str(unit), "--build", str(build)])
    assert done.exit_code == 0, done.output
    assert "IMU-T, accelerometer" in done.output
    assert "IMU-T, gyro" in done.output
    assert "2 of 2 builds passed" in done.output


def test_the_command_refuses_an_imu_without_c(tmp_path: Path) -> None:
    unit = copied(tmp_path / "IMU-T")
    text = (unit / "unit.toml").read_text()
    (unit / "unit.toml").write_text(text[: text.index("[device]")])
    done = CliRunner().invoke(main, ["target", "test", str(unit)])
    assert "has no [device], so no C is generated" in str(done.exception)
