"""`firmware`, `Firmware`: the integers that the device computes with, and the C of them."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from triaxcal.api.angles import Angles, angles_of, asked_for
from triaxcal.api.calibration import Calibration
from triaxcal.base.arrays import int32
from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import publish, renew
from triaxcal.codegen.angles import GeneratedAngles
from triaxcal.codegen.routines import Int32Array, UInt32Array, routines_of, start_generated
from triaxcal.delivery.firmware import make_firmware
from triaxcal.delivery.fitted import refuse_beyond_limits
from triaxcal.fixedpoint.angles import AnglesPlan
from triaxcal.fixedpoint.integer_model import apply, set_temperature
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.proof import Bound, prove
from triaxcal.fixedpoint.rate import RATE_Q
from triaxcal.model.types import FloatArray
from triaxcal.unit.arithmetic import checked_arithmetic
from triaxcal.unit.prefix import checked_prefix

Answers = tuple[Int32Array, UInt32Array]
_BLOCK = 1 << 16
"""Rows that are computed at a time: the working arrays stay small."""


class Firmware:
    """The fixed-point routine of one calibration, in Python's integers: the same bits as the C.

    Made by `firmware`.

    Attributes
    ----------
    calibration : Calibration
    plan : Plan
        Integer functions of temperature, formats and shifts.
    lsb_g : float
        One code of the result, in g.
    model_error_g : float
        Largest error of the functions that the device evaluates against the fitted model, at any
        temperature code and any raw code; `bound` does not include it.
    files : dict
        Name and content of the generated C and the image.
    """

    def __init__(
        self, calibration: Calibration, prefix: str | None = None, arithmetic: str | None = None
    ) -> None:
        self.calibration = calibration
        fitted = calibration.fitted
        if prefix is not None:
            fitted = replace(fitted, unit=replace(fitted.unit, prefix=checked_prefix(prefix)))
        if arithmetic is not None:
            form = checked_arithmetic(arithmetic)
            fitted = replace(fitted, unit=replace(fitted.unit, arithmetic=form))
        self._made = made = make_firmware(fitted)
        self.plan: Plan = made.plan
        self.files = made.files
        self.model_error_g = made.model_error_g
        self.lsb_g = 2.0**-made.plan.shape.output_q

    def __repr__(self) -> str:
        return f"<triaxcal.Firmware {self.calibration.serial}, {self._made.compensation.method}>"

    @property
    def unit(self) -> str:
        """Name of the unit."""
        return self._made.fitted.unit.name

    @property
    def prefix(self) -> str:
        """What names in the C begin with."""
        return self.plan.prefix

    @property
    def error_g(self) -> float:
        """Largest error against the fitted model: that of `bound` and `model_error_g` together."""
        return self.bound.lsb * self.lsb_g + self.model_error_g

    @cached_property
    def bound(self) -> Bound:
        """Proven error of the arithmetic, in codes of the result, for every input in range."""
        return prove(self.plan)

    def apply(self, raw_codes: Any, temp_codes: Any, rate_codes: Any = None) -> Answers:
        """Results of `triax_set_temperature` and `triax_apply`.

        Parameters
        ----------
        raw_codes : array_like of whole numbers, shape (n, 3)
            Codes of the converter, any int32.
        temp_codes : array_like of whole numbers, shape () or (n,)
            Codes of the thermometer, any int32.
        rate_codes : array_like of whole numbers, shape () or (n,), or None
            dT/dt in 2^-RATE_Q codes of the thermometer per second (docs/reference/c-api.md). None
            is zero; a routine without a term in dT/dt ignores it.

        Returns
        -------
        accel : array of int32, shape (n, 3)
            In `lsb_g`.
        status : array of uint32, shape (n,)
            Bits of docs/reference/c-api.md; 0 is good.

        Raises
        ------
        RefusedError
            For another shape, or a number beyond int32; no value wraps around.
        """
        raw, temp, rate = self.codes(raw_codes, temp_codes, rate_codes)
        accel = np.empty((len(raw), 3), np.int32)
        status = np.empty(len(raw), np.uint32)
        for start in range(0, len(raw), _BLOCK):
            block = slice(start, start + _BLOCK)
            wide = [codes[block].astype(np.int64) for codes in (temp, rate, raw)]
            state, flags = set_temperature(self.plan, wide[0], wide[1])
            accel[block], more = apply(self.plan, state, wide[2])
            status[block] = flags | more
        return accel, status

    def angles(self, accel: Any) -> Angles:
        """Answers of `triax_angles`: the two angles of [firmware] angles.

        Parameters
        ----------
        accel : array_like of whole numbers, shape (n, 3)
            What `apply` gives, any int32.

        Returns
        -------
        angle : array of uint32 or int32, shape (n, 2)
            Binary angles, 2^32 a turn: zenith and tool face (uint32), or pitch and roll (int32).
        status : array of uint32, shape (n,)
            Bits of docs/reference/c-api.md; 0 is good.

        Raises
        ------
        RefusedError
            For another shape, a number beyond int32, or a unit without [firmware] angles.
        """
        return angles_of(self.angles_plan, accel)

    @property
    def angles_plan(self) -> AnglesPlan:
        """What `angles` needs to know.

        Raises
        ------
        RefusedError
            For a unit without [firmware] angles.
        """
        return asked_for(self._made.angles, self.unit, "firmware")

    def model(self, raw_codes: Any, temp_codes: Any, rate_codes: Any = None) -> FloatArray:
        """The same functions in floats, shape (n, 3), in g: `bound` is against these.

        Codes out of the unit's range are clamped, as the routine clamps them.
        """
        raw, temp, rate = self.codes(raw_codes, temp_codes, rate_codes)
        plan, unit = self.plan, self.calibration.fitted.unit
        sensor = unit.temperature_sensor
        codes = temp.clip(plan.temp_min_code, plan.temp_max_code)
        temp_degc = codes * sensor.degc_per_code + sensor.degc_at_zero
        voltage = raw.clip(plan.shape.raw_min, plan.shape.raw_max) * unit.adc.volts_per_code
        rate_k_per_s = rate.astype(np.float64) * (sensor.degc_per_code * 2.0**-RATE_Q)
        return self._made.compensation.evaluate(voltage, temp_degc, rate_k_per_s)

    @contextmanager
    def compiled(self) -> Iterator[CompiledFirmware]:
        """The generated C, compiled for this machine, for the time of a `with` block.

        Raises
        ------
        RefusedError
            When there is no C compiler, or it refuses.
        """
        from triaxcal.codegen.compiler import library_folder  # noqa: PLC0415

        with library_folder() as folder:
            for file, content in self.files.items():
                (folder / file).write_bytes(content)
            yield CompiledFirmware(self, start_generated(folder, folder, self.plan.prefix).load())

    def check(self) -> int:
        """Check the C as `deliver` does: vectors on which Python, reference C and C agreed.

        Raises
        ------
        RefusedError
            When they differ, a result is beyond the proven bound or the unit's limits, or there is
            no C compiler.
        """
        from triaxcal.codegen.compiler import reference_under_way  # noqa: PLC0415
        from triaxcal.delivery.unit import deliver_fitted  # noqa: PLC0415

        with reference_under_way() as reference:
            return deliver_fitted(self._made.fitted, reference).check.total

    def write(self, folder: str | Path) -> tuple[Path, ...]:
        """Write the C and the image, all of them or none, into a folder of their own.

        Raises
        ------
        RefusedError
            When the folder holds anything else, or cannot be written.
        """
        target = Path(folder)
        publish(self.files, target)
        return tuple(target / name for name in self.files)

    def write_a2l(
        self,
        elf: str | Path,
        path: str | Path | None = None,
        *,
        variables: Sequence[str] = (),
        can_ids: tuple[int, int] | None = None,
        bitrate: int | None = None,
    ) -> Path:
        """Write the A2L of these constants with their addresses in a linked program.

        Parameters
        ----------
        elf : path
            The program as the linker wrote it, with its symbols.
        path : path or None
            File to write; None is triax_calib.a2l beside the program.
        variables : sequence of str
            The `triax_calib_t` that the program loads from an image. Without it the constants are
            those that triax_calib.c defines; they must be these.
        can_ids : tuple of two int, or None
            CAN identifiers of the XCP commands and of the answers; with bit 31 they are extended
            ones. None leaves XCP on CAN to the tool.
        bitrate : int or None
            Of the bus, in bit/s.

        Raises
        ------
        RefusedError
            When the file is no linked program, its constants are not these, or an identifier is
            none.
        """
        from triaxcal.api.a2lfile import write_linked_a2l, xcp_on_can  # noqa: PLC0415

        sensor = self._made.fitted.unit.temperature_sensor
        xcp = xcp_on_can(can_ids, bitrate)
        provenance = self._made.provenance
        return write_linked_a2l(
            elf, path, ((self.plan, sensor),), provenance, variables=variables, xcp=xcp
        )

    def write_node_a2l(
        self, path: str | Path, can_ids: tuple[int, int], *, bitrate: int | None = None
    ) -> Path:
        """Write the A2L of a node with `firmware_ref/xcp`: constants and signals, no program.

        Parameters
        ----------
        path : path
            File to write.
        can_ids : tuple of two int
            As `write_a2l` has them.
        bitrate : int or None
            Of the bus, in bit/s.

        Raises
        ------
        RefusedError
            When an identifier is none.
        """
        from triaxcal.report.a2l import XcpOnCan, node_a2l  # noqa: PLC0415

        target = Path(path)
        renew({target.name: node_a2l(self._made, XcpOnCan(*can_ids, bitrate))}, target.parent)
        return target

    def codes(
        self, raw_codes: Any, temp_codes: Any, rate_codes: Any
    ) -> tuple[Int32Array, Int32Array, Int32Array]:
        """Arguments of `apply`, checked: (n, 3), (n,), (n,)."""
        raw = int32("raw_codes", raw_codes, 3)
        temp = _one_or_all("temp_codes", temp_codes, len(raw))
        rate = _one_or_all("rate_codes", 0 if rate_codes is None else rate_codes, len(raw))
        return raw, temp, rate


class CompiledFirmware:
    """The generated C as a shared library of this machine."""

    def __init__(self, firmware: Firmware, library: ctypes.CDLL) -> None:
        self._firmware, self._library = firmware, library

    def apply(self, raw_codes: Any, temp_codes: Any, rate_codes: Any = None) -> Answers:
        """As `Firmware.apply`, by the compiled C."""
        raw, temp, rate = self._firmware.codes(raw_codes, temp_codes, rate_codes)
        plan = self._firmware.plan
        return routines_of(plan.rate, self._library, self._library, rate)[0].run(temp, raw)

    def angles(self, accel: Any) -> Angles:
        """As `Firmware.angles`, by the compiled C."""
        plan = self._firmware.angles_plan
        angle, status = GeneratedAngles(self._library, plan).run(int32("accel", accel, 3))
        return angle.astype(np.uint32 if plan.zenith else np.int32), status


def _one_or_all(name: str, value: Any, count: int) -> Int32Array:
    codes = int32(name, value)
    if codes.ndim and codes.shape != (count,):
        raise RefusedError(
            name,
            f"found the shape {codes.shape}",
            expected=f"one code, or ({count},) as the raw codes have",
        )
    return np.ascontiguousarray(np.broadcast_to(codes, (count,)))


def firmware(
    calibration: Calibration, prefix: str | None = None, arithmetic: str | None = None
) -> Firmware:
    """Integers of a calibration, by the method and formats that its unit states.

    Parameters
    ----------
    calibration : Calibration
    prefix : str or None
        What names in the C begin with; None is the unit's [firmware] prefix.
    arithmetic : str or None
        How the C forms its products; None is the unit's [firmware] arithmetic.

    Raises
    ------
    RefusedError
        When the calibration is beyond its unit's limits, its integers do not fit the format, or
        there is no such prefix or arithmetic.
    """
    if not isinstance(calibration, Calibration):
        raise RefusedError(
            "calibration", f"found a {type(calibration).__name__}", expected="a Calibration"
        )
    refuse_beyond_limits(calibration.fitted)
    return Firmware(calibration, prefix, arithmetic)
