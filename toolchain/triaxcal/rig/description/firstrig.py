"""A first rig.toml from a bus description: `triaxcal init --rig`."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.tomltext import toml_value
from triaxcal.rig.description import hints
from triaxcal.rig.description.busfile import BusFile, read_bus_file
from triaxcal.rig.description.buslookup import nearest
from triaxcal.rig.description.layout import FrameLayout
from triaxcal.rig.description.recorded import ACCELERATIONS, TEMPERATURES, folded
from triaxcal.rig.description.resolve import AXES
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.description.rigkeys import JOINS, RIG_FILE

WANTED = (*AXES, "temperature")
"""What is asked for."""
_HINTS: Mapping[str, re.Pattern[str]] = {
    "counter": hints.COUNTER,
    "crc": hints.CRC,
    "status": hints.STATUS,
}
_AGE_S = 0.005

Ask = Callable[[str, str], str]
"""Gives the name of a signal for x, y, z or the temperature, and a likely one or ""."""


def likely(file: BusFile) -> dict[str, str]:
    """Signals that may be x, y, z and the temperature, by their units and names."""
    found: dict[str, str] = {}
    for layout in file.layouts():
        for name, signal in layout.signals.items():
            full, unit = f"{layout.name}.{name}", folded(signal.unit)
            if unit in TEMPERATURES:
                found.setdefault("temperature", full)
            if unit in ACCELERATIONS:
                axis = next((a for a in AXES if re.search(rf"(?i)(^|[a-z_]){a}(_|$|\d)", name)), "")
                found.setdefault(axis, full)
    found.pop("", None)
    return found


def names_of(file: BusFile) -> list[str]:
    """Full names of all signals."""
    return [f"{layout.name}.{name}" for layout in file.layouts() for name in layout.signals]


def chosen(file: BusFile, given: Mapping[str, str | None], ask: Ask | None) -> dict[str, str]:
    """Signals for x, y, z and the temperature: those that are given, else those that `ask` gives.

    Raises
    ------
    RefusedError
        When one does not exist, with the nearest names; when one is missing and nobody is asked.
    """
    known, guess = names_of(file), likely(file)
    found: dict[str, str] = {}
    for key in WANTED:
        name = given.get(key)
        if name is None and ask is not None:
            name = ask(key, guess.get(key, ""))
        if not name and key == "temperature":
            continue
        if not name:
            raise RefusedError(
                f"--{key}",
                "missing",
                expected=f"a signal of {file.path}"
                + (f", as {guess[key]}" if key in guess else ""),
            )
        if name not in known:
            raise RefusedError(
                f"--{key}",
                f"no signal {name!r}",
                expected=f"a signal of {file.path}",
                remedy="nearest: " + ", ".join(nearest(name, known)),
            )
        found[key] = name
    return found


def write_rig(folder: Path, bus_file: Path, signals: Mapping[str, str]) -> Path:
    """Write rig.toml into a folder; returns its path.

    Parameters
    ----------
    signals : mapping
        "Message.Signal" for x, y, z and, where there is one, the temperature.

    Raises
    ------
    RefusedError
        When there is a rig.toml, the folder cannot be written, or the signals cannot be used.
    """
    path = folder / RIG_FILE
    if path.exists():
        raise RefusedError(
            str(path), "exists already", remedy="edit it, remove it, or name another folder"
        )
    file = read_bus_file(bus_file)
    aside = folder / f".{RIG_FILE}.{os.getpid()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        relative = Path(os.path.relpath(bus_file, folder)).as_posix()
        try:
            aside.write_text(_text(file, relative, signals), encoding="utf-8")
            read_description(aside)
            aside.replace(path)
        finally:
            aside.unlink(missing_ok=True)
    except OSError as error:
        raise refused_by_system(path, "written", error) from error
    except RefusedError as refusal:
        place = refusal.place.replace(str(aside), str(path))
        raise RefusedError(
            place, refusal.found, expected=refusal.expected, remedy=refusal.remedy
        ) from refusal
    return path


def _text(file: BusFile, relative: str, signals: Mapping[str, str]) -> str:
    layouts = {layout.name: layout for layout in file.layouts()}
    owner = {
        f"{layout.name}.{name}": layout for layout in layouts.values() for name in layout.signals
    }
    used = list(dict.fromkeys(owner[name].name for name in signals.values()))
    axis_messages = list(dict.fromkeys(owner[signals[axis]].name for axis in AXES))
    lines = [
        "# Which signals are the axes of the sensor. All keys: docs/reference/keys.md.",
        "# A key that is commented out is a guess by the name of the signal.",
        "format = 1",
        "",
        "[rig]",
        f"file = {toml_value(relative)}",
        "",
        "[signals]",
        *(f"{key} = {toml_value(name)}" for key, name in signals.items()),
    ]
    if len(axis_messages) > 1 or len({_case(owner[signals[a]], signals[a]) for a in AXES}) > 1:
        lines += [
            "# The axes come in several frames. With a counter of samples in each of them:",
            f'# join = "{JOINS[0]}"',
            f'join = "{JOINS[1]}"',
            f"age_s = {_AGE_S:g}  # state less than the time from sample to sample",
        ]
    for name in used:
        lines += _message(layouts[name], set(signals.values()))
    return "\n".join(lines) + "\n"


def _case(layout: FrameLayout, full: str) -> tuple[object, ...]:
    return layout.multiplexed.get(full.rpartition(".")[2], ())


def _message(layout: FrameLayout, taken: set[str]) -> list[str]:
    """Table of a message, with the signals that its keys may name."""
    lines: list[str] = []
    for key, hint in _HINTS.items():
        names = [
            name
            for name, signal in layout.signals.items()
            if hint.search(name)
            and f"{layout.name}.{name}" not in taken
            and not signal.is_float
            and name not in layout.multiplexed
        ]
        if key == "status" and len(names) > 1:
            lines.append(f"# status = [{', '.join(map(toml_value, names))}]")
        else:
            lines += [f"# {key} = {toml_value(name)}" for name in names]
        if key == "crc" and names:
            lines.append('# protection = "sae-j1850"')
        if key == "status" and names:
            lines.append("# status_good = [0]")
    bare = re.fullmatch(r"[A-Za-z0-9_-]+", layout.name)
    name = layout.name if bare else toml_value(layout.name)
    return ["", f"[message.{name}]", *lines] if lines else []
