"""The question, a TOML file: noise, rig, chamber, candidates, target."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import Layout, Table, read_tables
from triaxcal.model.positions import AXES, TEST_POSITIONS
from triaxcal.unit.description import PLAUSIBLE_DEGC, T0_TOLERANCE_DEGC

FORMAT = 1
CANDIDATES_MAX = 16
"""Every subset of the candidates is tried: 2^13 of them at most, the ends and T0 being fixed."""
_LAYOUT: Layout = {
    "": {"format": True, "description": False},
    "noise": {
        "reading_micro_g": True,
        "floor_micro_g": False,
        "repeatability_arcsec": False,
    },
    "rig": {"rate_hz": True, "volts_per_g": True, "turn_s": False},
    "chamber": {"ramp_k_per_min": True, "soak_min": True},
    "candidates": {"temperatures_degc": True, "positions": False},
    "curves": {"t0_degc": True, "order": True},
    "target": {"expanded_micro_g": False},
}


@dataclass(frozen=True)
class Problem:
    """A question, validated.

    Attributes
    ----------
    reading_g : float
        Standard deviation of one reading.
    floor_g : float
        Of a dwell's mean, however long: what averaging does not remove.
    repeatability_rad : float
        Of each dwell's tilt about each axis.
    rate_hz : int
    volts_per_g : tuple of three floats
    turn_s : float
        To the next position, before the rig's own settling.
    ramp_k_per_min, soak_s : float
        Of the chamber.
    temps_degc : tuple of float
        Candidates, rising; the first and the last are the ends of the working range.
    t0_degc : float
        One of the candidates, to 2 degC.
    order : int
        Of the polynomials that the constants follow over temperature.
    target_g : float or None
        Expanded uncertainty (95 %) of the acceleration that noise and repeatability may give;
        None asks for that of the usual plan.
    """

    source: str
    reading_g: float
    floor_g: float
    repeatability_rad: float
    rate_hz: int
    volts_per_g: tuple[float, float, float]
    turn_s: float
    ramp_k_per_min: float
    soak_s: float
    temps_degc: tuple[float, ...]
    t0_degc: float
    order: int
    target_g: float | None


def read_problem(path: Path) -> Problem:
    """Question in a TOML file.

    Raises
    ------
    RefusedError
        When the file breaks a rule of docs/design.md, or the candidates cannot determine the
        constants; says which they leave open.
    """
    tables = read_tables(path, _LAYOUT, FORMAT)
    noise, rig, curves = tables["noise"], tables["rig"], tables["curves"]
    chamber, target, candidates = tables["chamber"], tables["target"], tables["candidates"]
    scale = [float(v) for v in rig.decimals("volts_per_g", 3)]
    problem = Problem(
        source=str(path),
        reading_g=noise.number("reading_micro_g", 1e-3, 1e6) * 1e-6,
        floor_g=_number(noise, "floor_micro_g", 0.0, 1e6) * 1e-6,
        repeatability_rad=float(
            np.radians(_number(noise, "repeatability_arcsec", 0.0, 36000.0) / 3600.0)
        ),
        rate_hz=rig.integer("rate_hz", 10, 10_000),
        volts_per_g=(scale[0], scale[1], scale[2]),
        turn_s=_number(rig, "turn_s", 0.0, 3600.0, 10.0),
        ramp_k_per_min=chamber.number("ramp_k_per_min", 0.01, 100.0),
        soak_s=60.0 * chamber.number("soak_min", 0.0, 1440.0),
        temps_degc=candidates.rising(
            "temperatures_degc", *PLAUSIBLE_DEGC, range(2, CANDIDATES_MAX + 1)
        ),
        t0_degc=curves.number("t0_degc", *PLAUSIBLE_DEGC),
        order=curves.integer("order", 0, 9),
        target_g=target.number("expanded_micro_g", 1e-3, 1e6) * 1e-6
        if "expanded_micro_g" in target
        else None,
    )
    _refuse_blind_positions(candidates)
    _refuse_few_temperatures(problem, candidates)
    return problem


def _number(table: Table, key: str, low: float, high: float, default: float = 0.0) -> float:
    return table.number(key, low, high) if key in table else default


def unobservable(positions: tuple[str, ...]) -> list[str]:
    """What these positions leave open, in words; empty when all twelve constants are seen.

    In each position an output sees K_i a + U0_i: the constants are determined exactly when the
    rows (a, 1) span four dimensions.
    """
    rows = np.array([[*TEST_POSITIONS[p], 1.0] for p in positions], dtype=np.float64)
    rows = rows.reshape(-1, 4)
    if np.linalg.matrix_rank(rows) == 4:
        return []
    seen = np.linalg.pinv(rows) @ rows
    words = [
        f"K.{axis}: no two positions differ along {axis} alone"
        for j, axis in enumerate(AXES)
        if abs(seen[j, j] - 1.0) > 1e-9
    ]
    if abs(seen[3, 3] - 1.0) > 1e-9:
        words.append("U0: it cannot be told from the sensitivities")
    return words


def _refuse_blind_positions(table: Table) -> None:
    if "positions" not in table:
        return
    value = table.values["positions"]
    if not isinstance(value, list) or not all(p in TEST_POSITIONS for p in value):
        raise table.refuse("positions", "a list of names TP1 to TP6")
    missing = [p for p in TEST_POSITIONS if p not in value]
    if not missing:
        return
    left_open = unobservable(tuple(value))
    found = f"{', '.join(missing)} left out"
    if left_open:
        found += "; not determined: " + "; ".join(left_open)
    else:
        found += "; the constants are determined, but no residual shows a mistake"
    raise RefusedError(
        table.where("positions"), found, expected="all six", remedy="leave the key out"
    )


def _refuse_few_temperatures(problem: Problem, table: Table) -> None:
    temps, needed = problem.temps_degc, problem.order + 2
    if not any(abs(t - problem.t0_degc) <= T0_TOLERANCE_DEGC for t in temps):
        raise table.refuse("temperatures_degc", f"one within {T0_TOLERANCE_DEGC:g} degC of t0_degc")
    if len(temps) < needed:
        raise RefusedError(
            table.where("temperatures_degc"),
            f"{len(temps)} candidates; polynomials of order {problem.order} have "
            f"{problem.order + 1} coefficients",
            expected=f"{needed} candidates at least: with {problem.order + 1} temperatures the "
            "curve passes through every point and nothing shows whether it is right",
            remedy="add candidates, or lower [curves] order",
        )
