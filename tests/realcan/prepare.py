"""Builds the node and computes its answers, for a guest too slow to do it: prepare.py FOLDER."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from triaxcal.cli.rig_fil import build_node
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.delivery.unit import deliver
from triaxcal.rig.dbc import default_dbc, read_dbc
from triaxcal.rig.engine import Setup
from triaxcal.rig.fil import BATCH, vectors
from triaxcal.rig.plan import read_plan
from triaxcal.unit.description import read_unit

SAMPLES = 5000
REPO = Path(__file__).parents[2]


def main(target: Path) -> None:
    folder = REPO / "units" / "AT-SIM-BENCH"
    unit = read_unit(folder)
    plan = read_plan(REPO / "rig" / "plans" / "five-temperatures.toml", unit)
    delivery = deliver(folder)
    build_node(target, delivery.files, Setup(folder, unit, plan, read_dbc(default_dbc())))
    limits = (delivery.plan.temp_min_code, delivery.plan.temp_max_code)
    temps, raw = vectors(SAMPLES, limits, 11)
    each = np.repeat(temps, BATCH)[:SAMPLES]
    accel, status = python_routine(delivery.plan)(each, raw)
    np.savez(target / "answers.npz", temps=temps, raw=raw, accel=accel, status=status)


main(Path(sys.argv[1]))
