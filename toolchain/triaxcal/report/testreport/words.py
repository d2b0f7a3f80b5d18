"""Figures of a test report in words."""

from __future__ import annotations

import math

from triaxcal.performance.figures import Figure
from triaxcal.report.words.numbers import signed

NOT_MEASURED = "not measured"
_SMALL = 1e-4
"""Below it a number of two digits has too many noughts."""


def places(size: float) -> int:
    """Decimal places that show a size with two digits."""
    if not math.isfinite(size) or size <= 0.0:
        return 3
    return min(max(0, 1 - math.floor(math.log10(size))), 12)


def value_words(figure: Figure) -> str:
    """Value with its interval: "12.30 +- 0.15", "0.31 (0.21 to 0.52)", "below 5.2"."""
    if not figure.measured:
        return NOT_MEASURED
    value, low, high = figure.value, figure.low, figure.high
    if value is None:
        return f"below {_plain(high or 0.0, places(high or 0.0))}"
    if low is None or high is None:
        small = 0.0 < abs(value) < _SMALL
        return f"{value:.1g}" if small else _plain(value, places(abs(value)) if value else 0)
    half = 0.5 * (high - low)
    n = places(half)
    expanded = figure.expanded
    if expanded is not None:
        return f"{_plain(value, n)} ± {expanded:.{n}f}"
    return f"{_plain(value, n)} ({_plain(low, n)} to {_plain(high, n)})"


def _plain(value: float, n: int) -> str:
    shown = f"{value:.{n}f}"
    return shown if any(c in "123456789" for c in shown) else shown.removeprefix("-")


def screen_unit(unit: str) -> str:
    """Unit as a page shows it."""
    words = unit.replace("micro-", "µ").replace("sqrt(Hz)", "√Hz").replace("sqrt(s)", "√s")
    return words.replace("^2", "²").replace("^3", "³").replace("degC", "°C")


def on_page(text: str) -> str:
    """Text with true minus signs and the signs of units."""
    return screen_unit(signed(text))
