"""[test.NAME] of unit.toml: recordings of tests beside the calibration, for `triaxcal report`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

from triaxcal.base.keys import TableKeys, Values, each_of, setting
from triaxcal.base.kinds import number, word
from triaxcal.unit.recording import ACCELERATION_UNITS, RecordingLayout
from triaxcal.unit.recordingfile import (
    COLUMN,
    FILES,
    SIGNED_COLUMNS,
    STAMPS,
    TEMPERATURE_UNITS,
    TIMES,
    Column,
    SignedColumn,
    WrittenFile,
    check_units,
)

POWER_ON, REST, HYSTERESIS = "power-on", "rest", "hysteresis"
TEST_TABLE = "test"


@dataclass(frozen=True, kw_only=True)
class RecordedTest(WrittenFile):
    """[test.NAME]: a recording of a test in one orientation, for `triaxcal report`.

    Attributes
    ----------
    kind
        power-on: from switching on until the output is steady, each file one switching-on. rest:
        steady output, for the noise. hysteresis: heating and cooling, or the other way round.
    file
        File of the recording, in the unit's folder or below it; a list, or a pattern as "on*.csv".
    acceleration
        Readings of x, y, z, by name or number; "-ay" or -2 turns the sign.
    acceleration_unit
        Unit of the readings.
    time
        Time of each row.
    time_unit
        Unit of `time`, or a list of them.
    sample_rate_hz
        Rate of even samples, in place of `time`.
    temperature
        Temperature of each row; needed for hysteresis, and for the compensated output.
    temperature_unit
        Unit of `temperature`; codes are those of the unit's thermometer.
    first_sample_s
        Of power-on: time from switching on to the first sample.
    settled_within_micro_g
        Of power-on: the band about the steady output in which it has settled.
    longest_tau_s
        Of rest: the longest averaging time that is wanted.
    """

    kind: str = setting(word((POWER_ON, REST, HYSTERESIS)), example='"rest"')
    file: tuple[str, ...] = setting(FILES, example='"rest.csv"')
    acceleration: tuple[SignedColumn, ...] = setting(SIGNED_COLUMNS, example='["ux", "uy", "uz"]')
    acceleration_unit: str | None = setting(
        word(tuple(ACCELERATION_UNITS)),
        None,
        words="that of [recording], V on a tilter",
        example='"V"',
    )
    time: tuple[Column, ...] = setting(TIMES, (), words="none", example='"time"')
    time_unit: tuple[str, ...] = setting(STAMPS, ("s",), words='`"s"`', example='"s"')
    sample_rate_hz: float | None = setting(number(1e-3, 1e6), None, "Hz", example="100")
    temperature: Column | None = setting(COLUMN, None, example='"temperature"')
    temperature_unit: str = setting(word(TEMPERATURE_UNITS), "degC")
    first_sample_s: float | None = setting(
        number(0.0, 1e6), None, "s", words="required for power-on", example="0.5"
    )
    settled_within_micro_g: float = setting(number(1e-3, 1e6), 100.0, "micro-g")
    longest_tau_s: float | None = setting(
        number(1e-6, 1e7), None, "s", words="what the recording allows", example="100"
    )


TEST = TableKeys.of(RecordedTest)


@dataclass(frozen=True)
class StatedTest:
    """One [test.NAME].

    Attributes
    ----------
    name : str
    keys : RecordedTest
    where : str
        File and table, for messages.
    """

    name: str
    keys: RecordedTest
    where: str

    @property
    def table(self) -> str:
        """Name of the table."""
        return f"{TEST_TABLE}.{self.name}"

    def layout(self, file: str, default_unit: str) -> RecordingLayout:
        """Layout of one of its files, for the reader of recordings."""
        written = {f.name: getattr(self.keys, f.name) for f in fields(WrittenFile)}
        k = self.keys
        return RecordingLayout(
            **written,
            file=(file,),
            acceleration=k.acceleration,
            acceleration_unit=k.acceleration_unit or default_unit,
            time=k.time,
            time_unit=k.time_unit,
            sample_rate_hz=None if k.time else k.sample_rate_hz,
            temperature=k.temperature,
            temperature_unit=k.temperature_unit,
            table=self.table,
        )


def stated_tests(tables: Mapping[str, Values]) -> tuple[StatedTest, ...]:
    """Tests of a file, in its order.

    Raises
    ------
    RefusedError
        When a value is wrong.
    """
    found = []
    for name, values in each_of(tables, TEST_TABLE).items():
        keys = values.record(RecordedTest)
        check_units(values, keys.time, keys.time_unit)
        found.append(StatedTest(name, keys, f"{values.file}, [{values.name}]"))
    return tuple(found)
