"""`study_noise`: noise of a recording at rest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from triaxcal.api.study import Study
from triaxcal.base.errors import RefusedError
from triaxcal.base.tomltable import has_table
from triaxcal.noise.stretch import even_stretch
from triaxcal.noise.study import NoiseStudy
from triaxcal.noise.study import study_noise as study
from triaxcal.performance.noise import MICRO_G, allan_drawing, noise_figures
from triaxcal.readings.samples import READING, read_samples
from triaxcal.report.testreport.page import drawing_svg
from triaxcal.report.testreport.text import figure_lines
from triaxcal.unit.recording import read_layout
from triaxcal.unit.thermometer import TemperatureSensor


def study_noise(
    recorded: str | Path, layout: str | Path, *, longest_tau_s: float | None = None
) -> Study[NoiseStudy] | Study[tuple[NoiseStudy, NoiseStudy]]:
    """Allan deviation of a recording at rest, and the five coefficients of IEEE Std 952.

    Parameters
    ----------
    recorded : path
        The recording.
    layout : path
        TOML file whose table [recording] says what its columns are, as a unit.toml; or the
        unit.toml of an IMU, whose [dynamic] does.
    longest_tau_s : float or None
        The longest averaging time that is wanted; None is what the recording allows.

    Returns
    -------
    Study
        Its `result` has the coefficients with their intervals, in the unit of the recording, or in
        g where that is one of acceleration; its picture is the Allan deviation. Of an IMU there are
        two results, gyros in deg/h and accelerometers in micro-g, and the text has a [noise] for
        its unit.toml.

    Raises
    ------
    RefusedError
        When the recording cannot be read, its clock is uneven, or it is too short.
    """
    path = Path(recorded)
    if has_table(Path(layout), "dynamic"):
        from triaxcal.api.imunoise import study_imu_noise  # noqa: PLC0415

        return study_imu_noise(path, Path(layout), longest_tau_s)
    found = replace(read_layout(Path(layout)), file=(path.name,), temperature=None)
    samples = read_samples(path.parent, found, TemperatureSensor(1.0, 0.0))
    part = even_stretch(samples)
    of_1_g = found.reading_of_1_g
    signal = samples.part(READING, part.start, part.stop) / (of_1_g or 1.0)
    done = study(path.name, signal, part.step_s, longest_tau_s)
    findings = (*samples.table.findings, *part.findings, *done.findings)
    unit, scale = (MICRO_G, 1e6) if of_1_g else (found.acceleration_unit, 1.0)
    figures = tuple(noise_figures(done, path.name, unit, scale))
    head = f"{path.name}: {len(signal)} samples, one every {part.step_s:.6g} s; 95 % intervals"
    text = "\n".join([head, "", *figure_lines("noise at rest", figures), *findings])

    def draw() -> bytes:
        drawings = allan_drawing(done, unit, scale)
        if not drawings:
            raise RefusedError("picture", " ".join(done.findings))
        return drawing_svg(drawings[0])

    return Study(replace(done, findings=findings), text, draw)
