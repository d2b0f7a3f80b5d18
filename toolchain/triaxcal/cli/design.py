"""`triaxcal design`: what to measure, and for how long."""

from __future__ import annotations

from pathlib import Path

import click

from triaxcal.base.errors import RefusedError
from triaxcal.design.problem import read_problem
from triaxcal.design.search import best, usual
from triaxcal.design.words import comparison, rig_plan


@click.command()
@click.argument("question", type=click.Path(path_type=Path))
@click.option("--plan", type=click.Path(path_type=Path), help="Write the plan for `rig run` here.")
def design(question: Path, plan: Path | None) -> None:
    """Find the plan that answers QUESTION, a TOML file, in the least chamber time."""
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
    click.echo(comparison(problem, ordinary, found))
    if plan is not None:
        click.echo(f"\n{plan} written; take it with: triaxcal rig run --plan {plan} ...")
