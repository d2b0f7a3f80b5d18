"""ACSL in the C: contracts before functions, and steps of the proof inside them.

The delivered portable C keeps the contracts of a shape whose contracts are proven. Loop
invariants and assertions are for the prover: they stay in the text that it reads. The other forms
and shapes have none, since a contract that nobody proves may be wrong.
"""

from __future__ import annotations

import re

from triaxcal.fixedpoint.shape import Shape

_STEP = re.compile(r"^ +/\*@.*?\*/\n", re.MULTILINE | re.DOTALL)
_CONTRACT = re.compile(r"^/\*@.*?\*/\n", re.MULTILINE | re.DOTALL)


def with_contracts(text: str) -> str:
    """The C without the steps of the proof."""
    return _STEP.sub("", text)


def without_annotations(text: str) -> str:
    """The C without contracts and steps."""
    return _CONTRACT.sub("", with_contracts(text))


def blanked_contracts(text: str) -> str:
    """Delivered C with empty lines where its contracts are."""
    return _CONTRACT.sub(lambda found: "\n" * found[0].count("\n"), text)


def loader_not_covered(shape: Shape) -> str:
    """Which part of a shape has no contracts in its loader; "" where all have them."""
    parts = {
        "quadratic terms": shape.quadratic,
        "functions of order 6 and above": shape.order > 5,
    }
    return next((name for name, has in parts.items() if has), "")


def not_covered(shape: Shape) -> str:
    """Which part of a shape has no complete contracts; "" where all have them."""
    inverse = shape.inverse is not None
    whole = shape.raw_max - shape.raw_min == 2**32 - 1
    parts = {
        "quadratic terms in the inverse form": shape.quadratic and inverse,
        "quadratic terms with a term in dT/dt": shape.quadratic and shape.rate,
        "quadratic terms with saturating results": shape.quadratic and shape.saturates,
        "quadratic terms of 32-bit raw codes": shape.quadratic and whole,
        "a term in dT/dt in the inverse form": inverse and shape.rate,
        "a term in dT/dt with constant functions": shape.rate and not shape.order,
        "a term in dT/dt with sums of high words": shape.rate and shape.high_words,
    }
    return next((name for name, has in parts.items() if has), "")


def imu_not_covered(accel: Shape, gyro: Shape) -> str:
    """For which part of an IMU triax_imu.c has no contracts; "" where it has them.

    It takes the contracts of both triads, so both have to have them.
    """
    if gyro.inverse is not None:
        return "a gyro in the inverse form"
    return _of_triads(not_covered(accel), not_covered(gyro))


def imu_loader_not_covered(accel: Shape, gyro: Shape) -> str:
    """For which part of an IMU the loader of triax_imu.c has no contract."""
    return _of_triads(loader_not_covered(accel), loader_not_covered(gyro))


def _of_triads(accel: str, gyro: str) -> str:
    return f"{accel} (accelerometer)" if accel else f"{gyro} (gyro)" if gyro else ""
