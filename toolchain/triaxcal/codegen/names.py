"""The names in the C of a triad, and the shape and the unit that its link names carry."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from typing import Any

from triaxcal.codegen.image import header_words
from triaxcal.fixedpoint.plan import Plan
from triaxcal.unit.prefix import DEFAULT_PREFIX


@dataclass(frozen=True)
class Names:
    """Names in the C of a triad; status bits are common to all.

    Attributes
    ----------
    triad : str
        What the names of functions, types and files begin with.
    result : str
        Name of what triax_apply gives.
    shape : str
        `shape_id` of the routine.
    """

    triad: str
    result: str
    shape: str

    def file(self, name: str) -> str:
        """Name of this triad's file, from the default: triax_comp.c, triax_gyro_comp.c."""
        return self.triad + name.removeprefix(DEFAULT_PREFIX)

    @property
    def default(self) -> Names:
        """The names without a prefix, by which our own C files call this triad."""
        triad = f"{DEFAULT_PREFIX}_gyro" if self.result == "rate" else DEFAULT_PREFIX
        return replace(self, triad=triad)

    @property
    def linked(self) -> str:
        """What the link names begin with. The shape stands early: C99 compares 31 characters."""
        return f"{self.triad}_{self.shape}"

    def unit(self, inputs_sha256: str) -> str:
        """What the link names of a unit's own constants and known answers begin with.

        A linker takes the first library that has a name: units of one shape need their own.
        """
        return f"{self.linked}_{inputs_sha256[:8]}"

    def unit_context(self, inputs_sha256: str) -> dict[str, str]:
        """What the templates of a unit's own files know beside `context`."""
        return {
            "unit_linked": self.unit(inputs_sha256),
            "inputs_word": _word(inputs_sha256[:8]),
        }

    @property
    def context(self) -> dict[str, str]:
        """The names as the templates know them."""
        prefix = self.triad.upper()
        return {
            "triad": self.triad,
            "TRIAD": prefix,
            "result": self.result,
            "OUTPUT_Q": f"{prefix}_{self.result.upper()}_Q",
            "linked": self.linked,
            "shape_word": _word(self.shape),
        }


def shape_id(plan: Plan) -> str:
    """Eight hex digits of the shape: equal exactly when the generated routine is equal."""
    words = header_words(plan)
    return f"{zlib.crc32(b''.join(w.to_bytes(4, 'little') for w in words)):08x}"


def imu_context(accel: Plan, gyro: Plan, *, two_thermometers: bool) -> dict[str, Any]:
    """Names in the C of both triads together, beside the accelerometer's.

    With two thermometers a function has one more argument, and other link names.
    """
    ids = shape_id(accel), shape_id(gyro), *["two thermometers"] * two_thermometers
    both = f"{zlib.crc32(''.join(ids).encode()):08x}"
    return {
        "gyro_shape_word": _word(ids[1]),
        "imu_shape_word": _word(both),
        "two_thermometers": two_thermometers,
        "imu_linked": f"{accel.prefix}_imu_{both}",
    }


def _word(digits: str) -> str:
    return f"0x{digits.upper()}u"


def names_of(plan: Plan) -> Names:
    """Names in the C of a plan."""
    if plan.shape.gyro:
        return Names(f"{plan.prefix}_gyro", "rate", shape_id(plan))
    return Names(plan.prefix, "accel", shape_id(plan))
