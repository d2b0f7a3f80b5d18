"""What was held against which limit, and what was found."""

from __future__ import annotations

from dataclasses import dataclass

ALARM = 0.01
"""How often a sound recording may be refused, all tests together."""
TESTS = 6
"""Tests against chance: innovations, held-out rests, held-out turns, the Earth's rate, rests alone,
effects that are off. Each has an equal share of `ALARM`; by Boole's inequality the sum holds
however they depend on each other."""
SHARE = ALARM / TESTS
MODEL_TOLERANCE = 0.1
"""Of a mean square. Noise figures are stated to about 5 %, and no model is exact: so much more than
chance allows is no contradiction."""


@dataclass(frozen=True)
class Check:
    """One test.

    Attributes
    ----------
    name : str
    held : bool
    words : str
        What was found, with its limit.
    value, limit : float
        In `unit`.
    unit : str
        "" for a ratio or a chi-square.
    count : int
        Degrees of freedom, or how many were tested.
    demanded : bool
        Whether the limit is one of [limits] in unit.toml.
    """

    name: str
    held: bool
    words: str
    value: float
    limit: float
    unit: str
    count: int
    demanded: bool = False

    def __str__(self) -> str:
        return f"{self.name}: {self.words}"


@dataclass(frozen=True)
class Cause:
    """Something that would explain why checks fail, by its own trial.

    Attributes
    ----------
    words : str
        What it is.
    remedy : str
    left : float
        Largest of the failed chi-squares over its limit, after the trial.
    """

    words: str
    remedy: str
    left: float


@dataclass(frozen=True)
class Evidence:
    """What a recording says for or against the constants found from it.

    Attributes
    ----------
    checks : tuple of Check
    not_tested : tuple of str
        What no check has tested, in words.
    doubts : tuple of str
        What keeps the result from being shown, and is no contradiction.
    notes : tuple of str
        How it was tested, for readers.
    causes : tuple of Cause
        Of failed checks: those that explain it, the best first.
    tried : tuple of str
        Names of all causes that were tried.
    """

    checks: tuple[Check, ...]
    not_tested: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    causes: tuple[Cause, ...] = ()
    tried: tuple[str, ...] = ()

    @property
    def failed(self) -> tuple[Check, ...]:
        """Checks that did not hold."""
        return tuple(check for check in self.checks if not check.held)
