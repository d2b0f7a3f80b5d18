"""What a generated routine is specialised to."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.fixedpoint.inversion import InverseShifts

ROW_LIMIT = 2**32 - 8
"""|n_i0| + |n_i1| + |n_i2| + 2 |b_i| stays below this: the 64-bit sum and its high word plus b
cannot overflow for any int32 raw codes (docs/explanation/fixed-point.md, step R)."""

ROW_LIMIT_WITH_TERMS = 3 * 2**30
"""The same where quadratic terms or a g-sensitivity need room beside the row."""

FLOORS_LOSS = 1
"""The sum of three floors is the floor of the sum less 0, 1 or 2: the mean of these, and the most
by which they differ from it (docs/explanation/fixed-point.md, step E)."""


@dataclass(frozen=True)
class Shape:
    """What the generated routine is specialised to; two images fit the same code if this agrees.

    Attributes
    ----------
    form : str
        "direct" or "inverse".
    segments, order : int
        Of the piecewise polynomial.
    output_q : int
        Acceleration LSB is 2^-output_q g, rate LSB 2^-output_q deg/s.
    output_shift : int
        Right shift of the 64-bit sum, 32 + spare bits. Above 32 the result cannot leave int32.
    raw_min, raw_max : int
        Declared raw range; codes outside are clamped and flagged.
    raw_shift : int
        Left shift that makes the declared raw range fill int32.
    inverse : InverseShifts or None
        Shifts of the inversion on the device.
    quadratic : bool
        Whether there are quadratic terms.
    rate : bool
        Whether there is a term in dT/dt.
    gyro : bool
        Whether it is a gyro triad: LSB 2^-output_q deg/s, and a g-sensitivity.
    high_words : bool
        Whether each product is floored to its high word before they are summed, step A.
    """

    form: str
    segments: int
    order: int
    output_q: int
    output_shift: int
    raw_min: int
    raw_max: int
    raw_shift: int
    inverse: InverseShifts | None
    quadratic: bool = False
    rate: bool = False
    gyro: bool = False
    high_words: bool = False

    @property
    def adds_to_sums(self) -> bool:
        """Whether terms are added to the 64-bit sums of a sample."""
        return self.quadratic or self.gyro

    @property
    def unit(self) -> str:
        """Unit of the result."""
        return "deg/s" if self.gyro else "g"

    @property
    def row_limit(self) -> int:
        """Limit of a row, step R."""
        return ROW_LIMIT_WITH_TERMS if self.adds_to_sums else ROW_LIMIT

    @property
    def saturates(self) -> bool:
        """Whether a result may leave int32, so that the routine has to saturate."""
        return self.output_shift <= 32

    @property
    def rounding_in_offset(self) -> int:
        """Half an output LSB, where the offset's format can hold it: added to b."""
        return 0 if self.saturates or self.quadratic else 1 << (self.output_shift - 33)

    @property
    def held_in_offset(self) -> int:
        """What the direct form's offset holds besides b: that rounding, and what floors lose."""
        return self.rounding_in_offset + (FLOORS_LOSS if self.high_words else 0)

    @property
    def rounding_in_sum(self) -> int:
        """Half an output LSB, where it has to be added to the 64-bit sum."""
        return 1 << (self.output_shift - 1) if self.saturates or self.quadratic else 0

    @property
    def raw_box(self) -> int:
        """Largest magnitude of a left-justified raw code."""
        return max(abs(self.raw_min), abs(self.raw_max)) << self.raw_shift
