"""Several recordings against each other: one unit, two units, a wrong temperature, a new bias."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dynamic_cases import SHORT_MOVES, changed, held, sheet
from thermal_cases import POINTS, at_point, solved, truth_of
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.agreement import Difference, recordings_differ, refuse_others
from triaxcal.dynamic.calibrate import calibrate_dynamic
from triaxcal.dynamic.otherunits import refuse_other_misalignments
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.several import joined_recordings
from triaxcal.dynamic.temperatures import recorded_temperatures
from triaxcal.simulation.imu import simulate_imu
from triaxcal.simulation.imu_grades import MEMS, draw_truth
from triaxcal.simulation.imu_motion import ImuMotion, Mounting
from triaxcal.simulation.imu_truth import ImuTruth

MOTION = ImuMotion(tuple(Mounting(SHORT_MOVES, 12.0) for _ in range(3)))


def recorded(truth: ImuTruth, seed: int) -> ImuRecording:
    made = held(simulate_imu(truth, MOTION, 50.0, seed))
    return replace(made, name=f"{seed}.csv")


def differing(*recordings: ImuRecording) -> tuple[Difference, ...]:
    """At one temperature; biases that wander are stated to be none."""
    whole = joined_recordings(list(recordings))
    noise = replace(
        sheet(draw_truth(MEMS, 1)),
        gyro_bias_instability_deg_per_h=0.0,
        accel_bias_instability_ug=0.0,
    )
    result = calibrate_dynamic(whole, noise)
    return recordings_differ(whole, result, None, None)


def over_temperature(recordings: list[ImuRecording]) -> tuple[Difference, ...]:
    named = [replace(r, name=f"{k}.csv") for k, r in enumerate(recordings)]
    whole = joined_recordings(named)
    found = solved(truth_of(6), whole)
    degc = recorded_temperatures(whole)
    return recordings_differ(whole, found.full, degc, found.functions)


def test_recordings_of_one_unit_agree() -> None:
    truth = draw_truth(MEMS, 1)
    assert differing(*(recorded(truth, seed) for seed in (1, 2, 3))) == ()


def test_recordings_of_two_units_are_refused() -> None:
    one, two = draw_truth(MEMS, 1), draw_truth(MEMS, 2)
    with pytest.raises(RefusedError, match=r"that all (recordings )?are of one unit"):
        refuse_others(differing(recorded(one, 1), recorded(one, 2), recorded(two, 3)))


def test_a_bias_that_changed_with_switching_on_is_reported() -> None:
    """100 deg/h: some 20 standard deviations, and an eighth of what the grade's biases are."""
    truth = draw_truth(MEMS, 1)
    again = recorded(truth, 3)
    samples = again.all()
    shift = np.radians(100 / 3600)
    shifted = changed(again, rate=samples.rate + np.array([shift, 0.0, 0.0]))
    found = differing(recorded(truth, 1), recorded(truth, 2), shifted)
    words = refuse_others(found)
    named = {d.name: d.words for d in found}
    assert "drift of gyro x" in named["3.csv"]
    assert all("differs from the other recordings by more than the noise" in w for w in words)


def test_points_of_one_unit_agree_over_temperature() -> None:
    truth = truth_of(6)
    assert over_temperature([at_point(truth, t, 60 + k) for k, t in enumerate(POINTS)]) == ()


def test_a_point_of_another_unit_is_refused_over_temperature() -> None:
    truth, other = truth_of(6), truth_of(7)
    points = [at_point(other if k == 2 else truth, t, 60 + k) for k, t in enumerate(POINTS)]
    found = over_temperature(points)
    with pytest.raises(RefusedError, match="check that all are of one unit"):
        refuse_others(found)


@pytest.mark.parametrize("number", [6, 7])
def test_two_units_at_two_temperatures_are_refused_by_their_angles(number: int) -> None:
    """Any two units lie on a straight line over temperature; one unit keeps its angles."""
    truth, second = truth_of(6), truth_of(number)
    points = [at_point(truth, POINTS[0], 60), at_point(second, POINTS[-1], 61)]
    whole = joined_recordings([replace(r, name=f"{k}.csv") for k, r in enumerate(points)])
    degc = recorded_temperatures(whole)
    assert degc is not None
    known = solved(truth, whole).over.known
    if number == 6:
        refuse_other_misalignments(whole, degc, known)
        return
    with pytest.raises(RefusedError, match=r"1.csv: the gyros' misalignments differ by 0.\d+ deg"):
        refuse_other_misalignments(whole, degc, known)


def test_a_thermometer_that_reads_another_temperature_is_refused() -> None:
    """The chamber was at 50 degC, and the thermometer reads the 20 degC of the point before."""
    truth = truth_of(6)
    points = [at_point(truth, t, 60 + k) for k, t in enumerate(POINTS)]
    read = points[3].all().temp_degc
    assert read is not None
    points[3] = changed(points[3], temp_degc=read - np.median(read) + 20.0)
    found = over_temperature(points)
    assert {d.name for d in found} & {"2.csv", "3.csv"}
    with pytest.raises(RefusedError, match="and their temperatures"):
        refuse_others(found)
