"""Residuals grouped by temperature, as tables and pictures show them."""

from __future__ import annotations

from triaxcal.codegen.tryout import MethodResult

SAME_TEMPERATURE_DEGC = 1.0
"""Dwells nearer than this are shown as one temperature."""
_STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 10_000)


def by_temperature(result: MethodResult, prefix: str) -> list[tuple[float, list[int]]]:
    """Mean temperature and indices of the dwells whose position starts with `prefix`."""
    temps = {
        i: residual.dwell.temp_degc
        for i, residual in enumerate(result.residuals)
        if residual.dwell.position.startswith(prefix)
    }
    groups: list[list[int]] = []
    for i in sorted(temps, key=lambda i: temps[i]):
        if groups and temps[i] - temps[groups[-1][0]] < SAME_TEMPERATURE_DEGC:
            groups[-1].append(i)
        else:
            groups.append([i])
    return [(sum(temps[i] for i in group) / len(group), group) for group in groups]


def position_order(position: str) -> tuple[str, int]:
    """Sort key of a position's name: TP2 before TP10."""
    letters = position.rstrip("0123456789")
    return letters, int(position[len(letters) :] or 0)


def with_room(labels: list[str], spacing: float, letter: float) -> list[str]:
    """Labels so far apart, "" for those that would lie on others: every second, fifth, tenth."""
    room = max(map(len, labels)) * letter + 3.0
    step = next(s for s in _STEPS if spacing * s >= room or s == _STEPS[-1])
    # The last of each step: P5, P10, ... of poses that are numbered from 1.
    return [label if (n + 1) % step == 0 else "" for n, label in enumerate(labels)]


def degrees(temp_degc: float) -> str:
    """Temperature in whole degC with its sign; zero has none."""
    whole = round(temp_degc)
    return f"{whole:+d}" if whole else "0"
