"""triaxcal verify: the delivered C of a unit before other people's tools."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import click

from triaxcal.cli.options import example, say, unit_and_build


@click.command(epilog=example("triaxcal verify AT-SIM"))
@unit_and_build
def verify(unit: Path, build: Path) -> None:
    """Verify the generated C with independent tools.

    UNIT is calibrated as by `calib`. Then Gappa, Frama-C, cppcheck, gcc and clang check its C, and
    their results go into verification.json. The checks of a tool that is not installed count as not
    done. The exit code is 1 when a check failed.
    """
    from triaxcal.base.tomltable import has_table  # noqa: PLC0415
    from triaxcal.unit.description import find_unit  # noqa: PLC0415

    run = _verify_imu if has_table(find_unit(unit), "dynamic") else _verify_accelerometer
    target, code = run(unit, build)
    say(f"\nresults in {target / 'verification.json'}; see docs/explanation/verification.md")
    sys.exit(code)


def _verify_accelerometer(unit: Path, build: Path) -> tuple[Path, int]:
    from triaxcal.base.publish import publish, renew  # noqa: PLC0415
    from triaxcal.delivery.unit import deliver  # noqa: PLC0415  numpy and jinja2 only when needed
    from triaxcal.report.files import SOMETIMES, all_files, passport_files  # noqa: PLC0415
    from triaxcal.report.passport.content import passport  # noqa: PLC0415
    from triaxcal.verify.campaign import (  # noqa: PLC0415
        delivery_outcomes,
        exit_code,
        verify_files,
    )
    from triaxcal.verify.record import entries, is_delivered, record  # noqa: PLC0415
    from triaxcal.verify.table import table  # noqa: PLC0415

    delivery = deliver(unit)
    target = build / delivery.unit.name
    files = all_files(delivery)
    if not is_delivered(target, files):
        publish(files, target, SOMETIMES)
    with tempfile.TemporaryDirectory(prefix="triaxcal-verify-") as folder:
        outcomes = verify_files(Path(folder), delivery.files, delivery.plan, delivery.bound)
    tools = entries(outcomes)
    record(target, tools)
    renew(passport_files(passport(delivery, tools)), target)
    click.echo(f"unit {delivery.unit.name}\n")
    say(table([*delivery_outcomes(delivery.bound, delivery.check), *outcomes]))
    return target, exit_code(outcomes)


def _verify_imu(unit: Path, build: Path) -> tuple[Path, int]:
    from triaxcal.base.publish import publish, renew  # noqa: PLC0415
    from triaxcal.cli.dynamic import delivered_imu  # noqa: PLC0415
    from triaxcal.dynamic.description import read_dynamic  # noqa: PLC0415
    from triaxcal.report.dynamic import dynamic_files  # noqa: PLC0415
    from triaxcal.report.dynamicpage import dynamic_page  # noqa: PLC0415
    from triaxcal.report.imuc import C_FILES, refuse_no_device  # noqa: PLC0415
    from triaxcal.verify.campaign import exit_code  # noqa: PLC0415
    from triaxcal.verify.imu import imu_delivery_outcomes, verify_imu  # noqa: PLC0415
    from triaxcal.verify.record import entries, is_delivered, record  # noqa: PLC0415
    from triaxcal.verify.table import grouped_table  # noqa: PLC0415

    refuse_no_device(read_dynamic(unit))
    made = delivered_imu(unit)
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
    click.echo(f"unit {made.done.unit.name}\n")
    say(grouped_table(shown))
    return target, exit_code([o for outcomes in groups.values() for o in outcomes])
