"""Frames in, decisions out: the one pipeline of live sessions and of replays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import shown
from triaxcal.rig.blocks import BlockBuilder
from triaxcal.rig.dbc import RigDbc
from triaxcal.rig.events import Command, Event
from triaxcal.rig.frames import Frames
from triaxcal.rig.plan import SessionPlan
from triaxcal.rig.samples import SampleDecoder
from triaxcal.rig.session import Session
from triaxcal.rig.simulator import serial_crc
from triaxcal.unit.description import UnitDescription, read_unit
from triaxcal.unit.folder import list_units


@dataclass(frozen=True)
class Setup:
    """What a session is about: the unit, its folder, the plan and the frames."""

    folder: Path
    unit: UnitDescription
    plan: SessionPlan
    dbc: RigDbc


class Engine:
    """Decoder, blocks and session of one rig.

    Parameters
    ----------
    where : str
        Channel or log, for messages.
    history : tuple of Event
        Durable events, when a session is resumed.
    """

    def __init__(self, setup: Setup, where: str, history: tuple[Event, ...] = ()) -> None:
        self.setup = setup
        self.where = where
        self.session = Session(setup.plan, setup.unit, history)
        self._start()

    def _start(self) -> None:
        plan, adc = self.setup.plan, self.setup.unit.adc
        self._decoder = SampleDecoder(self.setup.dbc, plan.layout, plan.rate_hz)
        self._blocks = BlockBuilder(plan.rate_hz, (adc.code_min, adc.code_max))

    def resume(self, durable: int) -> None:
        """Go on as a new process would that has only the journal's durable events."""
        self.restore(self.session.durable[:durable])

    def restore(self, durable: Sequence[Event]) -> None:
        """Go on from these durable events."""
        self._start()
        self.session.restore(durable)

    def feed(self, frames: Frames) -> list[Event]:
        """Decisions that these frames bring about.

        Raises
        ------
        RefusedError
            When the rig says another serial number or rate than the unit and the plan.
        """
        samples = self._decoder.feed(frames)
        for identity in sorted(samples.identity):
            self._check_identity(*identity)
        return [e for b in self._blocks.feed(samples) for e in self.session.on_block(b)]

    def command(self, command: Command, t_ns: int) -> list[Event]:
        """Decisions after a word of the operator."""
        return self.session.on_command(command, t_ns)

    def _check_identity(self, serial: int, rate_hz: int) -> None:
        unit, plan = self.setup.unit, self.setup.plan
        if serial != serial_crc(unit.serial):
            other = _unit_of_serial(self.setup.folder, serial)
            raise RefusedError(
                f"{self.where}, RIG_IDENT",
                f"serial number {other} (CRC-32 0x{serial:08X})",
                expected=f'"{unit.serial}" (0x{serial_crc(unit.serial):08X}) of {unit.name}',
                remedy="mount that unit, or name the one that is mounted",
            )
        if rate_hz != plan.rate_hz:
            raise RefusedError(
                f"{self.where}, RIG_IDENT",
                f"{rate_hz} samples a second",
                expected=f"{plan.rate_hz}, rate_hz of {plan.source}",
                remedy="correct the plan or the rig",
            )


def _unit_of_serial(folder: Path, serial: int) -> str:
    """Serial number of another unit beside this one, or "unknown"."""
    for name in list_units(folder.absolute().parent):
        try:
            other = read_unit(folder.absolute().parent / name)
        except RefusedError:
            continue
        if serial_crc(other.serial) == serial:
            return f"{shown(other.serial)} of {name}"
    return "unknown"
