"""The guide: an operator who follows it is done sooner, and nothing is claimed that is not so."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest

from guide_operator import ARW_DEG, RATE_HZ, VRW_UG, G, Operator
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.blocks.base import BASE
from triaxcal.dynamic.calibrate import DynamicResult, calibrate_dynamic
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.limits import ImuLimits
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.recording import joined
from triaxcal.guide.goals import goals_of, standings
from triaxcal.guide.guide import GUARD_S, HOLD_S, Advice, Guide, Setting
from triaxcal.guide.screen import WIDTH, bar, screen_lines, status_line
from triaxcal.guide.session import at_once
from triaxcal.guide.stepmodel import StepModel
from triaxcal.guide.turns import Turn, candidates, up_words
from triaxcal.guide.watch import Watch

STEADY = {"gyro_bias_instability_deg_per_h": 0.0, "accel_bias_instability_ug": 0.0}
NOISE = DataSheet(ARW_DEG, VRW_UG, **STEADY)
LAYOUT = Layout(BASE)
LIMITS = ImuLimits(
    gyro_drift_sd_deg_per_h=20, gyro_scale_sd_ppm=100, gyro_misalignment_sd_arcsec=30,
    accel_bias_sd_mm_per_s2=1, accel_scale_sd_ppm=100, accel_misalignment_sd_arcsec=30,
)  # fmt: skip
SPARE_S = 0.7
"""More than is asked for: the operator watches the bar."""


def setting(limits: ImuLimits = LIMITS) -> Setting:
    return Setting(LAYOUT, NOISE, G, RATE_HZ, goals_of(limits, LAYOUT))


def met(result: DynamicResult, limits: ImuLimits = LIMITS) -> bool:
    return all(s.reached for s in standings(goals_of(limits, LAYOUT), LAYOUT, result.sd[:21]))


Choose = Callable[[Advice], Turn]


def followed(advice: Advice) -> Turn:
    assert advice.turn is not None
    return advice.turn


def guided(
    operator: Operator, choose: Choose = followed, most: int = 60, noise: DataSheet = NOISE
) -> Guide:
    """Let an operator work until the guide is done, or has asked for `most` turns."""
    guide = Guide(setting(), lambda: calibrate_dynamic(operator.recording(), noise), at_once)
    guide.feed(operator.hold(11.0))
    for _ in range(most):
        if guide.done is not None:
            break
        turn = choose(guide.advice)
        if turn.angle_deg:
            guide.feed(operator.turn(np.eye(3)[turn.axis], turn.angle_deg))
        guide.feed(operator.hold(HOLD_S + SPARE_S))
    return guide


def fixed_seconds(seed: int) -> float:
    """What the usual sequence takes: each axis once around in both senses and in quarters."""
    operator = Operator(seed)
    operator.hold(11.0)
    ends = [(len(operator.pieces), operator.time_s)]
    moves = []
    for axis, mount in ((0, (1, 90)), (1, (0, 90)), (2, (0, -90))):
        moves += [*((axis, angle) for angle in (360, -360, 90, 90, 90, 90)), mount]
    for axis, angle in moves * 2:
        operator.turn(np.eye(3)[axis], angle)
        operator.hold(HOLD_S + SPARE_S)
        ends.append((len(operator.pieces), operator.time_s))

    def enough(count: int) -> bool:
        whole = joined(operator.pieces[:count])
        recording = replace(operator.recording(), pieces=lambda: (whole,))
        try:
            return met(calibrate_dynamic(recording, NOISE))
        except RefusedError:
            return False

    low, high = 0, len(ends) - 1
    assert enough(ends[high][0])
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(ends[middle][0]) else (middle, high)
    return ends[high][1]


@pytest.fixture(scope="module")
def done() -> tuple[Operator, Guide]:
    operator = Operator(1)
    return operator, guided(operator)


def test_who_follows_is_done_sooner_than_by_the_usual_sequence(
    done: tuple[Operator, Guide],
) -> None:
    operator, guide = done
    assert guide.done is not None
    assert operator.time_s < fixed_seconds(1)


def test_what_is_claimed_holds_for_the_whole_recording(done: tuple[Operator, Guide]) -> None:
    operator, guide = done
    result = calibrate_dynamic(operator.recording(), NOISE)
    assert met(result)
    assert guide.done is not None
    found = standings(goals_of(LIMITS, LAYOUT), LAYOUT, result.sd[:21])
    # Nothing was recorded after it.
    assert [s.sd for s in guide.standings] == pytest.approx([s.sd for s in found], rel=1e-9)
    # The unit is the true one: chi-square of 21 beyond 46.8 is one in a thousand.
    truth = np.concatenate([
        operator.bias, operator.gamma[np.tril_indices(3)], operator.drift, operator.theta.ravel()
    ])  # fmt: skip
    error = result.p[:21] - truth
    assert error @ np.linalg.solve(result.covariance[:21, :21], error) < 46.8


def test_nothing_is_claimed_that_the_calibration_denies() -> None:
    """The recording is noisier than the guide was told: it expects too much, and goes on."""
    operator = Operator(2)
    worse = DataSheet(6 * ARW_DEG, 6 * VRW_UG, **STEADY)
    guide = guided(operator, most=16, noise=worse)
    assert guide.calibrations >= 1
    assert guide.done is None
    assert not met(calibrate_dynamic(operator.recording(), worse))
    # What it expects now is what the calibration said, and the turns since.
    assert any(not s.reached for s in guide.standings)


def test_who_turns_another_axis_is_guided_on() -> None:
    """Every second turn is another one; what is said follows where the unit is."""
    operator = Operator(3)
    rng = np.random.default_rng(0)
    count = 0

    def wilful(advice: Advice) -> Turn:
        nonlocal count
        count += 1
        assert advice.up is not None
        # The advice begins where the unit is: readings lean by the bias, 0.3 m/s^2 at most.
        true_up = operator.attitude.inv().apply([0, 0, 1])
        assert float(advice.up @ true_up) > np.cos(np.radians(3.0))
        if count % 2:
            return followed(advice)
        return Turn(int(rng.integers(3)), int(rng.choice([90, 180, -90])))

    guide = guided(operator, wilful)
    assert guide.done is not None
    assert any(note.startswith("not the turn that was asked for: now ") for note in guide.notes)
    assert met(calibrate_dynamic(operator.recording(), NOISE))


def test_who_does_not_hold_still_is_asked_again() -> None:
    operator = Operator(4)
    guide = Guide(setting(), lambda: calibrate_dynamic(operator.recording(), NOISE), at_once)
    guide.feed(operator.hold(11.0))
    rests = guide.rests
    guide.feed(operator.turn([1, 0, 0], 180))
    guide.feed(operator.hold(2.0))
    assert guide.rests == rests
    assert guide.advice.words == "do not move it"  # it was another turn; hold it there
    guide.feed(operator.turn([1, 0, 0], 90))
    guide.feed(operator.hold(HOLD_S + SPARE_S))
    assert guide.rests == rests + 1
    assert guide.advice.up == pytest.approx(operator.attitude.inv().apply([0, 0, 1]), abs=0.05)


def test_the_same_samples_give_the_same_advice() -> None:
    found = []
    for _ in range(2):
        said: list[str] = []
        guided(Operator(5), lambda advice, said=said: said.append(advice.words) or followed(advice),
               most=8)  # fmt: skip
        found.append(said)
    assert found[0] == found[1]
    assert len(set(found[0])) > 3


def test_the_target_is_the_demand_that_is_farthest_away() -> None:
    guide = guided(Operator(6), most=5)
    ratios = [s.ratio for s in guide.standings]
    assert guide.advice.target is not None
    assert guide.advice.target.ratio == max(ratios)
    # No other turn would lower it more for its time.
    model, up, place = guide._model, guide.advice.up, guide.advice.target.place
    assert up is not None

    def gain(turn: Turn) -> float:
        after = model.copy()
        after.rest(after.turn(turn, up), HOLD_S - 2 * GUARD_S)
        return float(np.log(model.sd[place] / after.sd[place])) / (turn.seconds + HOLD_S)

    gains = {turn: gain(turn) for turn in candidates(up)}
    assert gains[followed(guide.advice)] == pytest.approx(max(gains.values()))


def test_without_demands_it_guides_and_never_ends() -> None:
    operator = Operator(7)
    guide = Guide(
        setting(ImuLimits()), lambda: calibrate_dynamic(operator.recording(), NOISE), at_once
    )
    guide.feed(operator.hold(11.0))
    for _ in range(6):
        turn = followed(guide.advice)
        guide.feed(operator.turn(np.eye(3)[turn.axis], turn.angle_deg))
        guide.feed(operator.hold(HOLD_S + SPARE_S))
    assert guide.done is None
    assert guide.advice.target is None
    assert guide.standings[0].sd < 0.01 * LAYOUT.prior_sd[9] / LAYOUT.per_unit[9]


def test_a_calibration_in_another_thread_meets_the_recording_where_it_began() -> None:
    """Steps since its start are taken again: the expectation is that of a calibration at once."""
    waiting: list[tuple[Future[DynamicResult], Callable[[], DynamicResult]]] = []

    def later(work: Callable[[], DynamicResult]) -> Future[DynamicResult]:
        ended: Future[DynamicResult] = Future()
        result = work()
        waiting.append((ended, lambda: result))
        return ended

    def run(submit: Callable[[Callable[[], DynamicResult]], Future[DynamicResult]]) -> Guide:
        operator = Operator(8)
        guide = Guide(setting(), lambda: calibrate_dynamic(operator.recording(), NOISE), submit)
        guide._due = lambda: guide.rests == 12  # type: ignore[method-assign]
        guide.feed(operator.hold(11.0))
        turns = [(0, 360), (1, 360), (0, 90), (2, 360), (2, 90), (1, 180), (0, -90), (1, 90),
                 (0, 180), (2, 90), (0, 360), (1, 90), (2, -90), (0, 90)]  # fmt: skip
        for axis, angle in turns:
            guide.feed(operator.turn(np.eye(3)[axis], angle))
            guide.feed(operator.hold(HOLD_S + SPARE_S))
        for ended, work in waiting:
            ended.set_result(work())
        guide.finish()
        return guide

    now, after = run(at_once), run(later)
    assert now.calibrations == after.calibrations == 1
    assert [s.sd for s in after.standings] == pytest.approx([s.sd for s in now.standings])


def test_the_step_model_expects_what_the_filter_finds() -> None:
    """Turns about no axis of the instrument: the filter believes the rests alone, as the model.

    Rests of 12 s are cut by 0.3 s on each side here and by 0.2 s there, 2 % of an sd. The parts of
    a rest, of a second, and readings that are not calibrated are to first order: within a tenth.
    """
    operator = Operator(9)
    guide = Guide(setting(ImuLimits()), lambda: pytest.fail("not asked for"), at_once)
    guide._due = lambda: False  # type: ignore[method-assign]
    guide.feed(operator.hold(11.0))
    rng = np.random.default_rng(5)
    for k in range(24):
        axis = np.roll([1.0, 1.0, 0.0], k) * [1, rng.choice([-1, 1]), rng.choice([-1, 1])]
        guide.feed(operator.turn(axis, float(rng.choice([90, 120, 180]))))
        guide.feed(operator.hold(12.0))
    result = calibrate_dynamic(operator.recording(), NOISE)
    found = [s.sd for s in standings(goals_of(LIMITS, LAYOUT), LAYOUT, result.sd[:21])]
    ratio = np.array([s.sd for s in guide.standings]) / found
    assert (np.abs(np.log(ratio)) < 0.1).all(), ratio


# ---- parts ----


def test_a_turn_as_asked_for_is_a_turn_as_recorded() -> None:
    """Gains of the step model by the two ways: a path that is known, and rates that were seen."""
    operator = Operator(10)
    operator.drift[:] = operator.theta[:] = operator.bias[:] = operator.gamma[:] = 0
    watch = Watch(RATE_HZ)
    assert watch.feed(operator.hold(4.0)) == []
    (motion,) = watch.feed(joined([operator.turn([0, 1, 0], 90), operator.hold(1.0)]))
    up = np.array([0.0, 0.0, 1.0])
    assert motion.after == pytest.approx(Turn(1, 90).end(up), abs=1e-3)
    asked, seen = StepModel(LAYOUT, NOISE, G), StepModel(LAYOUT, NOISE, G)
    asked.rest(up, 5.0)
    seen.rest(motion.before, 5.0)
    asked.rest(asked.turn(Turn(1, 90), up), 5.0)
    seen.moved(motion.rate, motion.ups, motion.to_end, motion.step_s)
    seen.rest(motion.after, 5.0)
    assert seen.sd == pytest.approx(asked.sd, rel=0.02)


@pytest.mark.parametrize(
    ("turn", "up", "words"),
    [
        (Turn(0, 90), (0, 0, 1), "turn it by 90 deg around x, until +y is up"),
        (Turn(0, -90), (0, 0, 1), "turn it by 90 deg around x, until -y is up"),
        (Turn(1, 180), (1, 0, 0), "turn it by 180 deg around y, until -x is up"),
        (Turn(0, 45), (0, 0, 1), "turn it by 45 deg around x, until up is between +y and +z"),
        (
            Turn(2, 360), (0, -1, 0),
            "turn it once around z: until -x is up, and on until -y is up again",
        ),
        (
            Turn(0, -720), (0, 0, 1),
            "turn it twice around x: until -y is up, and on until +z is up again",
        ),
        (Turn(0, 0), (0, 0, 1), "do not move it"),
    ],
)  # fmt: skip
def test_turns_in_words(turn: Turn, up: tuple[float, ...], words: str) -> None:
    assert turn.words(np.array(up, dtype=float)) == words


@pytest.mark.parametrize(
    ("up", "words"),
    [((0.1, -0.05, -0.99), "-z is up"), ((0.6, 0.6, 0.52), "up is between +x, +y and +z")],
)
def test_up_in_words(up: tuple[float, ...], words: str) -> None:
    assert up_words(np.array(up)) == words


def test_turns_end_where_a_hand_finds_them() -> None:
    for up in ([0, 0, 1], [0, np.sqrt(0.5), np.sqrt(0.5)], [-1, 0, 0]):
        for turn in candidates(np.array(up, dtype=float)):
            assert "between" not in (words := up_words(turn.end(np.array(up)))) or (
                words.count(",") == 0
            )
    assert all(t.axis == 1 and abs(t.angle_deg) >= 360 for t in candidates(np.eye(3)[2], [1]))
    # About the vertical nothing is asked for: first the axis is laid level.
    assert all(abs(t.end(np.eye(3)[1])[1]) < 0.9 for t in candidates(np.eye(3)[1], [1]))


def test_the_screen_fits(done: tuple[Operator, Guide]) -> None:
    _, guide = done
    lines = screen_lines(guide, "IMU-7", 95.0)
    assert "  DONE  every demand is met, by a calibration of this recording" in lines
    assert sum(line.endswith(bar(1.0)) for line in lines) == 6
    under_way = guided(Operator(11), most=3)
    under_way.refusal = "x" * 300
    lines = screen_lines(under_way, "IMU-7", 3671.0)
    assert max(map(len, lines)) <= WIDTH
    assert lines[0] == "IMU-7   61 min 11 s   4 rests"
    assert any(line.startswith("  NOW   turn it ") for line in lines)
    assert len(status_line(under_way)) < 200


def test_bars() -> None:
    assert [bar(part).count("#") for part in (-1.0, 0.0, 0.5, 0.999, 1.0, 7.0)] == [
        0, 0, 10, 19, 20, 20,
    ]  # fmt: skip
