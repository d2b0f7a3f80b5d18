"""Fixtures that take time, made once a session, and the switch that writes golden files anew."""

from __future__ import annotations

import os
from collections.abc import Generator
from pathlib import Path
from random import Random

import pytest
from hypothesis import settings

from builds import UNITS, Builds
from plans import COVERING, GOLDEN, random_plan
from recordings import ABSENT, FOLDER
from triaxcal.codegen.compiler import start_reference
from triaxcal.codegen.routines import Reference
from triaxcal.delivery.unit import Delivery, deliver

# A deadline would fail tests on a machine that does other work.
settings.register_profile("any-machine", deadline=None)
settings.load_profile("any-machine")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--update-golden", action="store_true", help="write tests/golden/ anew instead of comparing"
    )


LONG = {
    "device/test_cli_device.py",
    "device/test_link.py",
    "family/test_check.py",
    "family/test_converter_signs.py",
    "family/test_cross_coupling.py",
    "family/test_cubes.py",
    "family/test_doubtful.py",
    "family/test_face_words.py",
    "family/test_files.py",
    "family/test_formats.py",
    "family/test_learned.py",
    "family/test_live_pair.py",
    "family/test_over_temperature.py",
    "family/test_pair_in_a_unit.py",
    "family/test_pair_on_a_tilter.py",
    "family/test_pose_causes.py",
    "family/test_poses.py",
    "family/test_priors_measured.py",
    "family/test_rate_term.py",
    "family/test_real_recordings.py",
    "family/test_saved.py",
    "family/test_scale_verdict.py",
    "family/test_scales.py",
    "family/test_table_forms.py",
    "family/test_table_terms.py",
    "family/test_tables.py",
    "family/test_terms_in_c.py",
    "family/test_unchecked.py",
    "family/test_update.py",
    "rig/test_any_rig.py",
    "rig/test_cli_rig.py",
    "rig/test_fil_angles.py",
    "rig/test_fil_bus.py",
    "rig/test_firmware.py",
    "rig/test_imu_log.py",
    "rig/test_live.py",
    "rig/test_logs.py",
    "rig/test_recording.py",
    "rig/test_rig_imu.py",
    "rig/test_safety.py",
    "rig/test_session.py",
    "rig/test_unattended.py",
    "targets/test_imu_on_targets.py",
    "targets/test_targets.py",
    "targets/test_two_sensors.py",
    "test_angles_delivery.py",
    "test_batch.py",
    "test_compilers.py",
    "test_dcc_signature.py",
    "test_design.py",
    "test_diagnosis.py",
    "test_diagnosis_blocks.py",
    "test_diagnosis_faults.py",
    "test_dynamic_agreement.py",
    "test_dynamic_bent.py",
    "test_dynamic_calibrate.py",
    "test_dynamic_curves.py",
    "test_dynamic_equations.py",
    "test_dynamic_hand.py",
    "test_dynamic_logs.py",
    "test_dynamic_plan.py",
    "test_dynamic_together.py",
    "test_dynamic_wander.py",
    "test_exact.py",
    "test_exports.py",
    "test_firmware_prefix.py",
    "test_first_hour.py",
    "test_fit_squares.py",
    "test_guide.py",
    "test_history.py",
    "test_imu_angles.py",
    "test_imu_compiled_truth.py",
    "test_imu_delivery.py",
    "test_imu_delivery_thermal.py",
    "test_imu_over_temperature.py",
    "test_imu_production.py",
    "test_imu_series.py",
    "test_imu_two_thermometers.py",
    "test_imu_verdict.py",
    "test_page_languages.py",
    "test_series_page.py",
    "test_test_report.py",
    "test_thermal_spline.py",
    "test_uncertainty.py",
    "test_uncertainty_coverage.py",
}
"""Files of five seconds of CPU and more that `make test` leaves to `make test-long`."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks what is long."""
    here = Path(__file__).parent
    for item in items:
        if item.path.is_relative_to(here) and item.path.relative_to(here).as_posix() in LONG:
            item.add_marker(pytest.mark.long)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Where every optional package should be, a test that lacks one has failed."""
    report = yield
    everything = os.environ.get("TRIAXCAL_ALL_EXTRAS") == "1"
    if everything and report.skipped and "could not import" in str(report.longrepr):
        report.outcome = "failed"
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """A test that did not run for want of a recording is told where everyone looks."""
    skipped = terminalreporter.stats.get("skipped", [])
    absent = sum(ABSENT in str(report.longrepr) for report in skipped)
    if absent:
        terminalreporter.write_line(
            f"NOT RUN: {absent} tests on real recordings, which are not in {FOLDER}", red=True
        )


@pytest.fixture(scope="session")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Reference:
    """The handwritten reference C."""
    return Reference(start_reference(tmp_path_factory.mktemp("reference")).load())


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Builds:
    """Every covering shape with random constants, and the golden plans."""
    plans = {name: random_plan(Random(name), shape) for name, shape in COVERING.items()}
    return Builds(plans | GOLDEN, tmp_path_factory.mktemp("generated"))


@pytest.fixture(scope="session")
def delivered() -> dict[str, Delivery]:
    """Both shipped units, delivered."""
    return {name: deliver(UNITS / name) for name in ("AT-CHERNIAK", "AT-SIM")}
