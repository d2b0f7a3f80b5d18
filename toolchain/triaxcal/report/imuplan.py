"""What a planned motion of an IMU determines, and what reaches its demands: text for the screen."""

from __future__ import annotations

from triaxcal.design.imudemands import ImuPlan, PlannedDemand, Reached
from triaxcal.report.dynamic import seen_lines
from triaxcal.report.dynamicpage import digits


def plan_summary(plan: ImuPlan) -> str:
    """What a plan determines, and what would meet its demands."""
    done = plan.done
    result, layout = done.result, done.result.layout
    minutes, states = result.survey.duration_s / 60, 3 + len(layout)
    noise = done.unit.noise
    unknown = None in (noise.gyro_bias_instability_deg_per_h, noise.accel_bias_instability_ug)
    lines = [
        f"plan            {done.unit.name}: {minutes:.1f} min, {states} states",
        f"motion          {'' if done.recording is None else done.recording.name}",
        *_demand_lines(plan),
        "",
        "expected standard deviations from a recording of this motion, if the model is right",
        *(["without bias instability, which [noise] does not state"] * unknown),
    ]
    for block in layout.blocks:
        lines.append(block.title)
        for i, state in enumerate(block.states, start=layout.place(block.name).start):
            sd = result.sd[i] / state.per_unit
            lines.append(f"  {state.name:9s} {digits(sd, sd):>10s} {state.unit}")
    return "\n".join([*lines, *seen_lines(done.seen)])


def _demand_lines(plan: ImuPlan) -> list[str]:
    """Each demand with what limits it, then how much of each programme meets all."""
    if not plan.demands:
        return []
    lines = ["", "demands of [limits], and what this motion reaches"]
    for demand in plan.demands:
        lines += _lines_of(demand)
    lines += ["", "what meets all demands"]
    return lines + [_reached_words(reached) for reached in plan.reached]


def _lines_of(demand: PlannedDemand) -> list[str]:
    state = f"{demand.state} {digits(demand.sd, demand.sd)} {demand.unit}"
    call = "met" if demand.met else "NOT MET"
    parts = ", ".join(f"{name} {100 * share:.0f} %" for name, share in demand.sources)
    return [
        f"  {demand.key} = {demand.limit:g}: {state}, {call}",
        f"      variance from {parts}" + (f"; {demand.motion}" if demand.motion else ""),
    ]


def _reached_words(reached: Reached) -> str:
    if reached.refused:
        return f"  {reached.name}: not planned, {reached.refused}"
    size = f"{reached.words}, {reached.minutes:.0f} min in all"
    left = reached.left
    if left is None:
        return f"  {reached.name}: {size}"
    sd = f"{left.state} has {digits(left.sd, left.sd)} {left.unit}"
    why = left.motion or f"from {', '.join(name for name, _ in left.sources)}"
    return f"  {reached.name}: {size}: not enough; {sd}, {left.key} = {left.limit:g} ({why})"
