"""`firmware_imu`: the integers of a whole IMU's calibration."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.api.imu import ImuCalibration
from triaxcal.base.arrays import int32
from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import publish
from triaxcal.codegen.imu import ImuBuild, imu_answers
from triaxcal.codegen.routines import Int32Array, UInt32Array


class ImuFirmware:
    """The fixed-point routines of both triads, in Python's integers: the same bits as the C.

    Attributes
    ----------
    build : ImuBuild
        Plans, proven bounds and what was cross-checked.
    files : dict
        Name and content of the C and the image.
    """

    def __init__(self, build: ImuBuild) -> None:
        self.build = build
        self.files = build.files

    def apply(
        self, raw_accel: Any, raw_gyro: Any, temp_codes: Any
    ) -> tuple[Int32Array, Int32Array, UInt32Array]:
        """Results of `triax_imu_apply`.

        Parameters
        ----------
        raw_accel, raw_gyro : array_like of whole numbers, shape (n, 3)
        temp_codes : array_like of whole numbers, shape () or (n,)

        Returns
        -------
        accel, rate : arrays of int32, shape (n, 3)
            In 2^-output_q g and deg/s.
        status : array of uint32, shape (n,)

        Raises
        ------
        RefusedError
            For another shape, or a number beyond int32.
        """
        accel, gyro = int32("raw_accel", raw_accel, 3), int32("raw_gyro", raw_gyro, 3)
        temp = int32("temp_codes", temp_codes)
        if accel.ndim != 2 or gyro.shape != accel.shape or temp.shape not in ((), (len(accel),)):
            raise RefusedError(
                "raw_accel, raw_gyro, temp_codes",
                f"found the shapes {accel.shape}, {gyro.shape}, {temp.shape}",
                expected="(n, 3), (n, 3), (n,)",
            )
        temp = np.ascontiguousarray(np.broadcast_to(temp, (len(accel),)))
        return imu_answers(self.build.accel, self.build.gyro, temp, accel, gyro)

    def write(self, folder: str | Path) -> tuple[Path, ...]:
        """Write the C and the image, all of them or none, into a folder of their own."""
        publish(self.files, Path(folder))
        return tuple(Path(folder) / name for name in self.files)


def firmware_imu(calibration: ImuCalibration) -> ImuFirmware:
    """Firmware of an IMU whose unit has [device].

    Raises
    ------
    RefusedError
        Where there is none.
    """
    return ImuFirmware(calibration.c.build)
