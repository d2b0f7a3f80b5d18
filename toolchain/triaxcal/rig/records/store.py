"""measurements.csv of a session, and measurements.json beside it: how it came about."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from triaxcal.base.durable import replace_file
from triaxcal.readings.measurements import MEASUREMENTS_FILE
from triaxcal.readings.measurements_csv import DEVIATIONS, READINGS, measurements_text
from triaxcal.rig.description.description import RigDescription
from triaxcal.rig.records.journal import disk_refusal
from triaxcal.rig.samples.undetected import undetected
from triaxcal.rig.session.events import AcceptedDwell
from triaxcal.rig.session.session import Session

SIDECAR_FILE = "measurements.json"
FORMAT = 1


@dataclass(frozen=True)
class Written:
    """Files of a session's records, and those of earlier records that were kept beside them."""

    files: tuple[Path, ...]
    kept: tuple[Path, ...]


def write_records(
    folder: Path, session: Session, rig: RigDescription, log: dict[str, int | str]
) -> Written:
    """Write measurements.csv and measurements.json into a folder.

    A row's `count` is the number of batch means and its deviation that of one batch mean, so that
    sd^2 / count is u(A)^2, which is what the fit makes of them.

    Records that are there already are kept beside the new ones, with the time of their last change
    in the name; those with the same content stay as they are.

    Raises
    ------
    RefusedError
        When the folder cannot be written.
    """
    dwells = in_plan_order(session)
    table, sidecar = folder / MEASUREMENTS_FILE, folder / SIDECAR_FILE
    rows = [(d.position, d.temp_code, *d.mean_code, d.batches, *d.batch_sd_code) for d in dwells]
    contents = {
        table: measurements_text(
            ("position", "temp_code", *READINGS["code"], "count", *DEVIATIONS["code"]),
            rows,
            (
                f"Session on the tilter rig, log SHA-256 {log['sha256']}",
                f"count: batch means of a dwell; sd: of one batch mean; see {SIDECAR_FILE}",
            ),
        ),
        sidecar: json.dumps(_sidecar(session, dwells, rig, log), indent=2, sort_keys=True) + "\n",
    }
    files = {path: text.encode() for path, text in contents.items()}
    try:
        kept = _kept(files)
        for path, content in files.items():
            replace_file(path, content)
    except OSError as error:
        raise disk_refusal(table, error) from error
    return Written(tuple(files), kept)


def _kept(files: Mapping[Path, bytes]) -> tuple[Path, ...]:
    """Copies of the files that are there, when one of them has another content."""
    there = {path: path.read_bytes() for path in files if path.exists()}
    if all(files[path] == content for path, content in there.items()):
        return ()
    changed = max(path.stat().st_mtime for path in there)
    stamp = datetime.fromtimestamp(changed, UTC).strftime("%Y%m%dT%H%M%SZ")
    kept = []
    for path, content in there.items():
        names = (f"{path.stem}.{stamp}{f'-{n}' if n else ''}{path.suffix}" for n in range(1000))
        free = (p for p in map(path.with_name, names) if _is_free(p, content))
        kept.append(next(free))
        replace_file(kept[-1], content)
    return tuple(kept)


def _is_free(path: Path, content: bytes) -> bool:
    """Whether no other content has this name."""
    return not path.exists() or path.read_bytes() == content


def in_plan_order(session: Session) -> list[AcceptedDwell]:
    """Dwells that count, in the order of the plan."""
    return [
        session.accepted[i, position]
        for i, step in enumerate(session.plan.steps)
        for position in step.positions
        if (i, position) in session.accepted
    ]


def _sidecar(
    session: Session, dwells: list[AcceptedDwell], rig: RigDescription, log: dict[str, int | str]
) -> dict[str, Any]:
    plan = session.plan
    scale = abs(session.micro_g_per_code)
    return {
        "format": FORMAT,
        "unit": session.unit.name,
        "serial": session.unit.serial,
        "plan_sha256": plan.sha256,
        "dbc_sha256": rig.bus_sha256,
        "rig": rig.name,
        "rig_sha256": rig.sha256,
        "recorded": [axis.said for axis in rig.axes],
        "undetected": list(undetected(rig)),
        "log": log,
        "thresholds": {"stillness": asdict(plan.stillness), "thermal": asdict(plan.thermal)},
        "reference": asdict(session.reference) if session.reference else None,
        "lost_samples": session.lost,
        "bad_crc_frames": session.bad_crc,
        "repeated_samples": session.repeated,
        "invalid_values": session.invalid,
        "gaps": [{"after_s": after, "seconds": seconds} for after, seconds in session.gaps],
        "dwells": [
            {**asdict(d), "u_micro_g": [float(v) for v in scale * d.u_code]} for d in dwells
        ],
    }
