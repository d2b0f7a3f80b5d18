"""[limits] of unit.toml: what is accepted."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.base.keys import TableKeys, Values, setting
from triaxcal.base.kinds import number, word
from triaxcal.unit.decision import DEFAULT_RULE, GUIDE, RULES, DecisionRule
from triaxcal.unit.thermal import near_t0

AT_T0, OVER_RANGE = "at T0", "over the range"
"""Where each of both limits holds, in words."""
WHERE = {"limits.at_t0_g": AT_T0, "limits.over_range_g": OVER_RANGE}

_OF_A_RECORDING = {"default": 0.02}
"""g. The limits of P1 (13) are those of a navigation accelerometer."""


@dataclass(frozen=True)
class Limits:
    """[limits]: what is accepted.

    Attributes
    ----------
    at_t0_g
        Largest | |a| - g | that is accepted at T0, P1 (13).
    over_range_g
        The same over the working range.
    decision_rule
        How the uncertainty is counted, by ILAC-G8:09/2019. guard-band: passed where error and guard
        band are within the limit; what lies in the guard band is not shown to pass.
        binary-guard-band: what lies in it is refused. simple-acceptance: passed where the error is
        within the limit; the uncertainty is stated and not counted.
    guard_band_g
        Guard band w below each limit.
    """

    at_t0_g: float = setting(number(1e-9, 1.0), 3e-4, "g")
    over_range_g: float = setting(number(1e-9, 1.0), 10e-4, "g")
    decision_rule: str = setting(word(tuple(RULES)), DEFAULT_RULE)
    guard_band_g: float | None = setting(
        number(1e-9, 1.0),
        None,
        "g",
        words="w = U, the expanded uncertainty of \\|a\\| (95 %)",
        example="0.0001",
    )

    def at(self, temp_degc: float, t0_degc: float) -> tuple[float, str]:
        """Limit at a temperature, g, and its key."""
        if near_t0(temp_degc, t0_degc):
            return self.at_t0_g, "limits.at_t0_g"
        return self.over_range_g, "limits.over_range_g"

    @property
    def rule(self) -> DecisionRule:
        """The decision rule."""
        return RULES[self.decision_rule]

    def guard_g(self, expanded_g: float) -> float:
        """Guard band w for an expanded uncertainty U, both in g."""
        if not self.rule.guarded:
            return 0.0
        return expanded_g if self.guard_band_g is None else self.guard_band_g

    @property
    def rule_is_default(self) -> bool:
        """Whether unit.toml states no other rule and no guard band."""
        return self.decision_rule == DEFAULT_RULE and self.guard_band_g is None

    @property
    def rule_words(self) -> str:
        """The decision rule by its name, with its guard band."""
        rule, guard = self.rule, " w = U (95 %)"
        if self.guard_band_g is not None:
            guard = f" w = {self.guard_band_g * 1e3:g} mg"
        return f"{rule.title}{guard if rule.guarded else ', w = 0'} ({GUIDE}, {rule.clause})"


def limits_of(values: Values) -> Limits:
    """Limits of a table [limits].

    Raises
    ------
    RefusedError
        When a value is out of range, the guard band leaves nothing to accept, or the rule has none.
    """
    limits = values.record(Limits)
    if limits.guard_band_g is None:
        return limits
    if not limits.rule.guarded:
        raise values.refuse(
            "guard_band_g",
            f"none, as decision_rule is {limits.decision_rule}",
            "remove one of both",
        )
    smallest = min(limits.at_t0_g, limits.over_range_g)
    if limits.guard_band_g >= smallest:
        raise values.refuse(
            "guard_band_g", f"less than {smallest:g} g, the smaller limit",
            "nothing would be accepted",
        )  # fmt: skip
    return limits


LIMITS = TableKeys.of(Limits)
RECORDED_LIMITS = LIMITS.but(at_t0_g=_OF_A_RECORDING, over_range_g=_OF_A_RECORDING)
