"""The verdict on a calibration: what was held against which limit, and in which words it is said.

Terminal, passport, JSON files, the C header and the page of a series all print what stands here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from triaxcal.base.errors import RefusedError

RESIDUAL, HELD_OUT, COMPONENTS, UNCERTAINTY, GUARDED = (
    "residual", "held out", "held out, a component", "with uncertainty", "with guard band",
)  # fmt: skip
PASSED, AT_DWELLS, AT_POSES, NOT_SHOWN, NOT_CHECKED, REFUSED = (
    "passed", "passed at the dwells", "passed at the poses", "not shown", "not checked", "refused",
)  # fmt: skip
"""Results. All but `REFUSED` are delivered; the last three have not passed."""
_ROWS = {
    RESIDUAL: "residual of the fit",
    HELD_OUT: "held out",
    COMPONENTS: "held out, of a component",
    UNCERTAINTY: "with uncertainty (95 %)",
    GUARDED: "with guard band",
}
DECISIVE = {UNCERTAINTY: "uncertainty (95 %)", GUARDED: "guard band"}
"""What decides by a decision rule with a guard band, and what is added to the error there."""


@dataclass(frozen=True)
class LimitCheck:
    """One limit, and what was held against it.

    Attributes
    ----------
    where : str
        "at T0" or "over the range".
    limit_g, largest_g : float
        Limit, and the largest | |a| - g |; the rms where `rms`.
    dwells : int
        How many dwells or poses; with none the limit was not tested, and `largest_g` is NaN.
    what : str
        "residual" at the dwells or poses of the fit; "held out", at check dwells, and at
        temperatures or poses held out; "held out, a component" of the force, there; "with
        uncertainty", the largest error with the uncertainty (95 %) of |a|; "with guard band", the
        same with a guard band that unit.toml states.
    whole : bool
        False where a source of the uncertainty is unknown: `largest_g` is without it.
    rms : bool
    """

    where: str
    limit_g: float
    largest_g: float
    dwells: int
    what: str = RESIDUAL
    whole: bool = True
    rms: bool = False

    @property
    def held(self) -> bool:
        """Whether the limit holds; what was not tested, or is not all known, does not."""
        return self.whole and self.largest_g <= self.limit_g

    @property
    def beyond(self) -> bool:
        """Whether what is known is beyond the limit."""
        return self.largest_g > self.limit_g

    def __str__(self) -> str:
        what = f"{self.what} {self.where}"
        if not self.dwells:
            return f"{what}: not tested"
        more = " rms" * self.rms + " and what is unknown" * (not self.whole)
        words = f"{what}: {self.largest_g * 1e3:.4g} mg{more}, limit {self.limit_g * 1e3:g} mg"
        return words if self.what in DECISIVE else f"{words}, {self.dwells} dwells"


@dataclass(frozen=True, repr=False)
class Verdict:
    """Whether a calibration may be delivered, and whether it has passed.

    Attributes
    ----------
    result : str
        "passed"; "passed at the dwells" or "passed at the poses", where something was not tested;
        "not shown", where the uncertainty reaches beyond a limit, or a result contradicts what is
        known beforehand; "not checked", where readings
        could not contradict the constants at all; "refused", and nothing is delivered.
    refusal : RefusedError or None
        Why it may not be delivered: place, found, expected, remedy.
    tested : tuple of LimitCheck
        Residuals, held-out errors, and errors with their uncertainty, at T0 and over the range.
    not_tested : tuple of str
        What no reading outside the fit has tested, in words.
    held_out_g : float or None
        Rms error of the chosen functions on readings that their fit did not use.
    note : str
        How a held-out error was estimated, where it is not that of the delivered curves; or "".
    contradicts : tuple of str
        What is known beforehand and contradicts the result, in words.
    rule : str
        The decision rule, where unit.toml states another than the default; or "".
    """

    result: str
    refusal: RefusedError | None
    tested: tuple[LimitCheck, ...]
    not_tested: tuple[str, ...]
    held_out_g: float | None
    note: str = ""
    contradicts: tuple[str, ...] = ()
    rule: str = ""

    @property
    def passed(self) -> bool:
        """Whether no limit is missed: by residuals, held-out errors and uncertainty."""
        return self.result in (PASSED, AT_DWELLS, AT_POSES)

    @property
    def checked(self) -> bool:
        """Whether the readings could contradict the constants at all."""
        return self.result != NOT_CHECKED

    @property
    def shown(self) -> bool:
        """Whether everything was tested and is within the limits, the uncertainty included."""
        return self.result == PASSED

    @property
    def words(self) -> str:
        """The verdict in words."""
        rule = [f"by {self.rule}"] if self.rule else []
        if self.result != NOT_SHOWN:
            return "; ".join([self.result, *rule, *self.not_tested])
        first, *others = self.reasons
        head = f"not shown to be within the limits: {first}"
        return "; ".join([head, *others, *rule, *self.not_tested])

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the limits are not shown to hold, in words; nothing where they are."""
        found = [t for t in self.tested if t.what in DECISIVE and t.beyond]
        if not found:
            return self.contradicts
        reached = ", ".join(
            f"{t.largest_g * 1e3:.3g} mg {t.where} (limit {t.limit_g * 1e3:g} mg)" for t in found
        )
        return (*self.contradicts, f"error and {DECISIVE[found[0].what]} reach {reached}")

    @property
    def heads(self) -> tuple[str, ...]:
        """Heads of `rows`: where each limit holds."""
        return ("error of |a|, mg", *dict.fromkeys(t.where for t in self.tested))

    @property
    def rows(self) -> tuple[tuple[str, ...], ...]:
        """What was held against the limits, in mg, and last the limits."""
        found = []
        for what, words in _ROWS.items():
            own = {t.where: t for t in self.tested if t.what == what}
            if own:
                rms = ", rms" * any(t.rms for t in own.values())
                cells = (_cell(own.get(where)) for where in self.heads[1:])
                found.append((words + rms, *cells))
        limits = {t.where: f"{t.limit_g * 1e3:g}" for t in self.tested}
        return (*found, ("limit", *limits.values()))

    def __str__(self) -> str:
        if self.refusal is not None:
            return f"refused: {self.refusal}"
        lines = [self.words, *map(str, self.tested), *([self.note] if self.note else [])]
        if self.held_out_g is not None:
            lines.append(f"held-out error: {self.held_out_g * 1e3:.4g} mg rms")
        return "\n".join(lines)

    __repr__ = __str__


def cell(check: LimitCheck | None) -> str | None:
    """What is known of the largest error, in mg; None where nothing was held against the limit."""
    return None if check is None or not check.dwells else _milli_g(check.largest_g)


def _cell(check: LimitCheck | None) -> str:
    words = cell(check)
    if check is None or words is None:
        return "nothing"
    return words + " + unknown" * (not check.whole)


def _milli_g(value_g: float) -> str:
    """Acceleration in mg: four places, or two digits where that would leave none."""
    value = value_g * 1e3
    return f"{value:.4f}" if value >= 1e-3 or value == 0.0 else f"{value:.2g}"


def worst(checks: Sequence[LimitCheck]) -> float:
    """The largest share of its limit; 0 where nothing was tested."""
    return max((c.largest_g / c.limit_g for c in checks if c.dwells), default=0.0)
