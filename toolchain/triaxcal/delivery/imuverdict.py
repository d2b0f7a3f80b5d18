"""The verdict on an IMU: whether it may be delivered, and its words.

Terminal, page, calibration.json and the C header print what stands here. The results are those of a
triad; what is held against which limit is in `triaxcal.evidence`.
"""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.base.errors import RefusedError
from triaxcal.delivery.verdict import NOT_CHECKED, NOT_SHOWN, PASSED, REFUSED
from triaxcal.dynamic.unit import DynamicUnit
from triaxcal.evidence.check import Check, Evidence

ON_RECORDING = "passed on the recording"
"""Passed, but something was not tested."""
PLAN = "`triaxcal dynamic {} --plan` says which motion reaches them"


@dataclass(frozen=True, repr=False)
class ImuVerdict:
    """Whether an IMU may be delivered, and whether it has passed.

    Attributes
    ----------
    result : str
        "passed"; "passed on the recording", where something was not tested; "not shown", where a
        doubt is left; "not checked", by a triaxcal that did not check; "refused", and nothing is
        delivered.
    checks : tuple of Check
        What was held against which limit.
    not_tested : tuple of str
        What no check has tested, in words.
    doubts : tuple of str
        Why the result is not shown, in words.
    notes : tuple of str
        How it was tested.
    refused : str
        The refusal in one line; "" where there is none.
    """

    result: str
    checks: tuple[Check, ...] = ()
    not_tested: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    refused: str = ""

    @property
    def passed(self) -> bool:
        """Whether every check that was made holds, and nothing is left in doubt."""
        return self.result in (PASSED, ON_RECORDING)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it has not passed, in words; nothing where it has."""
        return (*(str(check) for check in self.checks if not check.held), *self.doubts)

    @property
    def words(self) -> str:
        """The verdict in words."""
        head = "not shown to be right" if self.result == NOT_SHOWN else self.result
        if self.reasons:
            head += f": {'; '.join(self.reasons)}"
        return "; ".join([head, *self.not_tested])

    def __str__(self) -> str:
        return "\n".join([self.words, *map(str, self.checks), *self.notes])

    __repr__ = __str__


UNKNOWN = ImuVerdict(NOT_CHECKED, not_tested=("an earlier triaxcal made it without a verdict",))


def judge_imu(done: DynamicUnit, found: Evidence) -> ImuVerdict:
    """Verdict on a calibrated IMU by what its recording says."""
    refusal = refusal_of(done, found)
    result = PASSED
    if refusal is not None:
        result = REFUSED
    elif found.doubts:
        result = NOT_SHOWN
    elif found.not_tested:
        result = ON_RECORDING
    about = found.checks, found.not_tested, found.doubts, found.notes
    return ImuVerdict(result, *about, "" if refusal is None else str(refusal))


def refusal_of(done: DynamicUnit, found: Evidence) -> RefusedError | None:
    """Why nothing may be delivered: what failed, and what would explain it; None where it may."""
    if not found.failed:
        return None
    demands = [c for c in found.failed if c.demanded]
    others = [c for c in found.failed if not c.demanded]
    expected = []
    if others:
        expected.append("a recording that agrees with the constants found from it")
    if demands:
        expected.append("constants within [limits] of unit.toml")
    remedies = [_remedy(found)] if others else []
    if demands:
        remedies.append(PLAN.format(done.unit.path.parent))
    return RefusedError(
        done.unit.name if done.recording is None else done.recording.name,
        "; ".join(map(str, found.failed)),
        expected=", and ".join(expected),
        remedy="; ".join(remedies),
    )


def _remedy(found: Evidence) -> str:
    causes = found.causes
    if len(causes) == 1:
        return f"explained by {causes[0].words}: {causes[0].remedy}"
    if causes:
        both = "; or ".join(f"{c.words}: {c.remedy}" for c in causes)
        return f"these explain it and cannot be told apart: {both}"
    tried = f", tried: {', '.join(found.tried)}" if found.tried else ""
    return f"no single cause explains it{tried}; check axes, units and mounting, and record again"
