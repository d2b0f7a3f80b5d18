"""The chamber and the positioner of a plan: their keys, and what they are told."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import Key, TableKeys, Values, setting
from triaxcal.base.kinds import Kind, interval, listed, meaning, number, whole, word
from triaxcal.base.tomltable import shown
from triaxcal.model.positions import CHECK_POSITIONS, TEST_POSITIONS
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.rig.description.recorded import TEMPERATURES, folded
from triaxcal.rig.hands.instrument import DRIVERS, OPERATOR, Driver, Order, filled

POSITIONS = (*TEST_POSITIONS, *CHECK_POSITIONS)
"""Their places, from 1, are what a positioner without angles is told."""


@dataclass(frozen=True)
class TempUnit:
    """A unit of temperature: degc = value * scale + zero."""

    name: str
    scale: float
    zero: float

    def of_degc(self, degc: float) -> float:
        """Value of a temperature in degC."""
        return (degc - self.zero) / self.scale

    def degc(self, value: float) -> float:
        """Temperature in degC of a value."""
        return value * self.scale + self.zero


TEMP_UNITS = {name: TempUnit(name, *TEMPERATURES[folded(name)]) for name in ("degC", "K", "degF")}


@dataclass(frozen=True, kw_only=True)
class Chamber:
    """[chamber]: the chamber, where an instrument sets it.

    Attributes
    ----------
    unit
        Unit of the temperatures that it answers, and that a register or signal has.
    range_degc
        Set points that it may be given. A plan with others is refused.
    slew_k_per_min
        The set point is moved at this rate, by which the time of a run is predicted; 0 sets it at
        once.
    tau_s
        Time constant of the unit after the chamber, for the first prediction.
    overshoot_max_k
        The run is stopped when chamber or unit is further than this outside the way to the set
        point.
    agree_max_k
        The run is stopped when chamber and unit differ by more than this at equilibrium.
    settle_max_s
        Longest wait for an equilibrium.
    safe_degc
        Set point at the end of a run, however it ends.
    poll_s
        Time between two questions.
    timeout_s
        The instrument has to answer within this time.
    answer_place
        Which number of an answer is the temperature.
    """

    unit: TempUnit = setting(meaning(TEMP_UNITS), TEMP_UNITS["degC"], words='"degC"')
    range_degc: tuple[float, float] = setting(interval(*PLAUSIBLE_DEGC), (-40.0, 85.0), "degC")
    slew_k_per_min: float = setting(number(0.0, 100.0), 0.0, "K/min")
    tau_s: float = setting(number(1.0, 36_000.0), 600.0, "s")
    overshoot_max_k: float = setting(number(0.1, 100.0), 5.0, "K")
    agree_max_k: float = setting(number(0.1, 100.0), 10.0, "K")
    settle_max_s: float = setting(number(10.0, 172_800.0), 14_400.0, "s")
    safe_degc: float = setting(number(*PLAUSIBLE_DEGC), 23.0, "degC")
    poll_s: float = setting(number(1.0, 600.0), 10.0, "s")
    timeout_s: float = setting(number(0.1, 60.0), 5.0, "s")
    answer_place: int = setting(whole(1, 16), 1)

    def order(self, degc: float) -> Order:
        """What it is told for a temperature."""
        names = {"degc": "degC", "kelvin": "K", "degf": "degF"}
        words = {word: TEMP_UNITS[name].of_degc(degc) for word, name in names.items()}
        return Order(words, (self.unit.of_degc(degc),))


def _angles() -> Kind[Mapping[str, tuple[float, ...]]]:
    """A table of positions: TP1 = [0, 90]."""
    expected = "a table of positions, each with 1 to 3 angles, as {TP1 = [0, 0], TP2 = [90, 0]}"
    angles = listed(number(-720.0, 720.0), range(1, 4), expected)

    def parse(value: Any) -> Mapping[str, tuple[float, ...]]:
        if not isinstance(value, dict) or not value or not set(value) <= set(POSITIONS):
            raise ValueError
        found = {name: angles.parse(item) for name, item in value.items()}
        if len({len(item) for item in found.values()}) > 1:
            raise ValueError
        return found

    schema = {
        "type": "object",
        "properties": dict.fromkeys(POSITIONS, angles.schema),
        "additionalProperties": False,
    }
    return Kind(expected, parse, schema, example="{TP1 = [0, 0], TP2 = [90, 0]}")


@dataclass(frozen=True, kw_only=True)
class Positioner:
    """[positioner]: the table that turns the unit, where an instrument does.

    Attributes
    ----------
    angles
        Angles of the positions. Without them it gets the position's number: TP1 to TP6 are 1 to
        6, CP1 to CP6 7 to 12.
    tolerance_deg
        It has arrived when each angle that it answers is this near, whole turns apart.
    turn_s
        Time of a turn, for the prediction, and the wait where it cannot be asked.
    turn_max_s
        Longest time of a turn until the readings show the position.
    home
        Position at the end of a run, however it ends; "stay" leaves it as it is.
    poll_s
        Time between two questions.
    timeout_s
        The instrument has to answer within this time.
    """

    angles: Mapping[str, tuple[float, ...]] = setting(_angles(), {}, "deg", words="none")
    tolerance_deg: float = setting(number(0.001, 45.0), 0.5, "deg")
    turn_s: float = setting(number(0.0, 3600.0), 15.0, "s")
    turn_max_s: float = setting(number(1.0, 36_000.0), 120.0, "s")
    home: str = setting(word(("stay", *POSITIONS)), "stay")
    poll_s: float = setting(number(0.1, 600.0), 1.0, "s")
    timeout_s: float = setting(number(0.1, 60.0), 5.0, "s")

    def order(self, position: str) -> Order:
        """What it is told for a position."""
        place = POSITIONS.index(position) + 1
        angles = self.angles.get(position, ())
        words: dict[str, float | str] = {"position": position, "number": place}
        words |= {f"angle{i}": angle for i, angle in enumerate(angles, 1)}
        return Order(words, angles or (float(place),))

    def is_at(self, position: str, answer: tuple[float, ...]) -> bool:
        """Whether an answer says that it is at a position."""
        wanted = self.order(position).numbers
        turn = 360.0 if self.angles else float("inf")
        off = [abs(a - w) for a, w in zip(answer, wanted, strict=False)]
        near = [min(d, abs(d - round(d / turn) * turn)) <= self.tolerance_deg for d in off]
        return len(answer) >= len(wanted) and all(near)


@dataclass(frozen=True, kw_only=True)
class Limits:
    """[unattended]: when `rig run --unattended` tries again, and when it stops.

    Attributes
    ----------
    attempts
        Dwells of one position at one temperature, turns to one position, questions to one
        instrument: so often each, then the run is stopped.
    still_max_s
        Longest wait for rest in a position, and for the noise to be learned beyond reference_s.
    silence_max_s
        Longest time without readings.
    """

    attempts: int = setting(whole(1, 100), 3)
    still_max_s: float = setting(number(10.0, 36_000.0), 600.0, "s")
    silence_max_s: float = setting(number(1.0, 3600.0), 60.0, "s")


@dataclass(frozen=True)
class Connection:
    """A driver with its settings."""

    driver: Driver
    settings: Any

    @property
    def by_hand(self) -> bool:
        """A person does it."""
        return self.driver.name == OPERATOR

    @property
    def readable(self) -> bool:
        """It can be asked."""
        return bool(self.driver.reads and getattr(self.settings, self.driver.reads))


@dataclass(frozen=True)
class Equipment:
    """Chamber, positioner and limits of a plan."""

    chamber: Chamber
    positioner: Positioner
    limits: Limits
    chamber_by: Connection
    positioner_by: Connection


def equipment_tables() -> tuple[TableKeys, ...]:
    """Tables [chamber], [positioner] and [unattended], with the keys of every driver."""
    driver = Key(
        "driver",
        word(DRIVERS.names),
        f"How the bench speaks to it. {DRIVERS.explained}",
        OPERATOR,
    )
    keys = {key.name: key for entry in DRIVERS for key in entry.keys}
    tables = []
    for record in (Chamber, Positioner):
        own = TableKeys.of(record, optional=True)
        tables.append(replace(own, keys=(driver, *own.keys, *keys.values())))
    return (*tables, TableKeys.of(Limits, optional=True))


def read_equipment(tables: Mapping[str, Values]) -> Equipment:
    """Chamber, positioner and limits of a plan's tables.

    Raises
    ------
    RefusedError
        When a key is of another driver than the one that is named, one is missing, or a text names
        what there is not.
    """
    chamber = tables["chamber"].record(Chamber)
    positioner = tables["positioner"].record(Positioner)
    low, high = chamber.range_degc
    if not low <= chamber.safe_degc <= high:
        raise RefusedError(
            tables["chamber"].where("safe_degc"),
            f"found {chamber.safe_degc:g} degC",
            expected=f"a temperature of range_degc, {low:g} to {high:g} degC",
        )
    first = next(iter(positioner.angles), POSITIONS[0])
    return Equipment(
        chamber,
        positioner,
        tables["unattended"].record(Limits),
        _connection(tables["chamber"], chamber.order(chamber.safe_degc)),
        _connection(tables["positioner"], positioner.order(first)),
    )


def refuse_without_angles(equipment: Equipment, values: Values, positions: Iterable[str]) -> None:
    """Refuse positions that a positioner with angles has none for.

    Raises
    ------
    RefusedError
        Naming them.
    """
    positioner = equipment.positioner
    home = (positioner.home,) if positioner.home != "stay" else ()
    missing = [p for p in dict.fromkeys((*positions, *home)) if p not in positioner.angles]
    if positioner.angles and missing:
        raise values.missing("angles", "angles of " + ", ".join(missing))


def _connection(values: Values, example: Order) -> Connection:
    """Driver that a table names, with its settings, all of them checked."""
    name = values[Key("driver", word(DRIVERS.names), "", OPERATOR)]
    driver = DRIVERS[name]
    own = {key.name for key in driver.keys}
    others = {key.name: entry for entry in DRIVERS for key in entry.keys if key.name not in own}
    for key in values.given:
        if key in others:
            raise RefusedError(
                values.where(key),
                f'is of driver "{others[key].name}"',
                expected=f'keys of driver "{name}"',
                remedy="correct `driver`, or take the key out",
            )
    for key in driver.needs:
        if key not in values:
            raise values.missing(key, f'it, for driver "{name}"')
    settings = values.record(driver.settings)
    for key in driver.texts:
        _refuse_wrong_words(values, key, getattr(settings, key), example)
    folder = Path(values.file).parent
    files = {key: str(folder / getattr(settings, key)) for key in driver.files}
    return Connection(driver, replace(settings, **files) if files else settings)


def _refuse_wrong_words(
    values: Values, key: str, texts: str | tuple[str, ...], example: Order
) -> None:
    for text in (texts,) if isinstance(texts, str) else texts:
        try:
            filled(text, example)
        except (LookupError, ValueError, TypeError, AttributeError) as error:
            raise RefusedError(
                values.where(key),
                f"found {shown(text)}",
                expected="between braces one of " + ", ".join(example.words),
                remedy="write it as in {%s} or {%s:.2f}" % ((next(iter(example.words)),) * 2),
            ) from error
