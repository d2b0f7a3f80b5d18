"""What `triaxcal poses` and `drift` print, and their pictures."""

from __future__ import annotations

import numpy as np

from triaxcal.base.screentext import table
from triaxcal.fitting.core.drift import Drift
from triaxcal.model.positions import AXES
from triaxcal.model.types import FloatArray
from triaxcal.poses.poseset import PoseSet
from triaxcal.readings.samples import READING, Samples
from triaxcal.readings.table import TIME
from triaxcal.report.pictures.line_plot import BAD, COLOURS, GOOD, Band, Line, Panel, line_plot
from triaxcal.unit.recording import SAMPLES, RecordingLayout


def poses_text(poses: PoseSet, layout: RecordingLayout) -> str:
    """The poses with their uncertainty, and the reason of every refusal."""
    unit, mg = layout.acceleration_unit, 1e3 / poses.reading_of_1_g
    blocks = []
    sds, shares = poses.length_sd, poses.weights
    stretches = layout.rows == SAMPLES  # of rows that are poses no time is known
    rows = [
        [
            f"{p.number}",
            f"{p.file} {p.line}".strip(),
            *([f"{p.start_s:.1f}", f"{p.duration_s:.1f}"] if stretches else []),
            *(f"{v:.6g}" for v in p.reading),
            *(_of_one(p.scatter, p.drift, mg) if stretches else []),
            "-" if sds is None else f"{sds[k]:.2g}",
            "-" if sds is None else f"{sds[k] * mg:.2f}",
            "-" if shares is None else f"{shares[k]:.2f}",
            "-" if p.temp_degc is None else f"{p.temp_degc:.1f}",
            p.label,
        ]
        for k, p in enumerate(poses.poses)
    ]
    head = ["pose", "line", *(["from s", "still s"] if stretches else [])]
    head += [*(f"{a} {unit}" for a in AXES), *(["scatter mg", "drift mg"] if stretches else [])]
    head += [f"sd {unit}", "sd mg", "weight", "degC", "section"]
    blocks.append("\n".join(table(head, rows)))
    if poses.refused:
        reasons = [f"pose {r.number} (line {r.line}): {r.reason}" for r in poses.refused]
        blocks.append("at rest, but refused as poses:\n  " + "\n  ".join(reasons))
    if poses.findings:
        blocks.append("found:\n  " + "\n  ".join(poses.findings))
    count, refused = len(poses.poses), len(poses.refused)
    blocks.append(f"{count} poses" + f"; {refused} stretches at rest refused" * stretches)
    return "\n\n".join(blocks)


def _of_one(scatter: FloatArray | None, drift: FloatArray | None, mg: float) -> tuple[str, str]:
    """Scatter and drift of a pose, all axes together, mg."""
    if scatter is None or drift is None:
        return "-", "-"
    return f"{np.linalg.norm(scatter) * mg:.3g}", f"{np.linalg.norm(drift) * mg:.2g}"


def poses_picture(samples: Samples, poses: PoseSet, layout: RecordingLayout) -> bytes:
    """Readings over time, and their motion, with the poses behind them."""
    rows = samples.table.spool.thinned()
    t, reading = samples.cut(rows, TIME), samples.cut(rows, READING)
    bands = [Band(p.start_s, p.start_s + p.duration_s, GOOD, str(p.number)) for p in poses.poses]
    bands += [Band(r.start_s, r.start_s + r.duration_s, BAD, str(r.number)) for r in poses.refused]
    low, high = np.percentile(reading, [0.5, 99.5])
    room = 0.1 * float(high - low) or 1.0
    lines = [Line(AXES[k], COLOURS[k], t, reading[:, k]) for k in range(3)]
    panels = [
        Panel(
            f"readings, {layout.acceleration_unit}; green: poses, red: refused",
            "s",
            lines,
            bands,
            (float(low) - room, float(high) + room),
        )
    ]
    if poses.stillness is not None:
        motion = poses.stillness.motion * 1e3 / poses.reading_of_1_g
        panels.append(
            Panel(
                "change of the mean within 0.4 s, mg (powers of ten)",
                "s",
                [
                    Line(
                        "motion",
                        COLOURS[3],
                        poses.stillness.time_s,
                        np.log10(np.maximum(motion, 0.01)),
                    )
                ],
                bands,
            )
        )
    return line_plot(f"{len(poses.poses)} poses", panels)


def drift_text(drift: Drift, layout: RecordingLayout) -> str:
    """Hysteresis, then every candidate with its error on held-out half-cycles."""
    one_g = layout.reading_of_1_g
    scale, unit = (1e3 / one_g, "mg") if one_g else (1.0, layout.acceleration_unit)
    halves = "; ".join(h.label(drift.temp_degc) for h in drift.halves)
    apart = ", ".join(
        f"{AXES[k]} {drift.hysteresis[k] * scale:.3g} {unit} at {drift.hysteresis_degc[k]:.0f} degC"
        for k in range(3)
    )
    rows = [
        [
            f"{'*' if row is drift.chosen else ' '} {row.label}",
            str(row.parameters),
            *(f"{v * scale:.2f}" for v in row.fitted),
            *(["-"] * 3 if row.held_out is None else _held_out(row.held_out, scale)),
        ]
        for row in drift.rows
    ]
    names = [f"{a} {what}" for what in ("fitted", "held out") for a in AXES]
    head = [f"candidates, rms {unit}", "parameters", *names]
    lines = [
        f"half-cycles   {halves}",
        f"hysteresis    heating against cooling differ most by {apart}",
        "",
        *table(head, rows),
        "",
        _why(drift, scale, unit),
    ]
    return "\n".join(lines)


def _held_out(values: FloatArray, scale: float) -> list[str]:
    return [f"{v * scale:.2f}" for v in np.sqrt(np.mean(values**2, axis=0))]


def _why(drift: Drift, scale: float, unit: str) -> str:
    chosen = drift.chosen
    if chosen.held_out is None:
        return "one half-cycle only: none can be held out, so no candidate is chosen"
    score = f"{chosen.score * scale:.3g} {unit}"
    text = (
        f"* {chosen.label}: held-out error {score}, the simplest candidate within 10 % of the best"
    )
    plain = [row for row in drift.rows if row.rate is None]
    best = min(plain, key=lambda row: row.score)
    if chosen.rate is None:
        return text + "; a term in dT/dt does not improve it"
    rate = ", ".join(f"{v * scale:.3g}" for v in chosen.rate)
    return (
        f"{text}; without dT/dt the best is {best.score * scale:.3g} ({best.label}). dT/dt term: "
        f"{rate} {unit} per K/s in x, y, z"
    )


def drift_picture(samples: Samples, drift: Drift, layout: RecordingLayout) -> bytes:
    """Each output over temperature, half-cycle by half-cycle: hysteresis is what lies between."""
    panels = []
    reading = samples.part(READING)
    for k in range(3):
        mean = float(reading[:, k].mean())
        lines = [
            Line(
                h.label(drift.temp_degc),
                COLOURS[n % len(COLOURS)],
                drift.temp_degc[h.start : h.stop],
                _running(reading[h.start : h.stop, k]) - mean,
                dashed=not h.rising,
            )
            for n, h in enumerate(drift.halves)
        ]
        title = f"{AXES[k]}, {layout.acceleration_unit} from its mean"
        panels.append(Panel(title, "degC", lines))
    return line_plot("Outputs over temperature: heating against cooling", panels)


def _running(values: FloatArray, window: int = 25) -> FloatArray:
    """Running mean, so that noise does not hide the curve."""
    if len(values) <= window:
        return values
    sums = np.cumsum(np.concatenate([[0.0], values]))
    index = np.arange(len(values))
    low, high = np.maximum(index - window // 2, 0), np.minimum(index + window // 2 + 1, len(values))
    result: FloatArray = (sums[high] - sums[low]) / (high - low)
    return result
