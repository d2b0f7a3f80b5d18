"""`export`: a delivery in the layout of a build system, or as parameters of an autopilot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from triaxcal.api.delivered import delivered_firmware, load_delivered
from triaxcal.api.delivery import delivered_file
from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.publish import renew
from triaxcal.delivery.fitted import Fitted
from triaxcal.exports.registry import TARGETS
from triaxcal.exports.target import Source, Target


@dataclass(frozen=True)
class ExportedFiles:
    """What was written.

    Attributes
    ----------
    folder : Path
    files : tuple of str
        Paths below `folder`.
    summary : str
        What is said of it; of an autopilot, what its model costs.
    """

    folder: Path
    files: tuple[str, ...]
    summary: str


def export(
    unit: str | Path,
    to: str,
    into: str | Path | None = None,
    build: str | Path = "build",
    prefix: str | None = None,
    *,
    arithmetic: str | None = None,
) -> ExportedFiles:
    """Write a delivered unit for a build system or an autopilot.

    Parameters
    ----------
    unit : path
        A unit or an IMU, a delivered folder, or its calibration.json.
    to : str
        Name of a target, as `triaxcal export --help` lists them.
    into : path or None
        Folder for the files; None is `build`/NAME-TO, with a prefix `build`/NAME-PREFIX-TO.
    build : path
        Folder with the delivered units.
    prefix : str or None
        What names in the C begin with: it is made and checked again. None takes the delivered C.
    arithmetic : str or None
        How the C forms its products; as `prefix`.

    Raises
    ------
    RefusedError
        When there is no such target or delivery, a delivered file has changed, the target cannot
        hold the calibration, the prefix is none, or the target has no C.
    """
    target = TARGETS[to]
    delivered = delivered_file(Path(unit), Path(build)).parent
    done = load_delivered(unit, build).fitted
    same = prefix is None and arithmetic is None
    c = None if same else _checked_c(unit, build, prefix, arithmetic, target)
    made = target.make(Source(delivered, done, c))
    name = done.unit.name if isinstance(done, Fitted) else done.name
    parts = (name, to) if prefix is None else (name, prefix, to)
    folder = Path(into) if into is not None else Path(build) / "-".join(parts)
    if folder.is_file():
        raise RefusedError(str(folder), "a file", expected="a folder")
    for file, content in made.files.items():
        place = folder / file
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise refused_by_system(str(place.parent), "made", error) from error
        renew({place.name: content}, place.parent)
    return ExportedFiles(folder, tuple(made.files), made.summary)


def _checked_c(
    unit: str | Path,
    build: str | Path,
    prefix: str | None,
    arithmetic: str | None,
    target: Target,
) -> dict[str, bytes]:
    """C and image under a prefix, checked as those of a delivery."""
    if not target.takes_c:
        raise RefusedError(
            "arithmetic" if prefix is None else "prefix",
            f'found "{prefix or arithmetic}"',
            expected=f"none: {target.label} gets parameters, no C",
        )
    firmware = delivered_firmware(unit, build, prefix, arithmetic)
    firmware.check()
    return dict(firmware.files)
