"""The node of AT-SIM, at rest with z up."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from builds import UNITS, Built
from device.node import Node, build_node, write_samples
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.delivery.unit import Delivery, deliver


@dataclass
class Bench:
    """A node, the file of its calibration, and the delivery that both come from."""

    node: Node
    file: Path
    delivery: Delivery


def bench_of_at_sim(folder: Path) -> Bench:
    """Build it in a folder."""
    delivery = deliver(UNITS / "AT-SIM")
    for name, content in delivery.files.items():
        (folder / name).write_bytes(content)
    plan = delivery.plan
    middle = (plan.temp_min_code + plan.temp_max_code) // 2
    # The codes of 1 g along z: the routine is affine in them.
    codes = np.vstack([np.zeros(3), np.eye(3) * 2**20]).astype(np.int32)
    accel, _ = python_routine(plan)(np.full(4, middle, np.int32), codes)
    slopes = (accel[1:] - accel[0].astype(np.int64)).T / 2**20
    up = np.linalg.solve(slopes, np.array([0, 0, 1 << plan.shape.output_q]) - accel[0])
    raw = np.rint(up) + np.random.default_rng(4).integers(-40, 41, (64, 3))
    write_samples(folder / "samples.bin", np.full(64, middle), raw)
    built = Built(plan, folder, None)  # type: ignore[arg-type]
    program = build_node(built, folder / "xcp_node")
    node = Node(program, folder / "flash.bin", folder / "samples.bin")
    return Bench(node, folder / "triax_calib.bin", delivery)
