"""All tests of a calibration against its recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from triaxcal.base.progress import Progress
from triaxcal.base.screentext import counted
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.imumodel import IN_MODEL
from triaxcal.dynamic.limits import ImuLimits, demanded
from triaxcal.dynamic.missing import Effect
from triaxcal.dynamic.observability import Observability
from triaxcal.dynamic.shares import variance_shares
from triaxcal.dynamic.thermalbasis import GROUPS, OF_GYROS
from triaxcal.dynamic.unit import DynamicUnit
from triaxcal.evidence.case import Case
from triaxcal.evidence.causes import causes_of
from triaxcal.evidence.chance import (
    earth,
    effects_off,
    held_out_checks,
    innovations,
    less_noise,
    rests_alone,
)
from triaxcal.evidence.check import Check, Evidence
from triaxcal.evidence.counts import coarse_counts
from triaxcal.evidence.heldout import HeldOut, held_out
from triaxcal.model.types import FloatArray


def examine(done: DynamicUnit, report: Progress) -> Evidence:
    """Test a calibrated unit against its recording."""
    assert done.recording is not None
    case = Case(done.recording, done.result.noise, done.filtered, _worst_sd(done))
    return examine_case(case, done.unit.limits, done.seen, done.off, report)


def _worst_sd(done: DynamicUnit) -> FloatArray | None:
    """Deviations of the states; of base constants the largest over the working range."""
    if done.over is None or done.range_degc is None:
        return None
    known, worst = done.over.known, done.filtered.sd.copy()
    gyro_range = done.gyro_range_degc or done.range_degc
    start = 0
    for block in GROUPS:
        own = block.name in OF_GYROS
        temps = known.gyro_temps_degc if own else known.temps_degc
        low, high = gyro_range if own else done.range_degc
        inside = (temps >= low) & (temps <= high)
        place = slice(start, start + len(block.states))
        worst[place] = known.sd[inside | ~inside.any(), place].max(axis=0)
        start = place.stop
    return worst


def examine_case(
    case: Case, limits: ImuLimits, seen: Observability, off: Sequence[Effect], report: Progress
) -> Evidence:
    """Test a result against its recording; `off` are the effects that are switched off."""
    result = case.result
    held = held_out(case, lambda part: report("held out", part))
    checks = [
        innovations(result),
        *(() if held is None else held_out_checks(held, limits)),
        *rests_alone(result),
        *earth(result),
        *effects_off(off),
        *sd_checks(limits, case),
        *_unseen_of_the_base(result, seen),
    ]
    found = Evidence(
        tuple(checks),
        tuple(_not_tested(held, limits, result, seen)),
        (*less_noise(result), *coarse_counts(case)),
        _notes(held),
    )
    if not found.failed:
        return found
    return causes_of(found, case, off, held, report)


def sd_checks(limits: ImuLimits, case: Case) -> Iterator[Check]:
    """Standard deviations of the constants against what is demanded, over the working range.

    With the largest source of the variance, at the reference temperature.
    """
    result, worst_sd = case.result, case.worst_sd
    demands = demanded(limits, result.layout)
    shares = variance_shares(case.recording, result) if demands else {}
    states = result.layout.states
    deviations = result.sd if worst_sd is None else worst_sd
    where = "" if worst_sd is None else " at its worst temperature"
    for demand, limit, index in demands:
        sd = {i: float(deviations[i]) / states[i].per_unit for i in index}
        worst = max(sd, key=lambda i: sd[i])
        parts = {name: float(share[worst]) for name, share in shares.items()}
        source = max(parts, key=lambda name: parts[name])
        yield Check(
            f"[limits] {demand.key}", sd[worst] <= limit,
            f"{states[worst].name} has {sd[worst]:.3g} {demand.unit}{where} (limit {limit:g}), "
            f"{100 * parts[source]:.0f} % of its variance from {source}",
            sd[worst], limit, demand.unit, len(index), demanded=True,
        )  # fmt: skip


def _unseen(result: DynamicResult, seen: Observability) -> list[tuple[tuple[str, ...], bool]]:
    """Directions that the motion leaves open, with a state of the C; whether one is basic."""
    layout = result.layout
    of = {state.name: block for block in layout.blocks for state in block.states}
    found = []
    for names in seen.unseen:
        blocks = [of[name] for name in names]
        if any(block.name in IN_MODEL for block in blocks):
            found.append((names, any(block in BASE for block in blocks)))
    return found


def _unseen_of_the_base(result: DynamicResult, seen: Observability) -> Iterator[Check]:
    basic = [" with ".join(names) for names, is_basic in _unseen(result, seen) if is_basic]
    words = f"the motion does not determine {', '.join(basic)}" if basic else "every basic constant"
    count = sum(len(block.states) for block in BASE)
    yield Check("observability", not basic, words, float(len(basic)), 0.0, "", count)


def _not_tested(
    held: HeldOut | None, limits: ImuLimits, result: DynamicResult, seen: Observability
) -> Iterator[str]:
    if held is None:
        yield "nothing was held out: the recording has too few rests to spare one"
    for names, is_basic in _unseen(result, seen):
        if not is_basic:
            yield f"{' with '.join(names)} not observable: the value is that of the prior"
    if limits.g_drift_sd_deg_per_h_per_g is not None and "g-drift" not in result.layout:
        yield "[limits] g_drift_sd_deg_per_h_per_g not tested: the block g-drift is off"


def _notes(held: HeldOut | None) -> tuple[str, ...]:
    if held is None:
        return ()
    rests = len(held.stretches)
    words = (
        f"held out: one rest in {held.every} and the turns before and after it, "
        f"{counted(rests, 'rest')} and {2 * rests} turns, predicted by the remaining recording; "
        "the delivered constants are those of the whole recording"
    )
    return (words,)
