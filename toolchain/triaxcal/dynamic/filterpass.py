"""One pass of the filter through a recording, about given values of the constants.

However coarse the unit, the attitude that everything is linearised about stays close: after each
segment it is levelled again by the accelerometers, and the filter's error is counted from there
(P2 feeds back the filter's own estimate). That estimate is not used, because early in a recording
it is a guess along everything that cannot be separated yet (a tilt and a bias); feeding a guess
back turns what was inseparable, and the filter then believes to have seen it. The constants stay
what they were at the start of the pass, so that passes are steps of a Gauss-Newton iteration.
Segments are as long as the tilts allow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from triaxcal.dynamic.blocks.attitude import level, rotation_of
from triaxcal.dynamic.blocks.base import ARCSEC
from triaxcal.dynamic.channels import Moments, extra_rows, steady
from triaxcal.dynamic.passdata import History, PassResult, Reference, Task
from triaxcal.dynamic.preintegrate import BlockEquations, equations
from triaxcal.dynamic.recording import ImuSamples, joined
from triaxcal.dynamic.rootfilter import RootFilter
from triaxcal.dynamic.steps import Steps
from triaxcal.dynamic.survey import Section
from triaxcal.dynamic.tape import Tape
from triaxcal.dynamic.whiten import whitened
from triaxcal.dynamic.window import About, Window, gamma_matrix, inverse_of_one_plus
from triaxcal.model.types import BoolArray, FloatArray, IntArray

EARTH_RATE_RAD_PER_S = 7.292115e-5
SEGMENT_S = 30.0
FIRST_SEGMENT_S = 1.0
FEEDBACK_RAD = 0.01
"""A larger tilt shortens the segments: its square is what the filter leaves out."""
RELEVEL_S = 1.0
MARGIN = 6
"""Samples around a segment, for what looks at neighbours."""
CHECKPOINT_S = 30.0
LEVEL_SD_RAD = 0.1
HEADING_SD_RAD = math.pi / math.sqrt(3)
"""Nothing known: a uniform distribution over the whole circle."""
FIXED_SD_RAD = 1e-4
"""The azimuth of a frame that has none of its own."""
CHUNK = 1 << 14

Progress = Callable[[float], None]


def run_pass(
    task: Task, start: Reference, *, first: bool, progress: Progress | None = None
) -> PassResult:
    """Run the filter once through a recording; the first time in short segments."""
    return _Pass(task, start, first, RootFilter).run(progress)


def taped_pass(task: Task, start: Reference) -> Tape:
    """Run the filter once, and remember what was done to it."""
    made = _Pass(task, start, False, Tape)
    made.run(None)
    assert isinstance(made.filter, Tape)
    return made.filter


class _Pass:
    def __init__(self, task: Task, start: Reference, first: bool, kind: type[RootFilter]) -> None:
        self.recording, self.found = task.recording, task.survey
        self.frame, self.noise, self.start = task.frame, task.noise, start
        self.p = np.zeros(len(self.frame.layout))
        self.p[: len(start.p)] = start.p
        latitude = math.radians(task.recording.latitude_deg)
        self.north_rate = EARTH_RATE_RAD_PER_S * math.cos(latitude)
        self.up_rate = EARTH_RATE_RAD_PER_S * math.sin(latitude)
        self.reset = self.frame.layout.reset_columns()
        self.stage = 0
        self.cuts_s, self.watch, self.renewed = task.cuts_s, task.watch, task.renewed
        self.stage_p = start.stage_p.copy()
        if len(self.stage_p):
            self.p[self.reset] = self.stage_p[0]
        self.filter = kind.of_prior(self.frame.layout.prior_sd, -self.p)
        self.steps = Steps(self.filter, task.wander, self.found.sections[0].start_s)
        self.history = History()
        self.north = np.zeros((len(self.found.sections), 2, 2))
        self.turned = np.zeros(len(self.found.sections))
        self.blocks = self._as_blocks(FIRST_SEGMENT_S if first else SEGMENT_S)
        self.levels_s = self.found.levels_s

    def _as_blocks(self, seconds: float) -> int:
        return max(1, round(seconds / (self.frame.block * self.frame.interval_s)))

    def run(self, progress: Progress | None) -> PassResult:
        total = len(self.found.windows.first) and self.found.sections[-1].last + 1
        for number, section in enumerate(self.found.sections):
            C = self._align(number, section)
            for samples, lead, blocks in self._segments(section):
                C = self._segment(samples, lead, blocks, C)
                if progress is not None:
                    progress((section.first + self._done) / total)
            self._end_section(number)
        self._checkpoint(self._time_s)
        if len(self.stage_p):
            self.stage_p[self.stage] = self.p[self.reset] + self.filter.estimate()[1][self.reset]
        constants = self.steps.wander.constants
        return PassResult(
            (self.p + self.filter.estimate()[1])[:constants],
            self.filter.root_covariance()[3 : 3 + constants, 3:],
            self.stage_p,
            self.north,
            self.turned,
            self.history,
            self.filter.chi_square,
            self.filter.freedom,
        )

    def _align(self, number: int, section: Section) -> FloatArray:
        """L'^T at a section's first sample: level by the force, heading as known."""
        layout, heading = self.frame.layout, self.start.heading_rad
        gamma = gamma_matrix(layout.part(self.p, "accelerometer-matrix"))
        bias = layout.part(self.p, "accelerometer-bias")[:3]
        force = inverse_of_one_plus(gamma) @ (section.force - bias)
        C = level(force, 0.0 if heading is None else float(heading[number]))
        self._forget_attitude()
        self.steps.move(section.start_s)
        if number > 0 and "north" in layout:
            place = layout.place("north")
            self._forget(np.arange(len(layout))[place], np.zeros(2))
        return C

    def _forget_attitude(self) -> None:
        azimuth_sd = FIXED_SD_RAD if self.start.heading_rad is None else HEADING_SD_RAD
        self.filter.restart_attitude(np.array([LEVEL_SD_RAD, LEVEL_SD_RAD, azimuth_sd]))

    def _forget(self, columns: IntArray, values: FloatArray) -> None:
        """New states in `columns`, linearised about `values`."""
        self.filter.diffuse(columns, np.full(len(columns), np.inf))
        self.p[columns] = values
        self.filter.add_prior(columns, self.frame.layout.prior_sd[columns], -values)

    def _earth(self) -> FloatArray:
        if "north" in self.frame.layout:
            return np.array([*self.frame.layout.part(self.p, "north")[:2], self.up_rate])
        return np.array([0.0, self.north_rate, self.up_rate])

    def _segments(self, section: Section) -> Iterator[tuple[ImuSamples, int, int]]:
        """Samples, number of the sample before the first block, and blocks, of each segment."""
        size = self.frame.block
        self._done = 0
        pool: ImuSamples | None = None
        lead = 0
        pieces = self.recording.between(section.first, section.last, CHUNK)
        ended = False
        while True:
            wanted = lead + 1 + self.blocks * size + MARGIN
            while not ended and (pool is None or len(pool) < wanted):
                piece = next(pieces, None)
                ended = piece is None
                if piece is not None:
                    pool = piece if pool is None else joined([pool, piece])
            assert pool is not None
            blocks = min(self.blocks, (len(pool) - lead - 1) // size)
            blocks = self._until_next_cut(float(pool.time_s[lead]), blocks)
            if blocks == 0:
                return
            end = lead + blocks * size
            yield pool[: end + 1 + MARGIN], lead, blocks
            self._done += blocks * size
            keep = max(0, end - MARGIN)
            pool, lead = pool[keep:], end - keep

    def _until_next_cut(self, time_s: float, blocks: int) -> int:
        """At most so many blocks that a segment ends at the next mounting or cut.

        And at the end of a rest in the hand, to be levelled there.
        """
        self._next_stage(time_s)
        if self.cuts_s and time_s >= self.cuts_s[0]:
            self._forget_attitude()
            if len(self.renewed):
                self._forget(self.renewed, self.p[self.renewed])
            self.cuts_s = tuple(cut for cut in self.cuts_s if cut > time_s)
        block_s = self.frame.block * self.frame.interval_s
        ahead = self.levels_s[self.levels_s >= time_s + block_s]
        if len(ahead):
            blocks = min(blocks, math.floor((float(ahead[0]) - time_s) / block_s + 1e-6))
        stages = self.found.stages[self.stage + 1 : self.stage + 2]
        ends = [stage.start_s for stage in stages] + list(self.cuts_s[:1])
        if ends:
            blocks = min(blocks, max(1, math.ceil((min(ends) - time_s) / block_s)))
        return blocks

    def _segment(self, samples: ImuSamples, lead: int, blocks: int, C: FloatArray) -> FloatArray:
        time_s = samples.time_s[lead : lead + blocks * self.frame.block + 1 : self.frame.block]
        about = About(C, self.p, self._earth())
        made = equations(Window(samples, lead, blocks, about, self.frame))
        use = self.found.used_blocks(time_s)
        rows = whitened(made, use, self.frame, self.noise)
        freedom = 3 * (1 if made.y2 is None else 2) * use
        for more, where in self._table_rows(samples, lead, made, use):
            rows = np.concatenate([rows, more], axis=1)
            freedom = freedom + more.shape[1] * where
        self.steps.run(rows, freedom, time_s)
        if self.watch is not None:
            self.watch.segment(time_s, made)
            use = use * self.watch.level((time_s[:-1] + time_s[1:]) / 2)
        beta = self._level_again(made, use)
        self.filter.shift(beta, np.zeros_like(self.p))
        size = float(np.abs(beta).max())
        if size > FEEDBACK_RAD:
            self.blocks = max(1, self.blocks // 2)
        elif size < FEEDBACK_RAD / 4:
            self.blocks = min(2 * self.blocks, self._as_blocks(SEGMENT_S))
        self._time_s = float(time_s[-1])
        if not self.history.time_s or self._time_s >= self.history.time_s[-1] + CHECKPOINT_S:
            self._checkpoint(self._time_s)
        fed_back: FloatArray = rotation_of(beta) @ made.C[-1]
        return fed_back

    def _table_rows(
        self, samples: ImuSamples, lead: int, made: BlockEquations, use: IntArray
    ) -> list[tuple[FloatArray, BoolArray]]:
        """Rows of the turntable's measurements, once the heading is known."""
        table = self.recording.table
        if table is None or not table.mountings or self.start.heading_rad is None:
            return []
        size = self.frame.block
        blocks = len(use)
        end_s = samples.time_s[lead::size][: blocks + 1]
        windows = self.found.windows
        first = np.searchsorted(windows.start_s, end_s[:-1], side="right") - 1
        last = np.searchsorted(windows.start_s, end_s[1:], side="right") - 1
        still = self.found.still & self.found.use
        resting = still[np.maximum(first, 0)] & still[last]
        angle = samples.table_angle_rad
        mean = None
        if angle is not None and self.noise.table_sd_arcsec is not None:
            by_block = np.unwrap(angle[lead + 1 :][: blocks * size].reshape(blocks, size))
            mean = by_block.mean(axis=1)
            resting &= steady(by_block, self.noise.table_sd_arcsec * ARCSEC)
        inner = made.C[:-1].swapaxes(1, 2) @ made.C[1:]
        cosine = np.clip((np.trace(inner, axis1=1, axis2=2) - 1) / 2, -1, 1)
        moments = Moments(
            made.C[1:],
            mean,
            np.arccos(cosine),
            resting,
            use.astype(bool) & ~resting,
            size,
            self.frame.gravity,
        )
        mounting = table.mountings[min(self.stage, len(table.mountings) - 1)][1]
        return extra_rows(moments, self.frame.layout, self.p, self.noise, (table, mounting))

    def _level_again(self, made: BlockEquations, use: IntArray) -> FloatArray:
        """Tilt (3,) that takes the mean of y (9) away at the segment's end; none while handled."""
        blocks = min(self._as_blocks(RELEVEL_S), int(np.argmin(np.append(use[::-1], 0))))
        if blocks == 0:
            return np.zeros(3)
        y = made.y[-blocks:].mean(axis=0) / self.frame.gravity
        return np.array([y[1], -y[0], 0.0])

    def _next_stage(self, time_s: float) -> None:
        stages = self.found.stages
        while self.stage + 1 < len(stages) and time_s >= stages[self.stage + 1].start_s:
            if len(self.reset):
                estimate = self.filter.estimate()[1]
                self.stage_p[self.stage] = self.p[self.reset] + estimate[self.reset]
                self._forget(self.reset, self.start.stage_p[self.stage + 1])
            self.stage += 1

    def _end_section(self, number: int) -> None:
        layout = self.frame.layout
        self.turned[number] = self.filter.estimate()[0][2]
        if "north" in layout:
            place = layout.place("north")
            columns = np.arange(len(layout))[place]
            estimate = self.p + self.filter.estimate()[1]
            root = self.filter.root_covariance()[3 + columns]
            self.north[number] = estimate[columns], np.sqrt((root**2).sum(axis=1))

    def _checkpoint(self, time_s: float) -> None:
        history = self.history
        estimate = self.p + self.filter.estimate()[1]
        root = self.filter.root_covariance()[3:]
        history.time_s.append(time_s)
        history.p.append(estimate)
        history.sd.append(np.sqrt((root**2).sum(axis=1)))
        history.chi_square.append(self.filter.chi_square)
        history.freedom.append(self.filter.freedom)
