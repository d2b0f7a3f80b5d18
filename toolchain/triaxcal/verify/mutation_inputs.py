"""What mutants are run on: the cross-check's vectors and images, with the answers, in files."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from triaxcal.codegen.compiler import start_reference
from triaxcal.codegen.crosscheck import VectorSet, python_routine, vector_sets
from triaxcal.codegen.forces import forces_of, rates_of
from triaxcal.codegen.image_cases import case_vectors, image_cases
from triaxcal.codegen.routines import (
    GyroReference,
    RateReference,
    Reference,
    Routine,
)
from triaxcal.fixedpoint.plan import Plan
from triaxcal.verify.workspace import Workspace


def write_vectors(plan: Plan, vectors: Path, answers: Path) -> None:
    """The cross-check's vectors, those of the images first, and Python's answers."""
    temp, raw = case_vectors(plan)
    sets = vector_sets(plan)
    order = sorted(sets, key=lambda v: v.name != "boundaries")
    routine = python_routine(plan)
    with vectors.open("wb") as given, answers.open("wb") as expected:
        for v in (VectorSet("images", temp, raw), *order):
            accel, status = routine(v.temp, v.raw)
            given.write(_given(plan, v.temp, v.raw))
            expected.write(_rows(accel, status.view(np.int32)))


def write_images(work: Workspace, path: Path) -> None:
    """Images of the cross-check with the status and the answers of the reference C."""
    reference = _reference(work)
    temp, raw = case_vectors(work.plan)
    with path.open("wb") as file:
        file.write(struct.pack("=I", len(temp)))
        for case in image_cases(work.plan, work.image):
            size = len(case.image)
            file.write(struct.pack("=II", size, 0 if case.accepted else 16))
            file.write(case.image + bytes(-size % 4))
            if case.accepted:
                accel, status = reference(case.image)(temp, raw)
                file.write(_rows(accel, status.view(np.int32)))


def _reference(work: Workspace) -> Callable[[bytes], Routine]:
    """The handwritten reference of the triad, which binds an image."""
    library, rate = start_reference(work.folder).load(), work.plan.rate
    if work.plan.shape.gyro:
        return GyroReference(library).routine
    return (Reference(library) if rate is None else RateReference(library, rate)).routine


def _given(plan: Plan, temp: npt.NDArray[np.int32], raw: npt.NDArray[np.int32]) -> bytes:
    """Rows of inputs: the codes, and what else the routine of the plan is given."""
    more = [] if plan.rate is None else [rates_of(plan.rate, temp)]
    return _rows(temp, raw, *more, *([forces_of(temp, raw)] if plan.shape.gyro else []))


def _rows(*columns: npt.NDArray[np.integer]) -> bytes:
    return np.column_stack(columns).astype(np.int32).tobytes()
