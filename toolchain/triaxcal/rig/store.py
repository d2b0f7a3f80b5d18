"""measurements.csv of a session, and measurements.json beside it: how it came about."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

from triaxcal.readings.measurements import MEASUREMENTS_FILE, write_measurements
from triaxcal.readings.measurements_csv import DEVIATIONS, READINGS
from triaxcal.rig.events import AcceptedDwell
from triaxcal.rig.journal import disk_refusal
from triaxcal.rig.session import Session

SIDECAR_FILE = "measurements.json"
FORMAT = 1


def write_records(
    folder: Path, session: Session, dbc_sha256: str, log: dict[str, int | str]
) -> tuple[Path, Path]:
    """Write measurements.csv and measurements.json into a folder; returns their paths.

    A row's `count` is the number of batch means and its deviation that of one batch mean, so that
    sd^2 / count is u(A)^2, which is what the fit makes of them.

    Raises
    ------
    RefusedError
        When the folder cannot be written.
    """
    dwells = in_plan_order(session)
    table = folder / MEASUREMENTS_FILE
    write_measurements(
        table,
        ("position", "temp_code", *READINGS["code"], "count", *DEVIATIONS["code"]),
        [(d.position, d.temp_code, *d.mean_code, d.batches, *d.batch_sd_code) for d in dwells],
        (
            f"Session on the tilter rig, log SHA-256 {log['sha256']}",
            f"count: batch means of a dwell; sd: of one batch mean; see {SIDECAR_FILE}",
        ),
    )
    sidecar = folder / SIDECAR_FILE
    text = json.dumps(_sidecar(session, dwells, dbc_sha256, log), indent=2, sort_keys=True) + "\n"
    aside = sidecar.with_name(f".{sidecar.name}.{os.getpid()}")
    try:
        try:
            aside.write_text(text, encoding="utf-8", newline="\n")
            aside.replace(sidecar)
        finally:
            aside.unlink(missing_ok=True)
    except OSError as error:
        raise disk_refusal(sidecar, error) from error
    return table, sidecar


def in_plan_order(session: Session) -> list[AcceptedDwell]:
    """Dwells that count, in the order of the plan."""
    return [
        session.accepted[i, position]
        for i, step in enumerate(session.plan.steps)
        for position in step.positions
        if (i, position) in session.accepted
    ]


def _sidecar(
    session: Session, dwells: list[AcceptedDwell], dbc_sha256: str, log: dict[str, int | str]
) -> dict[str, Any]:
    plan = session.plan
    scale = abs(session.micro_g_per_code)
    return {
        "format": FORMAT,
        "unit": session.unit.name,
        "serial": session.unit.serial,
        "plan_sha256": plan.sha256,
        "dbc_sha256": dbc_sha256,
        "log": log,
        "thresholds": {"stillness": asdict(plan.stillness), "thermal": asdict(plan.thermal)},
        "reference": asdict(session.reference) if session.reference else None,
        "lost_samples": session.lost,
        "bad_crc_frames": session.bad_crc,
        "gaps": [{"after_s": after, "seconds": seconds} for after, seconds in session.gaps],
        "dwells": [
            {**asdict(d), "u_micro_g": [float(v) for v in scale * d.u_code]} for d in dwells
        ],
    }
