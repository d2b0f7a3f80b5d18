"""What makes a second of samples worthless, each fault by its name."""

from __future__ import annotations

from collections.abc import Iterator

from triaxcal.model.positions import AXES
from triaxcal.rig.blocks import Block
from triaxcal.rig.frames import BUS_OFF, error_names
from triaxcal.rig.plan import SessionPlan


def fault(block: Block, previous: Block | None, plan: SessionPlan) -> str:
    """What makes a block worthless, in words; "" when nothing does."""
    return next(_faults(block, previous, plan), "")


def complaint(block: Block) -> str:
    """What the bus complains of without a sample's loss by itself, in words; "" for nothing."""
    count = block.trouble.error_frames
    if not count:
        return ""
    return f"{count} error frames: {error_names(block.trouble.error_bits)}"


def _faults(block: Block, previous: Block | None, plan: SessionPlan) -> Iterator[str]:
    settings = plan.stillness
    if block.trouble.error_bits & BUS_OFF:
        yield f"error frames: {error_names(block.trouble.error_bits)}"
    if block.trouble.orphans > settings.jumps_max_ratio * plan.rate_hz:
        yield (
            f"{block.trouble.orphans} frames without their partner: "
            "another node sends under the rig's IDs"
        )
    if block.jumps > settings.jumps_max_ratio * block.count:
        yield (
            f"{block.jumps} jumps of the counters in 1 s: another node sends under the rig's IDs"
        )
    if previous is not None and block.index != previous.index + 1:
        yield f"gap of {block.index - previous.index - 1} s or more without samples"
    if block.jumps:
        yield "the counters jumped: the rig restarted"
    if block.lost > settings.gap_max_s * plan.rate_hz:
        yield f"{block.lost} of {plan.rate_hz} samples lost in 1 s"
    if block.clipped:
        yield f"clipped: {block.clipped} samples at the end of the ADC's range"
    stuck = [axis for axis, is_stuck in zip(AXES, block.stuck, strict=True) if is_stuck]
    if stuck:
        yield f"stuck: {', '.join(stuck)} gives one and the same code"
    if block.status:
        yield f"the rig reports status 0x{block.status:02X}"
    if block.temp_code is None:
        yield "no temperature from the rig"
