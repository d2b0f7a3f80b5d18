"""Many simulated units for the tests: their folders, a plan that lists them, a session."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from rig_cases import BENCH, FAST, SHORT_PLAN

from triaxcal.rig.live.simhands import simulated_attendant
from triaxcal.rig.many.hands import ManyAttendant
from triaxcal.rig.many.recording import ManyRecording
from triaxcal.rig.many.runner import ManyRobot, live_many
from triaxcal.rig.many.setup import ManySetup, many_of_plan
from triaxcal.rig.many.simbench import SimulatedBench, simulated_bench
from triaxcal.rig.simulated.simulator import RigSettings
from triaxcal.rig.sources.canbus import VirtualSource
from triaxcal.rig.sources.gather import Gathered
from triaxcal.simulation.tilts import truth_force_g
from triaxcal.simulation.truth import read_truth

PER_BUS = 16
ID_STEP = 0x10


def unit_folder(folder: Path, number: int) -> Path:
    """A copy of the bench's unit with constants and a serial number of its own."""
    unit = folder / f"AT-{number}"
    unit.mkdir(parents=True)
    text = (BENCH / "unit.toml").read_text(encoding="utf-8")
    (unit / "unit.toml").write_text(text.replace("AT-SIM-BENCH-001", f"SN-{number:04d}"))
    truth = (BENCH / "truth.toml").read_text(encoding="utf-8")
    own = truth.replace("U0x = [0.004491", f"U0x = [{0.004491 + 1e-4 * number:.6f}")
    assert own != truth
    (unit / "truth.toml").write_text(own, encoding="utf-8")
    return unit


def plan_of(folder: Path, count: int, temps: str = "[20]", tables: str = "", **bus: str) -> Path:
    """A plan that lists so many new units, 16 a bus."""
    text = SHORT_PLAN.format(rate=100, layout="classic", temps=temps, take="false") + tables
    for number in range(1, count + 1):
        unit = unit_folder(folder / "units", number)
        place = (number - 1) % PER_BUS
        lane = bus.get(unit.name.replace("-", "_"), f"can{(number - 1) // PER_BUS}")
        text += (
            f'[unit.{unit.name}]\nfolder = "units/{unit.name}"\nbus = "{lane}"\n'
            f"id_offset = {place * ID_STEP}\n"
        )
    path = folder / "many.toml"
    path.write_text(text, encoding="utf-8")
    return path


def setup_of(folder: Path, count: int, temps: str = "[20]", tables: str = "") -> ManySetup:
    return many_of_plan(plan_of(folder, count, temps, tables))


def bench_of(setup: ManySetup, *orders: str, **settings: float) -> SimulatedBench:
    return simulated_bench(setup, orders, settings=RigSettings(**{**FAST, **settings}))


class Run:
    """A session of many units in simulated time; `told`, `asides`, `done` are all so far."""

    def __init__(
        self, setup: ManySetup, bench: SimulatedBench, folder: Path, alone: bool = False
    ) -> None:
        self.bench = bench
        lanes = {bus: VirtualSource(lane.advance, bus) for bus, lane in bench.lanes.items()}
        self.sources = Gathered(lanes, in_step=True)

        def clock() -> float:
            return float(bench.seconds)

        own = simulated_attendant(setup.plan, bench)
        self.hands = ManyAttendant(own, clock) if alone else ManyRobot(bench)
        self.taken = ManyRecording(setup, folder, follow=not alone)
        self.ticks = live_many(self.taken, self.sources, list, self.hands, clock)
        self.told, self.done = [], []

    def go(self, until=lambda _: False, limit_s: int = 6000) -> Run:
        try:
            for tick in self.ticks:
                self.told += tick.told
                self.done += [(self.bench.seconds, text) for text in tick.done]
                assert self.bench.seconds < limit_s, f"not done after {limit_s} s"
                if until(self):
                    break
        finally:
            self.taken.close()
            self.sources.close()
        return self

    @property
    def group(self):
        return self.taken.group

    def accepted(self, name: str) -> list[tuple[int, str]]:
        mine = [e for m, e in self.told if m.name == name and e.kind == "accepted"]
        return [(e.step, e.dwell.position) for e in mine]


SIGMAS = 5.5
"""Of the noise that the truth states; exceeded by one value of 2800 once in 10 000 runs."""


def refuse_false_records(place, folder):
    """Number of rows of a unit's records.

    Each is the unit's own truth, U = K(T) a + U0(T), within the noise of its mean and one code.
    """
    setup = place.setup
    truth, _ = read_truth(setup.folder)
    per_code = setup.unit.adc.volts_per_code
    readings = 0.98 * setup.plan.rate_hz * setup.plan.stillness.average_s  # some may be lost
    limit = SIGMAS * truth.reading_sd_v / per_code / readings**0.5 + 1.0
    with (folder / "measurements.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    for row in rows:
        temp = float(row["temp_code"]) * setup.unit.temperature_sensor.degc_per_code
        force = truth_force_g(row["position"], setup.unit.gravity_g)
        exact = truth.voltage_v(force[None], np.array([temp]))[0] / per_code
        found = np.array([float(row[f"u{axis}_code"]) for axis in "xyz"])
        off = np.abs(found - exact)
        assert (off < limit).all(), f"{place.name} {row['position']} {temp:.2f}: {off} > {limit}"
    return len(rows)
