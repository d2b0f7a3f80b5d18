"""The C of an IMU in verification.json and the lines of the summary."""

from __future__ import annotations

from typing import Any

from triaxcal import __version__
from triaxcal.base.jsontext import json_bytes, sha256_of_files
from triaxcal.codegen.compiler import FLAGS
from triaxcal.codegen.crosscheck import CrossCheck
from triaxcal.codegen.imu import ImuBuild
from triaxcal.codegen.names import names_of, shape_id
from triaxcal.delivery.imu import ImuDelivery
from triaxcal.delivery.imuangles import not_in_them
from triaxcal.delivery.imuc import METHOD, ImuC
from triaxcal.dynamic.device import REQUIRED
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.proof import Bound
from triaxcal.report.a2l import Triad, linked_a2l
from triaxcal.report.words.angles import angles_document, angles_words, uncertainty_document
from triaxcal.report.words.firmware import checked_words, proven_words
from triaxcal.report.words.numbers import g_in_words, significant, thousands

VERIFICATION_FILE = "verification.json"
C_FILES = (
    "*_comp.h", "*_comp.c", "*_calib.h", "*_calib.c", "*_calib.a2l", "*_selftest.h",
    "*_selftest.c", "*_angles.h", "*_angles.c", "*_imu.h", "*_imu.c", "*_imu.bin",
    VERIFICATION_FILE,
)  # fmt: skip
"""What a unit with [device] receives besides; * is its prefix."""
NO_C = "none: unit.toml has no [device]; add it with " + ", ".join(REQUIRED)
FORMAT = 1


def imu_c_files(made: ImuDelivery) -> dict[str, bytes]:
    """Name and content of `C_FILES`; nothing if there is no C."""
    if made.c is None:
        return {}
    c = made.c
    name = names_of(c.build.accel).file("triax_calib.a2l")
    own = {name: imu_a2l(c), VERIFICATION_FILE: _verification_json(made, c)}
    return {**c.build.files, **own}


def imu_a2l(c: ImuC) -> bytes:
    """The constants of both triads for calibration tools; addresses are 0 until it is linked."""
    inputs = c.fitted.inputs_sha256
    triads = (
        Triad(c.build.accel, c.device.temperature_sensor, inputs),
        Triad(c.build.gyro, c.device.gyro_temperature_sensor, inputs),
    )
    return linked_a2l(triads, c.fitted.provenances[0])


def _verification_json(made: ImuDelivery, c: ImuC) -> bytes:
    build, unit = c.build, made.done.unit
    document: dict[str, Any] = {
        "format": FORMAT,
        "kind": "imu",
        "triaxcal": __version__,
        "unit": unit.name,
        "serial": unit.serial,
        "inputs_sha256": made.inputs_sha256,
        "compiler": build.compiler,
        "compiler_flags": list(FLAGS),
        "method": METHOD,
        "range_degc": list(c.device.range_degc),
        **({"gyro_range_degc": list(c.device.gyro_range)} if c.device.two_thermometers else {}),
        "not_corrected": list(c.fitted.left_out),
        "accelerometer": {
            **_triad(build.accel, build.accel_bound, build.accel_check),
            "bound_g": build.accel_bound.lsb * 2.0**-build.accel.shape.output_q,
            "model_error_g": c.accel_model_error_g,
            "error_g": c.accel_error_g,
        },
        "gyro": {
            **_triad(build.gyro, build.gyro_bound, build.gyro_check),
            "with_accelerometer_lsb": list(build.rate_bound_lsb),
            "with_accelerometer_deg_per_h": c.gyro_arithmetic_error_deg_per_h,
            "model_error_deg_per_h": c.gyro_model_error_deg_per_h,
            "error_deg_per_h": c.gyro_error_deg_per_h,
        },
        **_angles(made, c),
        "both_together_vectors": build.vectors,
        "mismatches": 0,
        "files_sha256": sha256_of_files(build.files),
    }
    return json_bytes(document)


def _angles(made: ImuDelivery, c: ImuC) -> dict[str, Any]:
    """As of a unit, and beside it what is known of the angles; nothing where there are none."""
    found = angles_document(c.build.angles, c.build.angles_check)
    known = uncertainty_document(made.angles)
    if known:
        missing = {"not_in_it": list(not_in_them(made.done))}
        found["angles"]["uncertainty"] = {**known["angles"], **missing}
    return found


def _triad(plan: Plan, bound: Bound, check: CrossCheck) -> dict[str, Any]:
    return {
        "shape": shape_id(plan),
        "output_q": plan.shape.output_q,
        "bound_lsb": bound.lsb,
        "per_axis_lsb": list(bound.per_axis_lsb),
        "largest_seen_lsb": check.largest_error_lsb,
        "temp_codes_visited": bound.codes,
        "vectors": check.vectors,
        "images": check.images,
    }


def _deg_per_h(gyro: Plan, lsb: float) -> float:
    return lsb * 2.0**-gyro.shape.output_q * 3600


def imu_verification(made: ImuDelivery) -> list[tuple[str, str]]:
    """What the delivery has shown of its C: rows for the page, nothing if there is no C."""
    if made.c is None:
        return []
    c, build = made.c, made.c.build
    accel_g = build.accel_bound.lsb * 2.0**-build.accel.shape.output_q
    own = significant(_deg_per_h(build.gyro, build.gyro_bound.lsb), 3)
    carried = max(build.rate_bound_lsb)
    gyro_model = f"{significant(c.gyro_model_error_deg_per_h)} °/h"
    model = f"{g_in_words(c.accel_model_error_g)} and {gyro_model}"
    rows = [
        (
            "Accelerometer: proven arithmetic error",
            proven_words(build.accel_bound, build.accel_check, g_in_words(accel_g)),
        ),
        (
            "Gyro: proven arithmetic error",
            proven_words(build.gyro_bound, build.gyro_check, f"{own} °/h")
            + f"; with the error carried over from the accelerometer ≤ {carried:.3f} LSB = "
            f"{significant(c.gyro_arithmetic_error_deg_per_h, 3)} °/h",
        ),
        (
            "Method against the fitted model",
            f"≤ {model} at every temperature code and any raw code",
        ),
        (
            "Arithmetic and method, the sum",
            f"≤ {g_in_words(c.accel_error_g)} and {significant(c.gyro_error_deg_per_h)} °/h",
        ),
        ("Accelerometer: cross-check", checked_words(build.accel_check)),
        ("Gyro: cross-check", checked_words(build.gyro_check)),
        (
            "Both together",
            f"{thousands(build.vectors)} vectors, constants and image: Python = generated C",
        ),
        *_angle_rows(build),
        (
            "Not corrected",
            "; ".join(c.fitted.left_out) or "nothing: every estimated effect is corrected",
        ),
    ]
    constant = constant_triads(made)
    if constant:
        rows.append(
            ("Constant over temperature", f"{' and '.join(constant)}: no temperature block")
        )
    return rows


def _angle_rows(build: ImuBuild) -> list[tuple[str, str]]:
    """What is proven of the angles' routine."""
    words = angles_words(build.angles, build.angles_check)
    if words is None:
        return []
    shown = (
        f"within {words.proven} arcsec of the exact ones of the accelerometer's result: "
        f"proven; {thousands(words.vectors)} vectors: Python = generated C"
    )
    return [(f"Angles, {words.names}", shown)]


def _with_functions(own: float, total: float) -> str:
    return f"and {own:.2g} of the fitted model: together {total:.3g}"


def constant_triads(made: ImuDelivery) -> list[str]:
    """Triads whose constants are the same over the whole range."""
    if made.done.over is not None:
        return []
    names = {block.name for block in made.done.result.layout.blocks}
    return [what for what in ("accelerometer", "gyro") if f"{what}-thermal" not in names]


def _own_thermometer(c: ImuC) -> list[str]:
    if not c.device.two_thermometers:
        return []
    low, high = c.device.gyro_range
    codes = thousands(c.build.gyro_bound.codes, " ")
    text = f"gyro by its own thermometer: {low:g} to {high:g} degC, {codes} temperature codes"
    return [f"                {text}"]


def _angle_lines(made: ImuDelivery, c: ImuC) -> list[str]:
    """Proven error of the routine, and how well the angles are known."""
    words = angles_words(c.build.angles, c.build.angles_check)
    known = made.angles
    if words is None or known is None:
        return []
    vectors = thousands(words.vectors, " ")
    first, second = (significant(float(u)) for u in known.over_range.max(axis=0))
    other = known.names[1]
    axis = "z" if c.build.angles is not None and c.build.angles.zenith else "x"
    return [
        f"  angles        {words.names}; proven within {words.proven} arcsec,",
        f"                {vectors} vectors: Python and generated C agree;",
        f"                uncertainty (95 %) {first} and {second} arcsec, {other} divided by",
        f"                the sine of the angle between axis {axis} and the plumb line",
    ]


def imu_c_lines(made: ImuDelivery) -> list[str]:
    """Lines of the summary."""
    if made.c is None:
        return [f"C               {NO_C}"]
    c, build = made.c, made.c.build
    low, high = c.device.range_degc
    accel_q, gyro_q = c.device.accel_q, c.device.gyro_rate_q
    accel, gyro = build.accel_bound.lsb, max(build.rate_bound_lsb)
    checked = build.accel_check.total + build.gyro_check.total + build.vectors
    codes = thousands(build.accel_bound.codes, " ")
    proven = (
        f"{accel:.3f} LSB, {accel * 2.0**-accel_q * 1e6:.3g} micro-g",
        f"{gyro:.3f} LSB, {c.gyro_arithmetic_error_deg_per_h:.3g} deg/h",
    )
    together = (
        _with_functions(c.accel_model_error_g * 1e6, c.accel_error_g * 1e6),
        _with_functions(c.gyro_model_error_deg_per_h, c.gyro_error_deg_per_h),
    )
    agree = f"{thousands(checked, ' ')} vectors: Python, reference C and generated C agree"
    lines = [
        f"C               both triads, {low:g} to {high:g} degC, {codes} temperature codes",
        *_own_thermometer(c),
        f"  accelerometer LSB 2^-{accel_q} g; proven within {proven[0]},",
        f"                {together[0]} micro-g",
        f"  gyro          LSB 2^-{gyro_q} deg/s; proven within {proven[1]},",
        f"                {together[1]} deg/h",
        f"  checked       {agree}",
    ]
    lines += _angle_lines(made, c)
    lines += [f"  not corrected {title}" for title in c.fitted.left_out]
    for what in constant_triads(made):
        lines += [
            f"  constant      {what} over temperature: [dynamic] blocks has no",
            f'                "{what}-thermal"',
        ]
    return lines
