"""The compiled C through ctypes: the generated routine and the reference, over arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from triaxcal.codegen.compiler import Compilation, compile_library
from triaxcal.errors import RefusedError
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


def _outputs(count: int) -> Answers:
    return np.zeros((count, 3), np.int32), np.zeros(count, np.uint32)


def _pointer(array: Int32Array | UInt32Array) -> ctypes.c_void_p:
    if not array.flags.c_contiguous:
        raise ValueError("arrays for C must be contiguous")
    return ctypes.c_void_p(array.ctypes.data)
