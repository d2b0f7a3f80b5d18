"""What makes a second of samples worthless, each fault by its name."""

from __future__ import annotations

from collections.abc import Iterator

from triaxcal.model.positions import AXES
from triaxcal.rig.bus.frames import BUS_OFF, error_names
from triaxcal.rig.plan.plan import SessionPlan
from triaxcal.rig.session.blocks import Block
from triaxcal.rig.session.reasons import Reason, Why, because

Three = tuple[bool, bool, bool]


def fault(
    block: Block, previous: Block | None, plan: SessionPlan, fine: Three = (True, True, True)
) -> Reason | None:
    """What makes a block worthless; None when nothing does.

    Parameters
    ----------
    fine : tuple of three bool
        Axes that show noise at rest: another one may give the same code all the time.
    """
    return next(_faults(block, previous, plan, fine), None)


def complaint(block: Block) -> Reason | None:
    """What the bus reports although no sample was lost; None for nothing."""
    count, bits = block.trouble.error_frames, block.trouble.error_bits
    return because(Why.BUS_ERRORS, count=count, names=error_names(bits)) if count else None


def _faults(
    block: Block, previous: Block | None, plan: SessionPlan, fine: Three
) -> Iterator[Reason]:
    limits, trouble = plan.stillness, block.trouble
    if trouble.error_bits & BUS_OFF:
        yield because(Why.BUS_OFF, names=error_names(trouble.error_bits))
    if trouble.conflicts:
        yield because(Why.CONFLICT, count=trouble.conflicts)
    if trouble.orphans > limits.jumps_max_ratio * plan.rate_hz:
        yield because(Why.ORPHANS, count=trouble.orphans)
    if block.jumps > limits.jumps_max_ratio * block.count:
        yield because(Why.JUMPS, count=block.jumps)
    if previous is not None and block.index != previous.index + 1:
        yield because(Why.GAP, seconds=block.index - previous.index - 1)
    if block.jumps:
        yield because(Why.RESTARTED)
    if block.lost > limits.gap_max_s * plan.rate_hz and trouble.invalid >= block.lost:
        yield because(Why.INVALID, count=trouble.invalid)
    if block.lost > limits.gap_max_s * plan.rate_hz:
        yield because(Why.LOST_IN_SECOND, lost=block.lost, expected=plan.rate_hz)
    if block.clipped:
        yield because(Why.CLIPPED, count=block.clipped)
    stuck = [
        a for a, is_stuck, shows in zip(AXES, block.stuck, fine, strict=True) if is_stuck and shows
    ]
    if stuck:
        yield because(Why.STUCK, axes=", ".join(stuck))
    if block.status:
        yield because(Why.STATUS, status=block.status)
    if block.temp_code is None:
        yield because(Why.NO_TEMPERATURE)
