"""What one check found: passed, failed, or not done because a tool is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

PASSED = "passed"
FAILED = "failed"
NOT_DONE = "not done"


@dataclass(frozen=True)
class Outcome:
    """Result of one check.

    Attributes
    ----------
    key : str
        Name in verification.json.
    title : str
        Name for readers.
    result : str
        `PASSED`, `FAILED` or `NOT_DONE`.
    finding : str
        One line: what was found, or what is missing.
    figures : dict
        What verification.json keeps; nothing that differs between two runs.
    details : tuple of str
        Complaints of the tool, for readers.
    """

    key: str
    title: str
    result: str
    finding: str
    figures: dict[str, Any] = field(default_factory=dict)
    details: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.result not in (PASSED, FAILED, NOT_DONE):
            raise ValueError(f"{self.result!r} is no result")

    def json(self) -> dict[str, Any]:
        """Entry of verification.json."""
        return {"result": self.result, "finding": self.finding, **self.figures}


def judged(
    key: str,
    title: str,
    *,
    good: bool,
    finding: str,
    figures: dict[str, Any],
    details: Sequence[str] = (),
) -> Outcome:
    """Outcome of a check that ran."""
    return Outcome(key, title, PASSED if good else FAILED, finding, figures, tuple(details))
