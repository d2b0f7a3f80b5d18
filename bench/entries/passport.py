"""The passport of a unit, its page and its JSON, beside everything else done for the unit."""

from __future__ import annotations

import time
from functools import cache

from measuring import UNITS, Bench, Figure, pick

from triaxcal.delivery.unit import Delivery, deliver
from triaxcal.report.files import passport_files
from triaxcal.report.passport.content import passport


@cache
def _delivered() -> tuple[Delivery, float]:
    start = time.process_time()
    done = deliver(UNITS / "AT-SIM")
    return done, time.process_time() - start


def measure(size: str) -> list[Figure]:
    done, whole = _delivered()
    passport_files(passport(done, {}))  # templates are compiled once a process
    seconds = []
    for _ in range(pick(size, 1, 9, 25)):
        made = passport(done, {})
        start = time.process_time()
        passport_files(made)
        seconds.append(time.process_time() - start)
    middle = sorted(seconds)[len(seconds) // 2]
    against = "fit, proof and cross-check of the same unit, in Python"
    return [Figure(_PASSPORT, 1e3 * middle, "CPU ms", against, 1e3 * whole)]


_PASSPORT = "passport.html and passport.json of AT-SIM"
ENTRY = Bench(
    name="passport",
    label="The passport",
    doc="Tables, pictures and budgets of one unit, from a delivery in memory. Asked for are "
    "100 ms.",
    measure=measure,
    figures=(_PASSPORT,),
    rank=21,
)
