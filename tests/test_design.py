"""The plan of least chamber time: its formula, and simulated units measured by it."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from triaxcal.base.errors import RefusedError
from triaxcal.cli.design import design as command
from triaxcal.design.problem import Problem, read_problem, unobservable
from triaxcal.design.search import (
    NOISE_SHARE,
    TILT_SHARE,
    Design,
    best,
    chamber_s,
    design,
    expanded_g,
    leverage,
    usual,
)
from triaxcal.design.words import comparison, rig_plan
from triaxcal.fitting.tilter.calibrate import calibrate
from triaxcal.model.metrological import force_from_voltage
from triaxcal.model.positions import TEST_POSITIONS
from triaxcal.rig.plan.plan import read_plan
from triaxcal.simulation.dwells import simulate
from triaxcal.simulation.truth import Imperfections, Plan, read_truth
from triaxcal.uncertainty.orientation import DIRECTIONS
from triaxcal.unit.description import read_unit
from triaxcal.unit.thermal import ThermalChoice

ROOT = Path(__file__).resolve().parents[1]
QUESTION = ROOT / "rig" / "design.toml"
UNITS = 60


def asked(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    text = QUESTION.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "question.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def problem() -> Problem:
    return read_problem(QUESTION)


def test_the_shares_are_those_of_six_positions() -> None:
    """Monte Carlo of the six-position solution itself, tilts exact to first order."""
    rng = np.random.default_rng(1)
    forces = np.array(list(TEST_POSITIONS.values()), dtype=float)
    rows = np.linalg.pinv(np.column_stack([forces, np.ones(6)]))
    noise = rng.standard_normal((20000, 6, 3))
    tilts = np.cross(rng.standard_normal((20000, 6, 3)), forces)
    for readings, share in ((noise, NOISE_SHARE), (tilts, TILT_SHARE)):
        constants = np.einsum("kd,ndi->nik", rows, readings)
        errors = np.einsum("nik,mk->nmi", constants, np.column_stack([DIRECTIONS, np.ones(146)]))
        # 20 000 draws: the worst of 438 variances, each known to 1 %, is at most 4 % too large.
        assert share * 0.99 <= float(errors.var(axis=0).max()) <= share * 1.04


def test_the_plan_is_the_best_of_all(problem: Problem) -> None:
    """The slow way: every subset, every dwell, in turn, on fewer candidates."""
    small = replace(problem, temps_degc=(-40.0, -30.0, -10.0, 0.0, 20.0, 50.0, 60.0, 70.0), order=2)
    target = 4e-6
    shortest = math.inf
    for count in range(4, 9):
        for temps in itertools.combinations(small.temps_degc, count):
            if not {-40.0, 20.0, 70.0} <= set(temps):
                continue
            for dwell_s in range(10, 400, 10):
                if expanded_g(small, leverage(small, temps), dwell_s) <= target:
                    shortest = min(shortest, chamber_s(small, temps, dwell_s))
                    break
    found = best(small, target)
    assert found.chamber_s == shortest
    assert found.expanded_g <= target
    assert found == design(small, found.temps_degc, found.dwell_s)


def worst_rms_g(problem: Problem, plan: Design) -> float:
    """Of the components' true errors, in the worst temperature, over simulated units.

    One reading a second stands for the rate's hundred: their mean is what is drawn.
    """
    unit = replace(
        read_unit(ROOT / "units" / "AT-SIM"),
        thermal=ThermalChoice("polynomial", {"order": problem.order}),
        estimator="least-squares",
        gravity_g=1.0,
    )
    truth, _ = read_truth(ROOT / "units" / "AT-SIM")
    truth = replace(
        truth,
        reading_sd_v=0.55 * problem.reading_g / math.sqrt(problem.rate_hz),
        thermometer_sd_degc=0.0,
        dwell_temp_sd_degc=0.0,
        imperfections=Imperfections(
            repeatability_sd_arcsec=math.degrees(problem.repeatability_rad) * 3600.0
        ),
    )
    temps = np.linspace(plan.temps_degc[0], plan.temps_degc[-1], 12)
    voltage = truth.voltage_v(DIRECTIONS[None], temps[:, None])
    errors = []
    for seed in range(UNITS):
        measured = simulate(unit, truth, Plan(seed, plan.dwell_s, plan.temps_degc, ()))
        constants = calibrate(unit, measured).thermal.constants_at(temps)
        errors.append(force_from_voltage(constants[:, None], voltage) - DIRECTIONS)
    # Mean over the orientations: noise acts alike in all of them.
    return float(np.sqrt(np.mean(np.square(errors), axis=(0, 2, 3)).max()))


def test_simulated_units_reach_the_same_by_the_shorter_plan(problem: Problem) -> None:
    white = replace(problem, floor_g=0.0)
    ordinary = usual(white)
    found = best(white, ordinary.expanded_g)
    assert found.chamber_s < 0.85 * ordinary.chamber_s
    for plan in (ordinary, found):
        # 60 units, three components, four free errors each: 720 values, their rms to 2.7 %;
        # the stated value is that of the worst orientation, at most 4 % more than the mean.
        stated = plan.expanded_g / 1.96
        assert 0.86 * stated <= worst_rms_g(white, plan) <= 1.11 * stated


def test_the_rig_takes_the_plan(problem: Problem, tmp_path: Path) -> None:
    found = best(problem, usual(problem).expanded_g)
    path = tmp_path / "plan.toml"
    path.write_text(rig_plan(problem, found, "triaxcal design"), encoding="utf-8")
    session = read_plan(path, read_unit(ROOT / "units" / "AT-SIM-BENCH"))
    assert tuple(s.temp_degc for s in session.steps) == found.temps_degc
    assert session.stillness.average_s == found.dwell_s
    u_micro_g = 1e6 * math.hypot(
        problem.reading_g / math.sqrt(100 * found.dwell_s), problem.floor_g
    )
    assert session.stillness.u_max_micro_g == pytest.approx(1.75 * u_micro_g, rel=0.01)


def test_the_command(tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    done = CliRunner().invoke(command, [str(QUESTION), "--plan", str(plan)])
    assert done.exit_code == 0
    assert plan.exists()
    assert "% less chamber time than the usual plan" in done.output
    assert "No plan of this kind shows the tilter's level" in done.output
    assert max(map(len, done.output.splitlines()[:16])) <= 80


def test_words_of_a_plan_that_is_no_shorter(problem: Problem) -> None:
    ordinary = usual(problem)
    longer = replace(ordinary, chamber_s=1.5 * ordinary.chamber_s)
    assert "50 % more chamber time" in comparison(problem, ordinary, longer)


@pytest.mark.parametrize(
    ("positions", "words"),
    [
        (("TP1", "TP2", "TP3", "TP4", "TP5", "TP6"), []),
        (("TP1", "TP2", "TP3", "TP4", "TP5"), []),
        (("TP1", "TP3"), ["K.x", "K.y"]),
        (("TP1", "TP2", "TP6"), ["K.x", "K.y", "K.z", "U0"]),
    ],
)
def test_what_positions_leave_open(positions: tuple[str, ...], words: list[str]) -> None:
    assert [w.split(":")[0] for w in unobservable(positions)] == words


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("# Nothing here asks for what the usual plan reaches.", "expanded_micro_g = 0.5"),
         ["all 14 candidates with dwells of 3600 s reach", "times the target, mostly by the"]),
        (("order = 3", "order = 13"), ["order", "0 to 9"]),
        (("-40, -35, -30, -20, -10, 0, 10, 20, 30, 40, 50, 60, 65, 70", "-40, 20, 50, 70"),
         ["4 candidates", "expected at least 5 candidates"]),
        (("10, 20, 30", "10, 30"), ["one within 2 degC of t0_degc"]),
        (("[candidates]", '[candidates]\npositions = ["TP1", "TP2", "TP3"]'),
         ["TP4, TP5, TP6 left out", "K.x: no two positions differ along x alone", "all six"]),
        (("[candidates]", '[candidates]\npositions = ["TP1", "TP2", "TP3", "TP4", "TP5"]'),
         ["TP6 left out", "no residual shows a mistake"]),
        (("[candidates]", '[candidates]\npositions = ["TP9"]'), ["a list of names TP1 to TP6"]),
        (("reading_micro_g", "reading_mg"), ["missing: [noise] reading_micro_g", "unknown"]),
    ],
)  # fmt: skip
def test_a_wrong_question_is_refused(
    tmp_path: Path, change: tuple[str, str], words: list[str]
) -> None:
    path = asked(tmp_path, change)
    with pytest.raises(RefusedError) as refusal:
        command.main([str(path)], standalone_mode=False)
    for word in words:
        assert word in str(refusal.value)
