"""`triaxcal design`: what to measure, and for how long."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.base.publish import renew
from triaxcal.cli.options import command, example, show


@command(epilog=example("triaxcal design rig/design.toml --plan my-plan.toml"))
@click.argument("question", type=click.Path(path_type=Path))
@click.option("--plan", type=click.Path(path_type=Path), help="Write the plan for `rig run` here.")
def design(question: Path, plan: Path | None) -> None:
    """Find the plan that takes the least chamber time.

    QUESTION is a TOML file with the uncertainty that is wanted and what is known of unit and
    chamber: see docs/how-to/design.md.
    """
    import triaxcal  # noqa: PLC0415

    found = triaxcal.plan_measurements(question)
    if plan is not None:
        text = found.result.session_plan(f"triaxcal design {question.name}")
        renew({plan.name: text.encode()}, plan.parent)
    show(found)
    if plan is not None:
        click.echo(f"\n{plan} written; measure by it with: triaxcal rig run --plan {plan}")
