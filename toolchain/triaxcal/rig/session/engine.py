"""Frames in, decisions out: the one pipeline of live sessions and of replays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import shown
from triaxcal.rig.bus.frames import Frames
from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.description.identity import sent_serial, sent_words, serial_of
from triaxcal.rig.plan.nominal import Coding, Nominal, coding_of, nominal_of, refuse_unfit
from triaxcal.rig.plan.plan import SessionPlan
from triaxcal.rig.samples.samples import SampleDecoder
from triaxcal.rig.session.blocks import BlockBuilder
from triaxcal.rig.session.events import Command, Event
from triaxcal.rig.session.session import Session
from triaxcal.unit.description import UnitDescription, read_unit
from triaxcal.unit.folder import list_units

_SENT = {"crc32": "CRC-32 ", "number": ""}


@dataclass(frozen=True)
class Setup:
    """What a session is about: the unit, its folder, the plan and what the rig sends."""

    folder: Path
    unit: UnitDescription
    plan: SessionPlan
    rig: RigDescription

    @property
    def sessions(self) -> Path:
        """Folder of the unit's sessions."""
        return self.folder / "sessions"

    @cached_property
    def nominal(self) -> Nominal:
        """Nominal meaning of the unit's codes.

        Raises
        ------
        RefusedError
            Where nothing states it, or plan and bus description contradict each other.
        """
        return nominal_of(self.rig, self.unit, self.plan)

    @cached_property
    def coding(self) -> Coding:
        """How the rig's values become codes of the unit."""
        return coding_of(self.rig, self.unit)

    def decoder(self) -> SampleDecoder:
        """New decoder of the unit's frames."""
        return SampleDecoder(self.rig, self.plan.rate_hz, self.coding)

    def refuse_unfit(self) -> None:
        """Refuse what cannot make a session.

        Raises
        ------
        RefusedError
            As `nominal.refuse_unfit` and `nominal`; where the unit's serial number has no number
            and the rig sends one.
        """
        refuse_unfit(self.rig, self.unit)
        assert self.nominal is not None
        if self.rig.serial is not None:
            serial_of(self.rig.serial_is, self.unit)


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
        self.session = Session(setup.plan, setup.unit, setup.nominal, history)
        self._start()

    def _start(self) -> None:
        plan, adc = self.setup.plan, self.setup.unit.adc
        self._decoder = self.setup.decoder()
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
        self._check_identity(samples.serials, samples.rates)
        return [e for b in self._blocks.feed(samples) for e in self.session.on_block(b)]

    def command(self, command: Command, t_ns: int) -> list[Event]:
        """Decisions after a word of the operator."""
        return self.session.on_command(command, t_ns)

    def _check_identity(self, serials: frozenset[int], rates: frozenset[int]) -> None:
        unit, plan, rig = self.setup.unit, self.setup.plan, self.setup.rig
        kind = rig.serial_is
        for serial in sorted(serials):
            mine = serial_of(kind, unit)
            if serial != mine and rig.serial is not None:
                other = _unit_of_serial(self.setup.folder, kind, serial)
                raise RefusedError(
                    f"{self.where}, {rig.serial.message}",
                    f"serial number {other} ({_SENT[kind]}{sent_words(kind, serial)})",
                    expected=f'"{unit.serial}" ({sent_words(kind, mine)}) of {unit.name}',
                    remedy="mount that unit, or name the one that is mounted",
                )
        for rate in sorted(rates):
            signal = rig.rate and rig.rate.signal
            rate_hz = rate * signal.scale + signal.offset if signal else rate
            if rate_hz != plan.rate_hz and rig.rate is not None:
                raise RefusedError(
                    f"{self.where}, {rig.rate.message}",
                    f"{rate_hz:g} samples a second",
                    expected=f"{plan.rate_hz}, rate_hz of {plan.source}",
                    remedy="correct the plan or the rig",
                )


def _unit_of_serial(folder: Path, kind: str, serial: int) -> str:
    """Serial number of another unit beside this one, or "unknown"."""
    for name in list_units(folder.absolute().parent):
        try:
            other = read_unit(folder.absolute().parent / name)
        except RefusedError:
            continue
        if sent_serial(kind, other.serial) == serial:
            return f"{shown(other.serial)} of {name}"
    return "unknown"
