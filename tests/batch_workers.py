"""What test_batch.py has its workers do; a module of its own, which they import."""

from __future__ import annotations

import os
import signal
from pathlib import Path

from triaxcal.batch.order import Order, Outcome, refused


def record(name: str) -> dict[str, object]:
    """A record as the page needs it."""
    return {
        "unit": name, "serial": name, "rig": None, "date": None, "t0_degc": 20.0,
        "result": "passed", "verdict": "passed", "reading_unit": "V",
        "range_degc": [-40.0, 70.0], "thermal_model": "polynomial of order 3", "acceptance": [],
        "worst_source": "", "at_t0": [0.5] * 12, "temperature_coefficients": [[0.0, 0.0]] * 12,
        "at_t0_expanded_uncertainty": [0.0] * 12, "placement_pattern_g": [[0.0] * 3] * 3,
        "bound_lsb": 1.0, "vectors": 1, "shape": "",
    }  # fmt: skip


def rows_of(order: Order) -> bytes:
    """Of the unit's folder, or as they were sent."""
    name = "measurements.csv"
    return order.inputs.get(name) or (Path(order.folder) / name).read_bytes()


def made(order: Order) -> Outcome:
    """A unit that passes at once; one whose file says so is refused."""
    if b"refuse" in rows_of(order):
        return refused(order, f"{order.folder}: as asked")
    return Outcome(order.name, order.key, "", {"calibration.json": b"{}"}, record(order.name))


def dies_once(order: Order) -> Outcome:
    """The worker dies in the middle of U-2, the first time."""
    if order.name == "U-2":
        mark = Path(rows_of(order).decode())
        if not mark.exists():
            mark.write_text("dead", encoding="utf-8")
            os.kill(os.getpid(), signal.SIGKILL)
    return made(order)


def always_dies(order: Order) -> Outcome:
    """The worker dies on U-2, each time."""
    if order.name == "U-2":
        os.kill(os.getpid(), signal.SIGKILL)
    return made(order)
