"""What a worker is given and what it gives back: bytes alone, so that it needs no shared disk."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from triaxcal.errors import RefusedError


@dataclass(frozen=True)
class Order:
    """One unit to be made.

    Attributes
    ----------
    name : str
        Of the unit.
    folder : str
        Where its files were read, for messages.
    key : str
        Hash of its inputs and of the toolchain: a result with the same key need not be made again.
    toolchain : str
        What the result must be made by (`batch.toolchain`).
    inputs : dict
        Name and content of unit.toml and measurements.csv.
    """

    name: str
    folder: str
    key: str
    toolchain: str
    inputs: dict[str, bytes]


@dataclass(frozen=True)
class Outcome:
    """One unit made or refused.

    Attributes
    ----------
    refusal : str
        Why it was refused, in one line; empty when it passed.
    files : dict
        Name and content of what build/<UNIT>/ receives.
    record : dict
        What the series' page needs of it, as JSON has it.
    """

    name: str
    key: str
    refusal: str = ""
    files: dict[str, bytes] = field(default_factory=dict)
    record: dict[str, Any] = field(default_factory=dict)


Make = Callable[[Order], Outcome]
"""Makes one unit; picklable, pure, and never raises for what a user can cause."""

Runner = Callable[[Make, list[Order]], Iterator[Outcome]]
"""Makes all of them somewhere, in any order."""


def refused(order: Order, why: RefusedError | str) -> Outcome:
    """Outcome of a unit that could not be made."""
    return Outcome(order.name, order.key, " ".join(str(why).split()))
