"""Noise of both triads of an IMU at rest, and the [noise] for its unit.toml."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from triaxcal.api.study import Study
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.blocks.base import DEG_PER_H
from triaxcal.dynamic.columns import RecordedFile
from triaxcal.dynamic.description import read_dynamic
from triaxcal.dynamic.noise import MICRO_G, DataSheet, noise_section
from triaxcal.dynamic.recording import INCREMENT, ImuSamples
from triaxcal.dynamic.several import read_recordings
from triaxcal.model.types import FloatArray
from triaxcal.noise.allan import FLICKER
from triaxcal.noise.stretch import SAMPLES_MIN
from triaxcal.noise.study import NoiseStudy, study_noise
from triaxcal.performance.figures import Figure
from triaxcal.performance.noise import MICRO_G as MICRO_G_WORD
from triaxcal.performance.noise import allan_drawing, noise_figures
from triaxcal.report.testreport.page import drawing_svg
from triaxcal.report.testreport.text import figure_lines

GAP = 1.5
"""Of an interval: a step as long as that has lost a sample."""
RATE_UNIT = "deg/h"
MEAN_S = 1.0
LEAN_DEG, TURN = 2.0, 1.0
"""Means of a second at rest stay within them: 35 mg and 1 deg/s are beyond what a bias wanders."""


def study_imu_noise(
    recorded: Path, layout: Path, longest_tau_s: float | None
) -> Study[tuple[NoiseStudy, NoiseStudy]]:
    """Studies of the gyros, deg/h, and of the accelerometers, micro-g.

    `layout` is the unit.toml whose [dynamic] says what the columns of the recording are.
    """
    unit = read_dynamic(layout.parent)
    recording = read_recordings(
        replace(unit, recordings=(RecordedFile(str(recorded.absolute())),), forces=None)
    )
    samples = _longest(recorded.name, recording.all(), 1 / recording.rate_hz)
    step_s = 1 / recording.rate_hz
    rate = samples.rate / (step_s if recording.rate_convention == INCREMENT else 1.0)
    force = samples.force / (step_s if recording.force_convention == INCREMENT else 1.0)
    _refuse_motion(recorded.name, rate, force, samples.time_s - samples.time_s[0])
    gyro = study_noise(recorded.name, rate / DEG_PER_H, step_s, longest_tau_s)
    accel = study_noise(recorded.name, force / MICRO_G, step_s, longest_tau_s)
    head = f"{recorded.name}: {len(samples)} samples, one every {step_s:.6g} s; 95 % intervals"
    lines = [
        head,
        "",
        *figure_lines("gyros at rest", tuple(_of_gyros(gyro))),
        "",
        *figure_lines("accelerometers at rest", tuple(noise_figures(accel, "", MICRO_G_WORD, 1.0))),
        *(f"gyros: {finding}" for finding in gyro.findings),
        *(f"accelerometers: {f}" for f in accel.findings if f not in gyro.findings),
        "",
        *_section(unit.noise, gyro, accel),
    ]

    def draw() -> bytes:
        drawings = allan_drawing(gyro, RATE_UNIT, 1.0)
        if not drawings:
            raise RefusedError("picture", " ".join(gyro.findings))
        return drawing_svg(drawings[0])

    return Study((gyro, accel), "\n".join(lines), draw)


def _of_gyros(study: NoiseStudy) -> Iterator[Figure]:
    """Figures by the names that they have of angles."""
    for figure in noise_figures(study, "", RATE_UNIT, 1.0):
        words = figure.name.replace("velocity random", "angle random")
        yield replace(figure, name=words.replace("acceleration random", "rate random"))


def _longest(name: str, samples: ImuSamples, step_s: float) -> ImuSamples:
    """Longest stretch without a gap."""
    cuts = np.flatnonzero(np.diff(samples.time_s) > GAP * step_s) + 1
    ends = np.concatenate([[0], cuts, [len(samples)]])
    k = int(np.argmax(np.diff(ends)))
    found = samples[int(ends[k]) : int(ends[k + 1])]
    if len(found) < SAMPLES_MIN:
        raise RefusedError(
            name,
            f"{len(found)} samples without a gap",
            expected=f"{SAMPLES_MIN} at least",
            remedy="record longer",
        )
    return found


def _refuse_motion(name: str, rate: FloatArray, force: FloatArray, time_s: FloatArray) -> None:
    """Refuse a recording in which the unit turns: its coefficients would be those of the motion."""
    starts = np.flatnonzero(np.diff(np.floor(time_s / MEAN_S), prepend=-1.0))
    count = np.diff([*starts, len(time_s)])[:, None]
    rates = np.add.reduceat(rate, starts) / count
    forces = np.add.reduceat(force, starts) / count
    up = forces / np.linalg.norm(forces, axis=1)[:, None]
    lean = np.linalg.norm(up - up[0], axis=1)
    turn = np.abs(rates - np.median(rates, axis=0)).max(axis=1)
    for what, size, limit in (("gravity moves in the unit by", lean, LEAN_DEG), ("", turn, TURN)):
        moved = np.degrees(size) > limit
        if moved.any():
            worst = float(np.degrees(size).max())
            found = f"{what} {worst:.3g} deg" if what else f"the unit turns at {worst:.3g} deg/s"
            raise RefusedError(
                name,
                f"{found}, first at {time_s[starts[np.argmax(moved)]]:.0f} s",
                expected="a recording at rest",
                remedy="cut out the part at rest; `triaxcal dynamic` takes the noise of a "
                "recording with turns from its rests",
            )


def _section(stated: DataSheet, gyro: NoiseStudy, accel: NoiseStudy) -> list[str]:
    """[noise] with what the recording determines; counts are in its white noise."""
    if not (gyro.trusted and accel.trusted):
        return ["no [noise] for unit.toml: outputs jump; cut those parts out"]
    hour = 60.0  # root seconds of a root hour
    found: dict[str, float] = {
        "gyro_arw_deg_per_sqrt_h": _mean(gyro, "N") / hour,
        "accel_vrw_ug_per_sqrt_hz": _mean(accel, "N"),
        "gyro_bias_instability_deg_per_h": FLICKER * _mean(gyro, "B"),
        "accel_bias_instability_ug": FLICKER * _mean(accel, "B"),
        "gyro_random_walk_deg_per_h_per_sqrt_h": _mean(gyro, "K") * hour,
        "accel_random_walk_ug_per_sqrt_h": _mean(accel, "K") * hour,
    }
    shown = {name: float(f"{value:.3g}") for name, value in found.items() if value}
    if not shown:
        return ["no figure for [noise] of unit.toml: the recording determines none"]
    head = "for unit.toml, the root mean squares of the axes:"
    return [head, *noise_section(replace(stated, **shown), shown)]


def _mean(study: NoiseStudy, symbol: str) -> float:
    """Root mean square of the axes of a coefficient; 0 where no axis determines it."""
    each = [axis.of(symbol) for axis in study.axes]
    if not any(c.determined for c in each):
        return 0.0
    return math.sqrt(sum(c.value**2 for c in each) / len(each))
