"""A unit's calibrations over time, for the terminal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.screentext import table
from triaxcal.delivery.fitted import fit_folder
from triaxcal.delivery.saved import read_saved
from triaxcal.delivery.unit import Delivery
from triaxcal.fitting.pair.cross_coupling import stated_pair
from triaxcal.model.framefree import NAMES, UNITS
from triaxcal.readings.measurements import MEASUREMENTS_FILE
from triaxcal.uncertainty.history import (
    EN_MAX,
    EN_MAX_NINE,
    HISTORY_FOLDER,
    Calibrated,
    Change,
    Repeatability,
    calibrated,
    day_of,
    latest_change,
)
from triaxcal.unit.description import UnitDescription


def read_history(
    folder: Path, unit: UnitDescription, delivered: Path | None = None
) -> list[Calibrated]:
    """All calibrations of a unit, the oldest first, the present one last.

    history/ has earlier readings, in the form of the unit's own, or calibration.json files as they
    were delivered. `delivered` is the calibration.json in use. It counts where it is an update by
    poses from the field, and so do the updates that are kept beside its folder: after the present
    one where they are updates of it, before it where they are not.

    Raises
    ------
    RefusedError
        When there is no earlier one, one is refused, or one does not know its uncertainty.
    """
    older = sorted(
        (path for path in (folder / HISTORY_FOLDER).glob("*") if path.is_file()),
        key=lambda path: path.stem,
    )
    found = [_earlier(path, folder, unit) for path in older if not path.name.startswith(".")]
    now = fit_folder(unit, folder)
    present = Calibrated(
        "now",
        unit.measured.date,
        now.measurements,
        now.calibration,
        now.unit,
        now.inputs_sha256,
    )
    updates = [] if delivered is None else _updates(delivered)
    found += [c for c in updates if now.inputs_sha256 not in c.parents]
    found += [present, *(c for c in updates if now.inputs_sha256 in c.parents)]
    if len(found) < 2:
        recorded = MEASUREMENTS_FILE
        if unit.recording is not None:
            recorded = ", ".join(unit.recording.file)
        raise RefusedError(
            str(folder / HISTORY_FOLDER),
            "no earlier measurements",
            expected=f"{HISTORY_FOLDER}/<day>.csv, as {HISTORY_FOLDER}/2025-03-30.csv",
            remedy=f"move {recorded} there before you put a new one in its place",
        )
    for each in found:
        recording = each.calibration.recording
        if recording is not None and not recording.checked:
            raise RefusedError(
                recording.poses.source,
                "its uncertainty is unknown: as many constants as poses",
                expected="a calibration with more poses",
                remedy=f"take it out of {HISTORY_FOLDER}",
            )
    return found


def _updates(delivered: Path) -> list[Calibrated]:
    """Updates that were delivered, the oldest first: in use, and kept beside the folder in use."""
    folder = delivered.parent
    kept = sorted(folder.parent.glob(f"{folder.name}.????????/{delivered.name}"))
    found = []
    for path in (*kept, delivered):
        if path.is_file():
            name = "update" if path == delivered else f"update {path.parent.name[-8:]}"
            found.append(_saved(path, name))
    updates = [c for c in found if c.calibration.update is not None]
    return sorted(updates, key=lambda c: len(c.parents))


def _earlier(path: Path, folder: Path, unit: UnitDescription) -> Calibrated:
    if path.suffix == ".json":
        return _saved(path, path.stem)
    if unit.recording is None:
        return calibrated(path, unit, path.stem, day_of(path.stem), stated_pair(unit, folder))
    from triaxcal.fitting.route import calibrate_recording  # noqa: PLC0415

    layout = replace(unit.recording, file=(f"{HISTORY_FOLDER}/{path.name}",))
    made, measurements, calibration = calibrate_recording(unit, layout, folder)
    return Calibrated(path.stem, day_of(path.stem), measurements, calibration, made)


def _saved(path: Path, name: str) -> Calibrated:
    saved = read_saved(path)
    if saved.fitted is None:
        raise RefusedError(
            str(path),
            saved.without_fit,
            expected="a calibration.json with its fit",
            remedy="put the readings of that day there instead",
        )
    done = saved.fitted
    day = day_of(path.stem)
    return Calibrated(name, day, done.measurements, done.calibration, done.unit, done.inputs_sha256)


def history_text(
    serial: str, history: list[Calibrated], found: list[Change], repeat: Repeatability | None
) -> str:
    """Table of the changes, what repeats, and what contradicts."""
    head = ["calibration", "bias mg", "scale ppm", "cross urad", "En", "where", "En free"]
    rows = [
        [
            c.name, f"{c.bias_mg:+.4f}", f"{c.scale_ppm:+.1f}", f"{c.cross_axis_micro_rad:+.1f}",
            f"{c.en:.2f}", c.where.replace("°C", "degC"), f"{c.nine_en:.2f}",
        ]
        for c in found
    ]  # fmt: skip
    lines = [
        f"{len(history)} calibrations of {serial}; largest change since the one before, at T0",
        "",
        *table(head, [[history[0].name, *"----", "", "-"], *rows], left=(0, 5)),
        "",
        "En: the largest of 36 differences, divided by its expanded uncertainty (95 %).",
        f"Chance alone gives more than {EN_MAX:.2f} in one comparison of twenty; above that, the",
        "two calibrations contradict each other.",
        "",
        *_frame_free(history, found),
        "",
    ]
    related = [f"{c.name} of {c.before}" for c in found if c.is_update]
    if related:
        lines += [
            f"Updates: {', '.join(related)}. The two share their data and are not independent:",
            "their En does not tell whether they contradict; only the later one counts below.",
            "",
        ]
    if repeat is None:
        lines.append("Repeatability: unknown, there are too few calibrations.")
    else:
        about = "about a straight line in time" if repeat.years else "about their mean"
        lines.append(
            f"Repeatability of {repeat.calibrations} calibrations {about}: bias "
            f"{repeat.bias_mg:.2g} mg, scale {repeat.scale_ppm:.2g} ppm, cross-axis "
            f"{repeat.cross_axis_micro_rad:.2g} urad."
        )
        if repeat.years and repeat.bias_mg_a_year is not None:
            lines.append(
                f"Ageing over {repeat.years:.1f} years, a year: bias {repeat.bias_mg_a_year:+.2g} "
                f"mg, scale {repeat.scale_ppm_a_year:+.2g} ppm."
            )
    lines += [contradiction(c) for c in found if c.contradicts and not c.is_update]
    return "\n".join(lines)


def _frame_free(history: list[Calibrated], found: list[Change]) -> list[str]:
    """The last change of the nine constants that no rotation of the frame changes."""
    last = found[-1]
    rows = [
        [f"  {name}", f"{last.nine[k]:+.4g}", f"{abs(last.nine_u[k]):.3g}", UNITS[k]]
        for k, name in enumerate(NAMES)
    ]
    head = [f"{last.name} less {last.before}, T0", "changed by", "+- 95 %", "unit"]
    lines = table(head, rows, left=(0, 3))
    lines += [
        "These nine do not depend on the frame. En free is the largest of 27. Chance",
        f"alone gives more than {EN_MAX_NINE:.2f} in one comparison of twenty.",
    ]
    for c in found:
        if c.en > EN_MAX and not c.nine_contradicts:
            turned = "which is free" if c.frame_is_free else "as another mounting turns it"
            lines.append(f"{c.name}: only the frame turned, {turned}; the sensor did not change.")
    for each in history:
        update = each.calibration.update
        if update is not None:
            before = f"calibration {update.parents[-1][:8]}"
            poses = f"{update.poses} poses of {update.recording}"
            lines.append(f"{each.name}: {before} updated by {poses}.")
    return lines


def contradiction(change: Change) -> str:
    """Warning of a calibration that contradicts the one before."""
    if change.nine_contradicts and (change.frame_is_free or change.en <= EN_MAX):
        return (
            f"warning: calibration {change.name} contradicts {change.before}: "
            f"{change.nine_where.replace('°C', 'degC')} changed, En = {change.nine_en:.1f}; "
            "the unit has aged or was damaged, or one of the two is wrong"
        )
    unit = change.of_unit.replace("µ", "u")
    return (
        f"warning: calibration {change.name} contradicts {change.before}: "
        f"{change.where.replace('°C', 'degC')} changed by {_figure(change.by):+} {unit}, "
        f"{change.en:.1f} times the {_figure(change.expanded)} {unit} (95 %) that their "
        "uncertainties allow; the unit has aged or was damaged, or one of the two is wrong"
    )


def contradiction_of(folder: Path, delivery: Delivery) -> tuple[str, ...]:
    """Warning where a calibration contradicts the last one in the unit's history; else nothing.

    Raises
    ------
    RefusedError
        When the last one cannot be calibrated.
    """
    newest = Calibrated("now", None, delivery.measurements, delivery.calibration)
    change = latest_change(folder, delivery.unit, newest)
    return (contradiction(change),) if change is not None and change.contradicts else ()


def _figure(value: float) -> float:
    """Three figures."""
    return float(f"{value:.3g}")
