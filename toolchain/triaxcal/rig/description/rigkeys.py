"""Keys of rig.toml."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from triaxcal.base.keys import DESCRIPTION, FORMAT, FileKeys, TableKeys, setting
from triaxcal.base.kinds import FLAG, Kind, line, listed, number, whole, word
from triaxcal.rig.description.lines import LineFormat
from triaxcal.rig.description.protection import DATA_ID_MODES, PROTECTIONS

RIG_FILE = "rig.toml"
JOINS = ("counter", "age")
SERIALS = ("crc32", "number")
_NAME = line()
_AXIS = replace(
    _NAME,
    expected='one signal, "Message.Signal"',
    remedy="an axis that is described as several signals, as its high and low byte: make one "
    "signal of them in a copy of the bus description",
)
_BYTE = whole(0, 255)
_PROTECTION = "How the CRC is made; required with crc. "


@dataclass(frozen=True, kw_only=True)
class RigKeys:
    """[rig]: the bus.

    Attributes
    ----------
    file
        Its description, beside this file: DBC, KCD, SYM or ARXML. Required without [lines].
    more_files
        More descriptions, as of a thermometer of another make, on this bus or another one.
    channel
        Channel of the sensor, where frames of several come.
    """

    file: str | None = setting(_NAME, None, example='"imu.dbc"')
    more_files: tuple[str, ...] = setting(listed(_NAME, range(17), "a list of files"), ())
    channel: str | None = setting(_NAME, None, example='"can0"')


@dataclass(frozen=True, kw_only=True)
class SignalKeys:
    """[signals]: what the signals are, each as "Message.Signal".

    Attributes
    ----------
    x
        Acceleration along x.
    y
        Acceleration along y.
    z
        Acceleration along z.
    gyro_x
        Rate about x, of an IMU; with gyro_y and gyro_z.
    gyro_y
        Rate about y.
    gyro_z
        Rate about z.
    temperature
        Temperature of the unit; a session needs it.
    record
        What is recorded of the axes: the raw integer ("raw"), or the physical value divided by the
        reading of one code of unit.toml ("value").
    gyro_record
        The same of the gyros; "value" is the physical value itself.
    temperature_record
        The same of the temperature.
    unit
        Unit of the axes' physical values.
    gyro_unit
        Unit of the gyros' physical values.
    temperature_unit
        Unit of the temperature's physical value.
    sample_time
        Time of the sample by the clock of the unit, a raw integer that turns.
    sample_tick_us
        Time of one step of sample_time.
    serial
        Identity of the unit.
    serial_is
        "crc32": CRC-32 of the text of the serial number. "number": the number at its end.
    rate
        Samples a second, as the unit reports them.
    join
        How axes that come in several messages belong together: by equal counters, or the last ones
        that are no older than age_s. Required where there are several.
    age_s
        Greatest age of an axis.
    sample_at
        Message whose arrival makes a sample where axes are joined by age.
    """

    x: str = setting(_AXIS, example='"IMU.AccX"')
    y: str = setting(_AXIS, example='"IMU.AccY"')
    z: str = setting(_AXIS, example='"IMU.AccZ"')
    gyro_x: str | None = setting(_AXIS, None, example='"IMU.RateX"')
    gyro_y: str | None = setting(_AXIS, None, example='"IMU.RateY"')
    gyro_z: str | None = setting(_AXIS, None, example='"IMU.RateZ"')
    temperature: str | None = setting(_NAME, None, example='"IMU.Temp"')
    record: str | None = setting(
        word(("raw", "value")), None, words='"raw" of integers, "value" of floats', example='"raw"'
    )
    gyro_record: str | None = setting(
        word(("raw", "value")), None, words='"raw" of integers, "value" of floats', example='"raw"'
    )
    temperature_record: str | None = setting(
        word(("raw", "value")), None, words='"raw" of integers, "value" of floats', example='"raw"'
    )
    unit: str | None = setting(_NAME, None, words="that of the bus description", example='"g"')
    gyro_unit: str | None = setting(
        _NAME, None, words="that of the bus description", example='"deg/s"'
    )
    temperature_unit: str | None = setting(
        _NAME, None, words="that of the bus description", example='"degC"'
    )
    sample_time: str | None = setting(_NAME, None, example='"IMU.TimeUs"')
    sample_tick_us: float | None = setting(
        number(1e-3, 1e6), None, "us", words="by the unit in the bus description", example="1"
    )
    serial: str | None = setting(_NAME, None, example='"IMU.Serial"')
    serial_is: str = setting(word(SERIALS), "crc32")
    rate: str | None = setting(_NAME, None, example='"IMU.Rate"')
    join: str | None = setting(word(JOINS), None, example='"counter"')
    age_s: float | None = setting(number(1e-4, 60.0), None, "s", example="0.005")
    sample_at: str | None = setting(_NAME, None, words="that of z", example='"IMU"')


@dataclass(frozen=True)
class Goods:
    """Good values of statuses: one list for all, or one for each."""

    lists: tuple[tuple[int, ...], ...]

    @property
    def count(self) -> int:
        """Number of the lists."""
        return len(self.lists)

    def of(self, place: int) -> tuple[int, ...]:
        """Good values of a status by its place from 0."""
        return self.lists[min(place, self.count - 1)]


def _one_or_several() -> Kind[tuple[str, ...]]:
    """A name, or a list of names."""
    several = listed(_NAME, range(1, 17), "a list of names", different=True)

    def parse(value: Any) -> tuple[str, ...]:
        return several.parse(value) if isinstance(value, list) else (_NAME.parse(value),)

    schema = {"anyOf": [_NAME.schema, several.schema]}
    return Kind("a name, or a list of names", parse, schema, example='"Status"')


def _goods() -> Kind[Goods]:
    """A list of whole numbers, or a list of such lists."""
    expected = "a list of whole numbers, or a list of such lists"
    one = listed(whole(0, 2**32 - 1), range(1, 257), expected)
    several = listed(one, range(1, 17), expected)

    def parse(value: Any) -> Goods:
        nested = isinstance(value, list) and any(isinstance(item, list) for item in value)
        return Goods(several.parse(value) if nested else (one.parse(value),))

    return Kind(expected, parse, {"anyOf": [one.schema, several.schema]}, example="[0]")


@dataclass(frozen=True, kw_only=True)
class MessageKeys:
    """[message.MESSAGE]: what else one message has; its signals by their names in it.

    Attributes
    ----------
    channel
        Channel that the message comes on, where it is another one.
    counter
        Counter of the message's frames, or of the samples.
    counter_modulus
        Number of values of the counter.
    counter_step
        What the counter grows by from frame to frame; of one that counts down, counter_modulus - 1.
    crc
        CRC of the payload.
    protection
        How the CRC is made.
    data_id
        Data ID of an AUTOSAR profile; profile 2 has 16 of them.
    data_id_mode
        What profile 1 covers of its Data ID.
    status
        Status or validity; a list where there are several, as one for each axis.
    status_good
        Raw values of status that are good: one list for all, or a list of lists, one for each.
    mux
        Selector of a message whose multiplexing the bus description does not state.
    mux_value
        Raw value of mux in the frames that count.
    j1939
        IDs match by PGN and source address.
    source_address
        J1939 source address of the unit; 254: any.
    """

    channel: str | None = setting(_NAME, None, words="that of [rig]", example='"can1"')
    counter: str | None = setting(_NAME, None, example='"Counter"')
    counter_modulus: int | None = setting(
        whole(2, 2**32), None, words="2^bits, 15 of AUTOSAR profile 1", example="16"
    )
    counter_step: int = setting(whole(1, 2**32 - 1), 1)
    crc: str | None = setting(_NAME, None, example='"Crc"')
    protection: str | None = setting(_NAME, None, example='"sae-j1850"')
    data_id: tuple[int, ...] = setting(
        listed(whole(0, 2**32 - 1), range(17), "a list of whole numbers"), (), example="[291]"
    )
    data_id_mode: str = setting(word(DATA_ID_MODES), "both")
    status: tuple[str, ...] = setting(_one_or_several(), (), words="none", example='"Status"')
    status_good: Goods = setting(_goods(), Goods(((0,),)), words="[0]", example="[0]")
    mux: str | None = setting(_NAME, None, example='"Mux"')
    mux_value: int | None = setting(whole(0, 2**32 - 1), None, example="0")
    j1939: bool | None = setting(FLAG, None, words="by the bus description", example="true")
    source_address: int | None = setting(
        _BYTE, None, words="that of the bus description", example="128"
    )


def rig_file() -> FileKeys:
    """Keys of rig.toml; the registered protections are among them."""
    protection = {"kind": word(PROTECTIONS.names), "doc": _PROTECTION + PROTECTIONS.explained}
    return FileKeys(
        RIG_FILE,
        "The signals of a rig on its bus",
        (
            TableKeys("", "", (FORMAT, DESCRIPTION)),
            TableKeys.of(RigKeys),
            TableKeys.of(LineFormat, optional=True),
            TableKeys.of(SignalKeys),
            TableKeys.of(MessageKeys).but(protection=protection),
        ),
        first=("file",),
    )
