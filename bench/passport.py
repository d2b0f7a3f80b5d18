"""How much CPU time the pages of a passport take, as a multiple of what the same takes at least.

The floor is the template alone: the same values rendered again, so without the budgets, the code
to scan, the coordinates of the pictures and the translation. The first page of a process, which
reads template and texts, is stated beside; it is not in the medians.

    python bench/passport.py [UNIT ...]
"""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path
from typing import Any

from triaxcal.delivery.unit import Delivery, deliver
from triaxcal.report.passport import page as module
from triaxcal.report.passport.content import Passport, passport
from triaxcal.report.passport.document import passport_json
from triaxcal.report.passport.page import passport_html
from triaxcal.unit.passport import CODES

ROOT = Path(__file__).resolve().parents[1]
ROUNDS = 11


def cpu_ms(work: Any) -> float:
    start = time.process_time()
    work()
    return (time.process_time() - start) * 1e3


def values_of(p: Passport, code: str) -> tuple[str, dict[str, Any]]:
    """Template and values of a page."""
    kept: list[tuple[str, dict[str, Any]]] = []
    render, module.page = module.page, lambda name, **values: kept.append((name, values)) or b""
    passport_html(p, code)
    module.page = render
    return kept[0]


def measure(delivery: Delivery, code: str) -> tuple[float, float, float, float]:
    """CPU ms of the page, the JSON and the template alone, and of the first page of a process."""

    def whole() -> bytes:
        return passport_html(passport(delivery, {}), code)  # a passport keeps its budgets

    first = cpu_ms(whole)
    template, values = values_of(passport(delivery, {}), code)
    works = (
        whole,
        lambda: passport_json(passport(delivery, {})),
        lambda: module.page(template, **values),
    )
    page, text, least = (statistics.median(cpu_ms(w) for _ in range(ROUNDS)) for w in works)
    return page, text, least, first


def main() -> None:
    print("CPU ms, medians                page   json   template alone   page/template   first")
    for name in sys.argv[1:] or ["AT-SIM", "AT-CHERNIAK"]:
        delivery = deliver(ROOT / "units" / name)
        for code in CODES:
            page, text, least, first = measure(delivery, code)
            print(
                f"{name:16} {code:10} {page:7.1f} {text:6.1f} {least:16.1f} "
                f"{page / least:15.1f} {first:7.1f}"
            )


if __name__ == "__main__":
    main()
