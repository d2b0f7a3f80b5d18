"""Forms of the routine: which multiplications and assembly a shape has, and what they need."""

from __future__ import annotations

from triaxcal.fixedpoint.shape import Shape


def limb_split(shape: Shape) -> int:
    """Bits of the lower half of a raw code for TRIAX_LIMBS; 0 when the sums would not fit int32.

    With k = 16 + spare - raw_shift the halves of a code are below 2^k and at most 2^(15 - spare),
    and the high halves of a row of gains sum to at most 2^16 + 3. Then three products of two low
    halves stay below 3 * 2^(16 + k), of a low gain and a high code below 3 * 2^(31 - spare), and of
    a high gain and a low code below (2^16 + 3) * 2^k: with what is carried into them all are below
    2^31 for spare >= 2 and k <= 13.
    """
    if shape.adds_to_sums:
        return 0  # what is added needs the 64-bit sums
    spare = shape.output_shift - 32
    split = 16 + spare - shape.raw_shift
    return split if spare >= 2 and shape.raw_shift <= 16 and 1 <= split <= 13 else 0


def assembly(shape: Shape) -> dict[str, int]:
    """Which assembly there is for a shape, and its shifts; 0 for none.

    Keys: `thumb2` and `thumb1`, whether `triax_apply` has that form (with a state of its own), for
    `thumb1` the number of limbs of a gain; `evaluate`, whether the thermal functions have one too;
    `in_sum`, bits of the final shift that the assembly for Thumb-2 gets for nothing, because it
    shifts the raw codes by so many less; `completes`, whether C puts the offset for that in place,
    as it does where there is no `evaluate` and where dT/dt adds to the offset first.
    """
    thumb2 = int(not shape.saturates and not shape.adds_to_sums)
    evaluate = int(shape.order > 0 and shape.inverse is None)
    return {
        "thumb2": thumb2,
        "thumb1": 2 if limb_split(shape) else 3 * thumb2,
        "evaluate": evaluate,
        "completes": int(thumb2 and (not evaluate or shape.rate)),
        "in_sum": min(shape.raw_shift, shape.output_shift - 32) if thumb2 else 0,
    }


def forms_using(shape: Shape) -> dict[str, str]:
    """Condition of the preprocessor under which each helper of the routine is used.

    "1" stands for every form and "" for none: such a helper is left out.
    """
    given = assembly(shape)
    limbs, order = limb_split(shape) > 0, shape.order > 0
    in_asm_2 = bool(given["thumb2"]) and bool(given["evaluate"])
    in_asm_1 = bool(given["thumb1"]) and bool(given["evaluate"])
    plain_apply = not shape.saturates and not shape.adds_to_sums
    in_every_high_word = bool(shape.adds_to_sums or shape.rate)
    in_every_asr32 = bool(shape.adds_to_sums) and not shape.saturates
    return {
        "high_word": _condition(
            portable=order or plain_apply or in_every_high_word,
            limbs=(plain_apply and not limbs) or in_every_high_word,
            thumb2=(order and not in_asm_2) or in_every_high_word,
            thumb1=in_every_high_word,
        ),
        "asr32": _condition(
            portable=plain_apply or in_every_asr32,
            limbs=plain_apply or order or in_every_asr32,
            thumb2=(given["completes"] and given["in_sum"] > 0) or in_every_asr32,
            thumb1=plain_apply or order or in_every_asr32,
        ),
        "high_half": _condition(limbs=limbs or order, thumb1=given["thumb1"] == 2 or order),
        "low_half": _condition(limbs=limbs or order, thumb1=given["thumb1"] == 2 or order),
        "int64_horner": _condition(portable=order, thumb2=order and not in_asm_2),
        "limb_horner": _condition(limbs=order, thumb1=order),
        "short_horner": _condition(limbs=order, thumb1=order and not in_asm_1),
        "evaluate_state": _condition(thumb2=in_asm_2, thumb1=in_asm_1),
        "int64_apply": _condition(portable=plain_apply, limbs=plain_apply and not limbs),
        "left_justify": _condition(
            portable=True, limbs=not limbs, thumb1=given["thumb1"] != 2, thumb2=not plain_apply
        ),
        "complete": _condition(
            thumb2=bool(given["completes"]), thumb1=plain_apply and not in_asm_1
        ),
    }


def _condition(
    *, portable: bool = False, limbs: bool = False, thumb2: bool = False, thumb1: bool = False
) -> str:
    """The shortest #if that holds for just these forms; "1" for all, "" for none."""
    wanted = {"PORTABLE": portable, "LIMBS": limbs, "THUMB2": thumb2, "THUMB1": thumb1}
    inside = [name for name, wants in wanted.items() if wants]
    outside = [name for name, wants in wanted.items() if not wants]
    if not outside:
        return "1"
    if len(outside) == 1:
        return f"TRIAX_ARITHMETIC != TRIAX_{outside[0]}"
    if len(inside) == 1:
        return f"TRIAX_ARITHMETIC == TRIAX_{inside[0]}"
    return " || ".join(f"(TRIAX_ARITHMETIC == TRIAX_{name})" for name in inside)
