"""The compiled C through ctypes: the generated routine and the reference, over arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from triaxcal.codegen.compiler import Compilation, compile_library
from triaxcal.codegen.forces import forces_of, rates_of
from triaxcal.errors import RefusedError
from triaxcal.fixedpoint.rate import RatePlan
from triaxcal.resources import shipped

Int32Array = npt.NDArray[np.int32]
UInt32Array = npt.NDArray[np.uint32]
Answers = tuple[Int32Array, UInt32Array]
"""Accelerations (n, 3) and status (n,)."""

Routine = Callable[[Int32Array, Int32Array], Answers]
"""Answers of temperature codes (n,) and raw codes (n, 3)."""


def start_reference(folder: Path) -> Compilation:
    """Start compiling the handwritten reference; it does not depend on the unit."""
    source = shipped("firmware_ref")
    return compile_library(
        [source / "triax_ref.c", source / "triax_ref_image.c"], folder / "triax_ref.so"
    )


def start_generated(folder: Path, target: Path) -> Compilation:
    """Start compiling the generated files in `folder` with the batch entry."""
    source = shipped("firmware_ref")
    return compile_library(
        [folder / "triax_comp.c", source / "triax_batch.c"],
        target / "triax_comp.so",
        include=[folder, source],
    )


def start_generated_imu(folder: Path, target: Path) -> Compilation:
    """Start compiling the generated files of an IMU in `folder` with the batch entries."""
    source = shipped("firmware_ref")
    names = ("triax_comp.c", "triax_gyro_comp.c", "triax_imu.c")
    batches = ("triax_batch.c", "triax_gyro_batch.c", "triax_imu_batch.c")
    return compile_library(
        [*(folder / name for name in names), *(source / name for name in batches)],
        target / "triax_imu.so",
        include=[folder, source],
    )


@dataclass(frozen=True)
class Reference:
    """The handwritten reference, which runs any image."""

    library: ctypes.CDLL

    def routine(self, image: bytes) -> Routine:
        """Bind an image."""

        def run(temp: Int32Array, raw: Int32Array) -> Answers:
            accel, status = _outputs(len(temp))
            refused = self.library.triax_ref_batch(
                image, ctypes.c_size_t(len(image)), ctypes.c_size_t(len(temp)),
                _pointer(temp), _pointer(raw), _pointer(accel), _pointer(status),
            )  # fmt: skip
            if refused:
                raise RefusedError("reference C", f"the image was refused (status {refused})")
            return accel, status

        return run


@dataclass(frozen=True)
class Generated:
    """The generated routine with the constants of triax_calib.h compiled in."""

    library: ctypes.CDLL

    @property
    def compiler(self) -> str:
        """Version of the compiler that built it."""
        function = self.library.triax_batch_compiler
        function.restype = ctypes.c_char_p
        return bytes(function()).decode()

    def run(self, temp: Int32Array, raw: Int32Array) -> Answers:
        """Answers with the compiled-in constants."""
        accel, status = _outputs(len(temp))
        self.library.triax_batch(
            ctypes.c_size_t(len(temp)),
            _pointer(temp), _pointer(raw), _pointer(accel), _pointer(status),
        )  # fmt: skip
        return accel, status

    def run_image(self, image: bytes, temp: Int32Array, raw: Int32Array) -> tuple[int, Answers]:
        """Status of triax_calib_load, and the answers with the constants of the image."""
        accel, status = _outputs(len(temp))
        loaded = self.library.triax_batch_image(
            image, ctypes.c_size_t(len(image)), ctypes.c_size_t(len(temp)),
            _pointer(temp), _pointer(raw), _pointer(accel), _pointer(status),
        )  # fmt: skip
        return int(loaded), (accel, status)


@dataclass(frozen=True)
class RateReference(Reference):
    """The handwritten reference with the rates of temperature of `rates_of`, or those given."""

    rate: RatePlan
    given: Int32Array | None = None

    def routine(self, image: bytes) -> Routine:
        """Bind an image."""

        def run(temp: Int32Array, raw: Int32Array) -> Answers:
            accel, status = _outputs(len(temp))
            rates = _rates(self.rate, self.given, temp)
            refused = self.library.triax_ref_batch_rate(
                image, ctypes.c_size_t(len(image)), ctypes.c_size_t(len(temp)),
                _pointer(temp), _pointer(rates), _pointer(raw), _pointer(accel), _pointer(status),
            )  # fmt: skip
            if refused:
                raise RefusedError("reference C", f"the image was refused (status {refused})")
            return accel, status

        return run


@dataclass(frozen=True)
class RateGenerated(Generated):
    """A generated routine with a term in dT/dt, with the rates of `rates_of`, or those given."""

    rate: RatePlan
    given: Int32Array | None = None

    def run(self, temp: Int32Array, raw: Int32Array) -> Answers:
        """Answers with the compiled-in constants."""
        return self._run(None, temp, raw)[1]

    def run_image(self, image: bytes, temp: Int32Array, raw: Int32Array) -> tuple[int, Answers]:
        """Status of triax_calib_load, and the answers with the constants of the image."""
        return self._run(image, temp, raw)

    def _run(self, image: bytes | None, temp: Int32Array, raw: Int32Array) -> tuple[int, Answers]:
        accel, status = _outputs(len(temp))
        rates = _rates(self.rate, self.given, temp)
        loaded = self.library.triax_batch_rate(
            image, ctypes.c_size_t(len(image or b"")), ctypes.c_size_t(len(temp)),
            _pointer(temp), _pointer(rates), _pointer(raw), _pointer(accel), _pointer(status),
        )  # fmt: skip
        return int(loaded), (accel, status)


@dataclass(frozen=True)
class GyroReference(Reference):
    """The handwritten reference of a gyro, with the forces of `forces_of`."""

    def routine(self, image: bytes) -> Routine:
        """Bind an image."""

        def run(temp: Int32Array, raw: Int32Array) -> Answers:
            rate, status = _outputs(len(temp))
            force = _forces(temp, raw)
            refused = self.library.triax_ref_batch_gyro(
                image, ctypes.c_size_t(len(image)), ctypes.c_size_t(len(temp)),
                _pointer(temp), _pointer(raw), _pointer(force), _pointer(rate), _pointer(status),
            )  # fmt: skip
            if refused:
                raise RefusedError("reference C", f"the image was refused (status {refused})")
            return rate, status

        return run


@dataclass(frozen=True)
class GyroGenerated(Generated):
    """A gyro's generated routine, with the forces of `forces_of`."""

    def run(self, temp: Int32Array, raw: Int32Array) -> Answers:
        """Answers with the compiled-in constants."""
        rate, status = _outputs(len(temp))
        force = _forces(temp, raw)
        self.library.triax_gyro_batch(
            ctypes.c_size_t(len(temp)),
            _pointer(temp), _pointer(raw), _pointer(force), _pointer(rate), _pointer(status),
        )  # fmt: skip
        return rate, status

    def run_image(self, image: bytes, temp: Int32Array, raw: Int32Array) -> tuple[int, Answers]:
        """Status of triax_gyro_calib_load, and the answers with the constants of the image."""
        rate, status = _outputs(len(temp))
        force = _forces(temp, raw)
        loaded = self.library.triax_gyro_batch_image(
            image, ctypes.c_size_t(len(image)), ctypes.c_size_t(len(temp)),
            _pointer(temp), _pointer(raw), _pointer(force), _pointer(rate), _pointer(status),
        )  # fmt: skip
        return int(loaded), (rate, status)


@dataclass(frozen=True)
class GeneratedImu:
    """Both triads in one call."""

    library: ctypes.CDLL

    def run(
        self, image: bytes | None, temp: Int32Array, raw_accel: Int32Array, raw_gyro: Int32Array
    ) -> tuple[int, tuple[Int32Array, Int32Array, UInt32Array]]:
        """Status of the loader (0 without an image); accelerations, rates and status."""
        accel, status = _outputs(len(temp))
        rate = np.zeros_like(accel)
        loaded = self.library.triax_imu_batch(
            image, ctypes.c_size_t(len(image or b"")), ctypes.c_size_t(len(temp)), _pointer(temp),
            _pointer(raw_accel), _pointer(raw_gyro), _pointer(accel), _pointer(rate),
            _pointer(status),
        )  # fmt: skip
        return int(loaded), (accel, rate, status)


def routines_of(
    rate: RatePlan | None,
    generated: ctypes.CDLL,
    reference: ctypes.CDLL,
    given: Int32Array | None = None,
) -> tuple[Generated, Reference]:
    """Generated routine and reference as the cross-check of an accelerometer calls them.

    `given` are rates in codes, one a vector, for vectors that have their own.
    """
    if rate is None:
        return Generated(generated), Reference(reference)
    return RateGenerated(generated, rate, given), RateReference(reference, rate, given)


def _rates(rate: RatePlan, given: Int32Array | None, temp: Int32Array) -> Int32Array:
    return rates_of(rate, temp).astype(np.int32) if given is None else given


def _forces(temp: Int32Array, raw: Int32Array) -> Int32Array:
    return np.ascontiguousarray(forces_of(temp, raw).astype(np.int32))


def _outputs(count: int) -> Answers:
    return np.zeros((count, 3), np.int32), np.zeros(count, np.uint32)


def _pointer(array: Int32Array | UInt32Array) -> ctypes.c_void_p:
    if not array.flags.c_contiguous:
        raise ValueError("arrays for C must be contiguous")
    return ctypes.c_void_p(array.ctypes.data)
