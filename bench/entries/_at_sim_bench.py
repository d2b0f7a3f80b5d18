"""The unit AT-SIM-BENCH on the simulated rig, at another rate, for the benchmarks."""

from __future__ import annotations

from pathlib import Path

from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.plan.plan import read_plan
from triaxcal.rig.session.engine import Setup
from triaxcal.unit.description import read_unit

REPO = Path(__file__).resolve().parents[2]


def setup_at(rate_hz: int, folder: Path) -> Setup:
    """Five temperatures at that rate; the plan is written to `folder`."""
    bench = REPO / "units" / "AT-SIM-BENCH"
    unit = read_unit(bench)
    plan = folder / "plan.toml"
    text = (REPO / "rig" / "plans" / "five-temperatures.toml").read_text(encoding="utf-8")
    plan.write_text(text.replace("rate_hz = 100", f"rate_hz = {rate_hz}"), encoding="utf-8")
    session = read_plan(plan, unit)
    return Setup(bench, unit, session, read_description(session.rig))
