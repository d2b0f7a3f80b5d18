"""The question, a TOML file: noise, rig, chamber, candidates, target."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from triaxcal.base.errors import RefusedError
from triaxcal.base.keys import FORMAT, FileKeys, Key, TableKeys, Values
from triaxcal.base.kinds import listed, number, rising, three, whole, word
from triaxcal.model.positions import AXES, TEST_POSITIONS
from triaxcal.model.thermal.shape import PLAUSIBLE_DEGC
from triaxcal.unit.description import DESCRIPTION, T0_TOLERANCE_DEGC

CANDIDATES_MAX = 16
"""Every subset of the candidates is tried: 2^13 of them at most, the ends and T0 being fixed."""

READING = Key(
    "reading_micro_g",
    number(1e-3, 1e6),
    "Standard deviation of one reading.",
    unit="micro-g",
    example="100",
)
FLOOR = Key(
    "floor_micro_g",
    number(0.0, 1e6),
    "Standard deviation of a dwell's mean, however long: what averaging does not remove.",
    0.0,
    "micro-g",
)
REPEATABILITY = Key(
    "repeatability_arcsec",
    number(0.0, 36000.0),
    "Standard deviation of each dwell's tilt about each axis.",
    0.0,
    "arcsec",
)
RATE = Key(
    "rate_hz", whole(10, 10_000), "Readings a second of each axis.", unit="Hz", example="100"
)
VOLTS_PER_G = Key(
    "volts_per_g",
    three(number(-1e6, 1e6), "a list of 3 numbers"),
    "Nominal scale of x, y, z with its sign.",
    unit="V/g",
    example="[0.5, 0.5, 0.5]",
)
TURN = Key(
    "turn_s",
    number(0.0, 3600.0),
    "Time to the next position, before the rig's own settling.",
    10.0,
    "s",
)
RAMP = Key("ramp_k_per_min", number(0.01, 100.0), "Rate of the chamber.", unit="K/min", example="2")
SOAK = Key(
    "soak_min",
    number(0.0, 1440.0),
    "Time that the unit takes to follow the chamber.",
    unit="min",
    example="60",
)
TEMPERATURES = Key(
    "temperatures_degc",
    rising(*PLAUSIBLE_DEGC, 2, CANDIDATES_MAX),
    "Temperatures to choose from; the first and the last are the ends of the working range.",
    unit="degC",
    example="[-40, -10, 20, 50, 85]",
)
POSITIONS = Key(
    "positions",
    listed(word(tuple(TEST_POSITIONS)), range(100), "a list of names TP1 to TP6"),
    "Positions to choose from; all six are needed.",
    tuple(TEST_POSITIONS),
    default_words="all six",
)
T0 = Key(
    "t0_degc",
    number(*PLAUSIBLE_DEGC),
    "T0; one of the temperatures is within 2 degC of it.",
    unit="degC",
    example="20",
)
ORDER = Key(
    "order",
    whole(0, 9),
    "Order of the polynomials that the constants follow over temperature.",
    example="3",
)
TARGET = Key(
    "expanded_micro_g",
    number(1e-3, 1e6),
    "Expanded uncertainty (95 %) that noise and repeatability may give.",
    None,
    "micro-g",
    default_words="that of the usual plan",
)
PROBLEM = FileKeys(
    "problem.toml",
    "The question to `triaxcal design`",
    (
        TableKeys("", "", (FORMAT, DESCRIPTION)),
        TableKeys("noise", "Noise of the readings.", (READING, FLOOR, REPEATABILITY)),
        TableKeys("rig", "What the rig does.", (RATE, VOLTS_PER_G, TURN)),
        TableKeys("chamber", "What the chamber does.", (RAMP, SOAK)),
        TableKeys("candidates", "What the plan may use.", (TEMPERATURES, POSITIONS)),
        TableKeys("curves", "What is fitted.", (T0, ORDER)),
        TableKeys("target", "What is wanted.", (TARGET,)),
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
        When the file breaks a rule of docs/design.md, or the candidates cannot determine the
        constants; says which they leave open.
    """
    tables = PROBLEM.read(path)
    noise, rig, curves = tables["noise"], tables["rig"], tables["curves"]
    chamber, candidates, target = tables["chamber"], tables["candidates"], tables["target"][TARGET]
    problem = Problem(
        source=str(path),
        reading_g=noise[READING] * 1e-6,
        floor_g=noise[FLOOR] * 1e-6,
        repeatability_rad=float(np.radians(noise[REPEATABILITY] / 3600.0)),
        rate_hz=rig[RATE],
        volts_per_g=rig[VOLTS_PER_G],
        turn_s=rig[TURN],
        ramp_k_per_min=chamber[RAMP],
        soak_s=60.0 * chamber[SOAK],
        temps_degc=candidates[TEMPERATURES],
        t0_degc=curves[T0],
        order=curves[ORDER],
        target_g=None if target is None else target * 1e-6,
    )
    _refuse_blind_positions(candidates)
    _refuse_few_temperatures(problem, candidates)
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
        words.append("U0: it cannot be told from the sensitivities")
    return words


def _refuse_blind_positions(values: Values) -> None:
    positions = values[POSITIONS]
    missing = [p for p in TEST_POSITIONS if p not in positions]
    if not missing:
        return
    left_open = unobservable(positions)
    found = f"{', '.join(missing)} left out"
    if left_open:
        found += "; not determined: " + "; ".join(left_open)
    else:
        found += "; the constants are determined, but no residual shows a mistake"
    raise RefusedError(
        values.where(POSITIONS), found, expected="all six", remedy="leave the key out"
    )


def _refuse_few_temperatures(problem: Problem, values: Values) -> None:
    temps, needed = problem.temps_degc, problem.order + 2
    if not any(abs(t - problem.t0_degc) <= T0_TOLERANCE_DEGC for t in temps):
        raise values.refuse(TEMPERATURES, f"one within {T0_TOLERANCE_DEGC:g} degC of t0_degc")
    if len(temps) < needed:
        raise RefusedError(
            values.where(TEMPERATURES),
            f"{len(temps)} candidates; polynomials of order {problem.order} have "
            f"{problem.order + 1} coefficients",
            expected=f"{needed} candidates at least: with {problem.order + 1} temperatures the "
            "curve passes through every point and nothing shows whether it is right",
            remedy="add candidates, or lower [curves] order",
        )
