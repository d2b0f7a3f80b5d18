"""What a worker is given and what it gives back.

A worker on this machine reads the unit's own folder. One of a cluster needs no shared disk: its
order is `filled` with the contents of the files.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError
from triaxcal.delivery.inputs import files_of, files_sha256


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
        Names of its inputs: unit.toml, and measurements.csv or recordings, which may be folders.
    device : bytes
        Record of the device that was verified, for its passport; empty where there is none.
    inputs : dict
        Name and content of each file, once it is `filled`.
    """

    name: str
    folder: str
    key: str
    toolchain: str
    files: tuple[str, ...]
    device: bytes = b""
    inputs: dict[str, bytes] = field(default_factory=dict)

    def refuse_change(self, inputs_sha256: str) -> None:
        """Refuse inputs of another hash than when the order was planned."""
        if _key(self.toolchain, self.name, inputs_sha256) != self.key:
            raise RefusedError(
                self.folder, "its files changed while the series ran", remedy="run again"
            )


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
    inputs = files_sha256((folder / file for file in files), "")
    return Order(name, str(folder), _key(toolchain, name, inputs), toolchain, files)


def filled(order: Order) -> Order:
    """The order with the contents of its files, read now.

    Raises
    ------
    RefusedError
        When a file cannot be read, or is another than when the order was planned.
    """
    folder = Path(order.folder)
    paths = [folder / file for file in order.files]
    order.refuse_change(files_sha256(paths, ""))
    files = (file for path in paths for file in files_of(path))
    return replace(order, inputs={f.relative_to(folder).as_posix(): f.read_bytes() for f in files})


def _key(toolchain: str, name: str, inputs_sha256: str) -> str:
    return hashlib.sha256(f"{toolchain}\0{name}\0{inputs_sha256}".encode()).hexdigest()


def refused(order: Order, why: RefusedError | str) -> Outcome:
    """Outcome of a unit that could not be made."""
    return Outcome(order.name, order.key, " ".join(str(why).split()))
