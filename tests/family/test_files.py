"""Files of other makers as they come: encodings, preambles, headers, clocks, binary files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from family_cases import csv_text, directions, log, write_unit
from scipy.io import savemat
from test_recordings import calibrated, found

from triaxcal.cli.main import main
from triaxcal.dynamic.reading import _doubles
from triaxcal.errors import RefusedError

UNITS = Path(__file__).parents[2] / "units"
TEXT = csv_text(log(directions(10)), "t,ax,ay,az")


def refusal(folder: Path) -> str:
    with pytest.raises(RefusedError) as caught:
        calibrated(folder)
    return str(caught.value)


# ---- encodings and binary files ----


@pytest.mark.parametrize("codec", ["utf-16", "utf-16-le", "utf-16-be"])
def test_utf_16_is_read(tmp_path: Path, codec: str) -> None:
    plain = calibrated(write_unit(tmp_path / "A", TEXT))
    folder = write_unit(tmp_path / "B", TEXT)
    (folder / "log.csv").write_bytes(TEXT.encode(codec))
    assert np.array_equal(found(plain)[0], found(calibrated(folder))[0])


def test_utf_16_that_breaks_off_is_called_so(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "U", TEXT)
    (folder / "log.csv").write_bytes(TEXT.encode("utf-16")[:-1])
    assert "begins as UTF-16 text, but byte" in refusal(folder)


@pytest.mark.parametrize(
    ("start", "name"),
    [
        (b"PK\x03\x04\0\0", ", a ZIP archive or an Excel workbook; expected text, or a MAT-file"),
        (b"SQLite format 3\0", ", an SQLite database, as ROS 2 writes; expected"),
        (b"\x01\0\x02\x03\0", "a binary file; expected text, or a MAT-file of MATLAB 5 to 7.2"),
    ],
)
def test_what_is_no_text_is_named(tmp_path: Path, start: bytes, name: str) -> None:
    folder = write_unit(tmp_path / "U", TEXT)
    (folder / "log.csv").write_bytes(start + bytes(range(256)))
    assert name in refusal(folder)


def test_vectors_of_unequal_length_are_refused(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "U", TEXT)
    rows = log(directions(4))
    columns = {"t": rows[:, 0], "ax": rows[:, 1], "ay": rows[:-3, 2], "az": rows[:, 3]}
    savemat(folder / "log.csv", columns, appendmat=False)
    assert f"{len(rows) - 3} values in ay ([recording] acceleration), {len(rows)} in ax" in refusal(
        folder
    )


@pytest.mark.parametrize("text", [np.array(["a", "b"]), np.array(["1", "x"], dtype=object)])
def test_text_in_a_column_of_numbers_is_refused(text: Any) -> None:
    """What Parquet and HDF5 give for text; gaps among numbers go through."""
    with pytest.raises(RefusedError, match=r"r.parquet, column a: holds .*; expected numbers"):
        _doubles(Path("r.parquet"), "a", text)
    gaps = _doubles(Path("r"), "a", np.array([1.5, None], dtype=object))
    assert gaps[0] == 1.5
    assert np.isnan(gaps[1])


def test_the_wrong_kind_of_unit_is_told_in_one_line() -> None:
    for command, unit, told in (
        ("poses", "IMU-SIM", "a whole IMU on a turntable, [dynamic]; expected a unit with a table"),
        ("drift", "IMU-SIM", "`triaxcal dynamic "),
        ("poses", "AT-SIM", "no table [recording]"),
        ("dynamic", "AT-SIM", "no table [dynamic]; expected a whole IMU on a turntable; `triaxcal"),
    ):
        result = CliRunner().invoke(main, [command, str(UNITS / unit)])
        assert isinstance(result.exception, RefusedError)
        assert told in str(result.exception)


# ---- what stands above the rows ----

BODY = TEXT.split("\n", 1)[1]


def closed(text: str) -> str:
    """Every line with a delimiter at its end."""
    return text.replace("\n", ",\n")


@pytest.mark.parametrize(
    "text",
    [
        f"sep=,\n{TEXT}",
        f"Device: Shimmer\nSample rate, 50 Hz\nStart: 2023 03 30\n{TEXT}",
        f"t,ax,ay,az\nCAL,CAL,CAL,CAL\nms,m/(sec^2),m/(sec^2),m/(sec^2)\n{BODY}",
        f"#t,ax,ay,az\n{BODY}",
        f"# made by hand, on a table, in may\n# t,ax,ay,az\n{BODY}",
        f'"t","ax","ay","az"\n{BODY}',
        closed(TEXT),
        f"t,ax,ay,az\n{closed(BODY)}",
        "ax,ay,az\n" + BODY,
    ],
    ids=["sep", "preamble", "units", "comment", "remark", "quoted", "closed", "half-closed", "R"],
)
def test_what_loggers_write_above_the_rows(tmp_path: Path, text: str) -> None:
    """The first three columns but time are asked for: R does not name the first."""
    recording = (
        'acceleration = ["ax", "ay", "az"]\nacceleration_unit = "m/s^2"\nsample_rate_hz = 50'
    )
    plain = calibrated(write_unit(tmp_path / "A", TEXT, recording))
    other = calibrated(write_unit(tmp_path / "B", text, recording))
    assert np.array_equal(found(plain)[0], found(other)[0])


def test_what_was_left_out_above_is_told(tmp_path: Path) -> None:
    text = f"Device: 17\n\nt,ax,ay,az\ns,m/s2,m/s2,m/s2\n{BODY}"
    told = calibrated(write_unit(tmp_path / "U", text)).findings
    assert "2 lines above the rows left out, from 1 on" in told


def test_a_first_row_with_empty_cells_is_still_a_row(tmp_path: Path) -> None:
    text = f"t,ax,ay,az\n-0.02,,,\n{BODY}"
    told = calibrated(write_unit(tmp_path / "U", text)).findings
    assert "1 row without all readings left out, the first is line 2" in told
