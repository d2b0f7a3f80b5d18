"""What the tests of the bench share: a short plan, a unit, a simulated session."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from triaxcal.rig.description.dbc import default_dbc, read_dbc
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.live.runner import Robot
from triaxcal.rig.plan.plan import read_plan
from triaxcal.rig.session.engine import Setup
from triaxcal.rig.simulated.simorders import read_fault
from triaxcal.rig.simulated.simulator import RigSettings, SimulatedRig
from triaxcal.simulation.truth import read_truth
from triaxcal.unit.description import read_unit

REPO = Path(__file__).parents[2]
BENCH = REPO / "units" / "AT-SIM-BENCH"
SHORT_PLAN = """
format = 1
[rig]
rate_hz = {rate}
layout = "{layout}"
volts_per_g = [-0.55, -0.55, -0.55]
[steps]
temperatures_degc = {temps}
take_out_of_order = {take}
[stillness]
reference_s = 60
settle_s = 5
average_s = 20
guard_s = 6
batches = 10
u_max_micro_g = 15.0
[thermal]
window_s = 30
slope_max_k_per_min = 0.3
"""
FAST = {"chamber_tau_s": 3.0, "unit_tau_s": 5.0}


def short_setup(
    folder: Path, *, rate=100, layout="classic", temps="[20, 25]", take="false"
) -> Setup:
    path = folder / "short.toml"
    path.write_text(SHORT_PLAN.format(rate=rate, layout=layout, temps=temps, take=take))
    unit = bench_unit()
    plan = read_plan(path, unit)
    return Setup(BENCH, unit, plan, description(plan.rig))


@cache
def bench_unit():
    return read_unit(BENCH)


@cache
def description(path):
    return read_description(path)


@cache
def dbc():
    return read_dbc(default_dbc())


def rig_of(setup: Setup, *orders: str, **settings) -> SimulatedRig:
    truth, _ = read_truth(BENCH)
    faults = tuple(read_fault(order) for order in orders)
    return SimulatedRig(
        setup.unit, truth, setup.plan, setup.rig, RigSettings(**{**FAST, **settings}), faults
    )


def play(rig: SimulatedRig, feed, session, limit_s=4000, accepted=None):
    """Play the operator until the session is done, or has so many dwells; all events."""
    robot, events = Robot(rig), []
    while not session.done and (accepted is None or len(session.accepted) < accepted):
        assert rig.seconds < limit_s, f"not done after {limit_s} s: {session.last_event}"
        events += feed(rig.advance())
        robot.act(session)
    return events
