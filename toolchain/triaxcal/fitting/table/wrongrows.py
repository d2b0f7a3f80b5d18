"""Rows of a table whose angles or readings the other rows contradict, several at once.

Two wrong rows hide each other: each is part of what the other is compared with. So the worst is
taken out, then the worst of the rest, and so on; the longest series at whose end the last one out
is still significant is wrong (Rosner's generalised extreme studentised deviate). The errors are
vectors of the force, each row held out: |a| alone does not see an angle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.fitting.core.outliers import worst_outlier
from triaxcal.fitting.table.candidates import TablePoses, TableRow, TableTrial, judge_table, turns
from triaxcal.model.orientation import angles_from_force, gravity_direction
from triaxcal.model.types import FloatArray
from triaxcal.poses.poseset import PoseSet
from triaxcal.unit.description import UnitDescription
from triaxcal.unit.recording import ANGLE_NAMES, Angles

_MOST = 5
_SHARE = 5
"""At most one row of five is looked for: beyond, nobody can say which rows are the wrong ones."""
_ALIKE = 0.2
"""Of the contradiction: a lost sign or an exchange must explain all of it but this."""
_SLIPS = (
    ("the first angle has the other sign", ((-1, 0), (0, 1))),
    ("the second angle has the other sign", ((1, 0), (0, -1))),
    ("both angles have the other sign", ((-1, 0), (0, -1))),
    ("the two angles are exchanged", ((0, 1), (1, 0))),
)


@dataclass(frozen=True)
class WrongRow:
    """A row that the others contradict.

    Attributes
    ----------
    pose : int
        Its index; `rivals` are poses that it cannot be told from.
    error_g : array, shape (3,)
        What the fit of the others gives, less what the angles say.
    others_g : float
        Rms residual of a component without it.
    """

    pose: int
    rivals: tuple[int, ...]
    error_g: FloatArray
    others_g: float

    def signed(self, sign: float) -> WrongRow:
        """The same with the sign of the table's gravity."""
        return replace(self, error_g=sign * self.error_g)


def wrong_rows(trial: TableTrial, poses: TablePoses, best: TableRow) -> list[WrongRow]:
    """Rows that the others contradict, the worst first; `best` is the trial's fit to all."""
    kept = np.ones(len(poses.readings), dtype=np.bool_)
    row: TableRow | None = best
    found: list[WrongRow] = []
    wrong = 0
    for _ in range(min(_MOST, len(kept) // _SHARE)):
        if row is None or row.errors_g is None:
            break
        where = np.flatnonzero(kept)
        errors = row.errors_g[: len(where)]
        outlier = worst_outlier(row.own_g, errors, trial.parameters)
        k = outlier.indices[0] if outlier else int((row.own_g * errors).sum(axis=1).argmax())
        rivals = () if outlier is None else tuple(int(where[i]) for i in outlier.indices[1:4])
        others = 0.0 if outlier is None else outlier.others
        found.append(WrongRow(int(where[k]), rivals, errors[k], others))
        if outlier is not None:
            wrong = len(found)
        kept[where[k]] = False
        row = _judged(trial, poses.select(kept))
    return _against_the_rest(trial, poses, found[:wrong])


def _judged(trial: TableTrial, poses: TablePoses) -> TableRow | None:
    if trial.parameters > 3 * (len(poses.readings) - 1):
        return None
    row = judge_table(trial, poses, turns(poses, []))
    return row if row.errors_g is not None else None


def _against_the_rest(
    trial: TableTrial, poses: TablePoses, found: list[WrongRow]
) -> list[WrongRow]:
    """The wrong rows with their errors in a fit of those that are right.

    What a candidate with priors says of a row held out is of first order, and a gross row is not.
    """
    kept = np.ones(len(poses.readings), dtype=np.bool_)
    kept[[row.pose for row in found]] = False
    dof = 3 * int(kept.sum()) - trial.parameters
    if not found or dof < 1:
        return found
    fit = trial.fit(poses.select(kept))
    error = fit.force_g(poses) - poses.force
    others = float(np.sqrt((error[kept] ** 2).sum() / dof))
    alone = len(found) == 1
    rows = [WrongRow(r.pose, r.rivals if alone else (), error[r.pose], others) for r in found]
    return sorted(rows, key=lambda row: -float(np.linalg.norm(row.error_g)))


def wrong_row_findings(
    unit: UnitDescription,
    angles: Angles,
    poses: PoseSet,
    *,
    table: FloatArray,
    sign: float,
    rows: list[WrongRow],
) -> list[str]:
    """Names the rows that the others contradict; refuses the first beyond the limit."""
    texts = [_words(unit, angles, poses, table[row.pose], row.signed(sign)) for row in rows]
    for row, text in zip(rows, texts, strict=True):
        pose = poses.poses[row.pose]
        temp = unit.t0_degc if pose.temp_degc is None else pose.temp_degc
        limit, key = unit.limits.at(temp, unit.t0_degc)
        if float(np.linalg.norm(row.error_g)) > limit:
            more = [poses.poses[r.pose].number for r in rows if r is not row]
            also = f"; so do poses {', '.join(map(str, more))}" if more else ""
            raise RefusedError(
                f"{poses.source}, line {pose.line}",
                text + also,
                expected=f"at most {limit * 1e3:g} mg ({key})",
                remedy=_REMEDY,
            )
    return [f"{text}; {_REMEDY}" for text in texts]


_REMEDY = "check its angles and readings, and correct or remove the row"


def _words(
    unit: UnitDescription,
    angles: Angles,
    poses: PoseSet,
    set_rad: FloatArray,
    row: WrongRow,
) -> str:
    """A wrong row in words; `set_rad` are the angles that the file has."""
    force = unit.gravity_g * gravity_direction(angles.kind, set_rad) + row.error_g
    rivals = "".join(f" or pose {poses.poses[i].number}" for i in row.rivals)
    away = float(np.linalg.norm(row.error_g))
    said = _vectors(poses.poses[row.pose].line, set_rad, force, angles)
    return (
        f"pose {poses.poses[row.pose].number}{rivals} contradicts the others: the file has "
        f"{said if angles.vectors else _angles(unit, angles, set_rad, force)}; the "
        f"difference is {away * 1e3:.3g} mg, the residuals of the others are "
        f"{row.others_g * 1e3:.2g} mg rms"
    )


def _vectors(line: int, set_rad: FloatArray, force: FloatArray, angles: Angles) -> str:
    """Upward directions of a row, in words: as stated and as the others have it."""
    stated, fitted = gravity_direction(angles.kind, set_rad), force / np.linalg.norm(force)
    words = [", ".join(f"{v + 0.0:.4f}" for v in vector) for vector in (stated, fitted)]
    slip = ""
    if float(np.linalg.norm(fitted + stated)) < _ALIKE * float(np.linalg.norm(fitted - stated)):
        slip = f": the vector of line {line} points the other way"
    return f"the direction ({words[0]}), the fit of the others gives ({words[1]}){slip}"


def _angles(unit: UnitDescription, angles: Angles, set_rad: FloatArray, force: FloatArray) -> str:
    """The same of angles."""
    seen = angles_from_force(angles.kind, force)
    words = [name.replace("_", " ") for name in ANGLE_NAMES[angles.kind][:2]]
    stated = ", ".join(f"{w} {v:.5g}" for w, v in zip(words, np.degrees(set_rad[:2]), strict=True))
    fitted = ", ".join(f"{w} {v:.5g}" for w, v in zip(words, np.degrees(seen), strict=True))
    slip = _slip(unit, angles, set_rad, force)
    return f"{stated} deg, the fit of the others gives {fitted} deg{slip}"


def _slip(unit: UnitDescription, angles: Angles, stated: FloatArray, force: FloatArray) -> str:
    """A lost sign or an exchange that explains the force of a row, in words; "" if none does."""
    away = float(np.linalg.norm(force - unit.gravity_g * gravity_direction(angles.kind, stated)))
    for words, matrix in _SLIPS:
        other = np.array(matrix) @ stated[:2]
        left = force - unit.gravity_g * gravity_direction(angles.kind, other)
        if float(np.linalg.norm(left)) < _ALIKE * away:
            return f", as if {words}"
    return ""
