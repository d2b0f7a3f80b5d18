"""What a worker is given and what it gives back: bytes alone, so that it needs no shared disk.

An order is planned without its inputs and is sent with them: a series of recordings need not fit
into memory.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError, refused_by_system


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
    files : tuple of str
        Names of its inputs: unit.toml, and measurements.csv or a recording.
    inputs : dict
        Name and content of each, once it is `filled`.
    """

    name: str
    folder: str
    key: str
    toolchain: str
    files: tuple[str, ...]
    inputs: dict[str, bytes] = field(default_factory=dict)


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


def planned(folder: Path, toolchain: str, files: tuple[str, ...]) -> Order:
    """Order of the unit in `folder`, without its inputs.

    Raises
    ------
    RefusedError
        When a file cannot be read.
    """
    name = folder.absolute().name
    key = _key(toolchain, name, (_content(folder / file) for file in files))
    return Order(name, str(folder), key, toolchain, files)


def filled(order: Order) -> Order:
    """The order with its inputs, read now.

    Raises
    ------
    RefusedError
        When a file cannot be read, or is another than when the order was planned.
    """
    inputs = {file: _content(Path(order.folder) / file) for file in order.files}
    if _key(order.toolchain, order.name, inputs.values()) != order.key:
        raise RefusedError(
            order.folder, "its files changed while the series ran", remedy="run again"
        )
    return replace(order, inputs=inputs)


def _key(toolchain: str, name: str, contents: Iterable[bytes]) -> str:
    digest = hashlib.sha256(toolchain.encode())
    digest.update(name.encode())
    for content in contents:
        digest.update(hashlib.sha256(content).digest())
    return digest.hexdigest()


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise refused_by_system(path, "read", error) from error


def refused(order: Order, why: RefusedError | str) -> Outcome:
    """Outcome of a unit that could not be made."""
    return Outcome(order.name, order.key, " ".join(str(why).split()))
