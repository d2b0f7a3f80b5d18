"""Whether a recording's calibration keeps the unit's limits, at its poses and at those held out.

    | |a| - g |  at each pose                     <= limits.at_t0_g within 2 degC of T0, else
                                                     limits.over_range_g
    rms of it at poses held out                   <= the same
    rms of it at temperatures held out            <= limits.over_range_g
    rms error of a component at what is held out  <= the same, where directions are known

The rms and not the largest: what is held out of a recording is a pose with its own noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.calibration import Calibration
from triaxcal.fitting.core.judged import TEMPERATURE
from triaxcal.fitting.core.recorded import RecordingFit
from triaxcal.model.types import FloatArray
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.limits import WHERE

_CHECK_POSE = (
    "check that pose with `triaxcal poses`; if it is good, state the limit that this sensor keeps"
)


@dataclass(frozen=True)
class HeldOutError:
    """Poses held out that have one limit in common: their rms error, and the worst of them.

    Attributes
    ----------
    what : str
        What was held out in turn, `ORIENTATION` or `TEMPERATURE`.
    limit_g : float
    key : str
        Of the limit, as in unit.toml.
    rms_g : float
        Of |a| - g; of a component of the force where `components`.
    worst : int
        Index of the pose with the largest error, `error_g`.
    poses : int
    components : bool
    """

    what: str
    limit_g: float
    key: str
    rms_g: float
    worst: int
    error_g: float
    poses: int
    components: bool = False

    @property
    def where(self) -> str:
        """Where its limit holds."""
        return WHERE[self.key]


def refuse_poses_beyond_limits(unit: UnitDescription, calibration: Calibration) -> None:
    """P1 (13) at the poses and at held-out poses; the compiled C is checked again afterwards.

    Raises
    ------
    RefusedError
        Names the worst pose.
    """
    recording = calibration.recording
    if recording is None:
        return
    errors = recording.residual_g
    poses = recording.poses.poses
    temps = _temps_degc(unit, recording)
    limits = np.array([unit.limits.at(t, unit.t0_degc)[0] for t in temps])
    worst = int((np.abs(errors) / limits).argmax())
    if abs(errors[worst]) <= limits[worst]:
        _refuse_held_out(unit, recording)
        return
    pose = poses[worst]
    key = unit.limits.at(temps[worst], unit.t0_degc)[1]
    raise RefusedError(
        f"{recording.poses.source}, line {pose.line}",
        f"| |a| - g | = {abs(errors[worst]) * 1e3:.4g} mg in pose {pose.number}, rms over "
        f"the poses {recording.rms_g * 1e3:.3g} mg",
        expected=f"at most {limits[worst] * 1e3:g} mg ({key})",
        remedy=next(iter(recording.contradicted), _CHECK_POSE),
    )


def _temps_degc(unit: UnitDescription, recording: RecordingFit) -> list[float]:
    """Temperature of each pose; T0 where none was recorded."""
    return [unit.t0_degc if p.temp_degc is None else p.temp_degc for p in recording.poses.poses]


def held_out_errors(unit: UnitDescription, recording: RecordingFit) -> list[HeldOutError]:
    """Held-out errors by the limit of their pose; temperatures held out have that over the range.

    The latter show the curves between the calibrated temperatures, as those of a tilter do.
    """
    found, temps = [], _temps_degc(unit, recording)
    for held in recording.held_out:
        over = unit.limits.over_range_g, "limits.over_range_g"
        own = [
            over if held.what == TEMPERATURE else unit.limits.at(temps[k], unit.t0_degc)
            for k in held.poses
        ]
        for limit_g, key in sorted(set(own)):
            at = [n for n, limit in enumerate(own) if limit == (limit_g, key)]
            for errors, components in ((held.error_g, False), (held.component_g, True)):
                if errors is not None:
                    limit = limit_g, key
                    found.append(
                        _of(held.what, limit, held.poses, at, errors, components=components)
                    )
    return found


def _of(
    what: str,
    limit: tuple[float, str],
    poses: Sequence[int],
    at: Sequence[int],
    errors_g: FloatArray,
    *,
    components: bool,
) -> HeldOutError:
    """Of the errors (n,) of held-out `poses` those `at` the limit."""
    own = np.abs(errors_g[list(at)])
    worst, rms = int(own.argmax()), float(np.sqrt(np.mean(own**2)))
    pose, error_g = poses[at[worst]], float(own[worst])
    return HeldOutError(what, *limit, rms, pose, error_g, len(at), components)


def _refuse_held_out(unit: UnitDescription, recording: RecordingFit) -> None:
    """Refuse an error at unseen poses that is beyond the limit, whatever the residual is."""
    errors = held_out_errors(unit, recording)
    missed = max(errors, key=lambda m: m.rms_g / m.limit_g, default=None)
    if missed is None or missed.rms_g <= missed.limit_g:
        return
    pose = recording.poses.poses[missed.worst]
    at = "" if pose.temp_degc is None else f" at {pose.temp_degc:.4g} degC"
    of = "a component of the force is off by" if missed.components else "| |a| - g | ="
    raise RefusedError(
        f"{recording.poses.source}, line {pose.line}",
        f"{of} {missed.rms_g * 1e3:.4g} mg rms at held-out poses, with each {missed.what} held "
        f"out in turn; the largest is {missed.error_g * 1e3:.4g} mg in pose {pose.number}{at}; "
        f"the fit's residual is {recording.rms_g * 1e3:.3g} mg rms",
        expected=f"at most {missed.limit_g * 1e3:g} mg ({missed.key})",
        remedy=next(iter(recording.contradicted), "")
        or f"{_remedy(missed)}; `triaxcal poses` shows those that there are",
    )


def _remedy(missed: HeldOutError) -> str:
    if missed.components:
        return (
            "check the stated angles or directions of that pose; if they are known no better, "
            "remove them, or state the limit that they allow"
        )
    if missed.what == TEMPERATURE:
        return "record poses at more temperatures, or choose another function in [thermal]"
    return "record more poses, in different orientations"
