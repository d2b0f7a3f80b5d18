"""Files of other makers as they come: encodings, preambles, headers, clocks, binary files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from family_cases import COLUMNS, U0, K, csv_text, directions, log, write_unit
from scipy.io import savemat
from test_recordings import calibrated, found

from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.readings.arrays import ArraySource
from triaxcal.unit.recordingfile import FileLayout

UNITS = Path(__file__).parents[2] / "units"
TEXT = csv_text(log(directions(10)), "t,ax,ay,az")


def refusal(folder: Path) -> str:
    with pytest.raises(RefusedError) as caught:
        calibrated(folder)
    return str(caught.value)


# ---- encodings and binary files ----


@pytest.mark.parametrize("codec", ["utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_wide_text_is_read(tmp_path: Path, codec: str) -> None:
    plain = calibrated(write_unit(tmp_path / "A", TEXT))
    folder = write_unit(tmp_path / "B", TEXT)
    (folder / "log.csv").write_bytes(TEXT.encode(codec))
    assert np.array_equal(found(plain)[0], found(calibrated(folder))[0])


@pytest.mark.parametrize("codec", ["utf-16", "utf-32"])
def test_wide_text_that_breaks_off_is_called_so(tmp_path: Path, codec: str) -> None:
    folder = write_unit(tmp_path / "U", TEXT)
    (folder / "log.csv").write_bytes(TEXT.encode(codec)[:-1])
    assert f"begins as {codec.upper()} text, but byte" in refusal(folder)


def test_utf_32_of_the_other_order_is_read(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "U", TEXT)
    (folder / "log.csv").write_bytes(b"\0\0\xfe\xff" + TEXT.encode("utf-32-be"))
    assert calibrated(folder).recording is not None


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (f'{TEXT}"{"x" * 140_000}"\n', len(TEXT.splitlines()) + 1),
        ('rows;"' + "x" * 140_000 + '"\n', 1),
    ],
    ids=["quoted", "document"],
)
def test_a_cell_without_end_is_refused_by_its_line(tmp_path: Path, text: str, line: int) -> None:
    told = refusal(write_unit(tmp_path / "U", text))
    assert f"log.csv, line {line}: a cell of more than 131072 characters, in a line of 1" in told
    assert told.endswith(
        "expected rows of numbers; export the recording as CSV, or remove the line"
    )


@pytest.mark.parametrize("columns", [COLUMNS, COLUMNS.replace('"ax", "ay", "az"', "2, 3, 4")])
def test_a_header_alone_is_called_one(tmp_path: Path, columns: str) -> None:
    told = refusal(write_unit(tmp_path / "U", "t,ax,ay,az\n", columns))
    assert told.endswith("log.csv: a header but no rows; expected rows of numbers")


@pytest.mark.parametrize(
    ("start", "name"),
    [
        (b"PK\x03\x04\0\0", "a binary file, a ZIP archive; expected a MAT-file of version"),
        (b"SQLite format 3\0", "a binary file, an SQLite database; expected a MAT-file of version"),
        (b"\x01\0\x02\x03\0", "a binary file; expected a MAT-file of version"),
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
    n = len(rows)
    told = f"columns of different lengths: t {n}, ax {n}, ay {n - 3}, az {n}; expected one value"
    assert told in refusal(folder)


@pytest.mark.parametrize("text", [np.array(["a", "b"]), np.array(["1", "x"], dtype=object)])
def test_text_in_a_column_of_numbers_is_refused(text: Any) -> None:
    """What Parquet and HDF5 give for text; gaps among numbers go through."""
    layout = FileLayout("recording")
    with pytest.raises(RefusedError, match=r"r.parquet, .*column a: .*; expected"):
        list(ArraySource("r.parquet", {"a": text}, layout).blocks([0], []))
    some = ArraySource("r", {"a": np.array([1.5, None], dtype=object)}, layout)
    (gaps,) = some.blocks([0], [])
    assert gaps.numbers[0, 0] == 1.5
    assert np.isnan(gaps.numbers[1, 0])


def test_the_wrong_kind_of_unit_is_told_in_one_line() -> None:
    for command, unit, told in (
        ("poses", "IMU-SIM", "a whole IMU, [dynamic]; expected the unit of one accelerometer"),
        ("drift", "IMU-SIM", "`triaxcal dynamic "),
        ("poses", "AT-SIM", "no table [recording]"),
        ("dynamic", "AT-SIM", "no table [dynamic]; expected a whole IMU; `triaxcal"),
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
    assert "2 lines left out above the rows, from line 1 on" in told


def test_a_first_row_with_empty_cells_is_still_a_row(tmp_path: Path) -> None:
    text = f"t,ax,ay,az\n-0.02,,,\n{BODY}"
    told = calibrated(write_unit(tmp_path / "U", text)).findings
    assert "1 row without all readings left out, the first is line 2" in told


# ---- clocks, sections, clouds ----


@pytest.mark.parametrize(
    ("stamp", "unit"),
    [
        (lambda t: f"{1680000000123456789 + round(t * 1e9)}", "ns"),
        (lambda t: f"2026-03-30 12:{int(t // 60):02d}:{t % 60:09.6f}", "iso"),
        (lambda t: f"2026/03/30 12:{int(t // 60):02d}:{t % 60:09.6f}", "iso"),
        (lambda t: f"2026-03-30T12:{int(t // 60):02d}:{t % 60:06.3f}Z", "iso"),
        (lambda t: f"9:{int(t // 60):02d}:{t % 60:06.3f}", "iso"),
    ],
)
def test_clocks_of_loggers(tmp_path: Path, stamp: Callable[[float], str], unit: str) -> None:
    rows = log(directions(10))
    lines = [f"{stamp(row[0])},{row[1]:.9g},{row[2]:.9g},{row[3]:.9g}" for row in rows]
    recording = f'{COLUMNS}\ntime_unit = "{unit}"'
    text = "\n".join(["t,ax,ay,az", *lines])
    plain = calibrated(write_unit(tmp_path / "A", TEXT))
    other = calibrated(write_unit(tmp_path / "B", text, recording))
    assert np.array_equal(found(plain)[0], found(other)[0])


def test_a_clock_that_cannot_be_is_told(tmp_path: Path) -> None:
    text = refusal(write_unit(tmp_path / "A", TEXT, COLUMNS + '\ntime_unit = "ms"'))
    assert 'the whole recording lasts 0.039 s: check time_unit, as time_unit = "s"' in text
    columns = COLUMNS.replace('time = "t"', "sample_rate_hz = 50000")
    text = refusal(write_unit(tmp_path / "B", TEXT, columns))
    assert "the whole recording lasts 0.039 s at 50000 Hz: check sample_rate_hz" in text
    rows = log(directions(10))
    rows[:, 0] *= 1000.0
    told = calibrated(write_unit(tmp_path / "C", csv_text(rows, "t,ax,ay,az"))).findings
    assert any(f.startswith('time_unit = "s" gives a sample every 20 s: correct') for f in told)


SECTIONS = (
    'rows = "sections"\nsection = "pose"\nacceleration = ["ax", "ay", "az"]\n'
    'acceleration_unit = "m/s^2"'
)


def indexed(moving: int | None = None) -> str:
    """Twelve poses of twenty rows each and rows of none between, with the pose's number."""
    random = np.random.default_rng(8)
    lines = ["pose,ax,ay,az"]
    for k, pose in enumerate(directions(12)):
        noise = 3.0 if k == moving else 0.01
        for reading in pose @ K.T + U0 + noise * random.standard_normal((20, 3)):
            lines.append(f"{k + 1}," + ",".join(f"{v:.6f}" for v in reading))
        lines += [",1.0,2.0,3.0"] * 2
    return "\n".join(lines) + "\n"


def test_sections_are_poses_without_any_clock(tmp_path: Path) -> None:
    calibration = calibrated(write_unit(tmp_path / "U", indexed(), SECTIONS))
    assert calibration.recording is not None
    assert [p.count for p in calibration.recording.poses.poses] == [20] * 12
    # Twenty readings of 0.01 m/s^2: 0.23 mg.
    assert calibration.recording.rms_g < 0.4e-3
    calibration = calibrated(write_unit(tmp_path / "V", indexed(moving=4), SECTIONS))
    assert calibration.recording is not None
    (refused,) = calibration.recording.poses.refused
    assert refused.number == 5
    assert "it is not held still" in refused.reason
    without = SECTIONS.replace('section = "pose"\n', "")
    with pytest.raises(RefusedError, match="section: missing; expected the column that numbers"):
        calibrated(write_unit(tmp_path / "W", indexed(), without))


def test_hundreds_of_single_readings_all_round(tmp_path: Path) -> None:
    """Counts without header or time, as for ellipsoid fits: neighbours must not chain into one."""
    random = np.random.default_rng(6)
    directions = random.standard_normal((300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    counts = np.rint(
        (directions @ K.T + U0) / 9.80665 * 16384 + 16 * random.standard_normal((300, 3))
    )
    text = "\n".join("\t".join(f"{v:.0f}" for v in row) for row in counts)
    recording = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "count"'
    calibration = calibrated(write_unit(tmp_path / "U", text, recording))
    assert "in 60 groups held out in turn" in calibration.selection_reason
    assert calibration.recording is not None
    # 16 counts of 16384 are 0.98 mg.
    assert calibration.recording.left_out_length_g == pytest.approx(0.98e-3, rel=0.15)
