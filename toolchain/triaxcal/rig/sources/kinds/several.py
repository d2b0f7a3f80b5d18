"""Several buses at once, as of a sensor and a thermometer; each frame keeps its channel."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import Frames, concatenate
from triaxcal.rig.sources.gather import Gathered
from triaxcal.rig.sources.source import FRAMES, Source, SourceKind, Wanted, kind_of

if TYPE_CHECKING:
    from triaxcal.rig.bus.busload import BitRates

_BETWEEN = "+"


class SeveralSource:
    """Frames of several buses in the order of their times."""

    def __init__(self, name: str, sources: dict[str, Source]) -> None:
        self.name = name
        self.rates: BitRates | None = None
        self._gathered = Gathered(sources)

    def read(self) -> Frames:
        """Frames that have come.

        Raises
        ------
        RefusedError
            When a bus cannot be read any more.
        """
        parts = [
            replace(frames, channel=np.full(len(frames), bus.encode()))
            for bus, frames in self._gathered.read()
        ]
        frames = concatenate(parts)
        return frames.take(np.argsort(frames.t_ns, kind="stable"))

    def notes(self) -> list[str]:
        """What happened to the connections since last asked."""
        return self._gathered.notes()

    def close(self) -> None:
        """Give the channels back."""
        self._gathered.close()


def _open(wanted: Wanted) -> SeveralSource:
    names = wanted.bus.split(_BETWEEN)
    if len(set(names)) < len(names):
        raise RefusedError("--bus", f"found {wanted.bus}, with a bus twice", expected="each once")
    sources: dict[str, Source] = {}
    try:
        for name in names:
            sources[name] = kind_of(name).open(replace(wanted, bus=name))
    except BaseException:
        for source in sources.values():
            source.close()
        raise
    return SeveralSource(wanted.bus, sources)


def _takes(bus: str) -> bool:
    names = bus.split(_BETWEEN)
    kinds = [kind_of(name) for name in names if name] if len(names) > 1 else []
    return len(kinds) == len(names) and all(k.speaks == FRAMES and not k.simulated for k in kinds)


ENTRY = SourceKind(
    name="several",
    label="can0+can1",
    doc="several of these buses; `channel` in rig.toml says which message comes on which",
    takes=_takes,
    open=_open,
    rank=25,
)
