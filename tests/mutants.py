"""One-line faults in the generated routine, by golden plan, that the vectors must notice."""

from __future__ import annotations

from typing import NamedTuple


class Mutant(NamedTuple):
    """What is wrong, a text of triax_comp.c, and what replaces its first occurrence."""

    what: str
    old: str
    new: str


MUTANTS: dict[str, list[Mutant]] = {
    "direct-checked": [
        Mutant(
            "high word truncated",
            "(-1 - (int32_t)((-1 - value) >> 32))",
            "(int32_t)(value / 4294967296)",
        ),
        Mutant("high word of the other half", "(int32_t)(value >> 32)", "(int32_t)(value >> 31)"),
        Mutant("final shift truncated", "(-1 - ((-1 - value) >> 3)) : (v", "(-(-value >> 3)) : (v"),
        Mutant("final shift one less", "accel[0] = apply_row(", "accel[0] = 2 * apply_row("),
        Mutant("final shift one more", ": (value >> 3)", ": (value >> 4)"),
        Mutant("rounding left out", "rounded(sum, row[3])", "rounded(sum, row[3] - 4)"),
        Mutant("lower end flagged", "code < calib->temp_min_code", "code <= calib->temp_min_code"),
        Mutant("upper end flagged", "code > calib->temp_max_code", "code >= calib->temp_max_code"),
        Mutant("lower clamp dropped", "code = calib->temp_min_code;", ";"),
        Mutant("upper clamp dropped", "code = calib->temp_max_code;", ";"),
        Mutant("wrong flag", "status = TRIAX_STATUS_TEMP_HIGH", "status = TRIAX_STATUS_TEMP_LOW"),
        Mutant("no raw flag", "status = TRIAX_STATUS_RAW_RANGE;", ";"),
        Mutant("raw clamp of y dropped", "uy = clamp_raw(uy);", ";"),
        Mutant("raw clamp to one less", "result = TRIAX_RAW_MAX;", "result = TRIAX_RAW_MAX - 1;"),
        Mutant("raw clamp to one more", "result = TRIAX_RAW_MIN;", "result = TRIAX_RAW_MIN + 1;"),
        Mutant("raw range one narrower", ">> 24u", ">> 23u"),
        Mutant("raw range one wider", ">> 24u", ">> 25u"),
        Mutant("z not looked at", "| above_min(uz)", "| 0u"),
        Mutant("swapped row and column", "times(row[1], uy)", "times(row[0], uy)"),
        Mutant("swapped axis", "times(row[0], ux)", "times(row[0], uy)"),
        Mutant(
            "offset of another axis",
            "apply_row(state->row[1], ux",
            "apply_row(state->row[2], ux",
        ),
        Mutant(
            "results swapped",
            "accel[1] = apply_row(state->row[1]",
            "accel[1] = apply_row(state->row[0]",
        ),
        Mutant("half the left shift", "uz *= 256;", "uz *= 128;"),
        Mutant("sign of a product", "+ times(row[1]", "- times(row[1]"),
        Mutant("wrong coefficient", "horner_step(c[1], x_q31, p)", "horner_step(c[0], x_q31, p)"),
        Mutant("Horner started low", "int32_t p = c[2];", "int32_t p = c[1];"),
        Mutant("wrong function", "coefficient[4u + j], x_q31", "coefficient[3u + j], x_q31"),
        Mutant("origin forgotten", "code - segment->origin_code", "code - segment->first_code"),
        Mutant("gain halved", "* segment->gain;", "* (segment->gain / 2);"),
    ],
    "direct-left-justified-piecewise": [
        Mutant("segment starts one late", "code >= calib->segment[i]", "code > calib->segment[i]"),
        Mutant(
            "segment before", "segment = &calib->segment[i];", "segment = &calib->segment[i - 1u];"
        ),
        Mutant(
            "last segment left out",
            "(uint32_t)TRIAX_SEGMENTS; i++",
            "(uint32_t)TRIAX_SEGMENTS - 1u; i++",
        ),
        Mutant(
            "Horner rounds",
            "high_word(times(x_q31, p))",
            "high_word(times(x_q31, p) + 2147483648)",
        ),
        Mutant(
            "32-bit product",
            "times(row[1], uy)",
            "(int64_t)(int32_t)((uint32_t)row[1] * (uint32_t)uy)",
        ),
    ],
    "inverse-saturating": [
        Mutant(
            "shift truncated",
            "asr64_29(int64_t value)\n{\n    return (value < 0) ? (-1 - ((-1 - value) >> 29))",
            "asr64_29(int64_t value)\n{\n    return (value < 0) ? (-(-value >> 29))",
        ),
        Mutant("saturation upwards dropped", "result = (int64_t)INT32_MAX;", ";"),
        Mutant(
            "saturation one low", "result = (int64_t)INT32_MIN;", "result = (int64_t)INT32_MIN + 1;"
        ),
        Mutant("not flagged", "return status | TRIAX_STATUS_SATURATED;", "return status;"),
        Mutant(
            "rounding of z left out",
            " + INT64_C(268435456);\n    sum_z = asr64_29",
            ";\n    sum_z = asr64_29",
        ),
        Mutant("shift of y one more", "sum_y = asr64_29(sum_y)", "sum_y = asr64_30(sum_y)"),
        Mutant(
            "minor's sign",
            "times(a, d) - times(b, c)",
            "times(b, c) - times(a, d)",
        ),
        Mutant("minor not transposed", "j2 = (j + 2u) % 3u", "j2 = (j + 1u) % 3u"),
        Mutant("reciprocal's sign", "(determinant < 0) ? -quotient : quotient", "quotient"),
        Mutant(
            "reciprocal halved",
            "INT64_C(2305843009213693952) / divisor",
            "INT64_C(1152921504606846976) / divisor",
        ),
        Mutant("gain not rounded", " + INT64_C(1073741824)", ""),
        Mutant("offset not rounded", "product + INT64_C(536870912)", "product"),
        Mutant("offset's sign", "saturate32(-asr64_30(product", "saturate32(asr64_30(product"),
        Mutant("bias of another axis", "row[j], u0[j]", "row[j], u0[0]"),
        Mutant(
            "determinant by the wrong row",
            "determinant_of(row[0], adjugate)",
            "determinant_of(row[1], adjugate)",
        ),
        Mutant(
            "determinant shift",
            "saturate32(asr64_29(determinant))",
            "saturate32(2 * asr64_29(determinant))",
        ),
        Mutant("range test one narrow", "> 14500000u", "> 14499999u"),
        Mutant(
            "one axis tested twice",
            "(above_min(uy) > ",
            "(above_min(ux) > ",
        ),
    ],
}
