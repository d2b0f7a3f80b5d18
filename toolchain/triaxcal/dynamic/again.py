"""One more pass about a finished result, perhaps with further blocks of states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from triaxcal.dynamic.calibrate import DynamicResult
from triaxcal.dynamic.layout import Layout
from triaxcal.dynamic.noise import DataSheet
from triaxcal.dynamic.passdata import Reference, Task
from triaxcal.dynamic.recording import ImuRecording
from triaxcal.dynamic.wander import wander_of


def extended(result: DynamicResult, layout: Layout) -> Reference:
    """The result as the reference of a pass with further blocks, whose states are zero."""
    p = np.concatenate([result.p, np.zeros(len(layout) - len(result.layout))])
    resets = layout.reset_columns()
    stage_p = np.zeros((max(1, len(result.survey.stages)), len(resets)))
    stage_p[:, np.isin(resets, result.layout.reset_columns())] = result.stage_p
    return Reference(p, stage_p, result.heading_rad)


def task_again(
    recording: ImuRecording, result: DynamicResult, layout: Layout, noise: DataSheet | None = None
) -> Task:
    """Task of a pass with the states of `layout`; `noise` is that of the result if None."""
    noise = noise or result.noise
    wander = wander_of(layout, noise, result.survey.duration_s)
    frame = replace(result.frame, layout=wander.layout)
    return Task(recording, result.survey, frame, noise, wander)
