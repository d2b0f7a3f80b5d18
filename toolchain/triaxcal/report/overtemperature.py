"""An IMU over temperature in calibration.json, on the screen and on the page."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from triaxcal.base.plaindata import plain
from triaxcal.dynamic.noise import MICRO_G
from triaxcal.dynamic.overtemperature import OverTemperature
from triaxcal.dynamic.thermalbasis import GROUPS, OF_GYROS
from triaxcal.dynamic.thermalchoice import Scored
from triaxcal.report.words.numbers import signed
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2

WIDTH, HEIGHT = 228.0, 112.0
COVERAGE = 1.96
"""k of 95 % of a normal distribution."""
EVERY = 4
"""Of the grid of temperatures, in tables."""


def over_document(over: OverTemperature) -> dict[str, Any]:
    """The key `over_temperature` of calibration.json."""
    known = over.known
    gyro = (
        {}
        if not _apart(over)
        else {
            "gyro_reference_degc": over.gyro_nodes.t0_degc,
            "gyro_seen_at_degc": over.gyro_nodes.degc.tolist(),
            "gyro_temps_degc": known.gyro_temps_degc.tolist(),
        }
    )
    return {
        "reference_degc": over.nodes.t0_degc,
        "seen_at_degc": over.nodes.degc.tolist(),
        "held_out_degc": list(over.choice.held_out_degc),
        "functions": [
            {
                "group": block.name,
                "function": over.choice.fit.shapes[block.name].label,
                "candidates": [
                    {"function": c.shape.label, "score": c.score, "weight": c.weight}
                    for c in over.choice.candidates.get(block.name, ())
                ],
            }
            for block in GROUPS
        ],
        "temps_degc": known.temps_degc.tolist(),
        **gyro,
        "constants": [
            {
                "name": name,
                "unit": unit,
                "value": (known.value[:, i] / known.per_unit[i]).tolist(),
                "sd": (known.sd[:, i] / known.per_unit[i]).tolist(),
            }
            for i, (name, unit) in enumerate(zip(known.names, known.units, strict=True))
        ],
        "accel_sd_ug": (known.accel_sd_g * STANDARD_GRAVITY_M_PER_S2 / MICRO_G).tolist(),
        "gyro_sd_deg_per_h": (np.degrees(known.gyro_sd_rad_per_s) * 3600).tolist(),
        "accel": plain(over.accel),
        "gyro": plain(over.gyro),
    }


def _apart(over: OverTemperature) -> bool:
    """Whether the gyros have a thermometer of their own."""
    return over.gyro_nodes is not over.nodes


def over_lines(over: OverTemperature) -> list[str]:
    """Lines of the summary."""
    own = f", gyros at {over.gyro_nodes.t0_degc:.4g} degC" if _apart(over) else ""
    lines = ["", f"over temperature, constants above at {over.nodes.t0_degc:g} degC{own}:"]
    lines += [f"  {title:46s} {function}" for title, function, _ in _functions(over)]
    lines += [f"  {_held_out(over)}", ""]
    if not _apart(over):
        lines.append("  degC   accelerometer sd   gyro sd")
        for degc, accel, _, gyro in _uncertainty(over):
            lines.append(f"  {degc:5.0f} {accel:>9s} micro-g {gyro:>9s} deg/h")
        return lines
    lines.append("  degC   accelerometer sd   degC   gyro sd")
    for degc, accel, gyro_degc, gyro in _uncertainty(over):
        lines.append(f"  {degc:5.0f} {accel:>9s} micro-g {gyro_degc:5.0f} {gyro:>9s} deg/h")
    return lines


def over_context(over: OverTemperature | None) -> dict[str, Any] | None:
    """What the page shows of it; None where the constants follow no temperature."""
    if over is None:
        return None
    panels, start = [], 0
    for block in GROUPS:
        count = len(block.states)
        panels.append(
            {
                "title": f"{block.title[0].upper()}{block.title[1:]}",
                "panels": [_panel(over, i) for i in range(start, start + count)],
            }
        )
        start += count
    return {
        "t0": signed(f"{over.nodes.t0_degc:g}"),
        "gyro_t0": signed(f"{over.gyro_nodes.t0_degc:.4g}") if _apart(over) else "",
        "functions": list(_functions(over)),
        "held_out": signed(_held_out(over)),
        "rows": [
            (signed(f"{t:.0f}"), a, signed(f"{gyro_t:.0f}"), g)
            for t, a, gyro_t, g in _uncertainty(over)
        ],
        "blocks": panels,
        "width": WIDTH,
        "height": HEIGHT,
        "coverage": COVERAGE,
    }


def _functions(over: OverTemperature) -> Iterator[tuple[str, str, str]]:
    """Group, its function, and the candidate that predicts next best."""
    for block in GROUPS:
        rows = sorted(over.choice.candidates.get(block.name, ()), key=lambda c: c.score)
        shape = over.choice.fit.shapes[block.name]
        others = [row for row in rows if row.shape != shape]
        yield block.title, shape.label, _next(others[0]) if others else ""


def _next(row: Scored) -> str:
    if row.score < 1:
        return f"{row.shape.label}: equally good"
    if row.score > 2 * math.log(1e6):
        return f"{row.shape.label}: less likely by more than a million"
    return f"{row.shape.label}: less likely by {math.exp(row.score / 2):.2g}"


def _held_out(over: OverTemperature) -> str:
    held = over.choice.held_out_degc
    if not held:
        return "nothing was held out: there are too few temperatures"
    words = ", ".join(f"{degc:.0f}" for degc in held)
    if not over.choice.candidates:
        return "as stated in unit.toml"
    return f"chosen by what was read at {words} degC, each held out in turn"


def _uncertainty(over: OverTemperature) -> Iterator[tuple[float, str, float, str]]:
    """Temperature and standard deviation, in micro-g, and those of the gyros, in deg/h."""
    known = over.known
    accel = known.accel_sd_g * STANDARD_GRAVITY_M_PER_S2 / MICRO_G
    gyro = np.degrees(known.gyro_sd_rad_per_s) * 3600
    for k in range(0, len(known.temps_degc), EVERY):
        degc, gyro_degc = float(known.temps_degc[k]), float(known.gyro_temps_degc[k])
        yield degc, _two(float(accel[k])), gyro_degc, _two(float(gyro[k]))


def _two(value: float) -> str:
    """Two significant digits."""
    places = max(0, 1 - math.floor(math.log10(value))) if value > 0 else 1
    return f"{value:.{min(places, 6)}f}"


def _panel(over: OverTemperature, i: int) -> dict[str, str]:
    """Change of a constant from T0, with its expanded uncertainty, over temperature."""
    known = over.known
    block, state = [(block, s) for block in GROUPS for s in block.states][i]
    own = block.name in OF_GYROS
    t = known.gyro_temps_degc if own else known.temps_degc
    nodes = over.gyro_nodes if own else over.nodes
    at_t0 = float(np.interp(nodes.t0_degc, t, known.value[:, i]))
    change = (known.value[:, i] - at_t0) / state.per_unit
    expanded = COVERAGE * known.sd[:, i] / state.per_unit
    span = float((np.abs(change) + expanded).max()) or 1.0
    x = WIDTH * (t - t[0]) / max(float(t[-1] - t[0]), 1e-9)

    def points(values: Any) -> list[str]:
        y = HEIGHT / 2 * (1 - 0.92 * values / span)
        return [f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True)]

    return {
        "name": state.label,
        "unit": state.unit.replace("^2", "²"),
        "scale": _two(span / 0.92),
        "largest": _two(float(expanded.max())),
        "low": signed(f"{t[0]:.0f}"),
        "high": signed(f"{t[-1]:.0f}"),
        "band": " ".join(points(change + expanded) + points(change - expanded)[::-1]),
        "line": " ".join(points(change)),
    }
