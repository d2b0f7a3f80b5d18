"""The node of AT-SIM, whose sensor can be turned."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from builds import UNITS, Built
from device.node import Node, build_node, write_samples
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.delivery.unit import Delivery, deliver

ROWS = 64
"""Samples that the sensor gives over and over."""


@dataclass
class Bench:
    """A node, the file of its calibration, and the delivery that both come from."""

    node: Node
    file: Path
    delivery: Delivery

    @property
    def gravity_g(self) -> float:
        return self.delivery.unit.gravity_g

    def turn(self, *direction: float, gravity_g: float | None = None) -> None:
        """Rest with the specific force in this direction."""
        size = self.gravity_g if gravity_g is None else gravity_g
        force = np.array(direction) / np.linalg.norm(direction) * size
        temps, raw = codes(self.delivery, force)
        write_samples(self.node.samples, temps, raw)


def codes(delivery: Delivery, force_g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Codes of a force in the middle of the range, with some noise: the routine is affine."""
    plan = delivery.plan
    middle = (plan.temp_min_code + plan.temp_max_code) // 2
    tried = np.vstack([np.zeros(3), np.eye(3) * 2**20]).astype(np.int32)
    accel, _ = python_routine(plan)(np.full(4, middle, np.int32), tried)
    slopes = (accel[1:] - accel[0].astype(np.int64)).T / 2**20
    exact = np.linalg.solve(slopes, force_g * 2.0**plan.shape.output_q - accel[0])
    noise = np.random.default_rng(4).integers(-40, 41, (ROWS, 3))
    return np.full(ROWS, middle, np.int32), (np.rint(exact) + noise).astype(np.int32)


def bench_of_at_sim(folder: Path) -> Bench:
    """Build it in a folder, at rest with z up."""
    delivery = deliver(UNITS / "AT-SIM")
    for name, content in delivery.files.items():
        (folder / name).write_bytes(content)
    built = Built(delivery.plan, folder, None)  # type: ignore[arg-type]
    program = build_node(built, folder / "xcp_node")
    node = Node(program, folder / "flash.bin", folder / "samples.bin")
    bench = Bench(node, folder / "triax_calib.bin", delivery)
    bench.turn(0, 0, 1)
    return bench
