"""A unit's folder: unit.toml, the three kinds of files, the command and its results."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dynamic_cases import COLUMNS, UNIT_TOML, mems_short, table_of, write_unit
from triaxcal.base.errors import RefusedError
from triaxcal.cli.main import main
from triaxcal.delivery.imu import deliver_imu
from triaxcal.delivery.inputs import files_sha256
from triaxcal.dynamic.description import read_dynamic
from triaxcal.dynamic.reading import read_recording
from triaxcal.readings.arrays import ArraySource
from triaxcal.readings.format import FORMATS, Format, starts_with


def table() -> np.ndarray:
    return table_of(mems_short()[1])


def refused(folder: Path) -> str:
    with pytest.raises(RefusedError) as refusal:
        read_recording(read_dynamic(folder)).all()
    assert "\n" not in str(refusal.value)
    return str(refusal.value)


def test_three_kinds_of_files_hold_the_same(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    parquet = pytest.importorskip("pyarrow.parquet")
    pyarrow = pytest.importorskip("pyarrow")
    rows = table()
    folder = write_unit(tmp_path / "IMU-A", rows)
    expected = read_recording(read_dynamic(folder)).all()
    columns = {name: rows[:, i] for i, name in enumerate(COLUMNS)}
    parquet.write_table(pyarrow.table(columns), folder / "recording.parquet")
    with h5py.File(folder / "recording.h5", "w") as file:
        for name, values in columns.items():
            file[name] = values
    for kind in ("parquet", "h5"):
        text = UNIT_TOML.replace("recording.csv", f"recording.{kind}")
        (folder / "unit.toml").write_text(text, encoding="utf-8")
        found = read_recording(read_dynamic(folder)).all()
        for name in ("time_s", "rate", "force"):
            assert np.array_equal(getattr(found, name), getattr(expected, name))
    assert np.array_equal(expected.rate, mems_short()[1].all().rate)


def test_a_recording_that_is_a_folder_is_delivered(tmp_path: Path) -> None:
    bag = Format(
        name="toybag",
        label="a bag",
        doc="A folder.",
        open=lambda path, layout: ArraySource(
            str(path), dict(zip(COLUMNS, np.load(path / "rows.npy").T, strict=True)), layout
        ),
        sniff=starts_with(b"toybag"),
    )
    rows = table()
    text = UNIT_TOML.replace("recording.csv", "bag")
    folder = write_unit(tmp_path / "IMU-A", rows, text)
    (folder / "bag").mkdir()
    (folder / "bag" / "metadata.yaml").write_text("toybag\n", encoding="utf-8")
    np.save(folder / "bag" / "rows.npy", rows)
    with FORMATS.added(bag):
        made = deliver_imu(folder)
    assert made.inputs_sha256 == files_sha256((folder / "unit.toml", folder / "bag"), "")
    assert made.done.unit.recording.name == "bag"


def test_units_of_the_file(tmp_path: Path) -> None:
    rows = table()[:200]
    rows[:, 0] *= 1e3
    rows[:, 1:4] = np.degrees(rows[:, 1:4])
    rows[:, 4:7] /= 9.80665e-3
    text = UNIT_TOML.replace('"rad/s"', '"deg/s"').replace('"m/s^2"', '"mg"')
    text = text.replace("[noise]", 'time_unit = "ms"\n[noise]')
    found = read_recording(read_dynamic(write_unit(tmp_path / "IMU-A", rows, text)))
    samples = found.all()
    exact = mems_short()[1].all()[:200]
    assert abs(found.rate_hz - 50.0) < 1e-9
    # One multiplication there and one back: two roundings.
    np.testing.assert_allclose(samples.rate, exact.rate, rtol=1e-15 * 4)
    np.testing.assert_allclose(samples.force, exact.force, rtol=1e-15 * 4)


BAD_TOML = {
    "latitude absent": ("latitude_deg = 50\n", "", "missing: [site] latitude_deg"),
    "unknown block": ("[noise]", 'blocks = ["g-drfit"]\n[noise]', "found 'g-drfit'"),
    "block without its column": (
        "[noise]",
        'blocks = ["gyro-thermal"]\n[noise]',
        '"gyro-thermal" is switched on and no temp_column is given',
    ),
    "unit of increments": ('"rad/s"', '"rad"', 'expected one of "rad/s", "deg/s"'),
    "two columns": ('"gy", ', "", "three different columns, by name or number"),
    "absent column": ('"gy"', '"gyro_y"', "no column 'gyro_y'"),
    "no such file": ("recording.csv", "other.csv", "other.csv: no such file"),
    "kind of file": ("recording.csv", "unit.toml", "no column 'time_s' ([dynamic] time_column)"),
    "beyond the gyros' range": (
        "[noise]",
        "rate_max = 0.05\n[noise]",
        "it is saturated; expected rates within its range, 0.05 deg/s",
    ),
    "both rate and times": ("[noise]", "rate_hz = 50\n[noise]", "both given"),
    "noise below zero": ("_h = 0.3\n", "_h = -0.3\n", "[noise] gyro_arw_deg_per_sqrt_h"),
}


@pytest.mark.parametrize("case", BAD_TOML)
def test_bad_descriptions(case: str, tmp_path: Path) -> None:
    old, new, words = BAD_TOML[case]
    assert old in UNIT_TOML
    folder = write_unit(tmp_path / "IMU-A", table()[:300], UNIT_TOML.replace(old, new))
    assert words in refused(folder)


def test_bad_cells_and_times(tmp_path: Path) -> None:
    rows = table()[:300]
    folder = write_unit(tmp_path / "IMU-A", rows)
    csv = folder / "recording.csv"
    lines = csv.read_text(encoding="utf-8").splitlines()
    csv.write_text("\n".join([*lines[:10], "oops" + lines[10], *lines[11:]]), encoding="utf-8")
    assert "line 11, column time_s: found 'oops" in refused(folder)
    csv.write_text(lines[0] + "\n", encoding="utf-8")
    assert "a header but no rows" in refused(folder)
    csv.write_text("\n".join(lines[:3]), encoding="utf-8")
    assert "fewer than three samples" in refused(folder)
    csv.write_bytes(b"\xff\xfe\x00")
    assert "begins as UTF-16 text, but byte 2 is none" in refused(folder)


def test_rows_that_are_doubled_late_or_empty_are_left_out_and_reported(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "IMU-A", table()[:300])
    plain = read_recording(read_dynamic(folder))
    csv = folder / "recording.csv"
    lines = csv.read_text(encoding="utf-8").splitlines()
    nothing = "nan," + lines[10].split(",", 1)[1]
    mended = [*lines[:10], lines[9], nothing, *lines[10:20], lines[15], *lines[20:]]
    csv.write_text("\n".join([*mended, ""]), encoding="utf-8")
    found = read_recording(read_dynamic(folder))
    assert found.findings == (
        "1 row without all readings left out, the first is line 12",
        "1 row doubled, left out once, the first is line 11",
        "1 row with a time that another row has or that runs back left out, the first is line 23",
    )
    for name in ("time_s", "rate", "force"):
        assert np.array_equal(getattr(found.all(), name), getattr(plain.all(), name))
    text = (folder / "unit.toml").read_text(encoding="utf-8")
    text = text.replace('"rad/s"', '"rad"').replace("instant", "increment")
    text = text.replace('"m/s^2"', '"m/s"')
    (folder / "unit.toml").write_text(text, encoding="utf-8")
    assert len(read_recording(read_dynamic(folder)).all()) == len(lines) - 1
    csv.write_text("\n".join([*lines[:10], *lines[11:20], *lines[22:]]), encoding="utf-8")
    told = "3 rows lost in 2 places, the first at 0.18 s; expected every increment, because"
    assert told in refused(folder)


def test_dynamic_takes_what_recording_takes(tmp_path: Path) -> None:
    """Delimiter, decimal sign, comments, columns by number, signs and a time in two columns."""
    rows = table()[:300]
    folder = write_unit(tmp_path / "IMU-A", rows)
    plain = read_recording(read_dynamic(folder)).all()
    text = UNIT_TOML.replace('"time_s"', '[1, "ms"]').replace('"gx", "gy", "gz"', '2, "-gy", 4')
    text = text.replace("[noise]", 'time_unit = ["s", "ms"]\ndelimiter = "semicolon"\n[noise]')
    text = text.replace("[noise]", 'decimal = ","\ncomment = "%"\n[noise]')
    assert text.count("[noise]") == 1
    (folder / "unit.toml").write_text(text, encoding="utf-8")
    whole, rest = np.divmod(np.rint(rows[:, 0] * 1000), 1000)
    rows[:, 2] *= -1.0
    body = [
        f"{int(s)};" + ";".join(f"{v!r}" for v in row[1:].tolist()) + f";{int(ms)}"
        for s, ms, row in zip(whole, rest, rows, strict=True)
    ]
    header = ";".join([*COLUMNS, "ms"])
    csv = "\n".join(["% made by hand", header, *body]).replace(".", ",")
    (folder / "recording.csv").write_text(csv, encoding="utf-8")
    found = read_recording(read_dynamic(folder)).all()
    assert np.array_equal(found.rate, plain.rate)
    assert np.array_equal(found.force, plain.force)
    # Seconds and thousandths are added: the sum is rounded once more.
    np.testing.assert_allclose(found.time_s, plain.time_s, rtol=4e-16)


def test_the_command(tmp_path: Path) -> None:
    folder = write_unit(tmp_path / "IMU-A", table())
    done = CliRunner().invoke(main, ["dynamic", str(folder), "--build", str(tmp_path / "build")])
    assert done.exit_code == 0, done.output
    assert "axis z" in done.output
    assert "verdict         passed" in done.output
    made = tmp_path / "build" / "IMU-A"
    assert sorted(path.name for path in made.iterdir()) == ["calibration.json", "dynamic.html"]
    result = json.loads((made / "calibration.json").read_text(encoding="utf-8"))
    assert (result["format"], result["kind"], result["serial"]) == (1, "dynamic", "IMU-TEST-001")
    values = {state["name"]: state for state in result["states"]}
    truth = mems_short()[0]
    for i in range(3):
        state = values[f"nu0_{i + 1}"]
        error = state["value"] / state["si_per_unit"] - truth.gyro_bias_deg_per_h[i]
        assert abs(error) < 4 * state["sd"] / state["si_per_unit"]
    page = (made / "dynamic.html").read_text(encoding="utf-8")
    assert page.count("<polyline") == len(result["states"])
