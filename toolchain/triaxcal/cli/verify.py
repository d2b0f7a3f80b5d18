"""triaxcal verify: the delivered C of a unit before other people's tools."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import click

from triaxcal.cli.options import unit_and_build


@click.command()
@unit_and_build
def verify(unit: Path, build: Path) -> None:
    """Verify the C of UNIT with Gappa, Frama-C, cppcheck, gcc and clang.

    UNIT is calibrated as by `calib`; the results go into its verification.json. Exit code 1 when
    a check failed; tools that are not installed are named, and their checks count as not done.
    """
    from triaxcal.delivery import deliver  # noqa: PLC0415  numpy and jinja2 only when needed
    from triaxcal.publish import publish, renew  # noqa: PLC0415
    from triaxcal.report.files import SOMETIMES, all_files, passport_files  # noqa: PLC0415
    from triaxcal.report.passport.content import passport  # noqa: PLC0415
    from triaxcal.verify.campaign import (  # noqa: PLC0415
        delivery_outcomes,
        exit_code,
        verify_files,
    )
    from triaxcal.verify.record import is_delivered, record  # noqa: PLC0415
    from triaxcal.verify.table import table  # noqa: PLC0415

    delivery = deliver(unit)
    target = build / delivery.unit.name
    files = all_files(delivery)
    if not is_delivered(target, files):
        publish(files, target, SOMETIMES)
    with tempfile.TemporaryDirectory(prefix="triaxcal-verify-") as folder:
        outcomes = verify_files(Path(folder), delivery.files, delivery.plan, delivery.bound)
    record(target, outcomes)
    made = passport(delivery, {outcome.key: outcome.json() for outcome in outcomes})
    renew(passport_files(made), target)
    click.echo(f"unit {delivery.unit.name}\n")
    click.echo(table([*delivery_outcomes(delivery.bound, delivery.check), *outcomes]))
    click.echo(f"\nresults in {target / 'verification.json'}; what they mean: docs/verification.md")
    sys.exit(exit_code(outcomes))
