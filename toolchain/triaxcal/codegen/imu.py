"""The C of a whole IMU: both triads planned, rendered, proven and cross-checked."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.codegen.angles import angles_plan, render_angles
from triaxcal.codegen.angles_check import AnglesCheck, check_angles
from triaxcal.codegen.annotations import (
    imu_loader_not_covered,
    imu_not_covered,
    with_contracts,
    without_annotations,
)
from triaxcal.codegen.compiler import library_folder, start_reference
from triaxcal.codegen.constants import Provenance, render_constants
from triaxcal.codegen.crosscheck import RANDOM_VECTORS, CrossCheck, cross_check, vector_sets
from triaxcal.codegen.identity import IDENTITY_SIZE, with_identity
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.image_cases import check_images, image_cases
from triaxcal.codegen.names import imu_context, names_of
from triaxcal.codegen.render import render_routine
from triaxcal.codegen.routines import (
    Generated,
    GeneratedImu,
    GyroGenerated,
    GyroReference,
    Int32Array,
    Reference,
    UInt32Array,
    routines_of,
    start_generated_imu,
)
from triaxcal.codegen.selftest import check_selftest, render_selftest
from triaxcal.codegen.templates import render
from triaxcal.fixedpoint.angles import AnglesPlan
from triaxcal.fixedpoint.gyro import make_gyro_plan
from triaxcal.fixedpoint.integer_model import STATUS_BAD_IMAGE, STATUS_OK, apply, set_temperature
from triaxcal.fixedpoint.plan import Plan, Triad, make_plan
from triaxcal.fixedpoint.proof import Bound, prove
from triaxcal.model.methods.imu import ImuCompensation
from triaxcal.unit.angles import AnglesChoice

IMU_FILES = ("triax_imu.h", "triax_imu.c")
IMU_IMAGE_FILE = "triax_imu.bin"
GYRO_STATUS = 256
"""The gyro's status bits stand above the accelerometer's."""
SEED = 20130529


@dataclass(frozen=True)
class ImuBuild:
    """Everything that the firmware of an IMU takes, and what was shown of it.

    Attributes
    ----------
    accel, gyro : Plan
    accel_bound, gyro_bound : Bound
        Proven errors; the gyro's for the specific force that it is given.
    rate_bound_lsb : tuple of three floats
        The gyro's bound with the accelerometer's error carried through the g-sensitivity.
    accel_check, gyro_check : CrossCheck
        Vectors on which three implementations of each agreed.
    vectors : int
        Vectors on which both together agreed with Python, compiled in and from the image.
    files : dict
        Name and content.
    compiler : str
        The compiler of the check, and its version.
    two_thermometers : bool
        Whether the gyro is compensated by the codes of a thermometer of its own.
    angles, angles_check : AnglesPlan and AnglesCheck, or None
        Of the angles, where the device makes them of the accelerometer's result.
    """

    accel: Plan
    gyro: Plan
    accel_bound: Bound
    gyro_bound: Bound
    rate_bound_lsb: tuple[float, float, float]
    accel_check: CrossCheck
    gyro_check: CrossCheck
    vectors: int
    files: dict[str, bytes]
    compiler: str
    two_thermometers: bool = False
    angles: AnglesPlan | None = None
    angles_check: AnglesCheck | None = None


def build_imu(
    imu: ImuCompensation,
    triads: tuple[Triad, Triad],
    provenances: tuple[Provenance, Provenance],
    random_vectors: int = RANDOM_VECTORS,
    *,
    two_thermometers: bool = False,
    choice: AnglesChoice | None = None,
) -> ImuBuild:
    """Plan, render, prove and check the C of an IMU; pairs are of accelerometer and gyro.

    `choice` is that of the angles, where the device makes them.

    Raises
    ------
    RefusedError
        When no format holds, a check fails or the compiler is missing.
    """
    accel = replace(make_plan(imu.accel, triads[0]), reading="g")
    gyro = replace(make_gyro_plan(imu, triads[1], accel.shape.output_q), reading="rad/s")
    angles = None if choice is None else angles_plan(choice, accel)
    files = render_imu(
        accel, gyro, triads, provenances, two_thermometers=two_thermometers, angles=angles
    )
    bounds = prove(accel), prove(gyro)
    with library_folder() as folder:
        for file, content in files.items():
            (folder / file).write_bytes(content)
        reference = start_reference(folder).load()
        compilation = start_generated_imu(folder, folder, accel.prefix)
        library = compilation.load()
        compiler = compilation.compiler.called(Generated(library).compiler)
        checks = (
            _check(accel, routines_of(accel.rate, library, reference), random_vectors),
            _check(gyro, (GyroGenerated(library), GyroReference(reference)), random_vectors),
        )
        for plan, provenance in zip((accel, gyro), provenances, strict=True):
            check_selftest(plan, provenance, library)
        angles_check = None if angles is None else check_angles(angles, library)
        image = files[names_of(accel).file(IMU_IMAGE_FILE)]
        samples = imu_vectors(accel, gyro, two_thermometers=two_thermometers)
        vectors = _check_both(accel, gyro, GeneratedImu(library), image, samples)
    for what, bound, check in zip(("accelerometer", "gyro"), bounds, checks, strict=True):
        if check.largest_error_lsb > bound.lsb:
            raise RefusedError(
                what,
                f"a sample is {check.largest_error_lsb:.4f} LSB off",
                expected=f"at most the proven {bound.lsb:.4f} LSB",
                remedy="the proof is wrong: this is a fault in triaxcal, report it",
            )
    carried = rate_bound(gyro, bounds[1], bounds[0])
    found = ImuBuild(accel, gyro, *bounds, carried, *checks, vectors, files, compiler)
    return replace(
        found, two_thermometers=two_thermometers, angles=angles, angles_check=angles_check
    )


def render_imu(
    accel: Plan,
    gyro: Plan,
    triads: tuple[Triad, Triad],
    provenances: tuple[Provenance, Provenance],
    *,
    two_thermometers: bool = False,
    angles: AnglesPlan | None = None,
) -> dict[str, bytes]:
    """Every file of an IMU, by name."""
    texts = {**render_routine(accel), **render_routine(gyro)}
    each = tuple(zip((accel, gyro), triads, provenances, strict=True))
    for plan, triad, provenance in each:
        texts |= render_constants(plan, triad.temperature_sensor, provenance)
        texts |= render_selftest(plan, provenance)
    names = names_of(accel)
    texts |= delivered_imu(accel, gyro, two_thermometers=two_thermometers)
    texts |= {} if angles is None else render_angles(angles, names)
    files = {name: text.encode() for name, text in texts.items()}
    files[names.file(IMU_IMAGE_FILE)] = b"".join(
        with_identity(image_bytes(plan), triad.temperature_sensor, provenance)
        for plan, triad, provenance in each
    )
    return files


def delivered_imu(accel: Plan, gyro: Plan, *, two_thermometers: bool) -> dict[str, str]:
    """Texts of `IMU_FILES` by name, with contracts where they are proven."""
    covered = not imu_not_covered(accel.shape, gyro.shape)
    kept = with_contracts if covered else without_annotations
    texts = annotated_imu(accel, gyro, two_thermometers=two_thermometers)
    return {name: kept(text) for name, text in texts.items()}


def annotated_imu(accel: Plan, gyro: Plan, *, two_thermometers: bool) -> dict[str, str]:
    """The same with every step of the proof."""
    names = names_of(accel)
    context = imu_context(accel, gyro, two_thermometers=two_thermometers)
    context |= {
        "accel_shape": accel.shape,
        "gyro_shape": gyro.shape,
        "loader_proven": not imu_loader_not_covered(accel.shape, gyro.shape),
        "unproven": without_annotations,
    }
    shapes = f"shapes {names.shape} and {names_of(gyro).shape}"
    return dict(render(name, shapes, names, **context) for name in IMU_FILES)


def rate_bound(gyro: Plan, own: Bound, accel: Bound) -> tuple[float, float, float]:
    """Bound of each rate, LSB, when the specific force is off by the accelerometer's bound.

    It was in the sum with the weight of the g-sensitivity's words: fixed-point.md, step G.
    """
    assert gyro.sensitivity is not None
    weight = np.abs(gyro.sensitivity) * 2.0**-gyro.shape.output_shift
    x, y, z = (
        # Seven roundings of some 2^-53 each; this is a figure for readers, and rounded up.
        (1 + 2.0**-49) * (b + float(row @ np.array(accel.per_axis_lsb)))
        for b, row in zip(own.per_axis_lsb, weight, strict=True)
    )
    return x, y, z


def _check(plan: Plan, routines: tuple[Generated, Reference], count: int) -> CrossCheck:
    image = image_bytes(plan)
    generated, reference = routines
    check = cross_check(plan, vector_sets(plan, count), generated, reference.routine(image), image)
    return replace(check, images=check_images(plan, image_cases(plan, image), generated, reference))


def _check_both(
    accel: Plan, gyro: Plan, generated: GeneratedImu, image: bytes, samples: ImuVectors
) -> int:
    """Random samples of both triads, in range and any, against Python; and the joint image."""
    temp, raw_accel, raw_gyro, gyro_temp = samples
    expected = imu_answers(accel, gyro, samples)
    bare = image_bytes(accel) + image_bytes(gyro)
    for given in (None, image, bare):
        loaded, found = generated.run(given, *samples)
        if loaded != STATUS_OK:
            raise RefusedError("triax_imu_calib_load", f"refused its own image: status {loaded}")
        differs = np.zeros(len(temp), np.bool_)
        for f, e in zip(found, expected, strict=True):
            differs |= (f != e).reshape(len(temp), -1).any(axis=1)
        if differs.any():
            i = int(differs.argmax())
            raise RefusedError(
                f"cross-check of triax_imu_apply, temp_code {temp[i]}, of the gyro {gyro_temp[i]}, "
                f"raw_accel {raw_accel[i].tolist()}, raw_gyro {raw_gyro[i].tolist()}",
                f"{found[0][i].tolist()}, {found[1][i].tolist()}, status {found[2][i]}",
                expected=f"{expected[0][i].tolist()}, {expected[1][i].tolist()}, "
                f"status {expected[2][i]}",
                remedy="do not use this build, report it",
            )
    accel_size = len(image_bytes(accel)) + IDENTITY_SIZE
    damaged = {
        "cut": image[:-4], "too long": image + bytes(4), "accelerometer alone": image[:accel_size],
        "exchanged": image[accel_size:] + image[:accel_size], "accelerometer's last byte":
        _flipped(image, accel_size - 1), "gyro's last byte": _flipped(image, len(image) - 1),
    }  # fmt: skip
    for name, wrong in damaged.items():
        loaded, _ = generated.run(wrong, *(values[:1] for values in samples))
        if loaded != STATUS_BAD_IMAGE:
            raise RefusedError(
                f"triax_imu_calib_load, image '{name}'",
                f"status {loaded}",
                expected=f"status {STATUS_BAD_IMAGE}",
                remedy="do not use this build, report it",
            )
    return len(temp)


def _flipped(image: bytes, at: int) -> bytes:
    return image[:at] + bytes([image[at] ^ 1]) + image[at + 1 :]


ImuVectors = tuple[Int32Array, Int32Array, Int32Array, Int32Array]
"""Temperature codes, raw codes of accelerometer and gyro, temperature codes of the gyro."""


def imu_vectors(accel: Plan, gyro: Plan, *, two_thermometers: bool = False) -> ImuVectors:
    """Temperature codes and raw codes of both triads: half in range, half any int32.

    Either triad alone is out of its range in a quarter each, to distinguish their status bits.
    """
    rng = np.random.Generator(np.random.PCG64(SEED))
    count = 10_000

    def codes(low: int, high: int, width: int) -> Int32Array:
        size = (count, width)
        near = rng.integers(low, high, size, dtype=np.int32, endpoint=True)
        anything = rng.integers(-(2**31), 2**31 - 1, size, dtype=np.int32, endpoint=True)
        return np.concatenate([near, anything])

    temp = codes(accel.temp_min_code, accel.temp_max_code, 1)[:, 0].copy()
    raw_accel = codes(accel.shape.raw_min, accel.shape.raw_max, 3)
    raw_gyro = np.roll(codes(gyro.shape.raw_min, gyro.shape.raw_max, 3), count // 2, axis=0)
    if not two_thermometers:
        return temp, raw_accel, raw_gyro, temp
    own = codes(gyro.temp_min_code, gyro.temp_max_code, 1)[:, 0]
    return temp, raw_accel, raw_gyro, np.roll(own, count // 4)


def imu_answers(
    accel: Plan, gyro: Plan, samples: ImuVectors
) -> tuple[Int32Array, Int32Array, UInt32Array]:
    """What Python makes of samples of both triads: accelerations, rates and status."""
    temp, raw_accel, raw_gyro, gyro_temp = samples
    state, accel_status = set_temperature(accel, temp.astype(np.int64))
    force, flags = apply(accel, state, raw_accel.astype(np.int64))
    state, gyro_status = set_temperature(gyro, gyro_temp.astype(np.int64))
    rate, gyro_flags = apply(gyro, state, raw_gyro.astype(np.int64), force)
    status = (accel_status | flags) | (gyro_status | gyro_flags) * GYRO_STATUS
    return force.astype(np.int32), rate.astype(np.int32), status.astype(np.uint32)
