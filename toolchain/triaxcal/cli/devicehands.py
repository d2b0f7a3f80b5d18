"""What `triaxcal device` asks of the person at the unit."""

from __future__ import annotations

import sys

import click

from triaxcal.base.errors import RefusedError


def ask_for_power_cycle() -> None:
    """Have the unit switched off and on, after its store.

    Raises
    ------
    RefusedError
        When nobody answers, or the answer is Ctrl-C.
    """
    _ask(
        "Switch the unit off and on, then press Enter",
        "--power-cycle",
        "the new calibration is stored, was read back, and is in use; `triaxcal device identify` "
        "after a power cycle shows whether it still is",
    )


def ask_for_position(position: str, why: str) -> None:
    """Have the unit put in a check position; `why` again, "" at first.

    Raises
    ------
    RefusedError
        As `ask_for_power_cycle`.
    """
    words = f"Put the unit in check position {position}, at rest, then press Enter"
    _ask(f"{why}. {words}" if why else words, f"--positions, {position}", "nothing was written")


def _ask(words: str, place: str, remedy: str) -> None:
    terminal = sys.stdin.isatty()
    # Enter at a terminal ends the line; what comes from a pipe does not.
    suffix = "" if terminal else "\n"
    try:
        click.prompt(words, default="", show_default=False, prompt_suffix=suffix)
    except click.Abort:
        if terminal:
            click.echo(err=True)
        raise RefusedError(
            place, "nobody has answered", expected="Enter, at a terminal or piped", remedy=remedy
        ) from None
