"""The same readings written into every format, by the libraries of the formats themselves.

ULog and DataFlash have no library that writes them: their bytes are laid down here by the published
descriptions of the formats (docs.px4.io, "ULog File Format"; ArduPilot's AP_Logger,
"LogStructure.h"), independently of the libraries that read them.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from family_cases import directions, log
from scipy.io import savemat

from triaxcal.model.types import FloatArray, IntArray

Times = IntArray
"""Microseconds, shape (n,)."""
AXES = ("ax", "ay", "az")


def csv(path: Path, t_us: Times, a: FloatArray) -> None:
    rows = [
        f"{t},{x!r},{y!r},{z!r}" for t, (x, y, z) in zip(t_us.tolist(), a.tolist(), strict=True)
    ]
    path.write_text("\n".join(["t,ax,ay,az", *rows]) + "\n")


def parquet(path: Path, t_us: Times, a: FloatArray) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet as file

    table = pyarrow.table({"t": t_us} | dict(zip(AXES, a.T, strict=True)))
    file.write_table(table, path, row_group_size=700)


def hdf5(path: Path, t_us: Times, a: FloatArray) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file["imu/t"] = t_us
        file["imu/acc"] = a


def mat5(path: Path, t_us: Times, a: FloatArray) -> None:
    savemat(path, {"imu": {"t": t_us[:, None], "acc": a}})


def mat73(path: Path, t_us: Times, a: FloatArray) -> None:
    """As MATLAB saves with -v7.3: 512 bytes of header, arrays by columns, so turned in HDF5."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("imu")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in {"t": t_us[None, :], "acc": a.T}.items():
            group[name] = values
            group[name].attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as out:
        text = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Mar 30 12:00:00 2026 HDF5"
        out.write(text.ljust(124) + struct.pack("<H2s", 0x0200, b"IM"))


def npy(path: Path, t_us: Times, a: FloatArray) -> None:
    rows = np.zeros(len(a), [("t", np.int64), *((name, np.float64) for name in AXES)])
    rows["t"] = t_us
    for name, values in zip(AXES, a.T, strict=True):
        rows[name] = values
    np.save(path, rows)


def npz(path: Path, t_us: Times, a: FloatArray) -> None:
    np.savez_compressed(path, t=t_us, acc=a)


def xlsx(path: Path, t_us: Times, a: FloatArray) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook(write_only=True)
    book.create_sheet("notes").append(["nothing", "here"])
    sheet = book.create_sheet("imu")
    sheet.append(["t", *AXES])
    for t, row in zip(t_us.tolist(), a.tolist(), strict=True):
        sheet.append([t, *row])
    book.save(path)


def json_arrays(path: Path, t_us: Times, a: FloatArray) -> None:
    path.write_text(json.dumps({"imu": {"t": t_us.tolist(), "acc": a.tolist()}}))


def _records(t_us: Times, a: FloatArray) -> list[dict[str, Any]]:
    return [
        {"t": t, "acc": {"x": x, "y": y, "z": z}}
        for t, (x, y, z) in zip(t_us.tolist(), a.tolist(), strict=True)
    ]


def json_records(path: Path, t_us: Times, a: FloatArray) -> None:
    path.write_text(json.dumps(_records(t_us, a), indent=1))


def json_lines(path: Path, t_us: Times, a: FloatArray) -> None:
    path.write_text("".join(json.dumps(record) + "\n" for record in _records(t_us, a)))


def mf4(path: Path, t_us: Times, a: FloatArray) -> None:
    asammdf = pytest.importorskip("asammdf")
    t_s = (t_us - t_us[0]) / 1e6
    with asammdf.MDF(version="4.10") as file:
        signals = [
            asammdf.Signal(values, t_s, name=name, unit="m/s^2")
            for name, values in zip(AXES, a.T, strict=True)
        ]
        file.append([*signals, asammdf.Signal(t_us, t_s, name="t_us")])
        file.append([asammdf.Signal(np.arange(3.0), np.arange(3.0), name="slow")])
        file.save(path, overwrite=True)


# ---- PX4 ULog ----

_ULOG = b"ULog\x01\x12\x35"


def ulog(path: Path, t_us: Times, a: FloatArray) -> None:
    """Two instances of one topic, the second of other readings, and a slower topic between."""

    def message(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    out = [_ULOG + struct.pack("<BQ", 1, int(t_us[0]))]
    out.append(message("B", bytes(40)))
    out.append(message("F", b"sensor_accel:uint64_t timestamp;float[3] xyz;float temperature;"))
    out.append(message("F", b"vehicle_status:uint64_t timestamp;uint8_t arming_state;"))
    for multi_id, msg_id in ((0, 0), (1, 1)):
        out.append(message("A", struct.pack("<BH", multi_id, msg_id) + b"sensor_accel"))
    out.append(message("A", struct.pack("<BH", 0, 2) + b"vehicle_status"))
    for k, (t, row) in enumerate(zip(t_us.tolist(), a.tolist(), strict=True)):
        out.append(message("D", struct.pack("<HQ4f", 1, t, *row, 25.0)))
        out.append(message("D", struct.pack("<HQ4f", 0, t, *reversed(row), 25.0)))
        if k % 100 == 0:
            out.append(message("D", struct.pack("<HQB", 2, t, 1)))
    path.write_bytes(b"".join(out))


# ---- ArduPilot DataFlash ----


def dataflash(path: Path, t_us: Times, a: FloatArray) -> None:
    """Two IMUs, told apart by the field I as FMTU says, the second with the readings."""
    kinds = {
        "FMT": (0x80, "BBnNZ", "Type,Length,Name,Format,Columns"),
        "FMTU": (0x81, "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
        "IMU": (0x82, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
        "BARO": (0x83, "Qf", "TimeUS,Alt"),
    }
    codes = {"B": "B", "Q": "Q", "f": "f", "n": "4s", "N": "16s", "Z": "64s"}

    def message(name: str, *values: Any) -> bytes:
        kind, fields, _ = kinds[name]
        texts = [v.encode() if isinstance(v, str) else v for v in values]
        layout = "<" + "".join(codes[field] for field in fields)
        return struct.pack("<BBB", 0xA3, 0x95, kind) + struct.pack(layout, *texts)

    out = []
    for name, (kind, fields, columns) in kinds.items():
        length = 3 + struct.calcsize("<" + "".join(codes[field] for field in fields))
        out.append(message("FMT", kind, length, name, fields, columns))
    out.append(message("FMTU", 0, 0x82, "s#EEEooo", "F-000000"))
    for k, (t, row) in enumerate(zip(t_us.tolist(), a.tolist(), strict=True)):
        out.append(message("IMU", t, 0, 0.0, 0.0, 0.0, *reversed(row)))
        out.append(message("IMU", t, 1, 0.0, 0.0, 0.0, *row))
        if k % 50 == 0:
            out.append(message("BARO", t, 12.5))
    path.write_bytes(b"".join(out))


# ---- ROS ----


def _imu(store: Any, header: Any, row: FloatArray) -> Any:
    kinds = store.types
    vector = kinds["geometry_msgs/msg/Vector3"]
    covariance = np.zeros(9)
    return kinds["sensor_msgs/msg/Imu"](
        header=header,
        orientation=kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=covariance,
        angular_velocity=vector(x=0.0, y=0.0, z=0.0),
        angular_velocity_covariance=covariance,
        linear_acceleration=vector(x=row[0], y=row[1], z=row[2]),
        linear_acceleration_covariance=covariance,
    )


def _stamp(store: Any, t_us: int) -> Any:
    second, rest = divmod(t_us, 10**6)
    return store.types["builtin_interfaces/msg/Time"](sec=second, nanosec=rest * 1000)


def ros1(path: Path, t_us: Times, a: FloatArray) -> None:
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as bag:
        topic = bag.add_connection("/imu/data", "sensor_msgs/msg/Imu", typestore=store)
        slow = bag.add_connection("/temp", "sensor_msgs/msg/Temperature", typestore=store)
        for k, (t, row) in enumerate(zip(t_us.tolist(), a.tolist(), strict=True)):
            header = store.types["std_msgs/msg/Header"](
                seq=k, stamp=_stamp(store, t), frame_id="imu_link"
            )
            data = store.serialize_ros1(_imu(store, header, row), "sensor_msgs/msg/Imu")
            bag.write(topic, t * 1000, data)
            if k % 50 == 0:
                warm = store.types["sensor_msgs/msg/Temperature"](
                    header=header, temperature=25.0, variance=0.0
                )
                data = store.serialize_ros1(warm, "sensor_msgs/msg/Temperature")
                bag.write(slow, t * 1000, data)


def _ros2(path: Path, t_us: Times, a: FloatArray, plugin: str) -> None:
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(path, version=9, storage_plugin=getattr(StoragePlugin, plugin)) as bag:
        topic = bag.add_connection("/imu/data", "sensor_msgs/msg/Imu", typestore=store)
        for t, row in zip(t_us.tolist(), a.tolist(), strict=True):
            header = store.types["std_msgs/msg/Header"](stamp=_stamp(store, t), frame_id="imu_link")
            data = store.serialize_cdr(_imu(store, header, row), "sensor_msgs/msg/Imu")
            bag.write(topic, t * 1000, data)


def ros2(path: Path, t_us: Times, a: FloatArray) -> None:
    """A folder with metadata.yaml and a database."""
    _ros2(path, t_us, a, "SQLITE3")


def mcap(path: Path, t_us: Times, a: FloatArray) -> None:
    """The file alone, as recorders other than ROS write it."""
    folder = path.with_suffix("")
    _ros2(folder, t_us, a, "MCAP")
    (file,) = folder.glob("*.mcap")
    file.rename(path)


@dataclass(frozen=True)
class Case:
    """A file of a format: who writes it, its name, the columns, and where its times are.

    `time` is None where the format has a clock of its own; `unit` is that of the times.
    """

    write: Callable[[Path, Times, FloatArray], None]
    file: str
    format: str
    columns: tuple[str, str, str]
    time: str | None
    unit: str


_IMU = ("imu.acc[0]", "imu.acc[1]", "imu.acc[2]")
_XYZ = ("acc.x", "acc.y", "acc.z")
_ROS = (
    "/imu/data.linear_acceleration.x",
    "/imu/data.linear_acceleration.y",
    "/imu/data.linear_acceleration.z",
)
CASES: dict[str, Case] = {
    "parquet": Case(parquet, "log.parquet", "parquet", AXES, "t", "us"),
    "hdf5": Case(hdf5, "log.h5", "hdf5", ("imu/acc[0]", "imu/acc[1]", "imu/acc[2]"), "imu/t", "us"),
    "mat5": Case(mat5, "log.mat", "mat", _IMU, "imu.t", "us"),
    "mat73": Case(mat73, "log73.mat", "mat73", _IMU, "imu.t", "us"),
    "npy": Case(npy, "log.npy", "numpy", AXES, "t", "us"),
    "npz": Case(npz, "log.npz", "numpy", ("acc[0]", "acc[1]", "acc[2]"), "t", "us"),
    "xlsx": Case(xlsx, "log.xlsx", "excel", ("imu.ax", "imu.ay", "imu.az"), "imu.t", "us"),
    "json arrays": Case(json_arrays, "log.json", "json", _IMU, "imu.t", "us"),
    "json records": Case(json_records, "records.json", "json", _XYZ, "t", "us"),
    "json lines": Case(json_lines, "log.jsonl", "json", _XYZ, "t", "us"),
    "mf4": Case(mf4, "log.mf4", "mf4", AXES, None, "s"),
    "ulog": Case(
        ulog,
        "log.ulg",
        "ulog",
        ("sensor_accel[1].xyz[0]", "sensor_accel[1].xyz[1]", "sensor_accel[1].xyz[2]"),
        None,
        "us",
    ),
    "dataflash": Case(
        dataflash,
        "log.bin",
        "dataflash",
        ("IMU[1].AccX", "IMU[1].AccY", "IMU[1].AccZ"),
        None,
        "us",
    ),
    "ros1": Case(ros1, "log.bag", "ros", _ROS, None, "ns"),
    "ros2": Case(ros2, "bag", "ros", _ROS, None, "ns"),
    "mcap": Case(mcap, "log.mcap", "ros", _ROS, None, "ns"),
}


def readings(count: int = 12) -> tuple[Times, FloatArray]:
    """Times and readings of a recording of poses.

    The readings are whole 1/4096 m/s^2: a single-precision float of ULog and DataFlash holds them
    exactly, and so do the 16 digits that openpyxl writes.
    """
    rows = log(directions(count))
    t_us = 1_774_872_000_000_000 + np.arange(len(rows), dtype=np.int64) * 20_000
    return t_us, np.round(rows[:, 1:] * 4096.0) / 4096.0
