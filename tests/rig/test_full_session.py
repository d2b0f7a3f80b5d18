"""Six positions at five temperatures, faults injected: the constants come back."""

from __future__ import annotations

import numpy as np
import pytest
from rig_cases import BENCH, REPO, bench_unit, description, play
from scipy.stats import chi2

from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.readings.measurements import read_measurements
from triaxcal.rig.plan.plan import read_plan
from triaxcal.rig.records.store import write_records
from triaxcal.rig.session.engine import Engine, Setup
from triaxcal.rig.simulated.simorders import read_fault
from triaxcal.rig.simulated.simulator import RigSettings, SimulatedRig
from triaxcal.simulation.truth import read_truth

# The slip falls into the first average; one that comes while the unit waits cannot be seen.
FAULTS = (
    "slip@900:38", "nudge@1000:20", "lose@1150:40", "gone@1250:1:5", "twonodes@1350:1:10",
    "bitflip@1450:20", "busoff@2700:1:3", "stuck@2800:1:3", "clipped@2900:1:2",
    "duplicate@3000:20", "error@3100:5", "linkdown@3200:1:8",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_the_constants_of_a_session_with_faults(tmp_path, seed):
    unit = bench_unit()
    plan = read_plan(REPO / "rig" / "plans" / "five-temperatures.toml", unit)
    setup = Setup(BENCH, unit, plan, description(plan.rig))
    truth, _ = read_truth(BENCH)
    faults = tuple(read_fault(order) for order in FAULTS)
    rig = SimulatedRig(unit, truth, plan, setup.rig, RigSettings(seed=seed), faults)
    engine = Engine(setup, "test")
    events = play(rig, engine.feed, engine.session, limit_s=20_000)
    assert sum(e.kind == "refused" for e in events) >= 3
    log = {"lines": 0, "bytes": 0, "sha256": ""}
    write_records(tmp_path, engine.session, setup.rig, log)
    found = calibrate(unit, read_measurements(tmp_path / "measurements.csv", unit))
    assert len(found.points) == 5
    for point in found.points:
        exact = truth.constants.constants_at(point.temp_degc)
        off = point.constants - exact
        # Twelve constants at five temperatures, two seeds: once in 1000.
        distance = off @ np.linalg.solve(point.covariance, off)
        assert distance < chi2.isf(1e-3 / 10, 12)
        sigma = off / np.sqrt(np.diag(point.covariance))
        if point.temp_degc == pytest.approx(unit.t0_degc, abs=1.0):
            assert np.abs(sigma).max() < 3.0
