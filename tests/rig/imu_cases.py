"""Logs of an IMU on a CAN bus: frames are made by cantools and struct, apart from the bench."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterator
from pathlib import Path

import cantools
import numpy as np

from triaxcal.dynamic.recording import ImuSamples
from triaxcal.rig.description.shippedrigs import descriptions_folder

FOLDER = descriptions_folder() / "can-imu"
START_NS = 1_700_000_000_000_000_000
G = 9.80665
FORCE_LSB, RATE_LSB, DEGC_LSB = 2.0**-12, 2.0**-6, 2.0**-7
"""g, deg/s, degC, as imu.dbc has them."""

UNIT_TOML = """\
format = 1
serial = "IMU-CAN-1"
[site]
latitude_deg = 50
local_gravity_m_per_s2 = 9.8107
[dynamic]
recording = "frames.log"
rig = "rig.toml"
time_column = "sample_time"
time_unit = "ns"
rate_columns = ["gyro_x", "gyro_y", "gyro_z"]
rate_unit = "deg/s"
rate_samples = "instant"
force_columns = ["x", "y", "z"]
force_unit = "g"
force_samples = "instant"
[noise]
gyro_arw_deg_per_sqrt_h = 0.3
accel_vrw_ug_per_sqrt_hz = 100
accel_lsb = 244
"""


def crc(payload: bytes) -> int:
    """CRC-8 of SAE J1850, bit by bit."""
    register = 0xFF
    for byte in payload:
        register ^= byte
        for _ in range(8):
            register = (register << 1 ^ 0x1D if register & 0x80 else register << 1) & 0xFF
    return register ^ 0xFF


def codes_of(samples: ImuSamples) -> tuple[np.ndarray, np.ndarray]:
    """Codes of forces and rates (n, 3), rounded."""
    force = np.rint(samples.force / G / FORCE_LSB).astype(int)
    return force, np.rint(np.degrees(samples.rate) / RATE_LSB).astype(int)


def lines(
    samples: ImuSamples,
    *,
    lost: Collection[int] = (),
    spoiled: Collection[int] = (),
    bad: Collection[int] = (),
    channel: str = "can0",
    offset: int = 0,
    late_ns: int = 0,
    first: int = 0,
    start_s: float = 0.0,
) -> Iterator[str]:
    """Lines of a candump log; samples that are lost, have a flipped bit, or a bad status.

    `late_ns`: frames arrive up to so much late, by chance. `first`, `start_s`: number and time of
    the first sample.
    """
    bus = cantools.database.load_file(FOLDER / "imu.dbc")
    force, rate = codes_of(samples)
    late = np.random.default_rng(1).integers(0, late_ns + 1, len(samples))
    since_s = samples.time_s - samples.time_s[0] + start_s
    time_ns = np.rint(since_s * 1e9).astype(int) + START_NS + late
    for k in range(len(samples)):
        frames = []
        if k % 50 == 0:
            temp = 20.0 if samples.temp_degc is None else float(samples.temp_degc[k])
            frames.append(("IMU_TEMP", {"Temperature": temp}))
        for name, codes, kind in (("IMU_FORCE", force, "Force"), ("IMU_RATE", rate, "Rate")):
            signals = {f"{kind}{a}": int(c) for a, c in zip("XYZ", codes[k], strict=True)}
            frames.append(
                (name, signals | {"Counter": (first + k) % 16, "Status": int(k in bad), "Crc": 0})
            )
        for place, (name, signals) in enumerate(frames):
            if k in lost and name == "IMU_RATE":
                continue
            message = bus.get_message_by_name(name)
            scaled = name == "IMU_TEMP"
            payload = bytearray(message.encode(signals, scaling=scaled))
            if name != "IMU_TEMP":
                payload[7] = crc(bytes(payload[:7]))
                if k in spoiled and name == "IMU_FORCE":
                    payload[0] ^= 4
            at = time_ns[k] + place * 120_000
            yield (
                f"({at // 10**9}.{at % 10**9 // 1000:06d}) {channel} "
                f"{message.frame_id + offset:03X}#{payload.hex().upper()}"
            )


def write_unit(folder: Path, samples: ImuSamples, **faults: object) -> Path:
    """Folder of a unit with the log and the rig description."""
    folder.mkdir(parents=True)
    for name in ("rig.toml", "imu.dbc"):
        shutil.copy(FOLDER / name, folder / name)
    (folder / "unit.toml").write_text(UNIT_TOML, encoding="utf-8")
    text = "\n".join(lines(samples, **faults))  # type: ignore[arg-type]
    (folder / "frames.log").write_text(text + "\n", encoding="utf-8")
    return folder
