"""Which units there are, which must be made, and which are refused before anything starts."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.tomltable import has_table, read_toml
from triaxcal.batch import journal
from triaxcal.batch.order import Order, Outcome, planned, refused
from triaxcal.batch.toolchain import toolchain
from triaxcal.device.record import record_path
from triaxcal.dynamic.description import read_dynamic
from triaxcal.readings.measurements import MEASUREMENTS_FILE
from triaxcal.simulation.imu_unit import IMU_TRUTH_FILE
from triaxcal.unit.folder import UNIT_FILE, find_unit, list_units
from triaxcal.unit.recordingfile import files_in, is_in_folder


@dataclass(frozen=True)
class Work:
    """The series before the run.

    Attributes
    ----------
    orders : list of Order
        To be made.
    done : dict
        Journal entries of units made before from the same inputs by the same toolchain.
    refused : list of Outcome
        Units that cannot be read, and those that share a name or serial.
    skipped : list of (Path, str)
        What was named and is no unit of a series, and why.
    """

    orders: list[Order]
    done: dict[str, dict[str, Any]]
    refused: list[Outcome]
    skipped: list[tuple[Path, str]]

    @property
    def total(self) -> int:
        """Units in all."""
        return len(self.orders) + len(self.done) + len(self.refused)


def plan_work(folders: Iterable[Path], build: Path) -> Work:
    """Read every unit's inputs and compare them with what `build` holds.

    Raises
    ------
    RefusedError
        When no unit is named, or the journal cannot be read.
    """
    named = sorted(dict.fromkeys(folders))
    before, by = journal.read_journal(build), toolchain()
    orders, failed, skipped = [], [], []
    for path in named:
        try:
            reason = _not_of_a_series(path)
            if reason:
                skipped.append((path, reason))
            else:
                orders.append(replace(_order(path, by), device=_device(build, path)))
        except RefusedError as refusal:
            failed.append(Outcome(path.absolute().name, "", str(refusal)))
    if not orders and not failed:
        raise RefusedError("batch", "no units named", remedy="run triaxcal batch units/*")
    clashes = _clashes(orders, before)
    failed += [refused(o, clashes[o.folder]) for o in orders if o.folder in clashes]
    orders = [o for o in orders if o.folder not in clashes]
    done = {
        o.name: before[o.name]
        for o in orders
        if before.get(o.name, {}).get("key") == o.key and journal.intact(build, before[o.name])
    }
    return Work([o for o in orders if o.name not in done], done, failed, skipped)


def _not_of_a_series(path: Path) -> str:
    if path.is_file():
        return "a file, not a unit's folder"
    simulated = is_imu(path) and (path / IMU_TRUTH_FILE).is_file()
    if simulated and not read_dynamic(path).recording.exists():
        return f"a simulated IMU without its recording, which triaxcal simulate {path} makes"
    return ""


def is_imu(folder: Path) -> bool:
    """Whether the unit.toml of a folder describes an IMU.

    Raises
    ------
    RefusedError
        When the file is no TOML.
    """
    description = folder / UNIT_FILE
    return description.is_file() and has_table(description, "dynamic")


def _order(folder: Path, by: str) -> Order:
    description = find_unit(folder)
    if is_imu(folder):
        return planned(folder, by, _imu_files(folder))
    # A recording that lies elsewhere is refused when the unit is made.
    named = (*_recorded(description), *_bus(folder, "recording"), *_pair(description))
    files = files_in(folder, [*filter(is_in_folder, named)])
    return planned(folder, by, (UNIT_FILE, *(f.relative_to(folder).as_posix() for f in files)))


def _bus(folder: Path, table: str) -> tuple[str, ...]:
    """Names of the files that describe the bus of a log that [recording] or [dynamic] names."""
    if not has_table(folder / UNIT_FILE, table):
        return ()
    written = read_toml(folder / UNIT_FILE)[table]
    rigs = _texts(written, "rig")
    inner = [
        (Path(rig).parent / name).as_posix()
        for rig in rigs
        if is_in_folder(rig) and (folder / rig).is_file()
        for name in _texts(read_toml(folder / rig).get("rig"), "file", "more_files")
    ]
    return tuple(dict.fromkeys([*_texts(written, "dbc"), *rigs, *inner]))


def _texts(table: object, *keys: str) -> list[str]:
    """Texts, or lists of texts, of a table of a file that was not checked yet."""
    found = [table.get(key) for key in keys] if isinstance(table, dict) else []
    every = [item for value in found for item in (value if isinstance(value, list) else [value])]
    return [item for item in every if isinstance(item, str)]


def _imu_files(folder: Path) -> tuple[str, ...]:
    """Names of the files of an IMU, in their order.

    Raises
    ------
    RefusedError
        As `read_dynamic`, and where one lies elsewhere: it would not travel with its unit.
    """
    imu = read_dynamic(folder)
    names = [Path(os.path.relpath(file, folder)).as_posix() for file in imu.inputs]
    names += [name for name in _bus(folder, "dynamic") if name not in names]
    for name in names:
        if not is_in_folder(name):
            raise RefusedError(
                f"{imu.path}, [dynamic] recording",
                f"{name} lies outside of the unit's folder",
                expected="a file in the folder of its unit",
                remedy="copy it there",
            )
    return tuple(names)


def _device(build: Path, folder: Path) -> bytes:
    """Record of the device that was verified with an earlier delivery, or this one."""
    path = record_path(build / folder.absolute().name)
    try:
        return path.read_bytes() if path.exists() else b""
    except OSError as error:
        raise refused_by_system(path, "read", error) from error


def _pair(path: Path) -> tuple[str, ...]:
    """Name of the pair's readings that [quadratic] names, if it does."""
    if not has_table(path, "quadratic"):
        return ()
    table = read_toml(path)["quadratic"]
    name = table.get("cross_coupling") if isinstance(table, dict) else None
    return (name,) if isinstance(name, str) else ()


def _recorded(path: Path) -> tuple[str, ...]:
    """Names of what was measured: measurements.csv, or the files of [recording]."""
    if not has_table(path, "recording"):
        return (MEASUREMENTS_FILE,)
    recording = read_toml(path)["recording"]
    named = recording.get("file", "") if isinstance(recording, dict) else ""
    return tuple(map(str, named)) if isinstance(named, list) else (str(named),)


def _clashes(orders: list[Order], before: dict[str, dict[str, Any]]) -> dict[str, RefusedError]:
    """Refusals by folder: two units with one name or serial, named or beside those named."""
    by_name, by_serial = defaultdict(list), defaultdict(list)
    for order in orders:
        by_name[order.name].append(order.folder)
        known = before.get(order.name, {})
        # Unchanged inputs have the serial they had: a thousand parses are saved.
        if known.get("key") == order.key:
            serial = known["record"]["serial"]
        else:
            serial = _serial(Path(order.folder))
        by_serial[serial].append(order.folder)
    named = {Path(order.folder).absolute() for order in orders}
    for units_dir in {folder.parent for folder in named}:
        for name in list_units(units_dir):
            if units_dir / name not in named:
                by_serial[_serial(units_dir / name)].append(str(units_dir / name))
    by_serial.pop(None, None)
    clashes: dict[str, RefusedError] = {}
    for what, groups in (("serial", by_serial), ("name", by_name)):
        for value, found in groups.items():
            for folder in found if len(found) > 1 else ():
                other = next(f for f in found if f != folder)
                where = f"{folder}/{UNIT_FILE}, serial" if what == "serial" else folder
                clashes[folder] = RefusedError(
                    where,
                    f'"{value}" is also the {what} of {other}',
                    expected=f"a {what} of its own for each unit",
                    remedy="correct one of the two",
                )
    return clashes


def _serial(folder: Path) -> str | None:
    """Serial of a unit; None when its file is wrong, which is reported when it is made."""
    try:
        found = read_toml(folder / UNIT_FILE).get("serial")
    except RefusedError:
        return None
    return found if isinstance(found, str) else None
