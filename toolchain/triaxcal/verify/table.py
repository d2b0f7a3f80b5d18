"""The outcomes as a table for readers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from triaxcal.verify.outcome import FAILED, NOT_DONE, PASSED, Outcome

SHOWN_DETAILS = 10


def table(groups: Mapping[str, Sequence[Outcome]]) -> str:
    """Title, result and finding of each check, complaints of those that failed, and the count.

    Each group stands below its name, where it has one.
    """
    lines: list[str] = []
    for name, outcomes in groups.items():
        lines += [*([name] if name else []), *_rows(outcomes), ""]
    return "\n".join([*lines, _count([o for outcomes in groups.values() for o in outcomes])])


def _rows(outcomes: Sequence[Outcome]) -> list[str]:
    left = max(len(o.title) for o in outcomes) + 2
    lines: list[str] = []
    for outcome in outcomes:
        lines.append(f"{outcome.title:<{left}}{outcome.result:<10}{outcome.finding}")
        if outcome.result == FAILED:
            lines += [f"  {detail}" for detail in outcome.details[:SHOWN_DETAILS]]
            if len(outcome.details) > SHOWN_DETAILS:
                lines.append(f"  and {len(outcome.details) - SHOWN_DETAILS} more")
    return lines


def _count(outcomes: Sequence[Outcome]) -> str:
    counts = {r: sum(o.result == r for o in outcomes) for r in (PASSED, FAILED, NOT_DONE)}
    text = f"{counts[PASSED]} passed, {counts[FAILED]} failed, {counts[NOT_DONE]} not done"
    names = dict.fromkeys(o.title for o in outcomes if o.result == NOT_DONE)
    return f"{text}: {', '.join(names)}" if names else text
