"""`firmware_imu`: the integers of a whole IMU's calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.api.angles import Angles, angles_of, asked_for
from triaxcal.api.imu import ImuCalibration
from triaxcal.base.arrays import int32
from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import publish
from triaxcal.codegen.imu import ImuBuild, imu_answers
from triaxcal.codegen.routines import Int32Array, UInt32Array
from triaxcal.delivery.imuc import ImuC, imu_c
from triaxcal.fixedpoint.angles import AnglesPlan
from triaxcal.unit.arithmetic import checked_arithmetic
from triaxcal.unit.prefix import checked_prefix

_THERMOMETERS = {
    True: ("not given", "codes of the gyros' own thermometer"),
    False: ("given", "none: both triads have one thermometer"),
}
"""What is wrong with codes of the gyros' thermometer, and expected, by whether there is one."""


class ImuFirmware:
    """The fixed-point routines of both triads, in Python's integers: the same bits as the C.

    Made by `firmware_imu`, which has proven and cross-checked the C.

    Attributes
    ----------
    build : ImuBuild
        Plans, proven bounds and what was cross-checked.
    files : dict
        Name and content of the C and the image.
    """

    def __init__(self, c: ImuC) -> None:
        self.c = c
        self.build: ImuBuild = c.build
        self.files = c.build.files

    @property
    def unit(self) -> str:
        """Name of the unit."""
        return self.c.fitted.name

    @property
    def prefix(self) -> str:
        """What names in the C begin with."""
        return self.build.accel.prefix

    def apply(
        self, raw_accel: Any, raw_gyro: Any, temp_codes: Any, gyro_temp_codes: Any = None
    ) -> tuple[Int32Array, Int32Array, UInt32Array]:
        """Results of `triax_imu_apply`.

        Parameters
        ----------
        raw_accel, raw_gyro : array_like of whole numbers, shape (n, 3)
        temp_codes : array_like of whole numbers, shape () or (n,)
        gyro_temp_codes : the same, or None
            Of the gyros' own thermometer, where they have one.

        Returns
        -------
        accel, rate : arrays of int32, shape (n, 3)
            In 2^-output_q g and deg/s.
        status : array of uint32, shape (n,)

        Raises
        ------
        RefusedError
            For another shape, or a number beyond int32; for codes of a thermometer that is not
            there, or none of one that is.
        """
        if (gyro_temp_codes is None) == self.build.two_thermometers:
            found, expected = _THERMOMETERS[self.build.two_thermometers]
            raise RefusedError("gyro_temp_codes", found, expected=expected)
        accel, gyro = int32("raw_accel", raw_accel, 3), int32("raw_gyro", raw_gyro, 3)
        temps = [int32("temp_codes", temp_codes)]
        if gyro_temp_codes is not None:
            temps.append(int32("gyro_temp_codes", gyro_temp_codes))
        fits = all(temp.shape in ((), (len(accel),)) for temp in temps)
        if accel.ndim != 2 or gyro.shape != accel.shape or not fits:
            raise RefusedError(
                "raw_accel, raw_gyro, temp_codes",
                f"found the shapes {accel.shape}, {gyro.shape}, {temps[0].shape}",
                expected="(n, 3), (n, 3), (n,)",
            )
        temps = [np.ascontiguousarray(np.broadcast_to(t, (len(accel),))) for t in temps]
        return imu_answers(self.build.accel, self.build.gyro, (temps[0], accel, gyro, temps[-1]))

    def angles(self, accel: Any) -> Angles:
        """Answers of `triax_angles`: the two angles of [device] angles.

        Parameters
        ----------
        accel : array_like of whole numbers, shape (n, 3)
            Accelerations that `apply` gives, any int32.

        Returns
        -------
        angle : array of uint32 or int32, shape (n, 2)
            Binary angles, 2^32 a turn: zenith and tool face (uint32), or pitch and roll (int32).
        status : array of uint32, shape (n,)
            Bits of docs/reference/c-api.md; 0 is good. None of them is one of `apply`.

        Raises
        ------
        RefusedError
            For another shape, a number beyond int32, or an IMU without [device] angles.
        """
        return angles_of(self.angles_plan, accel)

    @property
    def angles_plan(self) -> AnglesPlan:
        """What `angles` needs to know.

        Raises
        ------
        RefusedError
            For an IMU without [device] angles.
        """
        return asked_for(self.build.angles, self.unit, "device")

    def check(self) -> int:
        """Vectors on which Python, the reference C and the generated C agreed."""
        build = self.build
        return build.accel_check.total + build.gyro_check.total + build.vectors

    def write(self, folder: str | Path) -> tuple[Path, ...]:
        """Write the C and the image, all of them or none, into a folder of their own."""
        publish(self.files, Path(folder))
        return tuple(Path(folder) / name for name in self.files)

    def write_a2l(
        self,
        elf: str | Path,
        path: str | Path | None = None,
        *,
        variables: Sequence[str] = (),
        can_ids: tuple[int, int] | None = None,
        bitrate: int | None = None,
    ) -> Path:
        """Write one A2L of the constants of both triads; arguments as `Firmware.write_a2l`.

        `variables` are the two that `triax_imu_calib_load` writes: accelerometer, gyro.

        Raises
        ------
        RefusedError
            As `Firmware.write_a2l`.
        """
        from triaxcal.api.a2lfile import write_linked_a2l, xcp_on_can  # noqa: PLC0415

        fitted, build = self.c.fitted, self.build
        device, provenance = fitted.device, fitted.provenances[0]
        triads = (
            (build.accel, device.temperature_sensor),
            (build.gyro, device.gyro_temperature_sensor),
        )
        xcp = xcp_on_can(can_ids, bitrate)
        return write_linked_a2l(elf, path, triads, provenance, variables=variables, xcp=xcp)


def firmware_imu(
    calibration: ImuCalibration, prefix: str | None = None, arithmetic: str | None = None
) -> ImuFirmware:
    """Firmware of an IMU whose unit has [device].

    Parameters
    ----------
    calibration : ImuCalibration
        By `fit_imu`, or by `load_imu`: then the C is made, proven and checked once more.
    prefix : str or None
        What names in the C begin with; None is that of [device].
    arithmetic : str or None
        How the C forms its products; None is that of [device].

    Raises
    ------
    RefusedError
        Where there is no [device], no such prefix or arithmetic, or a check fails.
    """
    if prefix is None and arithmetic is None:
        return ImuFirmware(calibration.c)
    fitted = calibration.fitted
    device = fitted.device
    if prefix is not None:
        device = replace(device, prefix=checked_prefix(prefix))
    if arithmetic is not None:
        device = replace(device, arithmetic=checked_arithmetic(arithmetic))
    return ImuFirmware(imu_c(replace(fitted, saved=replace(fitted.saved, device=device))))
