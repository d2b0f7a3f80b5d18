"""Results of a dynamic calibration: calibration.json, the report page, the text on the screen."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from triaxcal import __version__
from triaxcal.base.jsontext import json_bytes
from triaxcal.base.plaindata import plain
from triaxcal.delivery.fittedimu import firmware_document
from triaxcal.delivery.imu import ImuDelivery
from triaxcal.delivery.imuverdict import ImuVerdict
from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.observability import Observability
from triaxcal.evidence.chance import innovation_words
from triaxcal.report.dynamicpage import digits, dynamic_page, weak_words
from triaxcal.report.imuc import imu_c_files, imu_c_lines
from triaxcal.report.imunoise import noise_document, noise_lines
from triaxcal.report.imurecording import effect_words, recorded_words
from triaxcal.report.overtemperature import over_document, over_lines
from triaxcal.report.stated.statements import statements_of
from triaxcal.unit.measured import MEASURED

FORMAT = 1


def dynamic_files(made: ImuDelivery) -> dict[str, bytes]:
    """Name and content of everything that build/<UNIT>/ receives."""
    return {
        "calibration.json": json_bytes(calibration_document(made)),
        "dynamic.html": dynamic_page(made, {}),
        **imu_c_files(made),
    }


def calibration_document(made: ImuDelivery) -> dict[str, Any]:
    """calibration.json of an IMU; the docs have the layout."""
    done, verdict = made.done, made.verdict
    unit, result, seen = done.unit, done.result, done.seen
    layout, last = result.layout, result.passes[-1]
    return {
        "format": FORMAT,
        "kind": "dynamic",
        "triaxcal": __version__,
        "unit": unit.name,
        "serial": unit.serial,
        "inputs_sha256": made.inputs_sha256,
        "recording": unit.recording_words,
        "reference_degc": result.frame.reference_degc,
        "range_degc": done.range_degc and list(done.range_degc),
        **({"gyro_range_degc": list(done.gyro_range_degc)} if done.gyro_range_degc else {}),
        "local_gravity_m_per_s2": unit.gravity_m_per_s2,
        "latitude_deg": unit.latitude_deg,
        "measured": {s.key: s.json for s in statements_of(MEASURED, unit.measured)},
        "blocks": list(unit.blocks),
        "states": _states(result),
        "covariance": result.covariance.tolist(),
        "each_mounting": {
            "states": [layout.states[int(i)].name for i in layout.reset_columns()],
            "values": result.stage_p.tolist(),
        },
        "heading_rad": None if result.heading_rad is None else result.heading_rad.tolist(),
        "rests": {"number": len(result.survey.rests), "guard_s": result.survey.guard_s},
        "stages": [asdict(stage) | {"axis": "xyz"[stage.axis]} for stage in result.survey.stages],
        "passes": len(result.passes),
        "noise": noise_document(result),
        "innovations": {
            "chi_square": last.chi_square,
            "freedom": last.freedom,
            "verdict": innovation_words(result),
        },
        "verdict": {"words": verdict.words, "passed": verdict.passed, **plain(verdict)},
        "switched_off": [
            {"name": e.name, "chi_square": e.chi_square, "states": e.states, "shown": e.shown}
            | {"chi_square_alone": e.alone, "moves": e.moved, "moves_sd": e.moves_sd}
            | ({"hint": e.hint} if e.hint else {})
            for e in done.off
        ],
        "not_seen": [list(names) for names in seen.unseen],
        "known_badly": [
            {"states": w.names, "unit": w.unit, "sd_each": w.sd_each, "sd_next": w.sd_next}
            for w in seen.weak
        ],
        "known_only_together": [list(pair) for pair in seen.together],
        **({"findings": list(done.findings)} if done.findings else {}),
        **({} if done.over is None else {"over_temperature": over_document(done.over)}),
        **firmware_document(done, verdict),
    }


def _states(result: DynamicResult) -> list[dict[str, Any]]:
    return [
        {
            "name": state.name,
            "unit": state.unit,
            "si_per_unit": state.per_unit,
            "value": float(value),
            "sd": float(sd),
            "prior_sd": state.prior_sd * state.per_unit,
        }
        for state, value, sd in zip(result.layout.states, result.p, result.sd, strict=True)
    ]


def dynamic_summary(made: ImuDelivery, files: Iterable[str], target: str) -> str:
    """Text for the screen; `files` lie in the folder `target`."""
    done = made.done
    unit, result, seen = done.unit, done.result, done.seen
    layout = result.layout
    found = result.survey
    last = result.passes[-1]
    samples = f"{found.sections[-1].last + 1:_}".replace("_", " ")
    sections = f"{len(found.sections)} section{'s' * (len(found.sections) > 1)}"
    lines = [
        f"unit            {unit.name}  (serial {unit.serial})",
        f"recording       {unit.recording_words}: {samples} samples, {sections}",
        *(f"                {words}" for words in recorded_words(done)),
    ]
    for stage in found.stages:
        lines.append(
            f"  axis {'xyz'[stage.axis]}        {stage.start_s:7.0f} to {stage.end_s:6.0f} s, "
            f"{stage.turned_rad / 2 / math.pi:.1f} revolutions"
        )
    lines += [
        f"filter          {3 + len(layout)} states, {len(result.passes)} passes, "
        f"{last.freedom:_} measurements".replace("_", " "),
        f"                {innovation_words(result)}",
        *noise_lines(result),
        *_verdict_lines(made.verdict),
        "",
    ]
    for block in layout.blocks:
        lines.append(block.title)
        place = layout.place(block.name)
        for i, state in enumerate(block.states, start=place.start):
            value, sd = result.p[i] / state.per_unit, result.sd[i] / state.per_unit
            found_sd = f"{digits(sd, sd):<10s} {state.unit}"
            lines.append(f"  {state.name:9s} {digits(value, sd):>14s} sd {found_sd}")
    if done.over is not None:
        lines += over_lines(done.over)
    if done.off:
        lines += ["", "effects switched off, chi-square of their states in this recording:"]
        for effect in done.off:
            call = "  SIGNIFICANT" if effect.shown else ""
            size = f"{effect.chi_square:.1f} of {effect.states}"
            lines.append(f"  {effect.name:26s} {size:>12s}{call}")
            lines += [" " * 8 + effect_words(effect)] if effect.shown else []
            lines += [" " * 8 + effect.hint] if effect.hint else []
    lines += seen_lines(seen)
    lines += ["", *imu_c_lines(made), "", f"files           {target}/", " " * 16 + ", ".join(files)]
    return "\n".join(lines)


def _verdict_lines(verdict: ImuVerdict) -> list[str]:
    """The verdict, and what was held against each limit."""
    lines = [f"verdict         {verdict.words}"]
    for check in verdict.checks:
        lines.append(f"  {check.name}: {check.words}")
    return lines + [f"  {note}" for note in verdict.notes]


def seen_lines(seen: Observability) -> list[str]:
    """What a motion does not separate, for the screen."""
    lines: list[str] = []
    if seen.unseen:
        lines += ["", "not observable in this motion (their values are those of the prior):"]
        lines += ["  " + " with ".join(names) for names in seen.unseen]
    for weak in seen.weak:
        lines += ["", "poorly determined:", f"  {weak_words(weak)}"]
    if seen.together:
        lines += ["", "determined only in combination:"]
        lines += [f"  {a} and {b}, correlation {c:+.4f}" for a, b, c in seen.together]
    return lines
