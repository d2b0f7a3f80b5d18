"""Forms of the routine: which multiplications and assembly a shape has, and what they need."""

from __future__ import annotations

from triaxcal.fixedpoint.shape import Shape
from triaxcal.unit.arithmetic import HIGH_WORDS, LIMBS, PORTABLE, THUMB1, THUMB2


def limb_split(shape: Shape) -> int:
    """Bits of the lower half of a raw code for limbs; 0 when the sums would not fit int32.

    With k = 16 + spare - raw_shift the halves of a code are below 2^k and at most 2^(15 - spare),
    and the high halves of a row of gains sum to at most 2^16 + 3. Then three products of two low
    halves stay below 3 * 2^(16 + k), of a low gain and a high code below 3 * 2^(31 - spare), and of
    a high gain and a low code below (2^16 + 3) * 2^k: with what is carried into them all are below
    2^31 for spare >= 2 and k <= 13.
    """
    if shape.adds_to_sums or shape.high_words:
        return 0  # what is added needs the 64-bit sums; high words have no other form
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
    thumb2 = int(not (shape.saturates or shape.adds_to_sums or shape.high_words))
    evaluate = int(shape.order > 0 and shape.inverse is None)
    return {
        "thumb2": thumb2,
        "thumb1": 2 if limb_split(shape) else 3 * thumb2,
        "evaluate": evaluate,
        "completes": int(thumb2 and (not evaluate or shape.rate)),
        "in_sum": min(shape.raw_shift, shape.output_shift - 32) if thumb2 else 0,
    }


def form_of(shape: Shape, asked: str) -> str:
    """The arithmetic that a shape has for the one asked: that one, or the next best.

    Limbs stand for Thumb-1 assembly and the portable form for the others. Sums of high words are a
    shape, whose form is the portable one.
    """
    given = assembly(shape)
    if asked == THUMB1 and not given["thumb1"]:
        asked = LIMBS
    has = {
        THUMB2: given["thumb2"],
        LIMBS: shape.order or limb_split(shape),
        HIGH_WORDS: False,
    }.get(asked, True)
    return asked if has else PORTABLE


def row_words(shape: Shape, form: str) -> int:
    """Words of a row of the state; those beyond 4 are the assembly's own."""
    return {THUMB2: 5, THUMB1: 7 if limb_split(shape) else 10}.get(form, 4)


def helpers(shape: Shape, form: str) -> dict[str, int]:
    """Which functions the routine has in a form; what it does not use is left out.

    `left_shift` is the number of bits by which it shifts raw codes to the left.
    """
    given, limbs, order = assembly(shape), limb_split(shape) > 0, shape.order > 0
    thumb = form in (THUMB1, THUMB2)
    in_assembly = thumb and given["evaluate"] > 0
    halved = form in (LIMBS, THUMB1)
    sums = form == PORTABLE or (form == LIMBS and not limbs)
    horner = order and not halved and not in_assembly
    adds = shape.quadratic or shape.rate
    halves = halved and (order or limbs)
    shift = {
        LIMBS: 0 if limbs else shape.raw_shift,
        THUMB1: 0 if given["thumb1"] == 2 else shape.raw_shift,
        THUMB2: shape.raw_shift - given["in_sum"],
    }
    return {
        "high_word": horner or adds or (sums and not shape.saturates),
        "asr32": halved or (form == THUMB2 and given["completes"] and given["in_sum"]),
        "asr32_spare": sums and not shape.saturates,
        "times": horner or sums or adds or shape.inverse is not None,
        "horner": horner,
        "halves": halves,
        "long_horner": order and halved,
        "short_horner": order and halved and not in_assembly,
        "evaluate_state": in_assembly,
        "complete": given["completes"] if form == THUMB2 else thumb and not in_assembly,
        "left_shift": shift.get(form, shape.raw_shift),
    }


def shifts_64(shape: Shape) -> list[int]:
    """Shifts of 64-bit sums to the right."""
    shifts = {shape.output_shift} if shape.saturates else set()
    i = shape.inverse
    if i is not None:
        shifts |= {2, 30, i.adjugate_shift, i.determinant_shift, i.gain_shift}
    return sorted(shifts)
