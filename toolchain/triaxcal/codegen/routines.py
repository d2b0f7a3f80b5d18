"""The compiled C through ctypes: the generated routine and the reference, over arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from triaxcal.base.errors import RefusedError
from triaxcal.base.shipped import shipped
from triaxcal.codegen.compiler import Compilation, compile_library
from triaxcal.codegen.forces import forces_of, rates_of
from triaxcal.codegen.objects import SharedObjects
from triaxcal.codegen.shim import write_shim
from triaxcal.fixedpoint.rate import RatePlan
from triaxcal.unit.prefix import DEFAULT_PREFIX

Int32Array = npt.NDArray[np.int32]
UInt32Array = npt.NDArray[np.uint32]
Answers = tuple[Int32Array, UInt32Array]
"""Accelerations (n, 3) and status (n,)."""

Routine = Callable[[Int32Array, Int32Array], Answers]
"""Answers of temperature codes (n,) and raw codes (n, 3)."""


@dataclass(frozen=True)
class Difference:
    """Where answers differ first: its index, how many do, and both answers there in words."""

    first: int
    count: int
    found: str
    expected: str


def difference(found: Answers, expected: Answers) -> Difference | None:
    """How answers differ from the expected ones; None where they are equal."""
    if np.array_equal(found[0], expected[0]) and np.array_equal(found[1], expected[1]):
        return None
    differs = (found[0] != expected[0]).any(axis=1) | (found[1] != expected[1])
    i = int(differs.argmax())
    words = [f"{accel[i].tolist()} status {status[i]}" for accel, status in (found, expected)]
    return Difference(i, int(differs.sum()), *words)


def start_generated(
    folder: Path,
    target: Path,
    prefix: str = DEFAULT_PREFIX,
    objects: SharedObjects | None = None,
) -> Compilation:
    """Start compiling the generated files in `folder` with the batch entry, into `target`.

    The routine, which has no constants of the unit, may come from `objects`.
    """
    return _start(folder, target, prefix, ("comp", "calib"), ("batch",), objects=objects)


def start_generated_imu(folder: Path, target: Path, prefix: str = DEFAULT_PREFIX) -> Compilation:
    """Start compiling the generated files of an IMU in `folder` with the batch entries."""
    names = ("comp", "calib", "gyro_comp", "gyro_calib", "imu")
    return _start(folder, target, prefix, names, ("batch", "gyro_batch", "imu_batch"))


def _start(
    folder: Path,
    target: Path,
    prefix: str,
    names: Sequence[str],
    batches: Sequence[str],
    *,
    objects: SharedObjects | None = None,
) -> Compilation:
    """Compile the files of `names`, the self-tests and the angles where there are any."""
    source = shipped("firmware_ref")
    shim = write_shim(target / "names", prefix)
    sources = [folder / f"{prefix}_{name}.c" for name in names]
    if objects is not None:
        sources[0] = objects.instead_of(sources[0])
    tests = (folder / f"{prefix}_{name}.c" for name in ("selftest", "gyro_selftest"))
    sources += [test for test in tests if test.exists()]
    sources += [source / f"{DEFAULT_PREFIX}_{name}.c" for name in batches]
    if (angles := folder / f"{prefix}_angles.c").exists():
        sources += [angles, source / f"{DEFAULT_PREFIX}_angles_batch.c"]
    library = target / f"{prefix}_{names[-1]}"
    return compile_library(sources, library, include=[folder, *shim, source])


@dataclass(frozen=True)
class Reference:
    """The handwritten reference, which runs any image."""

    library: ctypes.CDLL
    entry: ClassVar[str] = "triax_ref_batch"

    def routine(self, image: bytes) -> Routine:
        """Bind an image."""

        def run(temp: Int32Array, raw: Int32Array) -> Answers:
            function = getattr(self.library, self.entry)
            refused, answers = _call(function, _image(image), self._inputs(temp, raw))
            if refused:
                raise RefusedError("reference C", f"the image was refused (status {refused})")
            return answers

        return run

    def _inputs(self, temp: Int32Array, raw: Int32Array) -> tuple[Int32Array, ...]:
        return temp, raw


@dataclass(frozen=True)
class Generated:
    """The generated routine with the constants of triax_calib.h compiled in."""

    library: ctypes.CDLL
    entry: ClassVar[str] = "triax_batch"

    @property
    def compiler(self) -> str:
        """Version of the compiler that built it, by what it defines as __VERSION__."""
        function = self.library.triax_batch_compiler
        function.restype = ctypes.c_char_p
        return bytes(function()).decode(errors="replace").partition(" (")[0].strip()

    def run(self, temp: Int32Array, raw: Int32Array) -> Answers:
        """Answers with the compiled-in constants."""
        return _call(getattr(self.library, self.entry), (), self._inputs(temp, raw))[1]

    def run_image(self, image: bytes, temp: Int32Array, raw: Int32Array) -> tuple[int, Answers]:
        """Status of the loader, and the answers with the constants of the image."""
        function = getattr(self.library, f"{self.entry}_image")
        return _call(function, _image(image), self._inputs(temp, raw))

    def _inputs(self, temp: Int32Array, raw: Int32Array) -> tuple[Int32Array, ...]:
        return temp, raw


@dataclass(frozen=True)
class RateReference(Reference):
    """The handwritten reference with the rates of temperature of `rates_of`, or those given."""

    rate: RatePlan
    given: Int32Array | None = None
    entry: ClassVar[str] = "triax_ref_batch_rate"

    def _inputs(self, temp: Int32Array, raw: Int32Array) -> tuple[Int32Array, ...]:
        return temp, _rates(self.rate, self.given, temp), raw


@dataclass(frozen=True)
class RateGenerated(Generated):
    """A generated routine with a term in dT/dt, with the rates of `rates_of`, or those given."""

    rate: RatePlan
    given: Int32Array | None = None

    def run(self, temp: Int32Array, raw: Int32Array) -> Answers:
        """Answers with the compiled-in constants."""
        return self._call_rate(None, temp, raw)[1]

    def run_image(self, image: bytes, temp: Int32Array, raw: Int32Array) -> tuple[int, Answers]:
        """Status of the loader, and the answers with the constants of the image."""
        return self._call_rate(image, temp, raw)

    def _call_rate(
        self, image: bytes | None, temp: Int32Array, raw: Int32Array
    ) -> tuple[int, Answers]:
        inputs = temp, _rates(self.rate, self.given, temp), raw
        return _call(self.library.triax_batch_rate, _image(image), inputs)


@dataclass(frozen=True)
class GyroReference(Reference):
    """The handwritten reference of a gyro, with the forces of `forces_of`."""

    entry: ClassVar[str] = "triax_ref_batch_gyro"

    def _inputs(self, temp: Int32Array, raw: Int32Array) -> tuple[Int32Array, ...]:
        return temp, raw, _forces(temp, raw)


@dataclass(frozen=True)
class GyroGenerated(Generated):
    """A gyro's generated routine, with the forces of `forces_of`."""

    entry: ClassVar[str] = "triax_gyro_batch"

    def _inputs(self, temp: Int32Array, raw: Int32Array) -> tuple[Int32Array, ...]:
        return temp, raw, _forces(temp, raw)


@dataclass(frozen=True)
class GeneratedImu:
    """Both triads in one call."""

    library: ctypes.CDLL

    def run(
        self,
        image: bytes | None,
        temp: Int32Array,
        raw_accel: Int32Array,
        raw_gyro: Int32Array,
        gyro_temp: Int32Array | None = None,
    ) -> tuple[int, tuple[Int32Array, Int32Array, UInt32Array]]:
        """Status of the loader (0 without an image); accelerations, rates and status.

        `gyro_temp` are codes of the gyros' own thermometer, where they have one.
        """
        gyro_temp = temp if gyro_temp is None else gyro_temp
        accel, status = _outputs(len(temp))
        rate = np.zeros_like(accel)
        loaded = self.library.triax_imu_batch(
            image, ctypes.c_size_t(len(image or b"")), ctypes.c_size_t(len(temp)), _pointer(temp),
            _pointer(gyro_temp), _pointer(raw_accel), _pointer(raw_gyro), _pointer(accel),
            _pointer(rate), _pointer(status),
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


def _call(
    function: Callable[..., int], image: tuple[object, ...], inputs: tuple[Int32Array, ...]
) -> tuple[int, Answers]:
    """What the entry returned (a status, where it takes an image) and the answers."""
    results, status = _outputs(len(inputs[0]))
    loaded = function(
        *image,
        ctypes.c_size_t(len(inputs[0])),
        *map(_pointer, inputs),
        _pointer(results),
        _pointer(status),
    )
    return int(loaded), (results, status)


def _image(image: bytes | None) -> tuple[object, ...]:
    return image, ctypes.c_size_t(len(image or b""))


def _rates(rate: RatePlan, given: Int32Array | None, temp: Int32Array) -> Int32Array:
    if given is not None:
        return given
    return np.ascontiguousarray(rates_of(rate, temp).astype(np.int32))


def _forces(temp: Int32Array, raw: Int32Array) -> Int32Array:
    return np.ascontiguousarray(forces_of(temp, raw).astype(np.int32))


def _outputs(count: int) -> Answers:
    return np.zeros((count, 3), np.int32), np.zeros(count, np.uint32)


def _pointer(array: Int32Array | UInt32Array) -> ctypes.c_void_p:
    if not array.flags.c_contiguous:
        raise ValueError("arrays for C must be contiguous")
    return ctypes.c_void_p(array.ctypes.data)
