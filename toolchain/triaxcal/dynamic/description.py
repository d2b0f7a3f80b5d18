"""unit.toml of a unit on a turntable: [site], [dynamic], [noise], [table], [device]."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import Layout, Table, has_table, read_tables
from triaxcal.dynamic.block import StateBlock
from triaxcal.dynamic.device import DEVICE_KEYS, Device, device_of
from triaxcal.dynamic.noise import MICRO_G, DataSheet
from triaxcal.dynamic.recording import CONVENTIONS, INCREMENT, Turntable
from triaxcal.dynamic.registry import extensions
from triaxcal.model.types import FloatArray
from triaxcal.unit.description import FORMAT, PLAUSIBLE_DEGC, check_unit_name, find_unit

_LAYOUT: Layout = {
    "": {"format": True, "serial": True, "description": False},
    "site": {"latitude_deg": True, "local_gravity_m_per_s2": True},
    "dynamic": {
        "recording": True,
        "time_column": False,
        "time_unit": False,
        "rate_hz": False,
        "rate_columns": True,
        "rate_unit": True,
        "rate_samples": True,
        "rate_max": False,
        "force_columns": True,
        "force_unit": True,
        "force_samples": True,
        "force2_columns": False,
        "temp_column": False,
        "table_angle_column": False,
        "reference_degc": False,
        "blocks": False,
    },
    "noise": {
        "gyro_arw_deg_per_sqrt_h": True,
        "accel_vrw_ug_per_sqrt_hz": True,
        "second_vrw_ug_per_sqrt_hz": False,
        "accel_lsb": False,
        "table_sd_arcsec": False,
        "axis_wobble_arcsec": False,
    },
    "table": {"azimuth_deg": False, "elevation_deg": False, "mountings": False},
    "device": dict.fromkeys(DEVICE_KEYS, False),
}
_RATE_UNITS = {"rad/s": 1.0, "deg/s": math.pi / 180, "deg/h": math.pi / 648000}
_ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180, "arcsec": math.pi / 648000}
_FORCE_UNITS = {"m/s^2": 1.0, "g": 1e6 * MICRO_G, "mg": 1e3 * MICRO_G}
_VELOCITY_UNITS = {"m/s": 1.0, "mm/s": 1e-3}
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


@dataclass(frozen=True)
class Columns:
    """Where the readings stand in the file and what one of them is in SI units.

    Attributes
    ----------
    time : str or None
    time_scale, rate_scale, force_scale : float
        s, rad/s (rad), m/s^2 (m/s) for one unit of the file.
    rate, force : three str
    force2 : three str, or None
    temp, table_angle : str or None
        degC; degrees.
    """

    time: str | None
    time_scale: float
    rate: tuple[str, ...]
    rate_scale: float
    force: tuple[str, ...]
    force_scale: float
    force2: tuple[str, ...] | None
    temp: str | None
    table_angle: str | None


@dataclass(frozen=True)
class DynamicDescription:
    """A unit on a turntable.

    Attributes
    ----------
    name, serial : str
    path : Path
        Its unit.toml, for messages.
    recording : Path
    rate_hz : float or None
        Where there is no column of times.
    rate_max : float or None
        Full scale of the gyros, rad/s.
    device : Device or None
        What the firmware's codes are; without it there is no C.
    """

    name: str
    serial: str
    path: Path
    recording: Path
    latitude_deg: float
    gravity_m_per_s2: float
    columns: Columns
    rate_hz: float | None
    rate_max: float | None
    rate_convention: str
    force_convention: str
    reference_degc: float
    blocks: tuple[str, ...]
    noise: DataSheet
    table: Turntable | None
    device: Device | None = None

    def state_blocks(self) -> tuple[StateBlock, ...]:
        """Blocks of the extensions that are switched on."""
        return tuple(b for name in self.blocks for b in extensions()[name].blocks)


def read_dynamic(folder: Path) -> DynamicDescription:
    """Description of the unit in `folder`.

    Raises
    ------
    RefusedError
        When there is no such unit or its file breaks a rule of docs/file-formats.md.
    """
    path = find_unit(folder)
    if not has_table(path, "dynamic"):
        raise RefusedError(
            str(path),
            "no table [dynamic]",
            expected="a whole IMU on a turntable",
            remedy=f"`triaxcal calib {folder}` calibrates this unit; see docs/dynamic.md",
        )
    tables = read_tables(path, _LAYOUT, FORMAT)
    top, site, dynamic = tables[""], tables["site"], tables["dynamic"]
    check_unit_name(top.text("serial"), top.where("serial"))
    rate_convention = dynamic.choice("rate_samples", CONVENTIONS)
    force_convention = dynamic.choice("force_samples", CONVENTIONS)
    columns = _columns(dynamic, rate_convention, force_convention)
    blocks = _blocks(dynamic, columns)
    return DynamicDescription(
        name=folder.absolute().name,
        serial=top.text("serial"),
        path=path,
        recording=folder / dynamic.text("recording"),
        latitude_deg=site.number("latitude_deg", -90.0, 90.0),
        gravity_m_per_s2=site.number("local_gravity_m_per_s2", 9.7, 9.9),
        columns=columns,
        rate_hz=_rate_hz(dynamic),
        rate_max=math.radians(dynamic.number("rate_max", 1e-3, 1e5))
        if "rate_max" in dynamic
        else None,
        rate_convention=rate_convention,
        force_convention=force_convention,
        reference_degc=dynamic.number("reference_degc", *PLAUSIBLE_DEGC)
        if "reference_degc" in dynamic
        else 20.0,
        blocks=blocks,
        noise=_noise(tables["noise"]),
        table=_table(tables["table"]),
        device=device_of(tables["device"]),
    )


def _columns(table: Table, rate_convention: str, force_convention: str) -> Columns:
    rate_units = _ANGLE_UNITS if rate_convention == INCREMENT else _RATE_UNITS
    force_units = _VELOCITY_UNITS if force_convention == INCREMENT else _FORCE_UNITS
    time_unit = table.choice("time_unit", tuple(TIME_UNITS)) if "time_unit" in table else "s"
    return Columns(
        time=_text(table, "time_column"),
        time_scale=TIME_UNITS[time_unit],
        rate=_three(table, "rate_columns"),
        rate_scale=rate_units[table.choice("rate_unit", tuple(rate_units))],
        force=_three(table, "force_columns"),
        force_scale=force_units[table.choice("force_unit", tuple(force_units))],
        force2=_three(table, "force2_columns") if "force2_columns" in table else None,
        temp=_text(table, "temp_column"),
        table_angle=_text(table, "table_angle_column"),
    )


def _text(table: Table, key: str) -> str | None:
    return table.text(key) if key in table else None


def _names(table: Table, key: str) -> tuple[str, ...]:
    value = table.values[key]
    if not isinstance(value, list) or not all(isinstance(v, str) and v for v in value):
        raise table.refuse(key, "a list of names in quotes")
    return tuple(value)


def _three(table: Table, key: str) -> tuple[str, ...]:
    names = _names(table, key)
    if len(set(names)) != 3 or len(names) != 3:
        raise table.refuse(key, "three different names of columns, of axes x, y, z")
    return names


def _rate_hz(table: Table) -> float | None:
    if ("rate_hz" in table) == ("time_column" in table):
        found = "both given" if "rate_hz" in table else "neither given"
        raise RefusedError(
            f"{table.where('time_column')} and rate_hz",
            found,
            expected="one of them: a column of times, or the rate of even sampling",
        )
    return table.number("rate_hz", 1.0, 1e5) if "rate_hz" in table else None


_COLUMN_OF = {
    "temp_degc": ("temp_column", "temp"),
    "force2": ("force2_columns", "force2"),
    "table_angle_rad": ("table_angle_column", "table_angle"),
}


def _blocks(table: Table, columns: Columns) -> tuple[str, ...]:
    names = _names(table, "blocks") if "blocks" in table else ()
    known = extensions()
    for name in names:
        if name not in known or names.count(name) > 1:
            raise RefusedError(
                table.where("blocks"),
                f"found {name!r}" + (" twice" if name in known else ""),
                expected="names out of " + ", ".join(known) + ", each once",
            )
        for block in known[name].blocks:
            key, attribute = _COLUMN_OF.get(block.needs, ("", ""))
            if key and getattr(columns, attribute) is None:
                raise RefusedError(
                    table.where("blocks"),
                    f'"{name}" is switched on and no {key} is given',
                    expected=f"{key} in [dynamic]",
                    remedy="name the column, or switch the block off",
                )
    return names


def _noise(table: Table) -> DataSheet:
    limits = {
        "gyro_arw_deg_per_sqrt_h": (1e-6, 100.0),
        "accel_vrw_ug_per_sqrt_hz": (1e-3, 1e5),
        "second_vrw_ug_per_sqrt_hz": (1e-3, 1e5),
        "accel_lsb": (0.0, 1e6),
        "table_sd_arcsec": (1e-3, 1e5),
        "axis_wobble_arcsec": (1e-3, 1e5),
    }
    return DataSheet(**{k: table.number(k, *limits[k]) for k in limits if k in table})


def _table(table: Table) -> Turntable | None:
    """[table], or None where there is none."""
    if not table.values:
        return None
    for key in ("azimuth_deg", "mountings"):
        if key not in table:
            raise RefusedError(table.where(key), "missing", expected="it, where [table] is given")
    elevation = table.number("elevation_deg", -90.0, 90.0) if "elevation_deg" in table else 0.0
    return Turntable(
        math.radians(table.number("azimuth_deg", -360.0, 360.0)),
        math.radians(elevation),
        tuple((math.nan, _mounting(table, text)) for text in _names(table, "mountings")),
    )


def _mounting(table: Table, text: str) -> FloatArray:
    """Matrix of "+x +z": instrument axes along the table's axis, and up at angle zero."""
    axes = [_AXES.get(word if word[0] in "+-" else f"+{word}") for word in text.split()]
    if len(axes) != 2 or axes[0] is None or axes[1] is None or axes[0] @ axes[1] != 0:
        raise RefusedError(
            table.where("mountings"),
            f"found {text!r}",
            expected='two instrument axes such as "x z" or "-y x": along the table\'s axis, and up',
        )
    along, up = axes[0], axes[1]
    return np.column_stack([along, np.cross(up, along), up])


_AXES = {
    sign + axis: value * np.eye(3)[i]
    for sign, value in (("+", 1.0), ("-", -1.0))
    for i, axis in enumerate("xyz")
}
