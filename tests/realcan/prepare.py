"""Builds the nodes and computes their answers, for a guest too slow to do it: prepare.py FOLDER."""

from __future__ import annotations

import shutil
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np

from builds import PROVENANCE, Built
from device import node as xcp
from plans import COVERING, SENSOR, random_plan
from plans import vectors as at_limits
from triaxcal.cli.rig_fil import build_node, routine_of
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.codegen.identity import with_identity
from triaxcal.codegen.image import image_bytes
from triaxcal.delivery.unit import Delivery, deliver
from triaxcal.device import link  # noqa: F401  what is missing is noticed here, not in the guest
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.node.fil import BATCH, vectors
from triaxcal.rig.plan.plan import read_plan
from triaxcal.rig.session.engine import Setup
from triaxcal.unit.description import read_unit

SAMPLES = 5000
REPO = Path(__file__).parents[2]
BENCH = REPO / "units" / "AT-SIM-BENCH"


def main(target: Path) -> None:
    delivery = rig_node(target / "plain", BENCH)
    with tempfile.TemporaryDirectory() as name:
        unit = Path(name) / BENCH.name
        shutil.copytree(BENCH, unit)
        with (unit / "unit.toml").open("a", encoding="utf-8") as file:
            file.write('\n[firmware]\nangles = "zenith-tool-face"\n')
        rig_node(target / "angles", unit)
    xcp_node(target / "xcp", delivery)


def rig_node(target: Path, folder: Path) -> Delivery:
    """The node that compensates, and what it has to answer."""
    target.mkdir()
    unit = read_unit(folder)
    plan = read_plan(REPO / "rig" / "plans" / "five-temperatures.toml", unit)
    delivery = deliver(folder)
    build_node(target, delivery.files, Setup(folder, unit, plan, read_description(plan.rig)))
    limits = (delivery.plan.temp_min_code, delivery.plan.temp_max_code)
    temps, raw = vectors(SAMPLES, limits, 11)
    each = np.repeat(temps, BATCH)[:SAMPLES]
    values, status = routine_of(delivery.firmware)(each, raw)
    np.savez(target / "answers.npz", temps=temps, raw=raw, values=values, status=status)
    return delivery


def xcp_node(target: Path, delivery: Delivery) -> None:
    """The node with the XCP slave, files for it, and what its samples are compensated to."""
    target.mkdir()
    for name, content in delivery.files.items():
        (target / name).write_bytes(content)
    plan = delivery.plan
    built = Built(plan, target, None)  # type: ignore[arg-type]
    xcp.build_node(built, target / "node")
    xcp.build_node(built, target / "node-17", '-DNODE_SERIAL="SN-17"')
    other = random_plan(Random(1), COVERING["direct-cubic-24-bit"])
    for file, of, serial in (("old", plan, "OLD"), ("new", plan, "NEW"), ("other", other, "NEW")):
        whose = replace(PROVENANCE, serial=serial)
        (target / f"{file}.bin").write_bytes(with_identity(image_bytes(of), SENSOR, whose))
    temps, raw = (np.array(codes, np.int32) for codes in at_limits(plan, Random(8), 60))
    xcp.write_samples(target / "samples.bin", temps, raw)
    accel, status = python_routine(plan)(temps, raw)
    np.savez(target / "samples.npz", temps=temps, raw=raw, accel=accel, status=status)


main(Path(sys.argv[1]))
