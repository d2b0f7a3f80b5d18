"""The whole road for one IMU: recording, filter, model, C of both triads, proof, cross-check.

Nothing is written here; `triaxcal.base.publish` puts the files in place.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.progress import Progress
from triaxcal.codegen.compilers import find_compiler
from triaxcal.delivery.fittedimu import fitted_imu
from triaxcal.delivery.imuangles import imu_angles
from triaxcal.delivery.imuc import ImuC, imu_c
from triaxcal.delivery.imuverdict import ImuVerdict, judge_imu, refusal_of
from triaxcal.delivery.inputs import files_sha256
from triaxcal.dynamic.calibrate import NotSettledError
from triaxcal.dynamic.description import DynamicDescription, read_dynamic
from triaxcal.dynamic.device import REQUIRED
from triaxcal.dynamic.unit import DynamicUnit, calibrate_described
from triaxcal.evidence.check import Evidence
from triaxcal.evidence.examine import examine
from triaxcal.evidence.unsettled import explained
from triaxcal.uncertainty.angles import AngleUncertainty


@dataclass(frozen=True)
class ImuDelivery:
    """A calibrated IMU.

    Attributes
    ----------
    done : DynamicUnit
    inputs_sha256 : str
    evidence : Evidence
    c : ImuC or None
        None where unit.toml has no [device], or the verdict refuses.
    angles : AngleUncertainty or None
        Of the angles of its C; None where that makes none.
    """

    done: DynamicUnit
    inputs_sha256: str
    evidence: Evidence
    c: ImuC | None = None
    angles: AngleUncertainty | None = None

    @property
    def verdict(self) -> ImuVerdict:
        """Whether it may be delivered, and whether it has passed."""
        return judge_imu(self.done, self.evidence)


def deliver_imu(folder: Path, progress: Progress | None = None) -> ImuDelivery:
    """Calibrate the IMU in `folder` and, where its unit.toml has [device], make and check its C.

    Raises
    ------
    RefusedError
        As `read_dynamic` and `deliver_described`.
    """
    return deliver_described(read_dynamic(folder), progress)


def refuse_no_device(unit: DynamicDescription) -> None:
    """Refuse a unit that gets no C where C is asked for.

    Raises
    ------
    RefusedError
    """
    if unit.device is None:
        raise RefusedError(
            str(unit.path),
            "has no [device], so no C is generated",
            expected="[device] with " + ", ".join(REQUIRED),
            remedy="add it: docs/how-to/imu.md",
        )


def deliver_imu_c(folder: Path, progress: Progress | None = None) -> ImuC:
    """As `deliver_imu`, for its C alone.

    Raises
    ------
    RefusedError
        As `deliver_imu` and `refuse_no_device`.
    """
    unit = read_dynamic(folder)
    refuse_no_device(unit)
    made = deliver_described(unit, progress)
    assert made.c is not None
    return made.c


def deliver_described(unit: DynamicDescription, progress: Progress | None = None) -> ImuDelivery:
    """As `deliver_imu`, for a description that was read.

    Raises
    ------
    RefusedError
        As `fit_described` and `build_imu`; when the verdict refuses.
    """
    made = fit_described(unit, progress)
    refusal = refusal_of(made.done, made.evidence)
    if refusal is not None:
        raise refusal
    return made


def fit_described(unit: DynamicDescription, progress: Progress | None = None) -> ImuDelivery:
    """As `deliver_described`; what the verdict refuses is returned all the same, without C.

    Raises
    ------
    RefusedError
        As `calibrate_described` and `build_imu`; when the inputs change meanwhile.
    """
    if unit.device is not None:
        find_compiler()  # before minutes of filtering, not after
    inputs = _inputs_sha256(unit) if all(f.exists() for f in unit.inputs) else ""
    try:
        done = calibrate_described(unit, progress)
    except NotSettledError as refusal:
        raise explained(unit, refusal) from refusal
    if _inputs_sha256(unit) != inputs:
        raise RefusedError(
            str(unit.path.parent), "changed while it was read", remedy="run it again"
        )
    found = examine(done, progress or (lambda _step, _part: None))
    if unit.device is None or found.failed:
        return ImuDelivery(done, inputs, found)
    c = imu_c(fitted_imu(done, judge_imu(done, found), inputs))
    return ImuDelivery(done, inputs, found, c, imu_angles(done, c))


def _inputs_sha256(unit: DynamicDescription) -> str:
    return files_sha256(unit.inputs, "put it there, or correct [dynamic] recording")
