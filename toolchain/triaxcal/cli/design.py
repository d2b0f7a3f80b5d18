"""`triaxcal design`: what to measure, and for how long."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.base.errors import RefusedError
from triaxcal.cli.options import example, say
from triaxcal.design.problem import read_problem
from triaxcal.design.search import best, usual
from triaxcal.design.words import comparison, rig_plan


@click.command(epilog=example("triaxcal design rig/design.toml --plan my-plan.toml"))
@click.argument("question", type=click.Path(path_type=Path))
@click.option("--plan", type=click.Path(path_type=Path), help="Write the plan for `rig run` here.")
def design(question: Path, plan: Path | None) -> None:
    """Find the plan that takes the least chamber time.

    QUESTION is a TOML file with the uncertainty that is wanted and what is known of unit and
    chamber: see docs/how-to/design.md.
    """
    problem = read_problem(question)
    ordinary = usual(problem)
    found = best(problem, problem.target_g or ordinary.expanded_g)
    if plan is not None:
        try:
            plan.write_text(
                rig_plan(problem, found, f"triaxcal design {question.name}"), encoding="utf-8"
            )
        except OSError as error:
            raise RefusedError(
                str(plan), f"cannot be written: {(error.strerror or str(error)).lower()}"
            ) from error
    say(comparison(problem, ordinary, found))
    if plan is not None:
        click.echo(f"\n{plan} written; measure by it with: triaxcal rig run --plan {plan}")
