"""Every format: the same readings exactly, damage and missing packages in one line."""

from __future__ import annotations

import errno
import gc
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from threading import Thread
from types import ModuleType

import numpy as np
import pytest
from click.testing import CliRunner
from family_cases import UNIT
from scipy.io import savemat
from test_recordings import calibrated, found
from written import AXES, CASES, Case, Times, csv, readings

from recordings import recording
from triaxcal.base.errors import RefusedError
from triaxcal.base.extras import install_command
from triaxcal.batch.order import filled
from triaxcal.batch.plan import plan_work
from triaxcal.batch.run import run_series
from triaxcal.batch.toolchain import toolchain
from triaxcal.cli.main import main
from triaxcal.delivery.inputs import files_sha256
from triaxcal.delivery.unit import deliver
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.model.types import FloatArray
from triaxcal.readings.arrays import ArraySource, texts_of
from triaxcal.readings.clock import Clock
from triaxcal.readings.format import FORMATS, Block, Format, starts_with
from triaxcal.readings.opened import RecordingFile
from triaxcal.readings.quiet import quiet
from triaxcal.readings.spool import Spool
from triaxcal.report.files import SOMETIMES
from triaxcal.report.series.page import series_files
from triaxcal.report.series.unit import make_unit
from triaxcal.unit.recordingfile import ClockLayout, FileLayout

LAYOUT = FileLayout("recording")
every_format = pytest.mark.parametrize("name", CASES)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Writes the recording of `readings` in a format, once."""
    folder = tmp_path_factory.mktemp("written")

    def written(name: str) -> Path:
        pytest.importorskip(FORMATS[CASES[name].format].package)
        path = folder / CASES[name].file
        if not path.exists():
            CASES[name].write(path, *readings())
        return path

    return written


def read(path: Path, case: Case) -> tuple[FloatArray, FloatArray, RecordingFile]:
    """Times in the unit of the file from the first, readings, and the file."""
    file = RecordingFile(path, LAYOUT)
    columns = [file.index(column, "acceleration") for column in case.columns]
    if case.time is None:
        time, unit = file.source.clocks[file.source.tables[columns[0]]]
        assert unit == case.unit
    else:
        time = file.index(case.time, "time")
    rows = np.concatenate([block.numbers for block in file.blocks([time, *columns])])
    return rows[:, 0] - rows[0, 0], rows[:, 1:], file


@every_format
def test_readings_and_times_are_those_written(name: str, files: Callable[[str], Path]) -> None:
    t_us, a = readings()
    time, values_read, file = read(files(name), CASES[name])
    assert np.array_equal(values_read, a)
    if CASES[name].unit == "s":
        # Microseconds as doubles of at most 64 s: half a unit of the last place, 4e-15 s.
        assert np.abs(time * 1e6 - (t_us - t_us[0])).max() < 1e-8
    else:
        assert np.array_equal(time, (t_us - t_us[0]) * {"us": 1, "ns": 1000}[CASES[name].unit])
    assert file.source.findings == ()


@every_format
def test_the_format_is_found_whatever_the_file_is_called(
    name: str, files: Callable[[str], Path], tmp_path: Path
) -> None:
    path = files(name)
    if name == "ros1":
        pytest.skip("rosbags tells ROS 1 from ROS 2 by the name .bag")
    if name in {"ros2", "mcap"}:
        pytest.skip("rosbags tells the storage of ROS 2 by the name")
    other = tmp_path / "recording"
    shutil.copy(path, other)
    assert np.array_equal(read(other, CASES[name])[1], readings()[1])


def _cut(content: bytes) -> bytes:
    return content[: int(0.6 * len(content))]


def _start_only(content: bytes) -> bytes:
    return content[:20]


def _start_overwritten(content: bytes) -> bytes:
    noise = np.random.default_rng(0).bytes(300)
    return content[:32] + noise + content[332:]


def _middle_overwritten(content: bytes) -> bytes:
    half = len(content) // 2
    return content[:half] + np.random.default_rng(0).bytes(300) + content[half + 300 :]


DAMAGES = (_cut, _start_only, _start_overwritten, _middle_overwritten)
CUT_IS_READ = {"ulog", "dataflash"}
"""Loggers write these message by message, and a power cut ends them anywhere."""
BARE = {
    ("hdf5", _middle_overwritten),
    ("mat5", _middle_overwritten),
    ("mat73", _middle_overwritten),
    ("mat73", _start_overwritten),
    ("npy", _middle_overwritten),
    ("mf4", _middle_overwritten),
    ("mcap", _middle_overwritten),
    ("parquet", _start_overwritten),
}
"""Bytes of readings, which these formats do not protect, or of what is not read: not to be seen."""


@pytest.mark.parametrize("damage", DAMAGES)
@every_format
def test_damage_is_one_line(
    name: str,
    damage: Callable[[bytes], bytes],
    files: Callable[[str], Path],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    if (name, damage) in BARE:
        pytest.skip("this format does not show it")
    path = tmp_path / CASES[name].file
    source = files(name)
    if source.is_dir():
        shutil.copytree(source, path)
        (inner,) = path.glob("*.db3")
    else:
        inner = Path(shutil.copy(source, path))
    inner.write_bytes(damage(inner.read_bytes()))
    capfd.readouterr()
    if name in CUT_IS_READ and damage is _cut:
        _, a, file = read(path, CASES[name])
        assert np.array_equal(a, readings()[1][: len(a)])
        assert len(a) > 1000
        assert file.source.findings == (
            "the log ends within a message: it was cut, and is read to there",
        )
        return
    with pytest.raises(RefusedError) as refusal:
        read(path, CASES[name])
    text = str(refusal.value)
    assert text.startswith(str(path))
    assert "\n" not in text
    if (name, damage) != ("dataflash", _start_only):  # 20 bytes of it are the start of a message
        assert "damaged" in text
    assert capfd.readouterr() == ("", "")


EXTRAS = {entry.package: entry.extra for entry in FORMATS if entry.extra != "recordings"}


def test_every_optional_package_has_its_extra() -> None:
    import tomllib

    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())
    extras = project["project"]["optional-dependencies"]
    assert all(
        any(line.startswith(package) for line in extras[extra]) for package, extra in EXTRAS.items()
    )
    assert extras["recordings"] == [
        f"triaxcal[{','.join(e for e in extras if e in EXTRAS.values())}]"
    ]


MAGIC = {
    "pyarrow": b"PAR1",
    "h5py": b"\x89HDF\r\n\x1a\n",
    "openpyxl": b"PK\x03\x04" + bytes(26) + b"[Content_Types].xml",
    "pyulog": b"ULog\x01\x12\x35",
    "rosbags": b"#ROSBAG V2.0\n",
    "pymavlink": b"\xa3\x95\x80\x80",
    "asammdf": b"MDF     4.10",
}


@pytest.mark.parametrize("package", MAGIC)
def test_a_missing_package_names_the_command(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "log"
    path.write_bytes(MAGIC[package])
    monkeypatch.setitem(sys.modules, package, None)  # as if it were not installed
    (label,) = [e.label for e in FORMATS if e.package == package and e.sniff(MAGIC[package])]
    with pytest.raises(RefusedError) as refusal:
        RecordingFile(path, LAYOUT)
    assert str(refusal.value) == (
        f"{path}: the package {package} is missing; expected it, to read {label}; "
        f"install it: {install_command(EXTRAS[package])}"
    )


def test_a_package_that_lacks_another_is_named_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rosbags")
    path = tmp_path / "log.bag"
    path.write_bytes(MAGIC["rosbags"])
    for module in [name for name in sys.modules if name.startswith("rosbags")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "lz4.frame", None)
    with pytest.raises(RefusedError, match=r"package lz4 is missing; .*'triaxcal\[ros\]'"):
        RecordingFile(path, LAYOUT)


# ---- The same constants ----


def unit_of(folder: Path, case: Case, more: str = "") -> Path:
    """A unit's folder for a recording of a format; without a time where the format has a clock."""
    folder.mkdir()
    columns = ", ".join(f'"{column}"' for column in case.columns)
    time = f'time = "{case.time}"\ntime_unit = "{case.unit}"' if case.time else ""
    recording = f'acceleration = [{columns}]\nacceleration_unit = "m/s^2"\n{time}\n{more}'
    toml = UNIT.format(name=folder.name, more="", recording=recording)
    (folder / "unit.toml").write_text(toml.replace("log.csv", case.file))
    return folder


@pytest.fixture(scope="module")
def from_csv(tmp_path_factory: pytest.TempPathFactory) -> Calibration:
    """Calibration of the same readings as text."""
    case = Case(csv, "log.csv", "text", AXES, "t", "us")
    folder = unit_of(tmp_path_factory.mktemp("csv") / "SAME", case)
    csv(folder / case.file, *readings())
    return calibrated(folder)


@every_format
def test_the_same_constants_to_the_last_digit(
    name: str, files: Callable[[str], Path], from_csv: Calibration, tmp_path: Path
) -> None:
    folder = unit_of(tmp_path / "SAME", CASES[name])
    (shutil.copytree if name == "ros2" else shutil.copy)(files(name), folder / CASES[name].file)
    calibration = calibrated(folder)
    for one, other in zip(found(calibration), found(from_csv), strict=True):
        assert np.array_equal(one, other)
    assert calibration.recording is not None
    assert from_csv.recording is not None
    assert np.array_equal(calibration.recording.covariance, from_csv.recording.covariance)


def test_a_text_has_no_clock_of_its_own(tmp_path: Path) -> None:
    folder = unit_of(tmp_path / "SAME", Case(csv, "log.csv", "text", AXES, None, ""))
    csv(folder / "log.csv", *readings())
    with pytest.raises(RefusedError) as refusal:
        calibrated(folder)
    assert str(refusal.value) == (
        f"{folder}/unit.toml, [recording] time: missing; expected a time column, or sample_rate_hz"
    )


def test_a_bag_that_is_a_folder_reaches_the_c(files: Callable[[str], Path], tmp_path: Path) -> None:
    folder = unit_of(tmp_path / "SAME", CASES["ros2"])
    shutil.copytree(files("ros2"), folder / "bag")
    delivery = deliver(folder)
    (order,) = plan_work([folder], tmp_path / "build").orders
    for made in (make_unit(order), make_unit(filled(order))):
        assert made.refusal == ""
        assert {n: made.files[n] for n in delivery.files} == dict(delivery.files)
    assert delivery.calibration.recording is not None
    assert len(delivery.calibration.recording.poses.poses) == 12
    assert delivery.inputs_sha256 == files_sha256((folder / "unit.toml", folder / "bag"), "")
    with (folder / "bag" / "metadata.yaml").open("a") as file:
        file.write("\n")
    assert delivery.inputs_sha256 != files_sha256((folder / "unit.toml", folder / "bag"), "")


def test_the_hash_of_a_folder_is_of_names_and_subfolders(tmp_path: Path) -> None:
    (tmp_path / "bag" / "more").mkdir(parents=True)
    (tmp_path / "bag" / "a").write_text("1")
    (tmp_path / "bag" / "more" / "b").write_text("2")
    hashes = {files_sha256([tmp_path / "bag"], "")}
    (tmp_path / "bag" / "a").rename(tmp_path / "bag" / "c")
    hashes.add(files_sha256([tmp_path / "bag"], ""))
    (tmp_path / "bag" / "more" / "b").write_text("3")
    hashes.add(files_sha256([tmp_path / "bag"], ""))
    assert len(hashes) == 3


def test_a_folder_that_cannot_be_listed_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def denied(path: Path) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(os, "scandir", denied)  # root may list any folder
    with pytest.raises(RefusedError) as refusal:
        files_sha256([tmp_path], "put it there")
    assert str(refusal.value) == f"{tmp_path}: cannot be read: permission denied; put it there"


# ---- A format of one's own ----


def _toy(path: Path, layout: FileLayout) -> ArraySource:
    """Doubles, four a row, behind a word."""
    rows = np.frombuffer(path.read_bytes()[8:]).reshape(-1, 4)
    source = ArraySource(str(path), dict(zip(("t", *AXES), rows.T, strict=True)), layout)
    source.findings = ("one row of the toy was upside down",)
    return source


TOY = Format(
    name="toy",
    label="a toy of doubles",
    doc="Doubles that only a test knows.",
    open=_toy,
    sniff=starts_with(b"TOYTOYTO"),
    package="numpy",
)


def test_a_reader_added_at_run_time_reaches_every_page(tmp_path: Path) -> None:
    t_us, a = readings()
    folder = unit_of(tmp_path / "TOY-1", Case(csv, "log.toy", "toy", AXES, "t", "us"))
    content = np.column_stack([t_us, a])
    (folder / "log.toy").write_bytes(b"TOYTOYTO" + content.tobytes())
    run, told = CliRunner(), []
    with FORMATS.added(TOY):
        poses = run.invoke(main, ["poses", str(folder)])
        made = run.invoke(main, ["calib", str(folder), "--build", str(tmp_path / "build")])
        work = plan_work([folder], tmp_path / "many")
        series = run_series(
            work, tmp_path / "many", make_unit, map, sometimes=SOMETIMES, report=told.append
        )
        shown = run.invoke(main, ["calib", "--help"])
        (folder / "log.toy").write_bytes(b"TOYTOYTO" + content.tobytes()[:-3])
        broken = run.invoke(main, ["poses", str(folder)])
    assert poses.exit_code == 0, poses.output
    assert "12 poses" in poses.output
    assert made.exit_code == 0, made.output
    assert [outcome.refusal for outcome in told] == [""]
    assert json.loads(series_files(series)["series.json"])["made"] == 1
    built = tmp_path / "build" / "TOY-1"
    assert "TOY-1" in (built / "passport.json").read_text(encoding="utf-8")
    for name in ("passport.html", "calibration.json"):
        words = " ".join((built / name).read_text(encoding="utf-8").split())
        assert "ne row of the toy was upside down" in words  # the page begins with a capital
    assert "toy Doubles that only a test knows." in " ".join(shown.output.split())
    assert str(broken.exception) == (
        f"{folder}/log.toy: damaged, or not a toy of doubles: "
        "buffer size must be a multiple of element size"
    )
    without = run.invoke(main, ["poses", str(folder)])
    assert "log.toy: a binary file; expected " in str(without.exception)


def test_a_reader_without_a_package_shows_damage_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "log.toy"
    path.write_bytes(b"TOYTOYTO" + bytes(33))
    with FORMATS.added(replace(TOY, package="")), pytest.raises(RefusedError) as refusal:
        RecordingFile(path, LAYOUT)
    assert str(refusal.value) == (
        f"{path}: damaged, or not a toy of doubles: buffer size must be a multiple of element size"
    )


# ---- Nothing of the process is changed ----


@pytest.mark.parametrize("name", ["ulog", "dataflash", "mf4"])
def test_reading_leaves_the_streams_of_other_threads(
    name: str, files: Callable[[str], Path]
) -> None:
    path, before = files(name), (sys.stdout, sys.stderr, sys.unraisablehook)
    seen = set()

    def trace(*_: object) -> None:
        seen.add((sys.stdout, sys.stderr, sys.unraisablehook) == before)

    sys.setprofile(trace)
    try:
        read(path, CASES[name])
    finally:
        sys.setprofile(None)
    assert seen == {True}


def test_a_package_is_silent_in_the_thread_that_reads_alone(
    capsys: pytest.CaptureFixture[str],
) -> None:
    module = ModuleType("package")
    exec("def tell(text): print(text)", vars(module))
    with quiet(module):
        module.tell("mine")
        other = Thread(target=module.tell, args=("other's",))
        other.start()
        other.join()
    module.tell("later")
    assert capsys.readouterr().out == "other's\nlater\n"


@every_format
def test_a_file_is_closed_with_its_reader(name: str, files: Callable[[str], Path]) -> None:
    path = files(name)
    gc.collect()
    gc.disable()  # collected, a file may be let go of before what should close it
    try:
        read(path, CASES[name])
        held = {link.readlink() for link in Path("/proc/self/fd").iterdir() if link.is_symlink()}
    finally:
        gc.enable()
    assert path not in held


# ---- Two columns of one name ----


def refused(path: Path, column: str | int, layout: FileLayout = LAYOUT) -> str:
    with pytest.raises(RefusedError) as refusal:
        RecordingFile(path, layout).index(column, "acceleration")
    return str(refusal.value).removeprefix(f"{path}: ")


def values(path: Path, column: str | int, layout: FileLayout = LAYOUT) -> list[float]:
    file = RecordingFile(path, layout)
    return [x for b in file.blocks([file.index(column, "x")]) for x in b.numbers[:, 0].tolist()]


TWICE = (
    "2 columns 'ax' ([recording] acceleration); expected one of that name; give its number from 1"
)


def test_parquet_twice(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    path = tmp_path / "log.parquet"
    table = pyarrow.Table.from_arrays([pyarrow.array([1]), pyarrow.array([2])], names=["ax", "ax"])
    parquet.write_table(table, path)
    assert refused(path, "ax") == TWICE
    assert values(path, 2) == [2.0]


def test_excel_twice(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    path = tmp_path / "log.xlsx"
    book = openpyxl.Workbook()
    book.active.title = "imu"
    for row in (["ax", "ax", "az"], [1, 2, 3], [None] * 3, [4, None, 6]):
        book.active.append(row)
    book.save(path)
    assert refused(path, "ax") == TWICE
    assert values(path, "az") == [3.0, 6.0]
    second = values(path, 2)
    assert second[0] == 2.0
    assert np.isnan(second[1])


def test_json_twice(tmp_path: Path) -> None:
    path = tmp_path / "log.json"
    path.write_text('{"ax": [1], "ax": [2]}')
    assert refused(path, "ax") == "damaged, or not JSON: two values of one name, 'ax'"


def test_mf4_in_two_groups(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "log.mf4"
    with asammdf.MDF(version="4.10") as file:
        for k in range(2):
            file.append(asammdf.Signal(np.array([k, k]) * 1.0, np.array([0.0, 1.0]), name="ax"))
        file.save(path)
    assert refused(path, "ax") == (
        "2 columns 'ax' ([recording] acceleration); expected one of group0.ax, group1.ax"
    )
    assert values(path, "group1.ax") == [1.0, 1.0]
    assert values(path, "ax", FileLayout("recording", variable="group1")) == [1.0, 1.0]


# ---- Particular to a format ----


def test_columns_of_two_topics_are_refused(files: Callable[[str], Path]) -> None:
    file = RecordingFile(files("ulog"), LAYOUT)
    names = ("sensor_accel[1].xyz[0]", "vehicle_status.arming_state")
    with pytest.raises(RefusedError, match="columns of several tables: sensor_accel") as refusal:
        list(file.blocks([file.index(name, "acceleration") for name in names]))
    assert refusal.value.expected == "columns of one table, which has one clock"


def test_the_sensors_own_time_in_a_bag(files: Callable[[str], Path]) -> None:
    file = RecordingFile(files("ros2"), LAYOUT)
    (block,) = file.blocks([file.index("/imu/data.header.stamp", "time")])
    t_us, _ = readings()
    assert np.array_equal(block.numbers[:, 0], (t_us - t_us[0]) * 1000)


def test_a_wrong_topic_is_corrected(files: Callable[[str], Path]) -> None:
    file = RecordingFile(files("ros1"), LAYOUT)
    with pytest.raises(RefusedError, match=r'did you mean "/imu/data\.linear_acceleration\.x"\?'):
        file.index("/imu/dat.linear_acceleration.x", "acceleration")


def test_a_topic_may_be_named_once(files: Callable[[str], Path]) -> None:
    layout = FileLayout("recording", variable="/imu/data")
    file = RecordingFile(files("ros1"), layout)
    names = file.source.names
    assert names[file.index("time", "time")] == "/imu/data.time"
    assert names[file.index("linear_acceleration.y", "a")] == "/imu/data.linear_acceleration.y"


def test_an_excel_sheet_without_names_is_numbered(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    path = tmp_path / "log.xlsx"
    book = openpyxl.Workbook()
    book.create_sheet("raw").append([0.5, 1.5])
    book["raw"].append([2.5, "high"])
    book.save(path)
    layout = FileLayout("recording", variable="raw")
    assert values(path, 1, layout) == [0.5, 2.5]
    with pytest.raises(RefusedError, match=r"row 2, column : found 'high'; expected a number"):
        values(path, 2, layout)


def test_json_lines_name_the_damaged_one(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    path.write_text('{"ax": 1}\n{"ax": 2}\n{"ax": \n')
    with pytest.raises(RefusedError) as refusal:
        values(path, "ax")
    assert str(refusal.value).startswith(f"{path}, line 3: damaged JSON: Expecting value")


def test_parquet_fields_of_structures(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    path = tmp_path / "log.parquet"
    rows = [{"imu": {"acc": {"x": 1.0, "y": 2.0}, "n": 7}, "t": k} for k in range(3)]
    parquet.write_table(pyarrow.Table.from_pylist(rows), path)
    assert values(path, "imu.acc.y") == [2.0, 2.0, 2.0]
    file = RecordingFile(path, LAYOUT)
    names = ("t", "imu.n", "imu.acc.x")
    (block,) = file.blocks([file.index(name, "x") for name in names])
    assert block.numbers.tolist() == [[0, 7, 1], [1, 7, 1], [2, 7, 1]]


def test_matlab_vectors_either_way_and_a_matrix_of_rows(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "log.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["column"] = np.arange(4.0)[None, :]  # 4 x 1 in MATLAB
        file["row"] = np.arange(4.0)[:, None]
        file["wide"] = np.arange(36.0).reshape(12, 3)  # 3 x 12 in MATLAB
    with path.open("r+b") as out:
        out.write(b"MATLAB 7.3 MAT-file")
    assert values(path, "column") == values(path, "row") == [0.0, 1.0, 2.0, 3.0]
    assert values(path, "wide[1]") == values(path, 2) == list(np.arange(1.0, 36.0, 3.0))
    assert RecordingFile(path, LAYOUT).source.findings == (
        "wide: wider than long, so its rows are taken as columns",
    )


@pytest.mark.parametrize("kind", ["mat5", "mat73"])
def test_a_few_poses_of_many_columns_are_not_turned(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    for shape, wanted, turned in (
        ((12, 14), (2, 3, 4), False),
        ((3, 12), ("m[0]", "m[2]"), True),
        ((3, 12), ("m[3]",), False),
        ((3, 12), (12,), False),
    ):
        m = np.arange(1.0 * shape[0] * shape[1]).reshape(shape)
        if kind == "mat5":
            savemat(path, {"m": m})
        else:
            h5py = pytest.importorskip("h5py")
            with h5py.File(path, "w", userblock_size=512) as file:
                file["m"] = m.T
            with path.open("r+b") as out:
                out.write(b"MATLAB 7.3 MAT-file")
        layout = FileLayout("recording", wanted)
        expected = m.T if turned else m
        assert values(path, 2, layout) == expected[:, 1].tolist()
        assert bool(RecordingFile(path, layout).source.findings) == turned


# ---- Cells that are no plain numbers: one rule for every format ----


def unread(path: Path, column: str) -> str:
    with pytest.raises(RefusedError) as refusal:
        values(path, column)
    return str(refusal.value).removeprefix(f"{path}")


def book(path: Path, *rows: list[object]) -> Path:
    openpyxl = pytest.importorskip("openpyxl")
    made = openpyxl.Workbook()
    for row in rows:
        made.active.append(row)
    made.save(path)
    return path


def test_json_of_two_columns_with_one_full_name_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.json"
    for text in (
        '{"imu.ax": [1, 2], "imu": {"ax": [3, 4]}}',
        '[{"imu.ax": 1, "imu": {"ax": 3}}]',
        '{"imu.ax": 1, "imu": {"ax": 3}}\n{"imu.ax": 1, "imu": {"ax": 3}}\n',
    ):
        path.write_text(text)
        told = "damaged, or not JSON: two columns of one name, 'imu.ax'"
        assert refused(path, "imu.ax") == told


def test_true_and_false_are_no_numbers(tmp_path: Path) -> None:
    told = (
        ", row 1, column ax: found 'True'; expected a number; "
        "write the column as numbers, or name another"
    )
    path = tmp_path / "log.json"
    for text in ('{"ax": [true, false]}', '{"ax": [true, 1.5]}', '[{"ax": true}, {"ax": 1.5}]'):
        path.write_text(text)
        assert unread(path, "ax") == told
    path.write_text('{"acc": [[true, 1.5], [2.5, 1.5]]}')
    assert unread(path, "acc[0]") == told.replace("ax", "acc[0]")
    np.savez(tmp_path / "log.npz", ax=np.array([True, False]))
    assert unread(tmp_path / "log.npz", "ax") == told
    sheet = book(tmp_path / "log.xlsx", ["t", "ax", "ay"], [0, True, 1])
    assert unread(sheet, "ax") == told.replace("row 1", "row 2").replace("ax", "Sheet.ax")


def test_excel_has_the_rules_of_text(tmp_path: Path) -> None:
    path = book(
        tmp_path / "log.xlsx",
        ["t", "ax", "ay"],
        ["s", "m/s^2", "m/s^2"],
        [0, "#N/A", 1],
        [1, "-", 1],
        [2, "1,5", 1],
        [3, 2.5, 1],
    )
    file = RecordingFile(path, FileLayout("recording", decimal=","))
    (block,) = file.blocks([file.index("ax", "acceleration")])
    np.testing.assert_array_equal(block.numbers[:, 0], [np.nan, np.nan, 1.5, 2.5])
    assert file.source.findings == ("1 row left out above the rows, from row 2 on",)
    assert unread(path, "ax") == (
        ", row 5, column Sheet.ax: found '1,5'; expected a number; "
        'if the decimals have a comma, decimal = ","'
    )


def test_times_without_their_unit_name_it(tmp_path: Path) -> None:
    remedy = 'expected a number; if these are times, time_unit = "iso"'
    sheet = book(tmp_path / "log.xlsx", ["t", "a", "b"], [datetime(2026, 3, 30, 12), 1, 1])
    found = "found '2026-03-30T12:00:00'"
    assert unread(sheet, "t") == f", row 2, column Sheet.t: {found}; {remedy}"
    np.savez(tmp_path / "log.npz", t=np.array(["2026-03-30T12:00:00"], dtype="M8[s]"))
    assert unread(tmp_path / "log.npz", "t") == f", row 1, column t: {found}; {remedy}"
    text = tmp_path / "log.csv"
    text.write_text("t,a,b,c\n23:59:30.000,1,2,3\n23:59:30.010,1,2,3\n")
    assert unread(text, "t") == f", line 2, column t: found '23:59:30.000'; {remedy}"


def test_a_missing_time_is_a_missing_cell() -> None:
    times = np.array(["2026-03-30T12:00:00", "NaT", "2026-03-30T12:00:02"], dtype="M8[s]")
    assert texts_of(times) == ["2026-03-30T12:00:00", "", "2026-03-30T12:00:02"]
    clock = Clock(ClockLayout(columns=("t",), units=("iso",)), "log", "row")
    block = Block(np.empty((3, 0)), (), np.arange(1, 4))
    np.testing.assert_array_equal(
        clock.seconds(block, block.numbers, [texts_of(times)]), [0.0, np.nan, 2.0]
    )


@pytest.mark.parametrize("date", ["2026-03-30", "2026-03-30T00:00:00"])
def test_a_date_and_a_time_of_two_columns(date: str) -> None:
    """Excel's date column has a time of its own; hours may have one digit."""
    clock = Clock(ClockLayout(columns=("d", "t"), units=("iso", "iso")), "log", "row")
    block = Block(np.empty((2, 0)), (), np.arange(1, 3))
    seconds = clock.seconds(block, block.numbers, [[date] * 2, ["9:59:59", "10:00:01"]])
    assert seconds.tolist() == [0.0, 2.0]


def test_a_short_line_in_the_middle_has_its_own_count(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = [f"{k},1,2,3" for k in range(60)]
    path.write_text("\n".join(["t,a,b,c", *rows[:49], "49,1", *rows[50:], ""]))
    assert unread(path, "a") == (
        ", line 51: 2 cells; expected 4, as in line 2; "
        "check delimiter and decimal in [recording], or remove the line"
    )


def test_a_document_on_one_line_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("1.5," * 300_000)
    assert (
        refused(path, 1) == f"{path}, line 1: more than 1048576 characters; expected a row of the "
        "recording in each line; export the recording as CSV, a line for each row"
    )


def test_a_full_temporary_folder_names_what_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    spool = Spool(4)

    def full(_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(spool._file, "write", full)
    with pytest.raises(RefusedError) as refusal:
        spool.append(np.zeros((1 << 16, 4)))
    assert str(refusal.value) == (
        f"{tempfile.gettempdir()}: cannot be written: no space left on device; expected more than "
        "2 MiB free: 8 bytes for each number of a recording; set TMPDIR to a folder with more space"
    )


# ---- Recordings of other makers ----


def test_px4_ulog_is_read_as_it_is() -> None:
    pytest.importorskip("pyulog")
    path = recording("px4_ulog") / "sample_px4_events.ulg"
    rows: Callable[[str], int] = lambda name: len(values(path, name))  # noqa: E731
    for topic, fields, count in (
        ("sensor_combined", ("gyro_rad", "accelerometer_m_s2"), 7783),
        ("sensor_accel", ("x", "temperature"), 31),
        ("sensor_gyro", ("x", "temperature"), 31),
    ):
        names = RecordingFile(path, LAYOUT).source.names
        for field in fields:
            (first, *_) = [n for n in names if n.split("[")[0] == f"{topic}.{field}"]
            assert rows(first) == count
    file = RecordingFile(path, LAYOUT)
    a = [file.index(f"sensor_combined.accelerometer_m_s2[{k}]", "a") for k in range(3)]
    mean = np.concatenate([b.numbers for b in file.blocks(a)]).mean(axis=0)
    # A vehicle that stands or hovers: the mean specific force is gravity, upwards, to 5 %.
    assert abs(np.linalg.norm(mean) - 9.81) < 0.5
    assert file.source.findings == ()


@pytest.mark.parametrize("name", ["HC", "HC_improved", "IB", "CF"])
def test_furbrain_is_read_as_it_is(name: str) -> None:
    path = recording("furbrain_sap6") / f"{name}.json"
    file = RecordingFile(path, LAYOUT)
    assert file.source.names == tuple(f"{kind}[{k}]" for kind in ("mag", "grav") for k in range(3))
    (block,) = file.blocks([file.index(f"grav[{k}]", "acceleration") for k in range(3)])
    assert block.numbers.shape == (24, 3)
    # In m/s^2, uncalibrated: scale and bias errors of these instruments are below a tenth.
    assert (np.abs(np.linalg.norm(block.numbers, axis=1) - 9.81) < 0.981).all()


def test_readings_of_the_cases_are_exact_in_single_precision() -> None:
    t_us: Times
    t_us, a = readings()
    assert np.array_equal(a.astype(np.float32).astype(np.float64), a)
    assert len(np.unique(t_us)) == len(a)


def test_an_unknown_format_names_the_table_and_what_there_is(tmp_path: Path) -> None:
    path = tmp_path / "log.npy"
    np.save(path, np.zeros(3))
    with pytest.raises(RefusedError) as refusal:
        RecordingFile(path, FileLayout("recording", format="numpi"))
    assert str(refusal.value) == (
        f"{path}, [recording] format: found 'numpi' (did you mean \"numpy\"?); "
        f"expected one of {', '.join(FORMATS.names)}"
    )


def test_a_reader_added_at_run_time_is_part_of_the_toolchain() -> None:
    before = toolchain()
    with FORMATS.added(TOY):
        assert toolchain() != before
    assert toolchain() == before


@pytest.mark.parametrize(("everything", "word"), [("0", "1 skipped"), ("1", "1 failed")])
def test_a_missing_package_fails_where_all_should_be(
    everything: str, word: str, tmp_path: Path
) -> None:
    test = tmp_path / "test_absent.py"
    test.write_text("import pytest\ndef test_it(): pytest.importorskip('no_such_package')\n")
    tests = str(Path(__file__).parents[1])
    path = os.pathsep.join([tests, os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "conftest", "-c", os.devnull, str(test)],
        capture_output=True, text=True, check=False, cwd=tmp_path,
        env=os.environ | {"TRIAXCAL_ALL_EXTRAS": everything, "PYTHONPATH": path},
    )  # fmt: skip
    assert word in done.stdout
