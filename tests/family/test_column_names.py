"""Columns by name, whole numbers too large for doubles, and folders: what all formats share."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.readings.arrays import ArraySource
from triaxcal.readings.format import FORMATS, Format, Source, starts_with
from triaxcal.readings.names import meant
from triaxcal.readings.opened import RecordingFile
from triaxcal.unit.recordingfile import FileLayout

NAMES = ("imu.t", "imu.ax", "imu[1].ax", "gps.t", "GPS.alt", "esc[0].rpm", "raw/acc[0]")


@pytest.mark.parametrize(
    ("wanted", "variable", "found"),
    [
        ("imu.ax", None, [1]),
        ("IMU.AX", None, [1]),
        ("imu[0].ax", None, [1]),
        ("imu[1].ax", None, [2]),
        ("ax", None, [1, 2]),
        ("ax", "imu", [1]),
        ("ax", "imu[1]", [2]),
        ("t", None, [0, 3]),
        ("t", "gps", [3]),
        ("alt", None, [4]),
        ("rpm", None, [5]),
        ("acc[0]", None, [6]),
        ("acc[0]", "raw", [6]),
        ("mu.ax", None, []),
        ("acc", None, []),
    ],
)
def test_the_one_rule_of_names(wanted: str, variable: str | None, found: list[int]) -> None:
    assert meant(wanted, NAMES, variable) == found


def opened(tmp_path: Path, arrays: dict[str, np.ndarray], **layout: str) -> RecordingFile:
    """A file of a format that gives these arrays."""
    path = tmp_path / "log.toy"
    path.write_bytes(b"TOY")
    toy = Format(
        name="toy",
        label="a toy",
        doc="Arrays.",
        open=lambda file, given: ArraySource(str(file), arrays, given),
        sniff=starts_with(b"TOY"),
    )
    with FORMATS.added(toy):
        return RecordingFile(path, FileLayout("recording", **layout))


def test_an_ambiguous_name_names_what_it_may_mean(tmp_path: Path) -> None:
    file = opened(tmp_path, {"imu.ax": np.arange(3.0), "gps.ax": np.arange(3.0)})
    with pytest.raises(RefusedError) as refusal:
        file.index("ax", "acceleration")
    assert str(refusal.value) == (
        f"{tmp_path}/log.toy: 2 columns 'ax' ([recording] acceleration); "
        "expected one of gps.ax, imu.ax"
    )


@pytest.mark.parametrize("kind", [np.int64, np.uint64])
def test_nanoseconds_since_1970_keep_every_one(tmp_path: Path, kind: type) -> None:
    steps = np.array([0, 1, 3, 7, 5], np.int64)
    file = opened(tmp_path, {"t": (1_774_872_000_123_456_789 + steps).astype(kind)})
    (block,) = file.blocks([0])
    # Doubles of that size are 256 apart.
    assert block.numbers[:, 0].tolist() == steps.tolist()


def test_small_whole_numbers_stay_as_they_are(tmp_path: Path) -> None:
    file = opened(tmp_path, {"t": np.array([2**53 - 1, 2**53 - 3])})
    (block,) = file.blocks([0])
    assert block.numbers[:, 0].tolist() == [2**53 - 1, 2**53 - 3]


def test_records_are_columns_by_their_fields(tmp_path: Path) -> None:
    rows = np.zeros(2, [("t", "<i4"), ("acc", "<f4", (3,))])
    rows["acc"] = [[1, 2, 3], [4, 5, 6]]
    file = opened(tmp_path, {"": rows})
    assert file.source.names == ("t", "acc[0]", "acc[1]", "acc[2]")
    (block,) = file.blocks([file.index("acc[2]", "acceleration"), file.index(1, "time")])
    assert block.numbers.tolist() == [[3, 0], [6, 0]]


def test_text_among_numbers_is_refused_with_its_row(tmp_path: Path) -> None:
    file = opened(tmp_path, {"ax": np.array([1.5, None, "broken"], object)})
    with pytest.raises(RefusedError) as refusal:
        list(file.blocks([0]))
    assert str(refusal.value) == (
        f"{tmp_path}/log.toy, row 3, column ax: found 'broken'; expected a number; "
        "write the column as numbers, or name another"
    )


def test_columns_of_two_tables_are_refused(tmp_path: Path) -> None:
    class Two(Source):
        names = ("imu.ax", "gps.alt")
        tables = ("imu", "gps")

    file = opened(tmp_path, {})
    file.source = Two()
    with pytest.raises(RefusedError) as refusal:
        list(file.blocks([0, 1]))
    assert str(refusal.value) == (
        f"{tmp_path}/log.toy: columns of several tables: imu.ax, gps.alt; "
        "expected columns of one table, which has one clock; "
        "name columns of one, or export them at common times"
    )
