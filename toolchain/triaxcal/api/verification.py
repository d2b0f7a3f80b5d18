"""`verify_unit`: external tools check the delivered C."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.progress import Progress
from triaxcal.base.publish import publish, renew
from triaxcal.base.tomltable import has_table
from triaxcal.delivery.imu import deliver_imu
from triaxcal.delivery.unit import deliver
from triaxcal.device.record import read_record, record_path
from triaxcal.dynamic.description import read_dynamic
from triaxcal.report.dynamic import dynamic_files
from triaxcal.report.dynamicpage import dynamic_page
from triaxcal.report.files import SOMETIMES, all_files, passport_files
from triaxcal.report.imuc import C_FILES, refuse_no_device
from triaxcal.report.passport.content import passport
from triaxcal.unit.folder import find_unit
from triaxcal.verify.campaign import delivery_outcomes, exit_code, verify_files
from triaxcal.verify.imu import imu_delivery_outcomes, verify_imu
from triaxcal.verify.outcome import Outcome
from triaxcal.verify.record import entries, is_delivered, record
from triaxcal.verify.table import grouped_table, table


@dataclass(frozen=True)
class Verification:
    """What the tools found.

    Attributes
    ----------
    folder : Path
        Of the delivery; its verification.json has the outcomes.
    outcomes : tuple of Outcome
        One a check; the checks of a missing tool count as not done.
    failed : bool
        Whether a check failed.
    summary : str
        The table that the command line prints.
    """

    folder: Path
    outcomes: tuple[Outcome, ...]
    failed: bool
    summary: str


def verify_unit(
    folder: str | Path, build: str | Path = "build", progress: Progress | None = None
) -> Verification:
    """Deliver a unit, then check its C with Gappa, Frama-C, cppcheck, gcc and clang.

    A delivery that is there already and equal is kept. The outcomes go into verification.json and
    the passport.

    Raises
    ------
    RefusedError
        As `deliver`; for an IMU without [device].
    """
    unit = Path(folder)
    if has_table(find_unit(unit), "dynamic"):
        return _verify_imu(unit, Path(build), progress)
    return _verify_accelerometer(unit, Path(build))


def _verify_accelerometer(unit: Path, build: Path) -> Verification:
    delivery = deliver(unit)
    target = build / delivery.unit.name
    device = read_record(record_path(target))
    files = all_files(delivery, passport(delivery, {}, device))
    if not is_delivered(target, files):
        publish(files, target, SOMETIMES)
    with tempfile.TemporaryDirectory(prefix="triaxcal-verify-") as folder:
        outcomes = verify_files(Path(folder), delivery.files, delivery.plan, delivery.bound)
    tools = entries(outcomes)
    record(target, tools)
    renew(passport_files(passport(delivery, tools, device)), target)
    rows = table([*delivery_outcomes(delivery.bound, delivery.check), *outcomes])
    text = f"unit {delivery.unit.name}\n\n{rows}"
    return Verification(target, tuple(outcomes), exit_code(outcomes) != 0, text)


def _verify_imu(unit: Path, build: Path, progress: Progress | None) -> Verification:
    refuse_no_device(read_dynamic(unit))
    made = deliver_imu(unit, progress)
    assert made.c is not None
    target = build / made.done.unit.name
    files = dynamic_files(made)
    if not is_delivered(target, files):
        publish(files, target, C_FILES)
    with tempfile.TemporaryDirectory(prefix="triaxcal-verify-") as folder:
        groups = verify_imu(Path(folder), made.c.build)
    tools = {name: entries(outcomes) for name, outcomes in groups.items()}
    record(target, tools)
    renew({"dynamic.html": dynamic_page(made, tools)}, target)
    before = imu_delivery_outcomes(made.c.build)
    shown = {name.replace("_", " "): [*before[name], *groups[name]] for name in groups}
    outcomes = tuple(o for found in groups.values() for o in found)
    text = f"unit {made.done.unit.name}\n\n{grouped_table(shown)}"
    return Verification(target, outcomes, exit_code(list(outcomes)) != 0, text)
