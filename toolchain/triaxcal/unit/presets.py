"""Layouts of published recordings: values of [recording], which keys of the table override."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from types import MappingProxyType

PRESETS: Mapping[str, Mapping[str, object]] = MappingProxyType(
    {
        "mikoff-mpu9150": {
            "acceleration": [1, 2, 3],
            "acceleration_unit": "m/s^2",
            "gyro": [4, 5, 6],
            "sample_rate_hz": 100,
        },
        "imucal-annotated": {
            "acceleration": ["acc_x", "acc_y", "acc_z"],
            "acceleration_unit": "count",
            "sample_rate_hz": 100,
            "section": "part",
            "faces": {"x_p": "+x", "x_a": "-x", "y_p": "+y", "y_a": "-y", "z_p": "+z", "z_a": "-z"},
        },
        "imucal-session": {
            "acceleration": ["acc_x", "acc_y", "acc_z"],
            "acceleration_unit": "m/s^2",
            "gyro": ["gyr_x", "gyr_y", "gyr_z"],
            "sample_rate_hz": Decimal("102.4"),
        },
        "tofupilot-thermal": {
            "acceleration": ["imu.acc.x", "imu.acc.y", "imu.acc.z"],
            "acceleration_unit": "m/s^2",
            "time": "timestamp",
            "time_unit": "us",
            "temperature": "imu.temperature",
        },
        "imu-tk": {
            "time": 1,
            "time_unit": "s",
            "acceleration": [2, 3, 4],
            "acceleration_unit": "count",
        },
    }
)
