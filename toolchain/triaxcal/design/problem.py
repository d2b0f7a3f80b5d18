"""The question, a TOML file: noise, rig, chamber, candidates, target."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import DESCRIPTION, FORMAT, FileKeys, TableKeys, Values, setting
from triaxcal.base.kinds import listed, number, rising, three, whole, word
from triaxcal.model.positions import AXES, TEST_POSITIONS
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.unit.thermal import T0_TOLERANCE_DEGC

CANDIDATES_MAX = 16
"""Every subset of the candidates is tried: 2^13 of them at most, the ends and T0 being fixed."""


@dataclass(frozen=True)
class _Noise:
    """[noise]: noise of the readings.

    Attributes
    ----------
    reading_micro_g
        Standard deviation of one reading.
    floor_micro_g
        Standard deviation of a dwell's mean, however long: what averaging does not remove.
    repeatability_arcsec
        Standard deviation of each dwell's tilt about each axis.
    """

    reading_micro_g: float = setting(number(1e-3, 1e6), unit="micro-g", example="100")
    floor_micro_g: float = setting(number(0.0, 1e6), 0.0, "micro-g")
    repeatability_arcsec: float = setting(number(0.0, 36000.0), 0.0, "arcsec")


@dataclass(frozen=True)
class _Rig:
    """[rig]: what the rig does.

    Attributes
    ----------
    rate_hz
        Readings a second of each axis.
    volts_per_g
        Nominal scale of x, y, z with its sign.
    turn_s
        Time to the next position, before the rig's own settling.
    """

    rate_hz: int = setting(whole(10, 10_000), unit="Hz", example="100")
    volts_per_g: tuple[float, float, float] = setting(
        three(number(), "a list of 3 numbers"), unit="V/g", example="[0.5, 0.5, 0.5]"
    )
    turn_s: float = setting(number(0.0, 3600.0), 10.0, "s")


@dataclass(frozen=True)
class _Chamber:
    """[chamber]: what the chamber does.

    Attributes
    ----------
    ramp_k_per_min
        Its rate.
    soak_min
        Time that the unit takes to follow it.
    """

    ramp_k_per_min: float = setting(number(0.01, 100.0), unit="K/min", example="2")
    soak_min: float = setting(number(0.0, 1440.0), unit="min", example="60")


@dataclass(frozen=True)
class _Candidates:
    """[candidates]: what the plan may use.

    Attributes
    ----------
    temperatures_degc
        Temperatures to choose from; the first and the last are the ends of the working range.
    positions
        Positions to choose from; all six are needed.
    """

    temperatures_degc: tuple[float, ...] = setting(
        rising(*PLAUSIBLE_DEGC, 2, CANDIDATES_MAX), unit="degC", example="[-40, -10, 20, 50, 85]"
    )
    positions: tuple[str, ...] = setting(
        listed(word(tuple(TEST_POSITIONS)), range(100), "a list of names TP1 to TP6"),
        tuple(TEST_POSITIONS),
        words="all six",
    )


@dataclass(frozen=True)
class _Curves:
    """[curves]: what is fitted.

    Attributes
    ----------
    t0_degc
        T0; one of the temperatures is within 2 degC of it.
    order
        Order of the polynomials that the constants follow over temperature.
    """

    t0_degc: float = setting(number(*PLAUSIBLE_DEGC), unit="degC", example="20")
    order: int = setting(whole(0, 9), example="3")


@dataclass(frozen=True)
class _Target:
    """[target]: what is wanted.

    Attributes
    ----------
    expanded_micro_g
        Expanded uncertainty (95 %) that noise and repeatability may give.
    """

    expanded_micro_g: float | None = setting(
        number(1e-3, 1e6), None, "micro-g", words="that of the usual plan", example="100"
    )


PROBLEM = FileKeys(
    "problem.toml",
    "The question to `triaxcal design`",
    (
        TableKeys("", "", (FORMAT, DESCRIPTION)),
        TableKeys.of(_Noise),
        TableKeys.of(_Rig),
        TableKeys.of(_Chamber),
        TableKeys.of(_Candidates),
        TableKeys.of(_Curves),
        TableKeys.of(_Target),
    ),
)


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
        When the file breaks a rule of docs/reference/keys.md, or the candidates cannot determine
        the constants; says which they leave open.
    """
    tables = PROBLEM.read(path)
    noise, rig = tables["noise"].record(_Noise), tables["rig"].record(_Rig)
    chamber, curves = tables["chamber"].record(_Chamber), tables["curves"].record(_Curves)
    candidates = tables["candidates"].record(_Candidates)
    target = tables["target"].record(_Target).expanded_micro_g
    problem = Problem(
        source=str(path),
        reading_g=noise.reading_micro_g * 1e-6,
        floor_g=noise.floor_micro_g * 1e-6,
        repeatability_rad=float(np.radians(noise.repeatability_arcsec / 3600.0)),
        rate_hz=rig.rate_hz,
        volts_per_g=rig.volts_per_g,
        turn_s=rig.turn_s,
        ramp_k_per_min=chamber.ramp_k_per_min,
        soak_s=60.0 * chamber.soak_min,
        temps_degc=candidates.temperatures_degc,
        t0_degc=curves.t0_degc,
        order=curves.order,
        target_g=None if target is None else target * 1e-6,
    )
    _refuse_blind_positions(tables["candidates"], candidates.positions)
    _refuse_few_temperatures(problem, tables["candidates"])
    return problem


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
        words.append("U0: it cannot be separated from the sensitivities")
    return words


def _refuse_blind_positions(values: Values, positions: tuple[str, ...]) -> None:
    missing = [p for p in TEST_POSITIONS if p not in positions]
    if not missing:
        return
    left_open = unobservable(positions)
    found = f"{', '.join(missing)} left out"
    if left_open:
        found += "; not determined: " + "; ".join(left_open)
    else:
        found += "; the constants are determined, but no residual shows a mistake"
    raise RefusedError(values.where("positions"), found, expected="all six", remedy="omit the key")


def _refuse_few_temperatures(problem: Problem, values: Values) -> None:
    temps, needed = problem.temps_degc, problem.order + 2
    if not any(abs(t - problem.t0_degc) <= T0_TOLERANCE_DEGC for t in temps):
        near = f"one within {T0_TOLERANCE_DEGC:g} degC of t0_degc"
        raise values.refuse("temperatures_degc", near)
    if len(temps) < needed:
        raise RefusedError(
            values.where("temperatures_degc"),
            f"{len(temps)} candidates; polynomials of order {problem.order} have "
            f"{problem.order + 1} coefficients",
            expected=f"at least {needed} candidates: with {problem.order + 1} temperatures the "
            "curve passes through every point and nothing shows whether it is right",
            remedy="add candidates, or lower [curves] order",
        )
